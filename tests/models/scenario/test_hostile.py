"""Well-formed files with numbers that no mission has: one line or a scenario that can be used, and never a warning."""

import tomllib
from copy import deepcopy

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from baryscope.models.errors import InputError
from baryscope.models.lvlh import lvlh_attitude
from baryscope.models.relative_orbit import relative_transition
from baryscope.models.scenario import load_orbit, load_scenario
from malformed import GOOD_SCENARIO

RIG = {"focal_length": 1900.0, "baseline": 1.0, "pixel_noise": 0.5}
OUTLIERS = {"share": 0.1, "size": 2.0, "swapped": 0.1, "stretch": 10.0, "sliding": 1, "sliding_speed": 0.01}
ORBIT = {
    "semi_major_axis": 7e6,
    "eccentricity": 0.01,
    "inclination_deg": 50.0,
    "raan_deg": 1.0,
    "argument_of_periapsis_deg": 2.0,
    "true_anomaly_deg": 3.0,
    "gravitational_parameter": 3.986004418e14,
}

magnitudes = st.sampled_from([1e-320, 1e-300, 1e-160, 1e-17, 1e-9, 1e9, 1e16, 1e77, 1e103, 1e150, 1e155, 1e300])
numbers = (
    st.builds(lambda size, sign: size * sign, magnitudes, st.sampled_from([-1.0, 1.0]))
    | st.floats()
    | st.integers()
    | st.sampled_from([0, -1, 1, 2**63, 2**64, 10**30, 1 - 2**-53, 1.7976931348623157e308])
)
values = numbers | st.booleans() | st.text(max_size=5) | st.lists(numbers, max_size=4)


def toml(value):
    """A value in TOML; tables within tables stand inline."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return f"{{ {', '.join(f'{key} = {toml(item)}' for key, item in value.items())} }}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(toml, value))}]"
    if isinstance(value, str):
        return '"' + "".join(c if c.isalnum() else f"\\U{ord(c):08x}" for c in value) + '"'
    return repr(value)


def leaves(value, path=()):
    """Where the numbers of a tree are."""
    if isinstance(value, dict | list):
        pairs = value.items() if isinstance(value, dict) else enumerate(value)
        return [leaf for key, item in pairs for leaf in leaves(item, (*path, key))]
    return [] if isinstance(value, str) else [path]


def full_scenario(rig):
    data = tomllib.loads(GOOD_SCENARIO)
    data["orbit"] = dict(ORBIT)
    data["sensor"] = ({"stereo": dict(RIG)} if rig else {"noise": 0.02}) | {"outliers": dict(OUTLIERS)}
    data["run"]["tolerance"] = 1e-12
    data["chaser"] |= {"velocity": [0.0, 0.01, 0.0], "acceleration": [0.0, 0.0, 1e-6]}
    return data


@st.composite
def changed(draw, data):
    """The tree with one to three of its leaves replaced."""
    data = deepcopy(data)
    for path in draw(st.lists(st.sampled_from(leaves(data)), min_size=1, max_size=3, unique=True)):
        place = data
        for key in path[:-1]:
            place = place[key]
        place[path[-1]] = draw(values)
    return data


def loaded(load, path, data):
    """What is read from a file with this data; None where it is refused in one line that names the file."""
    text = "".join(f"{key} = {toml(value)}\n" for key, value in data.items())
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    try:
        return load(path)
    except InputError as error:
        message = str(error)
        assert message.startswith(f"{path}: ")
        assert message == " ".join(message.splitlines())
        assert len(message) < len(str(path)) + 300
        return None


def check_orbit(orbit):
    for value in (orbit.period, orbit.mean_motion, orbit.periapsis_rate):
        assert 0 < value < np.inf
    time = np.array([-1e4, 0.0, 1.0, 6000.0])
    R_I_L = lvlh_attitude(orbit, time)
    np.testing.assert_allclose(R_I_L @ np.swapaxes(R_I_L, 1, 2), np.broadcast_to(np.eye(3), (4, 3, 3)), atol=1e-12)
    assert np.isfinite(relative_transition(orbit, time)).all()


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return tmp_path_factory.mktemp("hostile") / "mine.toml"


@given(data=st.booleans().flatmap(lambda rig: changed(full_scenario(rig))))
def test_any_numbers_in_a_scenario(path, data):
    scenario = loaded(lambda file: load_scenario(str(file)), path, data)
    if scenario is not None:
        check_orbit(scenario.orbit)
        assert np.isfinite(scenario.flat_parameters()).all()
        count = scenario.sample_times.size
        assert 3 <= count <= 10_000_000 / len(scenario.features.points)
        assert scenario.sample_times[-1] <= scenario.duration * (1 + 1e-9)


@given(data=changed({"orbit": ORBIT}))
def test_any_numbers_in_an_orbit(path, data):
    orbit = loaded(load_orbit, path, data)
    if orbit is not None:
        check_orbit(orbit)


@given(data=st.builds(lambda **table: {"orbit": table}, **dict.fromkeys(ORBIT, numbers)))
def test_nothing_but_hostile_numbers(path, data):
    orbit = loaded(load_orbit, path, data)
    if orbit is not None:
        check_orbit(orbit)


@given(text=st.text() | st.text(alphabet="[]{}=.\"'\n#ab1e-_,"))
@pytest.mark.parametrize("load", [lambda path: load_scenario(str(path)), load_orbit], ids=["scenario", "orbit"])
def test_any_text(path, load, text):
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    with pytest.raises(InputError) as caught:
        load(path)
    assert str(caught.value) == " ".join(str(caught.value).splitlines())

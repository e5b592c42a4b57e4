"""Malformed scenario and orbit files: each is refused in one line that names file and field and what was expected."""

import re

import numpy as np
import pytest

from baryscope.models.errors import InputError
from baryscope.models.orbit import Orbit
from baryscope.models.scenario import load_orbit, load_scenario, preset_names
from malformed import ORBITS, SCENARIOS


def refusal(load):
    """The message of the InputError, which must be one line."""
    with pytest.raises(InputError) as caught:
        load()
    message = str(caught.value)
    assert message == " ".join(message.splitlines()), "more than one line"
    for word in ("pydantic", "tuple", "dict", "Input should", "a valid", "NoneType"):
        assert word not in message
    return message


@pytest.mark.parametrize("replacements, mentions", SCENARIOS)
def test_malformed_scenario(write_scenario, replacements, mentions):
    path = write_scenario(*replacements)
    message = refusal(lambda: load_scenario(str(path)))
    assert message.startswith(f"{path}: ")
    for mention in mentions:
        assert mention in message, message
    assert not re.search(r"([\w.]+): \1", message), "a field stands twice"


@pytest.mark.parametrize("text, expected", ORBITS)
def test_malformed_orbit(tmp_path, text, expected):
    path = tmp_path / "orbit.toml"
    path.write_text(text, encoding="utf-8")
    assert refusal(lambda: load_orbit(path)) == f"{path}: {expected}"


def test_orbit_file_with_nothing_but_the_needed(tmp_path):
    path = tmp_path / "orbit.toml"
    path.write_text("[orbit]\nsemi_major_axis = 7150000\neccentricity = 0\ninclination_deg = 98\n", encoding="utf-8")
    assert load_orbit(path) == Orbit(semi_major_axis=7.15e6, eccentricity=0.0, inclination=np.pi / 180 * 98.0)


@pytest.mark.parametrize("load", [lambda path: load_scenario(str(path)), load_orbit], ids=["scenario", "orbit"])
@pytest.mark.parametrize(
    "make, found",
    [
        pytest.param(lambda path: None, "No such file or directory", id="missing"),
        pytest.param(lambda path: path.mkdir(), "Is a directory", id="folder"),
        pytest.param(lambda path: path.write_bytes(b"[orbit]\n\xff\xfe"), "byte 8 is not UTF-8 text", id="not-utf-8"),
        pytest.param(lambda path: path.write_bytes(b"\x00\x01\x02"), "line 1", id="binary"),
    ],
)
def test_unreadable_file(tmp_path, load, make, found):
    path = tmp_path / "mine.toml"
    make(path)
    message = refusal(lambda: load(path))
    assert message.startswith(f"{path}: ")
    assert found in message
    assert "in TOML" in message


def test_empty_scenario_file(tmp_path):
    path = tmp_path / "mine.toml"
    path.touch()
    assert refusal(lambda: load_scenario(str(path))) == f"{path}: target: missing, expected a table (and 3 more)"


@pytest.mark.parametrize("name", ["envisatt", "envisat.tml", ""])
def test_unknown_preset(name):
    message = refusal(lambda: load_scenario(name))
    assert repr(name) in message
    assert all(known in message for known in preset_names())


def test_a_byte_order_mark_is_no_fault(write_scenario):
    path = write_scenario()
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert load_scenario(str(path)).name == "mine"


STEREO = "stereo = { focal_length = 1911.0, baseline = 1.0, pixel_noise = 0.5 }"


@pytest.mark.parametrize(
    "sensor, expected",
    [
        (f"noise = 0.02\n{STEREO}", "sensor.noise: found 0.02 m beside sensor.stereo, expected one of them"),
        ("stereo = { focal_length = 1911.0, pixel_noise = 0.5 }",
         "sensor.stereo.baseline: missing, expected a number in m"),
        ("stereo = { focal_length = 0, baseline = 1.0, pixel_noise = 0.5 }",
         "sensor.stereo.focal_length: found 0, expected a value of at least 1 in px"),
        ("stereo = { focal_length = 1911, baseline_cm = 10, pixel_noise = 0.5 }",
         "sensor.stereo.baseline_cm: unknown field, expected baseline in m"),
        ("stereo = 1911.0", "sensor.stereo: found 1911.0, expected a table"),
        ("outliers = { share = 1.0 }", "sensor.outliers.share: found 1.0, expected a value below 1"),
        ("outliers = { share = 0.1, size = 0 }", "sensor.outliers.size: found 0, expected a value above 0 in m"),
        ("outliers = { swapped = -0.1 }", "sensor.outliers.swapped: found -0.1, expected a value of at least 0"),
        ("outliers = { stretch = 0 }", "sensor.outliers.stretch: found 0, expected a value of at least 1e-09 in s"),
        ("outliers = { sliding = 0.5 }", "sensor.outliers.sliding: found 0.5, expected a whole number"),
        ("outliers = { sliding = 5 }", "sensor.outliers.sliding: found 5, expected at most the 4 features"),
        ("outliers = { sliding_speed = -1 }",
         "sensor.outliers.sliding_speed: found -1, expected a value above 0 in m/s"),
        ("outliers = { portion = 0.1 }", "sensor.outliers.portion: unknown field, expected one of share, size"),
    ],
)  # fmt: skip
def test_malformed_sensor(write_scenario, sensor, expected):
    path = write_scenario(("noise = 0.02", sensor))
    assert refusal(lambda: load_scenario(str(path))).startswith(f"{path}: {expected}")


def test_a_stereo_rig_and_outliers_in_a_file(write_scenario):
    sensor = load_scenario(str(write_scenario(("noise = 0.02", f"{STEREO}\noutliers = {{ share = 0.1 }}")))).sensor
    assert (sensor.stereo.focal_length, sensor.stereo.baseline, sensor.stereo.pixel_noise) == (1911.0, 1.0, 0.5)
    assert (sensor.outliers.share, sensor.outliers.size, sensor.outliers.sliding) == (0.1, 2.0, 0)

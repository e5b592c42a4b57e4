"""Which parameters are possible: against eigenvalues by numpy, on random bodies, and at the borders."""

from typing import get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from baryscope.models.scenario import OrbitTable, Scenario, load_scenario
from baryscope.models.target import tumbling_target
from baryscope.models.variables import AXES, Force, Kind

SCENARIO = load_scenario("envisat")
COUNT = len(SCENARIO.features.points)


def failure(forces=frozenset(), **changes):
    """The first check that fails on the preset's parameters with some of them replaced."""
    system, values = tumbling_target(COUNT, forces), SCENARIO.parameters()
    for name, value in changes.items():
        values[name.replace("__", ".")] = np.asarray(value, dtype=float)
    flat = np.concatenate([values[variable.name].ravel() for variable in system.of_kind(Kind.PARAMETER)])
    return system.checks.failure(flat)


def elements(name, tensor):
    return {f"{name}.{axes}": tensor["xyz".index(axes[0])]["xyz".index(axes[1])] for axes in AXES}


def inertia_failure(J):
    return failure(**elements("target.inertia", J))


def magnetic_failure(M):
    given = elements("target.magneticTensor", M) | {"magneticField.dipole": np.zeros(3)}
    return failure(frozenset({Force.EDDY_CURRENTS}), **given)


def turned(moments, rotation):
    R = Rotation.from_rotvec(rotation).as_matrix()
    return R @ np.diag(moments) @ R.T


ROTATIONS = st.tuples(*[st.floats(-3, 3)] * 3)
SCALES = st.floats(1e-3, 1e6)


def test_the_presets_parameters_are_possible():
    assert failure() is None


@given(
    points=st.lists(st.tuples(*[st.floats(-5, 5)] * 3), min_size=4, max_size=12),
    masses=st.lists(st.floats(0.1, 10), min_size=12, max_size=12),
)
def test_every_body_made_of_mass_is_possible(points, masses):
    """Point masses, and three small balls so that no body is a line."""
    r = np.array([*points, (1, 0, 0), (0, 1, 0), (0, 0, 1)])
    m = np.array([*masses[: len(points)], 1, 1, 1])
    r = r - m @ r / m.sum()
    J = np.einsum(
        "n,nij->ij", m, np.einsum("nk,nk->n", r, r)[:, None, None] * np.eye(3) - r[:, :, None] * r[:, None, :]
    )
    assert inertia_failure(J) is None


@given(scale=SCALES, rotation=ROTATIONS, split=st.floats(0.05, 0.95))
def test_a_flat_plate_is_possible(scale, rotation, split):
    """I₁ + I₂ = I₃ exactly, whatever the axes' rounding makes of it."""
    assert inertia_failure(turned(np.array([split, 1 - split, 1.0]) * scale, rotation)) is None


@given(scale=SCALES, rotation=ROTATIONS, split=st.floats(0.05, 0.95), excess=st.floats(1e-6, 10))
def test_the_triangle_inequality(scale, rotation, split, excess):
    moments = np.array([split, 1 - split, 1.0 + excess]) * scale
    message = inertia_failure(turned(moments, rotation))
    assert message is not None
    assert "triangle inequality" in message
    shown = float(message.split(" others ")[1].split(",")[0])
    assert shown == pytest.approx(1 + excess, rel=1e-5)


@given(scale=SCALES, rotation=ROTATIONS, low=st.floats(-2, -1e-6))
def test_a_tensor_with_a_negative_moment(scale, rotation, low):
    message = inertia_failure(turned(np.array([low, 1.0, 1.5]) * scale, rotation))
    assert message is not None
    assert "positive definite" in message
    shown = float(message.split(" moment ")[1].split(",")[0])
    assert shown == pytest.approx(low * scale, rel=1e-5, abs=1e-14 * scale)


@given(scale=SCALES, rotation=ROTATIONS, thickness=st.floats(1e-12, 1e-3))
def test_a_thin_rod_is_possible(scale, rotation, thickness):
    """Two second moments of mass are as good as zero."""
    assert inertia_failure(turned(np.array([thickness, 1.0, 1.0]) * scale, rotation)) is None


@given(scale=SCALES, rotation=ROTATIONS, others=st.sampled_from([(0.0, 0.0), (0.0, 1.0), (1.0, 1.0), (0.3, 0.0)]))
def test_a_magnetic_tensor_of_plane_loops_is_possible(scale, rotation, others):
    """A loop alone has a tensor of rank one, A²/R n nᵀ: two eigenvalues are zero, but for rounding."""
    assert magnetic_failure(turned(np.array([1.0, *others]) * scale, rotation)) is None
    assert magnetic_failure(np.zeros((3, 3))) is None


@given(scale=SCALES, rotation=ROTATIONS, low=st.floats(-2, -1e-8), other=st.sampled_from([0.0, 1.0, -1e-9]))
def test_a_magnetic_tensor_that_gives_energy(scale, rotation, low, other):
    message = magnetic_failure(turned(np.array([low, other, 1.0]) * scale, rotation))
    assert message.startswith("eddy_currents.tensor: found smallest eigenvalue -")
    shown = float(message.split(" eigenvalue ")[1].split(",")[0])
    assert shown == pytest.approx(low * scale, rel=1e-5, abs=1e-14 * scale)


@given(direction=ROTATIONS.filter(lambda d: np.linalg.norm(d) > 0.1), where=ROTATIONS, spread=st.floats(0.01, 30))
def test_features_on_a_line(direction, where, spread):
    along = np.linspace(-spread, spread, COUNT)[:, None] * np.array(direction) / np.linalg.norm(direction)
    message = failure(target__features=along + where)
    assert message is not None
    assert message.startswith("features.points: ")
    off = np.cross(direction, [1, 0, 0] if abs(direction[0]) < 0.5 * np.linalg.norm(direction) else [0, 1, 0])
    aside = along.copy()
    aside[0] += 0.01 * spread * off / np.linalg.norm(off)
    assert failure(target__features=aside + where) is None


@pytest.mark.parametrize(
    "name, value, field",
    [
        ("orbit__eccentricity", -1e-12, "orbit.eccentricity"),
        ("orbit__eccentricity", 1.0, "orbit.eccentricity"),
        ("orbit__eccentricity", np.nan, "orbit.eccentricity"),
        ("orbit__semiMajorAxis", 0.0, "orbit.semi_major_axis"),
        ("orbit__gravitationalParameter", -1.0, "orbit.gravitational_parameter"),
        ("target__attitude0", [0.998, 0, 0, 0], "target.attitude"),
        ("target__attitude0", [0, 0, 0, 0], "target.attitude"),
        ("target__normals", np.zeros((COUNT, 3)), "features.points"),
        ("target__features", np.zeros((COUNT, 3)), "features.points"),
        ("chaser__position0", [0, 0, 0], "chaser.position"),
        ("solver__tolerance", 1e-16, "run.tolerance"),
        ("solver__tolerance", 2e-3, "run.tolerance"),
        ("target__inertia__xx", np.nan, "target.inertia"),
        ("target__inertia__xy", np.nan, "target.inertia"),
    ],
)
def test_refused(name, value, field):
    assert failure(**{name: value}).startswith(f"{field}: found ")


@pytest.mark.parametrize(
    "name, value",
    [
        ("orbit__eccentricity", 0.0),
        ("orbit__eccentricity", 0.999),
        ("target__attitude0", [0.7071, 0.0, 0.7071, 0.0]),
        ("solver__tolerance", 1e-15),
        ("solver__tolerance", 1e-3),
        ("chaser__position0", [1e-3, 0, 0]),
    ],
)
def test_allowed(name, value):
    assert failure(**{name: value}) is None


def test_each_check_names_a_variable_and_a_field_that_exist():
    system = tumbling_target(COUNT, frozenset(Force))
    names = {variable.name for variable in system.variables}
    for check in system.checks.checks:
        assert check.variable in names or any(name.startswith(f"{check.variable}.") for name in names)
        table, field = check.field.split(".")
        annotation = Scenario.model_fields[table].annotation
        tables = get_args(annotation) or (OrbitTable if table == "orbit" else annotation,)
        assert field in tables[0].model_fields


@pytest.mark.parametrize(
    "first, values, words",
    [
        (0, [0.0] * 4, "state.attitude: found length 0, expected a quaternion with a direction"),
        (0, [np.inf] * 4, "state.attitude: found length inf"),
        (8, [0.0] * 3, "state.orbitPosition: found distance in m 0"),
        (11, [0.0] * 3, "state.orbitVelocity: found area rate in m²/s 0"),
        (0, [0.0, -3e-40, 0.0, 0.0], None),
    ],
)
def test_states_without_a_value_of_the_equations(first, values, words):
    states = np.concatenate([[1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.01, 0.5], [7e6, 0.0, 0.0, 0.0, 7e3, 0.0], np.ones(6)])
    states[first : first + len(values)] = values
    found = tumbling_target(COUNT, frozenset({Force.J2})).state_checks.failure(states)
    assert (found is None) if words is None else found.startswith(words)

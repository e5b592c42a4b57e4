"""Units with J2, drag, light pressure and eddy currents: against an independent integration, and closed forms."""

from dataclasses import replace

import numpy as np
import pytest

import forces
import oracles
from baryscope.fmu import Session, build_fmu, simulate
from baryscope.fmu.check.checker import check_unit
from baryscope.fmu.check.finding import Severity
from baryscope.fmu.units.series import series_source
from baryscope.models.orbit import orbit_parameters
from baryscope.models.target import PLACE_START, tumbling_target
from baryscope.models.variables import AXES, Force, Kind, forces_of

ALL = {"drag": forces.DRAG, "light": forces.LIGHT, "eddy_currents": forces.EDDY}
OFF = {
    Force.J2: {"orbit.j2": 0.0},
    Force.DRAG: {"atmosphere.density": 0.0},
    Force.LIGHT: {"sun.pressure": 0.0},
    Force.EDDY_CURRENTS: {f"target.magneticTensor.{axes}": 0.0 for axes in AXES},
}


def only(*forces):
    """Parameters of the unit with all forces that leave some of them."""
    return {name: value for force in set(Force) - set(forces) for name, value in OFF[force].items()}


@pytest.fixture(scope="module")
def oblate(small):
    """An orbit in full sunlight and shadow, and a chaser on an ellipse."""
    orbit = replace(small.orbit, eccentricity=0.02, inclination=1.1, j2=forces.J2, equatorial_radius=forces.RADIUS)
    chaser = small.chaser.model_copy(update={"position": (3.0, -20.0, 5.0), "velocity": (0.001, 0.002, -0.003)})
    return small.model_copy(update={"orbit": orbit, "chaser": chaser})


@pytest.fixture(scope="module")
def world(oblate):
    """The scenario with all forces and the gravity gradient."""
    target = oblate.target.model_copy(update={"gravity_gradient": True})
    return oblate.model_copy(update={"target": target} | ALL)


@pytest.fixture(scope="module")
def world_fmu(world, tmp_path_factory):
    return build_fmu(world, tmp_path_factory.mktemp("forces") / "world.fmu")


@pytest.fixture(scope="module")
def world_fmu3(world, tmp_path_factory):
    return build_fmu(world, tmp_path_factory.mktemp("forces") / "world3.fmu", fmi=3)


def test_the_unit_flies_what_an_independent_integration_flies(world, world_fmu):
    """Over half an orbit, through the edge of the shadow; two places of 7e6 m subtracted are good to some 1e-7 m."""
    time = np.linspace(0, 3000.0, 31)
    r, v, com, attitude = forces.fly(world, time)
    assert {forces.lit(place, world.light) for place in r} >= {0.0, 1.0}
    recording = simulate(world_fmu, time)
    np.testing.assert_allclose(recording["orbit.position"], r, atol=1e-4)
    np.testing.assert_allclose(recording["orbit.velocity"], v, atol=1e-7)
    np.testing.assert_allclose(recording["target.position"], com, atol=2e-6)
    assert oracles.angle_between(recording["target.attitude"], attitude).max() < 1e-8


@pytest.mark.parametrize("force", Force)
def test_each_force_moves_or_turns(world_fmu, force):
    """By far more than the tolerances of the test above, which so tests each of them."""
    with Session(world_fmu, only()) as session:
        session.step(3000.0)
        com, attitude = session.position, session.attitude
        session.reset(only(force))
        session.step(3000.0)
        moved = np.linalg.norm(session.position - com)
        assert max(moved, 100 * oracles.angle_between(attitude, session.attitude)) > 1e-3


def test_without_any_the_unit_is_the_one_of_kepler_orbits(oblate, world_fmu):
    time = np.linspace(0, 6000.0, 7)
    recording = simulate(world_fmu, time, only() | {"gravityGradient": False})
    np.testing.assert_allclose(recording["target.position"], oracles.com_in_chaser_frame(oblate, time), atol=1e-6)
    assert oracles.angle_between(recording["target.attitude"], oracles.torque_free_attitude(oblate, time)).max() < 1e-8


def test_a_unit_with_one_force_has_the_same_equations(world, small):
    """Rates and outputs of the systems with one force, against the one with all and the others at zero."""
    for force in Force:
        system = tumbling_target(len(small.features.points), frozenset({force}))
        values = world.parameters() | only(force)
        p, p_all = (
            np.concatenate([np.ravel(values[v.name]) for v in s.of_kind(Kind.PARAMETER)])
            for s in (system, world.system)
        )
        x = np.array(system.initial(p)).ravel()
        np.testing.assert_allclose(x, np.array(world.system.initial(p_all)).ravel(), rtol=1e-12, atol=1e-15)
        u = np.array([1e-3, 0, 2e-3, 1.0, 0, 0])
        for one, every in (
            (system.rhs(x, u, p), world.system.rhs(x, u, p_all)),
            (system.outputs(x, p), world.system.outputs(x, p_all)),
        ):
            np.testing.assert_allclose(np.array(one), np.array(every), rtol=1e-12, atol=1e-15)


def test_secular_rates_of_j2(world, world_fmu):
    """Ω̇ = −(3/2) n J₂ (R/p)² cos i and ω̇ = (3/4) n J₂ (R/p)² (4 − 5 sin² i) (Vallado, §9.6), to their order, over 40
    orbits; osculating elements also oscillate, by J₂/e in ω."""
    orbit = replace(world.orbit, semi_major_axis=9e6, eccentricity=0.2, inclination=0.6)
    time = np.linspace(0, 40 * orbit.period, 2001)
    recording = simulate(world_fmu, time, orbit_parameters(orbit) | only(Force.J2))
    r, v = recording["orbit.position"], recording["orbit.velocity"]
    h = np.cross(r, v)
    node = np.unwrap(np.arctan2(h[:, 0], -h[:, 1]))
    periapsis = np.cross(v, h) / orbit.gravitational_parameter - r / np.linalg.norm(r, axis=1, keepdims=True)
    along = np.column_stack([np.cos(node), np.sin(node), 0 * node])
    across = np.cross(h / np.linalg.norm(h, axis=1, keepdims=True), along)
    argument = np.unwrap(np.arctan2((periapsis * across).sum(axis=1), (periapsis * along).sum(axis=1)))
    p = orbit.semi_major_axis * (1 - orbit.eccentricity**2)
    scale = orbit.mean_motion * orbit.j2 * (orbit.equatorial_radius / p) ** 2
    assert np.polyfit(time, node, 1)[0] == pytest.approx(-1.5 * scale * np.cos(orbit.inclination), rel=0.01)
    expected = 0.75 * scale * (4 - 5 * np.sin(orbit.inclination) ** 2)
    assert np.polyfit(time, argument, 1)[0] == pytest.approx(expected, rel=0.01)


def test_a_circular_orbit_sinks_by_drag(world, world_fmu):
    """ȧ = −ρ b √(μ a) in an air at rest, of the same density everywhere."""
    orbit = replace(world.orbit, eccentricity=0.0)
    air = {"atmosphere.scaleHeight": 1e15, "atmosphere.rotationRate": 0.0, "atmosphere.density": 4e-12}
    parameters = orbit_parameters(orbit) | only() | air | {"target.drag": 0.01}
    recording = simulate(world_fmu, np.array([0.0, 3 * orbit.period]), parameters)
    r, v = (np.linalg.norm(recording[name], axis=1) for name in ("orbit.position", "orbit.velocity"))
    mu, a = orbit.gravitational_parameter, orbit.semi_major_axis
    found = 1 / (2 / r - v**2 / mu)
    assert found[0] - found[1] == pytest.approx(4e-12 * 0.01 * np.sqrt(mu * a) * 3 * orbit.period, rel=1e-4)


def test_velocities_are_the_derivatives_of_positions(world_fmu):
    """Also in LVLH, whose plane turns: central differences over 1 s."""
    recording = simulate(world_fmu, np.arange(0, 60.0, 1.0))
    for name in ("target", "chaser", "orbit"):
        position, velocity = recording[f"{name}.position"], recording[f"{name}.velocity"]
        step = (position[2:] - position[:-2]) / 2
        allowed = 2e-3 if name == "orbit" else 1e-8  # h² n³ a / 6
        np.testing.assert_allclose(step, velocity[1:-1], atol=allowed)


def test_lvlh_is_that_of_the_target_as_it_flies(world_fmu):
    recording = simulate(world_fmu, np.linspace(0, 6000.0, 7))
    r, v, com = recording["orbit.position"], recording["orbit.velocity"], recording["target.position"]
    up = r / np.linalg.norm(r, axis=1, keepdims=True)
    normal = np.cross(r, v) / np.linalg.norm(np.cross(r, v), axis=1, keepdims=True)
    axes = np.stack([up, np.cross(normal, up), normal], axis=1)
    np.testing.assert_allclose(recording["chaser.position"], -np.einsum("nij,nj->ni", axes, com), atol=1e-9)


def test_the_checker_finds_no_error(world_fmu, world_fmu3):
    for unit in (world_fmu, world_fmu3):
        assert [str(f) for f in check_unit(unit, isolated=False) if f.severity == Severity.ERROR] == []


def test_both_versions_and_a_restored_state_give_the_same(world_fmu, world_fmu3):
    with Session(world_fmu) as session, Session(world_fmu3) as other:
        for one in (session, other):
            one.step(100.0, acceleration=[1e-3, 0.0, 0.0])
        with session.state() as state:
            session.step(300.0)
            other.step(300.0)
            after = session.outputs.copy()
            assert np.array_equal(after, other.outputs)
            session.restore(state)
            session.step(300.0)
            assert np.array_equal(after, session.outputs)


def test_the_gravity_gradient_can_be_switched_in_a_run(world, world_fmu):
    with Session(world_fmu, {"gravityGradient": False}) as session:
        session.step(500.0)
        without = session.attitude
        session.reset({"gravityGradient": True})
        session.step(500.0)
        assert oracles.angle_between(without, session.attitude) > 1e-6
        session.reset({"gravityGradient": False})
        session.tune({"gravityGradient": True})
        session.step(500.0)
        with Session(world_fmu) as always:
            always.step(500.0)
            assert oracles.angle_between(always.attitude, session.attitude) < 1e-12


def test_a_unit_has_the_parameters_of_its_forces_only(oblate, small, world):
    assert small.forces == frozenset()
    assert oblate.forces == {Force.J2}
    assert world.forces == set(Force)
    for scenario in (small, oblate, world):
        names = [v.name for v in scenario.system.of_kind(Kind.PARAMETER)]
        assert forces_of(names) == scenario.forces
        assert set(names) == set(scenario.parameters())


def test_without_light_the_attitude_goes_by_its_series(world, tmp_path):
    """J2, drag, eddy currents and gravity gradient: Taylor's method, against the same independent integration."""
    scenario = world.model_copy(update={"light": None})
    assert "#define TURNED_SERIES 1" in series_source(scenario.system.series_rates, PLACE_START)
    time = np.linspace(0, 1500.0, 6)
    _, _, com, attitude = forces.fly(scenario, time)
    recording = simulate(build_fmu(scenario, tmp_path / "unit.fmu"), time)
    np.testing.assert_allclose(recording["target.position"], com, atol=1e-6)
    assert oracles.angle_between(recording["target.attitude"], attitude).max() < 1e-8

"""Derivatives of inputs: FMI 2's fmi2SetRealInputDerivatives, against closed forms and scipy's integrator."""

import ctypes

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import forces
import oracles
from baryscope.fmu import build_fmu
from importer import ERROR, Importer

ACCELERATION, TORQUE = [0, 1, 2], [3, 4, 5]  # value references
JERK, DURATION = 0.1, 20.0  # m/s³, s
NO_GRAVITY = {"orbit.gravitationalParameter": 1e-3}  # m³/s²


class Ramped(Importer):
    """An instance in Step Mode with its time."""

    def begin(self, parameters=()):
        for name, value in dict(parameters).items():
            (self.fmu.setBoolean if isinstance(value, bool) else self.fmu.setReal)([self.references[name]], [value])
        self.initialise()
        self.time = 0.0
        return self

    def ramp(self, references, values, rates):
        self.fmu.setReal(references, values)
        self.fmu.setRealInputDerivatives(references, [1] * len(references), rates)

    def step(self, size):
        self.fmu.doStep(self.time, size)
        self.time += size

    def get(self, name, size=3):
        names = [f"{name}[{k + 1}]" for k in range(size)]
        return np.array(self.fmu.getReal([self.references[each] for each in names]))


@pytest.fixture
def load(tmp_path):
    """Makes instances of units, which are freed at the end."""
    made = []

    def make(path):
        made.append(Ramped(path, tmp_path / f"unit{len(made)}"))
        return made[-1]

    yield make
    for each in made:
        each.fmu.freeInstance()


@pytest.mark.parametrize("again", [True, False], ids=["set at every step", "set once"])
@pytest.mark.parametrize("size", [0.1, 2.5, DURATION])
def test_a_ramp_of_the_acceleration(load, envisat_fmu, size, again):
    """Without gravity the chaser goes j t³/6; with the input held over steps of 0.1 s it is 1 m short of 133 m."""
    unit = load(envisat_fmu).begin(NO_GRAVITY)
    before = unit.get("chaser.position")
    unit.ramp(ACCELERATION, [0.0, 0.0, 0.0], [JERK, 0.0, -JERK / 2])
    while unit.time < DURATION - 1e-9:
        if again:
            unit.ramp(ACCELERATION, [JERK * unit.time, 0.0, -JERK / 2 * unit.time], [JERK, 0.0, -JERK / 2])
        unit.step(size)
    gone = unit.get("chaser.position") - before
    np.testing.assert_allclose(gone, np.array([1.0, 0.0, -0.5]) * JERK * DURATION**3 / 6, rtol=0, atol=1e-8)
    np.testing.assert_allclose(
        unit.get("chaser.acceleration"), [JERK * DURATION, 0.0, -JERK / 2 * DURATION], rtol=1e-12
    )


def test_without_derivatives_inputs_are_held(load, envisat_fmu):
    unit = load(envisat_fmu).begin(NO_GRAVITY)
    before, steps = unit.get("chaser.position"), round(DURATION / 0.1)
    for k in range(steps):
        unit.fmu.setReal(ACCELERATION, [JERK * 0.1 * k, 0.0, 0.0])
        unit.step(0.1)
    # The sum over all steps of the held acceleration's way: the ramp's, less j h T²/4 to first order in h.
    short = JERK * DURATION**3 / 6 - (unit.get("chaser.position") - before)[0]
    assert short == pytest.approx(JERK * 0.1 * DURATION**2 / 4, rel=0.01)


SPHERE = {
    f"target.inertia.{axes}": 500.0 if axes[0] == axes[1] else 0.0 for axes in ("xx", "yy", "zz", "xy", "xz", "yz")
}


@pytest.mark.parametrize("size", [0.1, 7.0, 350.0])
@pytest.mark.parametrize("gradient", [False, True])
def test_a_ramp_of_the_torque(load, envisat_fmu, gradient, size):
    """On a sphere, which gravity does not turn: ω = (τ t + τ̇ t²/2)/J, by both expansions of the attitude."""
    rest = {f"target.angularRate0[{k}]": 0.0 for k in (1, 2, 3)}
    unit = load(envisat_fmu).begin(SPHERE | rest | {"gravityGradient": gradient})
    first, torque, slope = unit.get("target.attitude", 4), np.array([0.02, -0.01, 0.03]), -2e-5
    unit.ramp(TORQUE, torque.tolist(), (slope * torque / 0.02).tolist())
    while unit.time < 350.0 - 1e-9:
        unit.step(size)
    t, slope = unit.time, slope / 0.02
    np.testing.assert_allclose(
        unit.get("target.angularRate"), torque * (t + slope * t**2 / 2) / 500.0, rtol=1e-11, atol=1e-15
    )
    turn = torque * (t**2 / 2 + slope * t**3 / 6) / 500.0
    expected = (Rotation.from_quat(first, scalar_first=True) * Rotation.from_rotvec(turn)).as_quat(scalar_first=True)
    assert oracles.angle_between(unit.get("target.attitude", 4)[None], expected[None]).max() < 1e-10


WORLDS = {
    "free": {},
    "gravity gradient": {"gradient": True},
    "eddy currents": {"gradient": True, "eddy_currents": forces.EDDY},
    "light": {"gradient": True, "light": forces.LIGHT},
}


@pytest.mark.parametrize("world", WORLDS)
def test_ramps_of_all_inputs_against_scipy(load, small, small_fmu, tmp_path, world):
    """The equations integrated by scipy, the inputs set at unequal steps; light pressure has no series."""
    others = dict(WORLDS[world])
    target = small.target.model_copy(update={"gravity_gradient": others.pop("gradient", False)})
    scenario = small.model_copy(update={"target": target} | others)
    unit = load(build_fmu(scenario, tmp_path / "unit.fmu") if world != "free" else small_fmu).begin()
    system, p = scenario.system, scenario.flat_parameters()
    rng = np.random.default_rng(11)
    x = np.array(system.initial(p)).ravel()
    for size in (0.1, 40.0, 3.0, 300.0):
        u = np.concatenate([1e-3 * rng.normal(size=3), 0.5 * rng.normal(size=3)])
        rate = np.concatenate([1e-4 * rng.normal(size=3), 0.05 * rng.normal(size=3)])
        unit.ramp(ACCELERATION + TORQUE, u.tolist(), rate.tolist())
        unit.step(size)
        rates = oracles.slope_of(system.rhs, len(x), lambda t, u=u, rate=rate: u + rate * t, p)
        x = solve_ivp(rates, (0.0, size), x, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    found = np.array(unit.fmu.getReal([r for name, r in unit.references.items() if name.startswith("state.")]))
    assert len(found) == len(x)
    np.testing.assert_allclose(found, x, rtol=1e-8, atol=1e-8)


def test_a_saved_state_goes_on_with_the_ramp(load, envisat_fmu):
    unit = load(envisat_fmu).begin()
    unit.ramp(ACCELERATION + TORQUE, [0.0, 1e-3, 0.0, 0.1, 0.0, 0.0], [1e-4, 0.0, 0.0, 0.0, 1e-2, 0.0])
    unit.step(0.7)
    state, found = unit.fmu.getFMUstate(), []
    copy = unit.fmu.deSerializeFMUstate(unit.fmu.serializeFMUstate(state))
    unit.fmu.setRealInputDerivatives(TORQUE, [1] * 3, [1.0] * 3)
    for saved in (state, copy):
        unit.fmu.setFMUstate(saved)
        unit.time = 0.7
        for _ in range(30):
            unit.step(0.3)
        found.append(unit.fmu.getReal([r for name, r in unit.references.items() if name != "gravityGradient"]))
        unit.fmu.freeFMUstate(saved)
    assert found[0] == found[1]
    np.testing.assert_allclose(unit.get("target.torque"), [0.1, 1e-2 * 9.7, 0.0], rtol=1e-12)


def test_what_cannot_be_is_refused(load, envisat_fmu):
    unit = load(envisat_fmu).begin()
    s, name = unit.fmu, "fmi2SetRealInputDerivatives"
    unit.refused(lambda: s.setRealInputDerivatives([0], [2], [1.0]), name, "found order 2, expected 1")
    unit.refused(lambda: s.setRealInputDerivatives([0], [1], [np.inf]), name, "chaser.acceleration[1] is inf")
    output = unit.references["target.position[1]"]
    unit.refused(lambda: s.setRealInputDerivatives([output], [1], [1.0]), name, "expected an input")
    s.terminate()
    unit.refused(lambda: s.setRealInputDerivatives([0], [1], [1.0]), name, "Terminated")


def test_model_exchange_has_no_steps_to_derive_inputs_over(model):
    one = (ctypes.c_uint32 * 1)(0), 1, (ctypes.c_int * 1)(1), (ctypes.c_double * 1)(1.0)
    assert model.fmu.dll.fmi2SetRealInputDerivatives(ctypes.c_void_p(model.fmu.component), *one) == ERROR
    assert "Model Exchange" in model.messages[-1]


def test_a_reset_ends_the_ramp(load, envisat_fmu):
    unit = load(envisat_fmu).begin(NO_GRAVITY)
    unit.ramp(ACCELERATION, [1.0, 0.0, 0.0], [1.0, 0.0, 0.0])
    unit.step(1.0)
    unit.fmu.reset()
    unit.begin(NO_GRAVITY)
    before = unit.get("chaser.position")
    unit.step(10.0)
    np.testing.assert_allclose(unit.get("chaser.position"), before, atol=1e-9)
    assert unit.get("chaser.acceleration").tolist() == [0.0, 0.0, 0.0]

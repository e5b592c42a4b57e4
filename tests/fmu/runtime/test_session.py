"""Stepping the unit from Python."""

import subprocess
import sys
from decimal import Decimal
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from baryscope.fmu import Session, simulate
from baryscope.fmu.runtime.session import UnitError
from baryscope.models.errors import InputError


def test_sixty_thousand_steps_land_on_the_right_time(any_fmu):
    with Session(any_fmu) as session:
        for _ in range(60_000):
            session.step(0.1)
        assert session.time == pytest.approx(6000.0, abs=1e-9)
        stepped = session.outputs.copy()
        session.reset()
        session.step(6000.0)
        # Momentum is of the order of 1e4 kg m²/s, positions of 20 m.
        np.testing.assert_allclose(stepped, session.outputs, rtol=1e-9, atol=1e-8)


def test_two_instances_do_not_disturb_each_other(any_fmu):
    with Session(any_fmu) as alone:
        for _ in range(50):
            alone.step(0.7)
        expected = alone.outputs.copy()
    with Session(any_fmu) as one, Session(any_fmu, {"target.angularRate0": [0.0, 0.0, 0.2]}) as other:
        for _ in range(50):
            one.step(0.7)
            other.step(1.3, torque=[100.0, 0.0, 0.0])
        assert np.array_equal(one.outputs, expected)
        assert not np.allclose(other.outputs, expected)


def growth(fmu, leaky):
    """Bytes by which a process grows over 2,000 rounds of resets, steps, refusals and saved states."""
    probe = Path(__file__).with_name("leak_probe.py")
    command = [sys.executable, str(probe), str(fmu), "2000", str(int(leaky))]
    return int(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


resident_memory = pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="needs Linux's /proc/self/statm")


@resident_memory
def test_two_thousand_rounds_leak_nothing(any_fmu):
    """The limit is 100 bytes a round. A saved state has about 6 kB."""
    assert growth(any_fmu, leaky=False) < 200_000


@resident_memory
def test_an_artificial_leak_is_detected(envisat_fmu):
    """The same rounds, with one saved state that is not freed."""
    assert growth(envisat_fmu, leaky=True) > 5_000_000


def test_reset_forgets_parameters_inputs_and_time(any_fmu):
    with Session(any_fmu) as session:
        fresh = session.outputs.copy()
        session.reset({"chaser.position0": [5.0, 0.0, 0.0]}, start_time=100.0)
        session.step(1.0, acceleration=[1.0, 0.0, 0.0])
        session.reset()
        assert session.time == 0
        assert np.array_equal(session.outputs, fresh)
        session.step(10.0)
        coasted = session.outputs.copy()
        session.reset()
        session.step(10.0, acceleration=[0.0] * 3)
        assert np.array_equal(session.outputs, coasted)


def test_outputs_by_name_have_their_shapes_and_are_copies(envisat, any_fmu):
    with Session(any_fmu) as session:
        features = session.features
        assert features.shape == (len(envisat.features.points), 3)
        assert session["orbit.trueAnomaly"].shape == ()
        before = features.copy()
        session.step(1.0)
        assert np.array_equal(features, before)
        assert not np.array_equal(session.features, before)
        with pytest.raises(ValueError, match="read-only"):
            session.outputs[0] = 1.0


def test_inputs_hold_until_they_are_given_again(any_fmu):
    with Session(any_fmu) as held, Session(any_fmu) as repeated:
        held.step(1.0, torque=[10.0, 0.0, 0.0])
        repeated.step(1.0, torque=[10.0, 0.0, 0.0])
        held.step(1.0)
        repeated.step(1.0, torque=[10.0, 0.0, 0.0])
        assert np.array_equal(held.outputs, repeated.outputs)


@pytest.mark.parametrize("parameters, words", [
    pytest.param({"target.inertia.xx": -1.0}, ["target.inertia", "positive definite"], id="negative moment"),
    pytest.param({"target.inertia.xx": 1e6}, ["target.inertia", "triangle"], id="triangle"),
    pytest.param({"orbit.eccentricity": 1.0}, ["orbit.eccentricity", "found value 1", "0 ≤ e < 1"], id="parabola"),
    pytest.param({"orbit.semiMajorAxis": 0.0}, ["orbit.semiMajorAxis", "above 0"], id="no orbit"),
    pytest.param({"chaser.position0": [0.0] * 3}, ["chaser.position0", "centre of mass"], id="no range"),
    pytest.param({"target.attitude0": [2.0, 0.0, 0.0, 0.0]}, ["target.attitude0", "length 2", "unit"], id="length"),
    pytest.param({"solver.tolerance": 0.0}, ["solver.tolerance", "1e-15"], id="tolerance"),
    pytest.param({"chaser.velocity0": [np.nan] * 3}, ["chaser.velocity0[1]", "nan", "finite"], id="nan"),
    pytest.param({"target.torque0": 1.0}, ["target.torque0", "expected one of"], id="unknown"),
    pytest.param({"features": 1.0}, ["features", "not a parameter"], id="an output"),
    pytest.param({"chaser.position0": [1.0, 2.0]}, ["chaser.position0", "(2,)", "(3,)"], id="shape"),
    pytest.param({"chaser.position0": "near"}, ["chaser.position0", "'near'", "numbers"], id="text"),
])  # fmt: skip
def test_wrong_parameters_are_refused_with_a_reason(any_fmu, parameters, words):
    with pytest.raises((InputError, UnitError)) as raised:
        Session(any_fmu, parameters)
    message = str(raised.value)
    assert "\n" not in message
    for word in words:
        assert word in message


def test_features_on_one_line_are_refused(envisat, any_fmu):
    line = np.outer(np.arange(len(envisat.features.points)), [1.0, 2.0, 3.0])
    with pytest.raises(UnitError, match=r"target\.features: .*one line"):
        Session(any_fmu, {"target.features": line})


@pytest.mark.parametrize("duration, words", [
    (0.0, "communicationStepSize is 0"), (-1.0, "communicationStepSize is -1"), (np.nan, "is nan"), (np.inf, "is inf"),
])  # fmt: skip
def test_wrong_steps_are_refused_and_leave_the_session_as_it_was(any_fmu, duration, words):
    with Session(any_fmu) as session:
        session.step(1.0)
        before = session.outputs.copy()
        with pytest.raises(UnitError, match=words):
            session.step(duration)
        assert session.time == 1.0
        assert np.array_equal(session.outputs, before)
        session.step(1.0)
        assert session.time == 2.0


@pytest.mark.parametrize("duration", [np.float32(0.1), Decimal("0.1"), Fraction(1, 10), np.array(0.1)])
def test_steps_of_any_number_keep_unit_and_session_at_one_time(any_fmu, duration):
    """A float32 made a float32 of the session's time, which the unit refused at the third step."""
    with Session(any_fmu) as session, Session(any_fmu) as other:
        for _ in range(100):
            session.step(duration)
            other.step(float(duration))
        assert isinstance(session.time, float)
        assert session.time == other.time
        session.step_to(np.float32(10.1))
        other.step_to(float(np.float32(10.1)))
        assert isinstance(session.time, float)
        assert np.array_equal(session.outputs, other.outputs)


@pytest.mark.parametrize("inputs, error, words", [
    ({"torque": [np.nan, 0, 0]}, UnitError, r"target\.torque\[1\] is nan"),
    ({"acceleration": [0, np.inf, 0]}, UnitError, r"chaser\.acceleration\[2\] is inf"),
    ({"torque": [1, 2]}, InputError, r"target\.torque: found shape \(2,\), expected \(3,\)"),
])  # fmt: skip
def test_wrong_inputs_are_refused(any_fmu, inputs, error, words):
    with Session(any_fmu) as session:
        with pytest.raises(error, match=words):
            session.step(1.0, **inputs)
        assert session.time == 0


def test_a_state_out_of_bounds_is_reported_and_undone(any_fmu):
    with Session(any_fmu) as session:
        session.step(1.0)
        before = session.outputs.copy()
        with pytest.raises(UnitError, match="integration from 1 s"):
            session.step(1.0, torque=[1e300, 0.0, 0.0])
        assert session.time == 1.0
        session.step(1.0, torque=[0.0] * 3)
        session.reset()
        session.step(1.0)
        assert np.array_equal(session.outputs, before)


def test_the_stop_time_is_kept(any_fmu):
    with Session(any_fmu, stop_time=10.0) as session:
        session.step(10.0)
        with pytest.raises(UnitError, match="at most the stop time, 10"):
            session.step(0.1)


def test_a_looser_experiment_tolerance_changes_nothing(any_fmu):
    with Session(any_fmu) as usual, Session(any_fmu, tolerance=1e-3) as loose:
        usual.step(500.0)
        loose.step(500.0)
        assert np.array_equal(usual.outputs, loose.outputs)


def test_simulate_records_what_a_session_sees(any_fmu):
    times = [5.0, 5.5, 7.0, 20.0]
    recording = simulate(any_fmu, times, torque=[1.0, 2.0, 3.0])
    with Session(any_fmu, start_time=5.0) as session:
        session.set_inputs(torque=[1.0, 2.0, 3.0])
        assert np.array_equal(recording["features"][0], session.features)
        for row, time in enumerate(times[1:], start=1):
            session.step_to(time)
            assert np.array_equal(recording.values[row], session.outputs)
    assert recording["target.angularMomentum"].shape == (4, 3)


def test_control_closes_the_loop(any_fmu):
    """A chaser that holds its station by feedback stays there; one that coasts drifts off."""
    hold = np.array([10.0, -20.0, 5.0])
    start = {"chaser.position0": hold, "chaser.velocity0": [0.0] * 3}

    def control(session):
        session.set_inputs(acceleration=-1e-2 * (session.chaser_position - hold) - 0.2 * session.chaser_velocity)

    times = np.arange(0.0, 1000.0)
    held = simulate(any_fmu, times, start, control=control)["chaser.position"]
    coasting = simulate(any_fmu, times, start)["chaser.position"]
    assert np.linalg.norm(held - hold, axis=1).max() < 0.02
    assert np.linalg.norm(coasting[-1] - hold) > 10


@pytest.mark.parametrize("times", [[0, 1, 1], [[0, 1]], [], [0, np.nan]])
def test_times_must_increase(any_fmu, times):
    with pytest.raises(InputError, match="times: expected"):
        simulate(any_fmu, times)


def test_durations_are_no_times(any_fmu):
    with pytest.raises(InputError, match=r"times: found timedelta64\[ms\], expected real numbers"):
        simulate(any_fmu, np.arange(3).astype("timedelta64[ms]"))


def test_progress_is_reported_up_to_the_end(any_fmu):
    shares = []
    simulate(any_fmu, np.arange(500.0), progress=shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert len(shares) > 50

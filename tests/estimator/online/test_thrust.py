"""The online estimator while the chaser accelerates on an orbit, against its motion by scipy's DOP853."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

import oracles
from baryscope.estimator.online import OnlineEstimator, Thrust
from baryscope.models.errors import InputError
from baryscope.models.orbit import Orbit
from tops import DRIFT, SIGMA, START, attitudes, run, straight, tracks

ACCELERATION = np.array([2e-3, -1e-3, 5e-4])  # m/s²
ORBIT = Orbit(7.2e6, 0.1, 1.7, 2.0, 1.5, 0.4)
LAST = 59.0  # s


def displaced(ahead):
    """By how much the acceleration moves the chaser in a time in s, m."""
    mu = ORBIT.gravitational_parameter
    _, start = oracles.inertial_states(ORBIT, [2.0, -20.0, 1.0], [0.005, 0.002, -0.003])
    state = np.concatenate(oracles.propagate_kepler(*start, mu, LAST)).astype(float)
    ends = [
        solve_ivp(
            lambda _, y, a=acceleration: np.concatenate([y[3:], a - mu * y[:3] / np.linalg.norm(y[:3]) ** 3]),
            (0.0, ahead),
            state,
            method="DOP853",
            rtol=1e-13,
            atol=1e-9,
        ).y[:3, -1]
        for acceleration in (ACCELERATION, np.zeros(3))
    ]
    return ends[0] - ends[1]


@pytest.mark.parametrize("ahead", [20.0, 120.0])
def test_gravity_acts_on_what_an_acceleration_displaces(ahead):
    """Without it the prediction is off by 4 mm after 120 s."""
    time = np.arange(LAST + 1)
    filter = OnlineEstimator(SIGMA, ORBIT)
    run(filter, time, tracks(np.random.default_rng(8), time, straight(time)))
    moved = filter.predict(LAST + ahead, ACCELERATION).position - filter.predict(LAST + ahead).position
    np.testing.assert_allclose(moved, -displaced(ahead), atol=2e-4)


STD = 0.02  # of what thrusters are wrong by
DRAWS = 12


def flown(seed, told=STD, wrong=None):
    """A flight of 330 s on a chaser whose thrusters are wrong by deviates of STD, or by `wrong`.

    It turns, and from 130 s on its thrust turns with the target, as that of a chaser that stays before a point of it
    does: what that is wrong by looks like an offset. Motion between frames, under a constant acceleration, is exact.
    Returns the errors (n, 3) of position from there on, their covariances, the last state, and what the thrusters were
    wrong by.
    """
    rng = np.random.default_rng(seed)
    wrong = STD * rng.standard_normal(4) if wrong is None else wrong
    time = np.arange(330.0)
    target, chaser = attitudes(time), Rotation.from_rotvec(np.outer(time, [0.01, 0.02, 0.0]))
    push = np.where(time[:, None] > 130, target @ [0.02, -0.01, 0.005], 0.0)  # since the frame before
    pushed = (chaser * Rotation.from_rotvec(wrong[1:]) * chaser.inv()).apply((1 + wrong[0]) * push)
    speed = DRIFT - np.cumsum(pushed, axis=0)
    path = START + np.concatenate([np.zeros((1, 3)), np.cumsum(speed[1:] + 0.5 * pushed[1:], axis=0)])
    filter = OnlineEstimator(SIGMA, thrust_std=told)
    states = [
        filter.update(t, frame, acceleration=Thrust(push[k], chaser[k].as_matrix()))
        for k, (t, frame) in enumerate(zip(time.tolist(), tracks(rng, time, path), strict=True))
    ]
    late = slice(131, None)
    errors = np.array([state.position for state in states])[late] - path[late]
    return errors, np.array([state.covariance[:3, :3] for state in states])[late], states[-1], wrong


def squares(errors, covariances):
    return np.einsum("...i,...ij,...j->...", errors, np.linalg.inv(covariances), errors)


def test_what_thrusters_are_wrong_by_is_found_and_claims_are_true():
    """Told accelerations were taken for exact: off by several times the claim.

    At each of four times NEES is that of true claims, its mean over the draws below the 99.9 % quantile of χ².
    """
    errors, covariances, states, wrong = zip(*(flown(seed) for seed in range(DRAWS)), strict=True)
    nees = squares(np.array(errors), np.array(covariances)).mean(axis=0)
    assert (nees[[20, 50, 100, -1]] < chi2.ppf(0.999, 3 * DRAWS) / DRAWS).all()
    found = np.array([state.thrust for state in states]) - wrong
    of_thrust = squares(found, np.array([state.thrust_covariance for state in states]))
    assert of_thrust.mean() < chi2.ppf(0.999, 4 * DRAWS) / DRAWS
    assert np.sqrt(np.mean(found[:, 0] ** 2)) < 0.1 * STD
    assert all(state.status == "tracking" for state in states)


def test_thrust_that_is_exact_is_told_by_none():
    """With thrust_std 0 nothing is estimated: claims are those of known thrust, and wrong thrust is doubted at last."""
    errors, covariances, state, _ = flown(3, told=0.0, wrong=np.zeros(4))
    assert squares(errors, covariances)[-1] < chi2.ppf(0.999, 3)
    np.testing.assert_array_equal(state.thrust, np.zeros(4))
    np.testing.assert_array_equal(state.thrust_covariance, np.zeros((4, 4)))
    known = flown(3, wrong=np.zeros(4))[1]
    assert np.trace(covariances[-1]) < np.trace(known[-1])


def test_a_prediction_under_thrust_knows_what_the_thrusters_may_be_wrong_by():
    """Thrusters that have never fired: after T s their displacement a T²/2 is uncertain by STD in each direction."""
    time = np.arange(180.0)
    filter = OnlineEstimator(SIGMA, thrust_std=STD)
    run(filter, time, tracks(np.random.default_rng(8), time, straight(time)))
    push = np.array([0.03, 0.0, 0.0])
    more = filter.predict(time[-1] + 60, push).covariance - filter.predict(time[-1] + 60).covariance
    expected = (STD * 0.5 * 0.03 * 60**2) ** 2 * np.eye(3)  # along the thrust by its scale, across it by its direction
    np.testing.assert_allclose(more[:3, :3], expected, atol=1e-9)


def test_thrust_that_is_none_is_refused():
    filter = OnlineEstimator(SIGMA)
    points = tracks(np.random.default_rng(8), np.zeros(1), straight(np.zeros(1)))[0]
    with pytest.raises(InputError, match="attitude of the thrust"):
        filter.update(0.0, points, acceleration=Thrust(ACCELERATION, 2 * np.eye(3)))
    with pytest.raises(InputError, match=r"thrust_std is -0\.1, expected 0 to 1"):
        OnlineEstimator(SIGMA, thrust_std=-0.1)

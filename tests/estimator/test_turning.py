"""Points far from the tracks, against motions that scipy integrates: members of a posterior, and errors of draws."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation as Turn
from scipy.stats import chi2

from baryscope.estimator import PathOptions, estimate
from baryscope.estimator.dynamics.inertia import of_a_body
from baryscope.estimator.dynamics.rotation import Rotation
from baryscope.estimator.dynamics.torque import LastingTorque
from baryscope.estimator.turning import TurningPoint, carried, curved
from baryscope.models.attitude import INERTIA_BASIS
from baryscope.models.errors import ComputationError
from synthetic import attitude, box_features, make_case

pytestmark = pytest.mark.usefixtures("shared_pivot")

INERTIA = np.diag([0.28, 0.33, 0.39])
RATE = np.array([0.02, 0.035, 0.03])  # rad/s
B = np.array([0.6, -0.3, 0.4])  # m
DRAWS = 300
PATH = np.eye(6)[None]  # a state that is its own unknowns


def moved(turn, rate, inertia):
    """The rotation at time 0 after a change."""
    changed = INERTIA + np.tensordot(inertia, INERTIA_BASIS, 1)
    return Rotation(0.0, Turn.from_rotvec(turn).as_matrix(), RATE + rate, of_a_body(changed))


def applied(matrices, vectors):
    return np.einsum("kij,kj->ki", matrices, vectors)


def carried_by_scipy(changes, time, push=0.0):
    """Positions and velocities (k, 6) of the points that free bodies carry after changes (k, 20), by Euler's equations.

    All are integrated together, as what takes time is the number of steps. push (3,): an angular acceleration in B.
    """
    starts = [moved(*np.split(change[:11], [3, 6])) for change in changes]
    J, b = np.array([one.inertia for one in starts]), B + changes[:, 17:]

    def slope(_, y):
        R, w = y[: 9 * len(J)].reshape(-1, 3, 3), y[9 * len(J) :].reshape(-1, 3)
        turning = np.cross(R, w[:, None])  # R [w]×, row by row
        change = np.linalg.solve(J, np.cross(applied(J, w), w)[..., None])[..., 0] + push
        return np.concatenate([turning.ravel(), change.ravel()])

    y = np.concatenate([np.array([one.attitude for one in starts]).ravel(), *(one.rate for one in starts)])
    end = solve_ivp(slope, (0, time), y, "DOP853", rtol=1e-8, atol=1e-10).y[:, -1]
    R, w = end[: 9 * len(J)].reshape(-1, 3, 3), end[9 * len(J) :].reshape(-1, 3)
    return np.concatenate([applied(R, b), applied(R, np.cross(w, b))], axis=1)


@pytest.fixture(scope="module")
def covariance():
    """Of a body whose rate is known to 1e-5 rad/s, its inertia to 0.03, its point with what errors of attitude do."""
    deviation = np.array([*3 * [0.005], *3 * [1e-5], *5 * [0.03], *6 * [1e-3], *3 * [1e-3]])
    found = np.diag(deviation**2)
    arm = np.array([[0, -B[2], B[1]], [B[2], 0, -B[0]], [-B[1], B[0], 0]])  # θ moves the point by θ × b
    by_turn = np.eye(20)
    by_turn[17:, :3] = arm
    return by_turn @ found @ by_turn.T


@pytest.mark.parametrize("time", [-250.0, 250.0])
def test_mean_and_covariance_are_those_of_drawn_motions(time, covariance):
    """Two turns away, where the attitude is uncertain by half a radian because the inertia is.

    To first order the mean of the normalised squares is 3000 to 15,000 times their number, as what is across the
    tangent is missing.
    """
    here = TurningPoint(moved(np.zeros(3), np.zeros(3), np.zeros(5)), moved, B, covariance, 0.0)
    mean, found = here.away(np.array([time]), np.zeros((1, 6)), PATH)
    change = np.random.default_rng(5).standard_normal((DRAWS, 20)) @ np.linalg.cholesky(covariance).T
    drawn = carried_by_scipy(change, time) + change[:, 11:17]
    sampled, size = np.cov(drawn.T), np.sqrt(np.diag(found[0]))
    np.testing.assert_allclose((mean[0] - drawn.mean(axis=0)) / size, 0.0, atol=0.25)
    np.testing.assert_allclose((found[0] - sampled) / np.outer(size, size), 0.0, atol=0.35)
    off = drawn - mean[0]
    squares = np.einsum("ni,ij,nj->n", off, np.linalg.inv(found[0]), off)
    assert np.mean(squares) == pytest.approx(6, rel=0.3)


def test_where_errors_are_small_the_first_order_is_all(covariance):
    """A second away, with errors a hundredth as large: the Jacobian by differences of scipy's motions."""
    small, step = 1e-4 * covariance, 1e-5
    here = TurningPoint(moved(np.zeros(3), np.zeros(3), np.zeros(5)), moved, B, small, 0.0)
    _, found = here.away(np.array([1.0]), np.zeros((1, 6)), PATH)
    by_change = np.zeros((6, 20))
    by_change[:, 11:17] = np.eye(6)
    own = np.delete(np.arange(20), np.s_[11:17])
    ends = carried_by_scipy(step * np.concatenate([np.eye(20)[own], -np.eye(20)[own]]), 1.0).reshape(2, -1, 6)
    by_change[:, own] = (ends[0] - ends[1]).T / (2 * step)
    expected = by_change @ small @ by_change.T
    size = np.sqrt(np.diag(expected))
    np.testing.assert_allclose((found[0] - expected) / np.outer(size, size), 0.0, atol=2e-4)


@pytest.mark.parametrize("time", [-250.0, 250.0])
def test_a_torque_that_lasts_carries_a_point_on(time, covariance):
    """By hundredths of a radian: the mean against scipy's motion under it, the covariance against differences."""
    push, step, of_push = np.array([4e-6, -3e-6, 2e-6]), 1e-8, 1e-14 * np.array([[4, 1, 0], [1, 3, 0], [0, 0, 2.0]])
    known = moved(np.zeros(3), np.zeros(3), np.zeros(5)), moved, B, 1e-16 * covariance, 0.0
    at, axes = (np.array([time]), np.zeros((1, 6)), PATH), step * np.eye(3)
    (mean,), (found,) = TurningPoint(*known, LastingTorque(push, of_push)).away(*at)
    expected, *ends = (carried_by_scipy(np.zeros((1, 20)), time, push + one)[0] for one in (0.0, *axes, *-axes))
    (free,), _ = TurningPoint(*known).away(*at)
    assert np.linalg.norm(free[:3] - expected[:3]) > 0.02
    np.testing.assert_allclose(mean, expected, atol=1e-6)
    by_push = (np.array(ends[:3]) - np.array(ends[3:])).T / (2 * step)
    size = np.sqrt(np.diag(by_push @ of_push @ by_push.T))
    np.testing.assert_allclose((found - by_push @ of_push @ by_push.T) / np.outer(size, size), 0.0, atol=1e-3)


@pytest.mark.parametrize("method", ["ml", "ekf"])
def test_a_body_that_a_torque_brakes_is_braked_on(method, monkeypatch):
    """By a tenth in the tracks, as by eddy currents: half as long after them a feature is where it is foreseen, to half
    of the error of a torque that ends with them, and what is claimed of that holds.
    """
    features, time = box_features(8, (1, 1, 1), seed=3), np.append(4.0 * np.arange(100.0), 600.0)
    R = attitude(np.diag([0.28, 0.33, 0.39]), np.array([0.006, 0.004, 0.04]), time, braking=1e-4)
    com = np.tile([4.0, -19.0, 3.0], (101, 1))
    tracks = make_case(time[:-1], R[:-1], com[:-1], features, noise=0.005, seed=1).tracks
    found, errors = estimate(tracks, method=method, options=PathOptions(trajectory="fixed")), []
    truth = com[0] + R[-1] @ features[2]
    for _ in range(2):
        there = found.predict([600.0], "F2")
        errors.append(there.position[0] - truth)
        square = float(errors[-1] @ np.linalg.solve(there.covariance[0, :3, :3], errors[-1]))
        assert len(errors) == 2 or square < chi2.isf(1e-3, 3)
        monkeypatch.setattr(LastingTorque, "of", lambda *_: None)
    assert 2 * np.linalg.norm(errors[0]) < np.linalg.norm(errors[1])


def test_a_point_moves_on_an_arc():
    """Mean and covariance of position and velocity against those of drawn attitudes, uncertain by 0.1 to 0.4 rad.

    To first order nothing moves along the arm, and the mean is a fifth of a metre too far out.
    """
    rng, b, rate = np.random.default_rng(81), np.array([1.5, -0.7, 2.0]), np.array([[0.5, -0.3, 0.8]])
    R = Turn.random(random_state=2).as_matrix()[None]
    L = np.array([[0.3, 0.0, 0.0], [0.1, 0.2, 0.0], [-0.05, 0.1, 0.25]])
    turned = R @ Turn.from_rotvec(rng.standard_normal((200_000, 3)) @ L.T).as_matrix()
    drawn = np.concatenate([turned @ b, turned @ np.cross(rate[0], b)], axis=1)
    arm, by_motion, _ = carried(R, rate, b)
    shift, arc = curved(R, rate, b, (L @ L.T)[None])
    first = by_motion[0, :, :3] @ L @ L.T @ by_motion[0, :, :3].T
    sampled = np.cov(drawn.T)
    deviations = np.sqrt(np.diag(sampled))
    assert np.abs(drawn.mean(axis=0) - arm[0] - shift[0]).max() < 0.012  # of terms of fourth order
    assert np.abs(drawn.mean(axis=0) - arm[0]).max() > 0.15
    off = np.abs(first + arc[0] - sampled) / np.outer(deviations, deviations)
    assert off.max() < 0.2  # of the product of first and third order, which is left out
    along = arm[0, :3] / np.linalg.norm(arm[0, :3])
    told, linear, true = (along @ C[:3, :3] @ along for C in (first + arc[0], first, sampled))
    assert linear < 0.1 * true
    assert told == pytest.approx(true, rel=0.25)


@pytest.mark.parametrize("method", ["ml", "ekf"])
def test_a_point_two_turns_after_less_than_one_is_as_uncertain_as_its_errors_are(method):
    """Position and velocity of a feature of a body that is watched for nine tenths of a turn, over draws of noise.

    By the first order of the inertia's error the mean of the normalised squares was 130 to 190, and seven of ten were
    beyond the limit of one in a thousand.
    """
    rate, features = RATE, box_features(8, (1, 1, 1), seed=3, centre=(0.3, 0.1, 0))
    time = np.append(3.0 * np.arange(45.0), 390.0 + np.array([-0.01, 0.0, 0.01]))
    R, com = attitude(np.diag([0.30, 0.33, 0.37]), rate, time), np.tile([4.0, -19.0, 3.0], (48, 1))
    options = PathOptions(trajectory="fixed", process_noise="none", torque_noise="none", sigma=0.008)
    squares = []
    for seed in range(5):
        tracks = make_case(time[:45], R[:45], com[:45], features, noise=0.008, seed=seed).tracks
        found = estimate(tracks, method=method, options=options).predict([390.0], "F2")
        truth = np.concatenate([com[0] + R[-2] @ features[2], (R[-1] - R[-3]) @ features[2] / 0.02])
        error = np.concatenate([found.position[0], found.velocity[0]]) - truth
        squares.append(float(error @ np.linalg.solve(found.covariance[0], error)))
    assert np.mean(squares) < 2 * 6  # 4 deviations √(12/5)
    assert sum(square > chi2.ppf(0.999, 6) for square in squares) <= 1


def test_a_point_too_far_away_is_refused_in_a_line(covariance):
    here = TurningPoint(moved(np.zeros(3), np.zeros(3), np.zeros(5)), moved, B, covariance, 0.0)
    with pytest.raises(ComputationError, match=r"times: found 1e\+06 s away from the tracks, expected .* for a point"):
        here.away(np.array([1e6]), np.zeros((1, 6)), PATH)


def test_a_point_whose_rate_is_hardly_known_is_refused_as_soon(covariance):
    """To 10 rad/s: members, which turn thousands of times, were followed for minutes."""
    size = np.ones(len(covariance))
    size[3:6] = 1e6
    here = TurningPoint(moved(np.zeros(3), np.zeros(3), np.zeros(5)), moved, B, covariance * np.outer(size, size), 0.0)
    with pytest.raises(ComputationError, match=r"expected .* s at most for a point: the target turns at .* ± "):
        here.away(np.array([3000.0]), np.zeros((1, 6)), PATH)

"""Rate and inertia from noisy attitudes, against the true values."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation as ScipyRotation

from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.dynamics.inertia import BEYOND
from baryscope.estimator.dynamics.rotation import Rotation
from baryscope.estimator.ml.initial_tumble import fit_tumbles
from baryscope.estimator.registration.body import Body
from baryscope.models.errors import ComputationError
from synthetic import ENVISAT, Orbit, attitude

POINTS = np.array([[3.0, 1, 0], [-2, 2, 1], [0, -3, 1], [-1, 0, -2]])
NOISE = 0.02  # m of each coordinate


def bodies_of(R_I_B, seen, seed=0, points=POINTS):
    """A body for each list of frames, in axes of its own, with the attitude noise that observations of `NOISE` give."""
    rng = np.random.default_rng(seed)
    inertia = np.eye(3) * (points**2).sum() - points.T @ points
    deviation = NOISE * np.linalg.cholesky(np.linalg.inv(inertia))
    bodies, m = [], len(points)
    for index, frames in enumerate(seen):
        R_B_S = ScipyRotation.random(random_state=seed + 100 + index).as_matrix() if index else np.eye(3)
        noise = ScipyRotation.from_rotvec(rng.normal(size=(len(frames), 3)) @ deviation.T).as_matrix()
        bodies.append(Body(np.arange(m) + m * index, frames, points @ R_B_S, R_I_B[frames] @ noise @ R_B_S))
    weight = np.zeros((len(R_I_B), m * len(seen)))
    for body in bodies:
        weight[np.ix_(body.frames, body.features)] = 1.0
    return tuple(bodies), Observations(np.zeros((*weight.shape, 3)), weight)


def greatest_error(found, R_I_B, time):
    """Of the attitudes that the motion predicts, in axes of the first body, rad."""
    predicted = found.rotation.at(time).attitude @ found.bodies[0]
    return float(ScipyRotation.from_matrix(np.swapaxes(predicted, 1, 2) @ R_I_B).magnitude().max())


def body_with(moments, seed):
    axes = ScipyRotation.random(random_state=seed).as_matrix()
    return axes @ np.diag(moments) @ axes.T


# moments, rate in °/s, step in s, frames
TUMBLES = {
    "envisat": ([17.0, 125, 129], [1.2, 2.2, 2.4], 1.0, 800),
    "symmetric": ([17.0, 125, 125], [3.0, 1.0, 0.5], 1.0, 400),
    "nearly symmetric, flat": ([60.0, 60.5, 118], [1.0, -1.5, 2.0], 1.0, 400),
    "nearly a sphere": ([1.0, 1.01, 1.02], [2.0, 1.0, -1.0], 1.0, 400),
    "unstable axis": ([1.0, 2.0, 2.9], [0.05, 4.0, 0.05], 1.0, 500),
    "slow": ([1.0, 2.0, 2.5], [0.05, 0.1, 0.12], 10.0, 500),
    "fast": ([1.0, 2.0, 2.5], [80.0, 100.0, 60.0], 0.1, 500),
    "few frames a turn": ([1.0, 2.0, 2.5], [20.0, 15.0, 10.0], 2.0, 300),
}


@pytest.mark.parametrize("name", TUMBLES)
def test_the_rotation_of_different_bodies_is_found(name):
    """The attitudes predicted are better than those seen by the square root of how many there are for 11 unknowns."""
    moments, rate, step, count = TUMBLES[name]
    inertia = body_with(moments, seed=5)
    time = step * np.arange(float(count))
    R_I_B = attitude(inertia, np.deg2rad(rate), time)
    bodies, observations = bodies_of(R_I_B, [np.arange(count)])
    found = fit_tumbles(bodies, observations, NOISE**2, time, (None,))[0]
    # Each attitude is off by 0.005 rad or so; the worst of a fit by 11 unknowns by 4 √(11/n) of that.
    assert greatest_error(found, R_I_B, time) < 4 * np.sqrt(11 / count) * 0.008
    # Cauchy's cost of χ²₃ values is a little below three each.
    assert found.cost < 3.3 * count


def test_rate_and_inertia_of_envisat():
    """In axes of the body: 1,500 attitudes of 0.3° over 3 turns tell the rate to a part in 10⁴, the ratios to 1 %."""
    time = np.arange(1500.0)
    rate = np.deg2rad([1.2, 2.2, 2.4])
    R_I_B = attitude(ENVISAT, rate, time)
    bodies, observations = bodies_of(R_I_B, [np.arange(1500)])
    found = fit_tumbles(bodies, observations, NOISE**2, time, (None,))[0]
    start = Rotation(0.0, np.eye(3), rate, ENVISAT).at(np.array([found.rotation.epoch]))
    turn = found.bodies[0]  # R_B_S: axes of the tumble against those of the first body
    np.testing.assert_allclose(turn.T @ found.rotation.rate, start.rate[0], atol=1e-3 * np.linalg.norm(rate))
    inertia = turn.T @ found.rotation.inertia @ turn
    np.testing.assert_allclose(inertia, ENVISAT / np.trace(ENVISAT), atol=0.01)


def test_slow_turns_are_fitted_by_the_inertia_of_a_body():
    """A quarter of a turn by attitudes of 0.02 rad. Inertias that no body has, of moments of up to 0.97 of the trace,
    cone so fast that fits ended in what the noise made of that: off by 0.04, 0.015, 0.03, 0.05, 0.02 and 0.04 rad.
    """
    time = np.linspace(0.0, 780.0, 426)
    for seed in (0, 2, 5, 10, 15, 18):
        rng = np.random.default_rng([seed, 7])
        mass = rng.uniform(0.2, 1, 3)
        inertia = body_with(mass.sum() - mass, seed)
        rate = rng.normal(size=3)
        R_I_B = attitude(inertia, 2.2e-3 * rate / np.linalg.norm(rate), time)
        bodies, observations = bodies_of(R_I_B, [np.arange(426)], seed, POINTS / 3)
        found = fit_tumbles(bodies, observations, NOISE**2, time, (None,))[0]
        # As above, of points at a third of the distance.
        assert greatest_error(found, R_I_B, time) < 4 * np.sqrt(11 / 426) * 3 * 0.008
        assert np.linalg.eigvalsh(found.rotation.inertia)[2] < 0.5 + 3 * BEYOND


def test_bodies_without_common_features_get_relative_attitudes_from_the_motion():
    time = np.arange(900.0)
    R_I_B = attitude(ENVISAT, np.deg2rad([1.2, 2.2, 2.4]), time)
    seen = [np.arange(0, 350), np.arange(400, 600), np.arange(650, 900)]
    bodies, observations = bodies_of(R_I_B, seen, seed=1)
    found = fit_tumbles(bodies, observations, NOISE**2, time, (None,))[0]
    first = found.bodies[0]
    for index, R_B_S in enumerate(found.bodies):
        # Truth: R_I_B is the first body's attitude, and the points of the others are turned by R_B_S from it.
        true = ScipyRotation.align_vectors(POINTS, bodies[index].points)[0]
        # The points, not scipy's rssd: the root of a difference of sums of squares, it rounds to √ε.
        np.testing.assert_allclose(true.apply(bodies[index].points), POINTS, atol=1e-13)
        turn = ScipyRotation.from_matrix(first.T @ R_B_S @ true.as_matrix().T)
        assert turn.magnitude() < 0.005
    assert greatest_error(found, R_I_B, time) < 0.005


def test_wrong_attitudes_have_limited_influence():
    time = np.arange(500.0)
    R_I_B = attitude(ENVISAT, np.deg2rad([1.2, 2.2, 2.4]), time)
    (body,), observations = bodies_of(R_I_B, [np.arange(500)])
    wrong = np.random.default_rng(0).random(500) < 0.02
    body.attitude[wrong] = ScipyRotation.random(int(wrong.sum()), random_state=0).as_matrix()
    found = fit_tumbles((body,), observations, NOISE**2, time, (None,))[0]
    assert greatest_error(found, R_I_B, time) < 0.005


def test_the_gravity_gradient_is_chosen_if_it_acts():
    """A slow tumble over two fifths of an orbit, which the torque bends by radians, and the same without the torque."""
    orbit = Orbit().model()
    time = np.linspace(0.0, 2400.0, 200)
    rate = np.deg2rad([0.1, 0.2, 0.25])
    gravity_gradient = Rotation(0.0, np.eye(3), rate, ENVISAT, orbit).at(time).attitude
    free = Rotation(0.0, np.eye(3), rate, ENVISAT).at(time).attitude
    for R_I_B, expected in ((gravity_gradient, orbit), (free, None)):
        bodies, observations = bodies_of(R_I_B, [np.arange(200)])
        found = fit_tumbles(bodies, observations, NOISE**2, time, (None, orbit))[0]
        assert found.rotation.orbit == expected
        assert greatest_error(found, R_I_B, time) < 0.008


def test_too_few_frames_are_refused():
    time = np.arange(3.0)
    R_I_B = attitude(ENVISAT, np.deg2rad([1.2, 2.2, 2.4]), time)
    bodies, observations = bodies_of(R_I_B, [np.arange(3)])
    with pytest.raises(ComputationError, match="features are not followed for long enough"):
        fit_tumbles(bodies, observations, NOISE**2, time, (None,))

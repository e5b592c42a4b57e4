"""The inertia from a small nutation, of bodies whose motion is integrated here."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.ml.initial_tumble import fit_tumbles
from baryscope.estimator.ml.nutation import near_spins
from baryscope.estimator.registration.body import Body

NOISE = 1e-3  # rad, of the attitudes
SPEED = 0.0054  # rad/s
POINTS = np.array([[1.0, 0.0, 0.0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])

# principal moments, the axis of the spin, tilt in degrees, a 10th of it along the second axis; rotations, frames
SPINS = {
    "long body, major axis": ([0.0605, 0.4631, 0.4764], 2, 0.5, 10.3, 101),
    "long body, minor axis": ([0.10, 0.42, 0.48], 0, 1.0, 12.0, 150),
    "flat body": ([0.22, 0.29, 0.49], 2, 1.0, 6.0, 150),
    "many turns": ([0.15, 0.40, 0.45], 2, 0.5, 80.0, 900),
}


def spinning(moments, axis, tilt, rotations, frames, seed=3):
    """Times, true attitudes and inertia in axes turned at random, attitudes with noise."""
    J, others = np.array(moments), [k for k in range(3) if k != axis]
    start = np.zeros(3)
    start[axis], start[others[0]], start[others[1]] = 1.0, np.deg2rad(tilt), np.deg2rad(tilt) / 10
    time = np.linspace(0.0, rotations * 2 * np.pi / SPEED, frames)

    def slope(_, state):
        x, y, z, w = state[:4]
        a, b, c = rate = state[4:]
        turned = 0.5 * np.array(
            [w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a, -(x * a + y * b + z * c)]
        )
        return np.concatenate([turned, -np.cross(rate, J * rate) / J])

    state = np.concatenate([[0.0, 0, 0, 1], SPEED * start])
    found = solve_ivp(slope, (0.0, time[-1]), state, "DOP853", time, rtol=1e-11, atol=1e-12)
    axes = Rotation.random(random_state=seed).as_matrix()  # from principal ones
    true = Rotation.from_quat(found.y[:4].T).as_matrix() @ axes.T
    noise = Rotation.from_rotvec(NOISE * np.random.default_rng(seed).normal(size=(frames, 3))).as_matrix()
    return time, true, axes @ np.diag(J) @ axes.T / J.sum(), true @ noise, axes @ found.y[4:]


@pytest.mark.parametrize("name", SPINS)
def test_the_moments_of_a_body_that_hardly_nutates(name):
    """Rates of short windows have a noise of a third of the nutation's: their inertia is a sphere's, give or take."""
    time, true, inertia, seen, _ = spinning(*SPINS[name])
    frames, m = len(time), len(POINTS)
    body = Body(np.arange(m), np.arange(frames), POINTS, seen)
    observations = Observations(np.zeros((frames, m, 3)), np.ones((frames, m)))
    # Each axis of attitude has the information of four points at one metre from it.
    found = fit_tumbles((body,), observations, 4 * NOISE**2, time, (None,))[0]
    np.testing.assert_allclose(np.linalg.eigvalsh(found.rotation.inertia), np.linalg.eigvalsh(inertia), atol=0.04)
    predicted = found.rotation.at(time).attitude @ found.bodies[0]
    error = Rotation.from_matrix(np.swapaxes(predicted, 1, 2) @ true).magnitude()
    assert error.max() < 4 * np.sqrt(11 / frames) * 1.7 * NOISE
    assert found.cost < 3.3 * frames


@pytest.mark.parametrize("name", SPINS)
def test_without_noise_one_of_both_senses_is_right(name):
    """But for the second order of the tilt, and the step of the frequencies."""
    time, true, inertia, _, rate = spinning(*SPINS[name])
    both = near_spins(time, true, rate[:, 0])
    apart = [np.abs(one.inertia - inertia).max() for one in both]
    best = both[int(np.argmin(apart))]
    assert min(apart) < 0.05
    np.testing.assert_allclose(best.rate, rate.T, atol=0.01 * SPEED)
    # The momentum comes as near to the axis of the spin as its ellipse is wide.
    momentum = inertia @ rate
    axes = np.linalg.eigh(inertia)[1]
    spun = axes[:, SPINS[name][1]]  # its moments ascend
    sine = np.linalg.norm(np.cross(momentum.T, spun), axis=1) / np.linalg.norm(momentum, axis=0)
    assert best.width == pytest.approx(sine.min(), abs=0.05 * sine.max())


def test_what_is_no_spin_or_too_short_has_none():
    time = np.linspace(0.0, 3000.0, 100)
    still = np.tile(np.eye(3), (100, 1, 1))
    tumbling = Rotation.from_rotvec(np.outer(time, [0.003, 0.0, 0.0])) * Rotation.from_rotvec(
        np.outer(time, [0.0, 0.004, 0.0])
    )
    assert near_spins(time, still, np.array([1e-6, 0.0, 0.0])) == ()
    assert near_spins(time, tumbling.as_matrix(), np.array([0.0, 0.004, 0.003])) == ()
    assert near_spins(time[:5], still[:5], np.array([0.01, 0.0, 0.0])) == ()

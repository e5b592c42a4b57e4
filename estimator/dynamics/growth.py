"""The covariance that white acceleration adds to a state (displacement, velocity) after the last observation.

Path and rotation alike: s = (δ, δ̇) obeys ṡ = A(t) s + (0, w), with w white noise of a density q per axis. For A = 0 but
for δ̇ the covariance after T seconds is q [T³/3, T²/2; T²/2, T].
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.dynamics.linear_motion import highest_frequency
from baryscope.estimator.dynamics.paths import Path
from baryscope.estimator.dynamics.rotation import Rotation
from baryscope.estimator.geometry.so3 import cross_matrices

FloatArray = NDArray[np.float64]

PHASE = 0.05  # of A's frequency times a step, at most: errors of (0.05)²/12 of the covariance
MOST_STEPS = 200_000
POINTS, WEIGHTS = (np.polynomial.legendre.leggauss(3)[0] + 1) / 2, np.polynomial.legendre.leggauss(3)[1] / 2


def path_growth(path: Path, density: float, end: float, time: FloatArray) -> FloatArray:
    """The covariance (n, 6, 6) of position and velocity in C by acceleration noise of a density in m²/s³ after `end`.

    time (n,) in s; before `end` it is zero. The gravity gradient acts on what the noise has caused.
    """
    frequency = highest_frequency(path.gravity_gradient, end, max(end, float(time.max())))

    def rates(at: FloatArray) -> FloatArray:
        found = np.zeros((len(at), 6, 6))
        found[:, :3, 3:] = np.eye(3)
        gradient = path.gravity_gradient(at)
        if gradient is not None:
            found[:, 3:, :3] = gradient
        return found

    return _grown(rates, frequency, density, end, time)


def rotation_growth(rotation: Rotation, density: float, end: float, time: FloatArray) -> FloatArray:
    """The covariance (n, 6, 6) of attitude (a rotation vector) and rate, both in B, by torque noise after `end`.

    density: of the angular acceleration, rad²/s³; time (n,) in s. φ̇ = δω − ω × φ, and Euler's equation for δω.
    """
    rate = rotation.at(np.array([end])).rate[0]
    moments = np.linalg.eigvalsh(rotation.inertia)
    frequency = float(np.linalg.norm(rate)) * float(moments[-1] / moments[0])

    def rates(at: FloatArray) -> FloatArray:
        omega, J = rotation.at(at).rate, rotation.inertia
        found = np.zeros((len(at), 6, 6))
        found[:, :3, :3], found[:, :3, 3:] = -cross_matrices(omega), np.eye(3)
        found[:, 3:, 3:] = np.linalg.solve(J, cross_matrices(omega @ J) - cross_matrices(omega) @ J)
        return found

    return _grown(rates, frequency, density, end, time)


def _grown(
    rates: Callable[[FloatArray], FloatArray], frequency: float, density: float, end: float, time: FloatArray
) -> FloatArray:
    """The covariance (n, 6, 6) for rates A (k, 6, 6) at times (k,); frequency: an upper bound of A's, 1/s."""
    found = np.zeros((len(time), 6, 6))
    ahead = np.flatnonzero(time > end)
    if density <= 0 or not len(ahead):
        return found
    span = float(time[ahead].max()) - end
    steps = int(np.clip(np.ceil(frequency * span / PHASE), 1, MOST_STEPS))
    h = span / steps
    starts = np.asarray(end + h * np.arange(steps), dtype=np.float64)
    whole, noise = _step(rates(starts + h / 2), np.full(steps, h))
    at_start = np.zeros((steps, 6, 6))
    for k in range(steps - 1):
        at_start[k + 1] = whole[k] @ at_start[k] @ whole[k].T + noise[k]
    step = np.minimum(((time[ahead] - end) / h).astype(np.intp), steps - 1)
    rest = time[ahead] - starts[step]
    own, own_noise = _step(rates(starts[step] + rest / 2), rest)
    found[ahead] = density * (own @ at_start[step] @ np.swapaxes(own, 1, 2) + own_noise)
    return found


def _step(rates: FloatArray, step: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Transitions (k, 6, 6) over steps (k,) in s, and covariances (k, 6, 6) after them by noise of a density of 1.

    The latter are integrals of the responses to δ̇, by Gauss and Legendre's points.
    """
    noise = np.zeros_like(rates)
    for point, weight in zip(POINTS, WEIGHTS, strict=True):
        response = _transition(rates, (1 - point) * step)[:, :, 3:]
        noise += (weight * step)[:, None, None] * (response @ np.swapaxes(response, 1, 2))
    return _transition(rates, step), noise


def _transition(rates: FloatArray, step: FloatArray) -> FloatArray:
    """exp(A h) (k, 6, 6) for small A h."""
    scaled = rates * step[:, None, None]
    term = found = np.tile(np.eye(6), (len(step), 1, 1))
    for order in range(1, 6):
        term = term @ scaled / order
        found = found + term
    return found

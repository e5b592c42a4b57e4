"""The covariance that white acceleration adds to a state (displacement, velocity) before and after the observations.

Path and rotation alike: s = (δ, δ̇) obeys ṡ = A(t) s + (0, w), with w white noise of a density q per axis. Away from the
observations, by T seconds in either direction, noise that they do not tell adds q ∫ Φ(t, s) B Bᵀ Φ(t, s)ᵀ |ds|, B that
part of Φ which the noise drives. For A = 0 but for δ̇ that is q [T³/3, ±T²/2; ±T²/2, T], with − before the first one.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.dynamics.rotation import Attitudes, Rotation
from baryscope.estimator.paths.linear_motion import highest_frequency
from baryscope.estimator.paths.path import Path
from baryscope.models.errors import ComputationError, Reason

FloatArray = NDArray[np.float64]
# Times (k,) and steps (k,) from there in s, of either sign → transitions (k, 6, 6) over the steps
Transition = Callable[[FloatArray, FloatArray], FloatArray]

PHASE = 0.05  # of the path's frequency times a step, at most: errors of (0.05)²/12 of the covariance
MOST_STEPS = 1_000_000  # of one integration
AT_ONCE = 10_000  # steps: some tens of megabytes
MOST_TURNED = 3.0  # rad², of an attitude's three variances together: of one about which nothing is known it is no more
POINTS, WEIGHTS = (np.polynomial.legendre.leggauss(2)[0] + 1) / 2, np.polynomial.legendre.leggauss(2)[1] / 2


def path_growth(path: Path, density: float, begin: float, end: float, time: FloatArray) -> FloatArray:
    """The covariance (n, 6, 6) of position and velocity in C by acceleration noise of a density in m²/s³.

    Of the noise before `begin` and after `end`; time (n,) in s; between them it is zero. The gravity gradient acts on
    what the noise has caused.

    Raises:
        ComputationError: the times are too far away.
    """
    first, last = min(begin, float(time.min())), max(end, float(time.max()))
    frequency = highest_frequency(path.gravity_gradient, first, last)

    def transition(start: FloatArray, step: FloatArray) -> FloatArray:
        rates = np.zeros((len(start), 6, 6))
        rates[:, :3, 3:] = np.eye(3)
        gradient = path.gravity_gradient(start + step / 2)
        if gradient is not None:
            rates[:, 3:, :3] = gradient
        return _exponential(rates * step[:, None, None])

    longest = PHASE / frequency if frequency > 0 else np.inf
    return _grown(transition, longest, density, begin, end, time)


def rotation_growth(
    rotation: Rotation, motion: Attitudes, density: float, begin: float, end: float, time: FloatArray
) -> FloatArray:
    """The covariance (n, 6, 6) of attitude (a rotation vector) and rate, both in B, by torque noise.

    motion: of the rotation, over a span that holds the other times; density: of the angular acceleration, rad²/s³;
    begin, end, time: as for `path_growth`. About the axis of middle inertia it grows exponentially; what is more than
    MOST_TURNED is taken for that, and the rate's errors for as many times less.

    Raises:
        ComputationError: the times are too far away.
    """

    def transition(start: FloatArray, step: FloatArray) -> FloatArray:
        return rotation.transition(motion.at(start), motion.at(start + step))

    return _grown(transition, rotation.longest_step, density, begin, end, time, MOST_TURNED)


def _grown(
    transition: Transition,
    longest: float,
    density: float,
    begin: float,
    end: float,
    time: FloatArray,
    most: float = np.inf,
) -> FloatArray:
    """The covariance (n, 6, 6) at times (n,), by steps of at most `longest` s; most: of δ, see `_within`."""
    found = np.zeros((len(time), 6, 6))
    for origin, outside in ((begin, time < begin), (end, time > end)):
        if density > 0 and outside.any():
            found[outside] = density * _from(transition, longest, origin, time[outside], most / density)
    return found


def _from(transition: Transition, longest: float, origin: float, time: FloatArray, most: float) -> FloatArray:
    """The covariance (n, 6, 6) by noise of a density of 1 from the origin to times (n,), all on the same side of it."""
    span = float(time[np.argmax(np.abs(time - origin))]) - origin
    if abs(span) > MOST_STEPS * longest:
        raise ComputationError(
            f"times: found {abs(span):.3g} s away from the tracks, expected {MOST_STEPS * longest:.3g} s at most",
            Reason.TOO_LONG,
        )
    steps = max(int(np.ceil(abs(span) / longest)), 1)
    h = span / steps
    starts = np.asarray(origin + h * np.arange(steps), dtype=np.float64)
    whole, noise = _steps(transition, starts, np.full(steps, h))
    at_start = np.zeros((steps, 6, 6))
    for k in range(steps - 1):
        at_start[k + 1] = _within(most, whole[k] @ at_start[k] @ whole[k].T + noise[k])
    step = np.clip(((time - origin) / h).astype(np.intp), 0, steps - 1)
    own, own_noise = _steps(transition, starts[step], time - starts[step])
    return _within(most, own @ at_start[step] @ np.swapaxes(own, 1, 2) + own_noise)


def _within(most: float, covariance: FloatArray) -> FloatArray:
    """Covariances (..., 6, 6), in proportion, where the variances of δ would be more than so much together."""
    size = np.trace(covariance[..., :3, :3], axis1=-2, axis2=-1)
    return np.asarray(covariance * (np.minimum(size, most) / np.where(size > 0, size, 1.0))[..., None, None])


def _steps(transition: Transition, start: FloatArray, step: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Transitions (k, 6, 6) over steps (k,) in s, and covariances (k, 6, 6) after them by noise of a density of 1."""
    cuts = range(AT_ONCE, len(start), AT_ONCE)
    parts = zip(np.split(start, cuts), np.split(step, cuts), strict=True)
    found = [_few_steps(transition, *part) for part in parts]
    return np.concatenate([whole for whole, _ in found]), np.concatenate([noise for _, noise in found])


def _few_steps(transition: Transition, start: FloatArray, step: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Transitions and growth over some steps: integrals of the responses to δ̇, by Gauss and Legendre's points."""
    begun = np.array([0.0, *POINTS])[:, None]
    starts, steps = start + begun * step, (1 - begun) * step
    whole, *later = transition(starts.ravel(), steps.ravel()).reshape(len(begun), -1, 6, 6)
    noise = np.zeros_like(whole)
    for weight, response in zip(WEIGHTS, later, strict=True):
        driven = response[:, :, 3:]
        noise += (weight * np.abs(step))[:, None, None] * (driven @ np.swapaxes(driven, 1, 2))
    return whole, noise


def _exponential(small: FloatArray) -> FloatArray:
    """exp (k, 6, 6) of small matrices."""
    term = found = np.tile(np.eye(6), (len(small), 1, 1))
    for order in range(1, 6):
        term = term @ small / order
        found = found + term
    return found

"""The motion of chasers near a target about a point mass or an oblate Earth, by DOP853 in Encke's form."""

import numpy as np
from scipy.integrate import solve_ivp

from baryscope.study.population.fourth.orbits import EQUATORIAL_RADIUS, J2, MU
from baryscope.study.population.interface import FloatArray

TOLERANCE = 1e-12
ABSOLUTE = np.repeat([1e-6, 1e-9], 3), np.repeat([1e-11, 1e-14], 3)  # m and m/s, of the target and of the chasers
STEPS = np.repeat([1.0, 1e-3], 3)  # m and m/s, of the differences that make the Jacobian


def flown(
    target: FloatArray, chasers: FloatArray, begin: float, time: FloatArray, oblate: bool
) -> tuple[FloatArray, FloatArray]:
    """States in I, m and m/s, of the target (n, 6), and of chasers less the target (n, k, 6), at times (n,), s.

    target (6,) and chasers (k, 6), less the target, at the time `begin`, from which `time` goes on, or back, in order.
    """
    first = np.concatenate([target, chasers.ravel()])
    if time[-1] == begin:
        still = np.tile(first.reshape(-1, 6), (len(time), 1, 1))
        return still[:, 0], still[:, 1:]
    tolerance = np.concatenate([ABSOLUTE[0], np.tile(ABSOLUTE[1], len(chasers))])

    def slope(_: float, flat: FloatArray) -> FloatArray:
        states = flat.reshape(-1, 6)
        r, d = states[0, :3], states[1:, :3]
        pull = -MU / (r @ r) ** 1.5 * r
        change = _difference(r, d)
        if oblate:
            bulge = _bulge(r)
            pull, change = pull + bulge, change + _bulge(r + d) - bulge
        return np.concatenate([states[:, 3:], np.concatenate([pull[None], change])], axis=1).ravel()

    span = (begin, float(time[-1]))
    found = solve_ivp(slope, span, first, "DOP853", time, rtol=TOLERANCE, atol=tolerance)
    if not found.success:
        raise RuntimeError(found.message)
    states = found.y.T.reshape(len(time), -1, 6)
    return states[:, 0], states[:, 1:]


def carried(target: FloatArray, span: float, oblate: bool) -> FloatArray:
    """The target's state (6,) in I after a span of time, s, or before it if that is negative."""
    return np.asarray(flown(target, np.zeros((0, 6)), 0.0, np.array([span]), oblate)[0][0])


def path_jacobian(target: FloatArray, chaser: FloatArray, begin: float, time: FloatArray, oblate: bool) -> FloatArray:
    """(n, 3, 6) of the centre of mass in C by the chaser's state (6,) at `begin`, by central differences."""
    ways = np.concatenate([chaser + np.diag(STEPS), chaser - np.diag(STEPS)])
    _, found = flown(target, ways, begin, time, oblate)
    change = found[:, 6:, :3] - found[:, :6, :3]  # the path is the target less the chaser
    return np.asarray(np.swapaxes(change, 1, 2) / (2 * STEPS))


def _difference(r: FloatArray, d: FloatArray) -> FloatArray:
    """A point mass's attraction at r + d less that at r, (k, 3), without loss of digits; r (3,), d (k, 3), m."""
    q = ((d @ (2 * r)) + (d * d).sum(axis=1)) / (r @ r)
    shrink = np.expm1(-1.5 * np.log1p(q))[:, None]
    return np.asarray(-MU / (r @ r) ** 1.5 * (d + shrink * (r + d)))


def _bulge(r: FloatArray) -> FloatArray:
    """What the Earth's oblateness adds to the acceleration (..., 3) at places (..., 3) in I, m/s²."""
    squared = (r * r).sum(axis=-1, keepdims=True)
    lift = 5 * r[..., 2:] ** 2 / squared
    return np.asarray(-1.5 * J2 * MU * EQUATORIAL_RADIUS**2 / squared**2.5 * r * (np.array([1, 1, 3]) - lift))

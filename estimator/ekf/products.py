"""Products of errors in `ekf`: of the attitude with the offset of the centre of mass, see `adjustment.spurious`.

Where the centre of mass is off by δ in B, an attitude error φ moves all points of a frame by φ × δ. That is of second
order, and the linearised system does not know it. The errors φ that the parameters make are a few modes over time, so
that each pair of a mode and an axis of δ moves the observations in a known pattern, by a random number of variance 1.
"""

from dataclasses import replace

import numpy as np

from baryscope.estimator.dynamics.rotation import RATE_AND_INERTIA
from baryscope.estimator.ekf.filter import ProcessNoise, filtered
from baryscope.estimator.ekf.linearised import TURN, Linearised
from baryscope.estimator.ekf.solution import Solution
from baryscope.estimator.tracks import FloatArray

MODES = RATE_AND_INERTIA  # of the attitude's errors, at most
DISTINCT = 1e-10  # of the greatest variance of the scaled parameters: less is rounding
NEGLIGIBLE = 0.1  # rms shift of the frames by products of errors, over the least deviation of the position


def product_gradient(system: Linearised, noise: ProcessNoise, solution: Solution, offset: FloatArray) -> FloatArray:
    """The gradient (q, k) of half the cost by the parameters, in the weights' units, for k patterns of variance 1.

    There are no patterns where they are negligible.

    Args:
        system: the linearised one.
        noise: the process noise of one member.
        solution: in SI units.
        offset: covariance (3, 3) in B of the offset, m².
    """
    shift, c = _shifts(system, solution, offset), system.rhs.shape[2]
    least = float(np.linalg.eigvalsh(solution.of_state[:, :3, :3])[:, 0].min())
    if float((shift[system.seen] ** 2).sum(axis=(1, 2)).mean()) <= NEGLIGIBLE**2 * least:
        return np.zeros((c - 1, 0))
    return np.asarray(filtered(_moved(system, shift), noise, keep=False).cost[0, 1:c, c:])


def _shifts(system: Linearised, solution: Solution, offset: FloatArray) -> FloatArray:
    """The patterns (n, 3, k) in B, m, by which pairs of errors of one standard deviation move the frames."""
    values, axes = np.linalg.eigh((offset + offset.T) / 2)
    deviations = axes * np.sqrt(np.maximum(values, 0.0))
    turns = _turns(system, solution)
    pairs = np.cross(turns[:, :, :, None], deviations[None, :, None, :], axis=1)
    return np.asarray(pairs.reshape(len(turns), 3, -1))


def _turns(system: Linearised, solution: Solution) -> FloatArray:
    """The strongest patterns (n, 3, k) of the attitude's errors that the parameters make, rad in B, less their means.

    Each is that of a combination of the parameters of variance 1; the combinations are independent.
    """
    scale = np.sqrt(np.maximum(np.diag(solution.of_theta), np.finfo(float).tiny))
    values, axes = np.linalg.eigh(solution.of_theta / np.outer(scale, scale))
    kept = values > DISTINCT * values[-1]
    turns = solution.crossed[:, TURN] @ (axes[:, kept] / np.sqrt(values[kept]) / scale[:, None])
    turns = turns - turns[system.seen].mean(axis=0)
    seen = turns[system.seen].reshape(-1, turns.shape[2])
    strongest = np.linalg.eigh(seen.T @ seen)[1][:, ::-1][:, :MODES]
    return np.asarray(turns @ strongest)


def _moved(system: Linearised, shift: FloatArray) -> Linearised:
    """The system with a further column for each of k shifts (n, 3, k) of all points of a frame in B, m."""
    d, c = system.first.shape
    more = shift.shape[2]
    static = np.zeros((c + more, c + more))
    static[:c, :c] = system.static
    points = slice(1 + system.points.start, None)
    static[c:, points.start : c] = np.einsum("naz,nap->zp", shift, system.rhs[:, :3, points])
    static[:c, c:] = static[c:, :c].T
    return replace(
        system,
        first=np.concatenate([system.first, np.zeros((d, more))], axis=1),
        rhs=np.concatenate([system.rhs, system.information[:, :, :3] @ shift], axis=2),
        static=static,
    )

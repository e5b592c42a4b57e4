"""What products of errors do to the estimate of `ekf`, see `adjustment.products`."""

from dataclasses import replace

import numpy as np

from baryscope.estimator.adjustment.products import independent, product_shifts
from baryscope.estimator.ekf.filter import ProcessNoise, filtered
from baryscope.estimator.ekf.linearised import TURN, Linearised
from baryscope.estimator.ekf.solution import Solution
from baryscope.estimator.tracks import FloatArray


def product_gradient(system: Linearised, noise: ProcessNoise, solution: Solution, offset: FloatArray) -> FloatArray:
    """The gradient (q, k) of half the cost by the parameters, in the weights' units, for k patterns of variance 1.

    There are no patterns where they are negligible.

    Args:
        system: the linearised one.
        noise: the process noise of one member.
        solution: in SI units.
        offset: covariance (3, 3) in B of the offset, m².
    """
    c = system.rhs.shape[2]
    turns = system.turns_seen(solution.crossed[:, TURN], solution.of_theta) @ independent(solution.of_theta)[1]
    shift = product_shifts(turns, offset, solution.of_state[:, :3, :3], system.seen)
    if not shift.shape[2]:
        return np.zeros((c - 1, 0))
    return np.asarray(filtered(_moved(system, shift), noise).cost[0, 1:c, c:])


def _moved(system: Linearised, shift: FloatArray) -> Linearised:
    """The system with a further column for each of k shifts (n, 3, k) of all points of a frame in B, m."""
    d, c = system.first.shape
    more = shift.shape[2]
    static = np.zeros((c + more, c + more))
    static[:c, :c] = system.static
    static[c:, 1:c] = np.einsum("naz,nap->zp", shift, system.rhs[:, :3, 1:])
    static[:c, c:] = static[c:, :c].T
    return replace(
        system,
        first=np.concatenate([system.first, np.zeros((d, more))], axis=1),
        rhs=np.concatenate([system.rhs, system.information[:, :, :3] @ shift], axis=2),
        static=static,
    )

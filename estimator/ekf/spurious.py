"""What `ekf` does not know: spurious information on the centre of mass, see `adjustment.spurious`, products of errors,
and untold durations of burns.
"""

import numpy as np

from baryscope.estimator.adjustment.spurious import SpuriousInformation, farthest, spurious_information_columns
from baryscope.estimator.dynamics.rotation import RATE_AND_INERTIA
from baryscope.estimator.ekf.linearised import INERTIA, Linearised
from baryscope.estimator.ekf.passes import Passes
from baryscope.estimator.ekf.solution import Solution
from baryscope.estimator.geometry.gauge import offset_by_points
from baryscope.estimator.geometry.so3 import turned_information
from baryscope.estimator.paths.burns import untold_durations
from baryscope.estimator.tracks import FloatArray, IntArray


def attached_offset(found: Passes, features: IntArray) -> tuple[FloatArray, FloatArray, float]:
    """The offset (3,) of some features' centroid in B, m; its Jacobian (3, 3 m) by all points, in axes attached to
    these features; and the information, 1/m², of what is not observed of it.
    """
    points = found.reference.points
    attached = offset_by_points(points, features)
    return points[features].mean(axis=0), attached, 1 / farthest(points[features]) ** 2


def spurious_growth(
    solution: Solution, system: Linearised, variance: float, attached: FloatArray, least: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """What the covariances grow by when the spurious information on the centre of mass is removed.

    An error φ of the attitude moves the centroid, at d from the centre of mass, by φ × d. Of φ only the deviation from
    its mean over time counts, as the mean turns the axes. The parameters make it of a few random numbers only, so that
    what it adds may be far above its mean.

    Args:
        solution: in SI units.
        system: which it solves.
        variance: of an observation of weight 1.
        attached: (3, 3 m), Jacobian of d by the points, in axes attached to them.
        least: information, 1/m², that remains in a direction.

    Returns:
        columns A (3, k) of d, B (n, d, k) of the states and C (q, k) of θ: their covariances grow by A Aᵀ, B Bᵀ, C Cᵀ.
    """
    n, d = solution.state.shape
    points = system.points
    offset = attached @ solution.of_theta[points, points] @ attached.T
    crossed = (solution.crossed[:, :, points] @ attached.T).reshape(n * d, 3)
    crossed = np.concatenate([crossed, solution.of_theta[:, points] @ attached.T]).T
    position = system.information[:, :3, :3] / variance
    by_few, by_noise = (turned_information(position, spread) for spread in solution.spread)
    spurious = SpuriousInformation.of(by_few, RATE_AND_INERTIA)
    spurious += SpuriousInformation.of(by_noise, int(system.seen.sum()))
    of_offset, of_others = spurious_information_columns(offset, crossed, spurious, least)
    return of_offset, of_others[: n * d].reshape(n, d, -1), of_others[n * d :]


def growth(
    found: Passes, solution: Solution, system: Linearised, features: IntArray, products: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """What the covariances grow by: by spurious information on some features' offset, by products of errors, and by
    untold durations of burns.

    products (q, k): see `products.product_gradient`. Returns columns as `spurious_growth`.
    """
    _, attached, least = attached_offset(found, features)
    of_offset, of_states, of_theta = spurious_growth(solution, system, found.last.variance, attached, least)
    own = slice(INERTIA, INERTIA + found.problem.path.size)
    durations = untold_durations(found.problem.path, solution.of_theta[own, own])
    pull = np.concatenate([-products / found.last.variance, np.zeros((len(products), durations.shape[1]))], axis=1)
    pull[own, products.shape[1] :] = durations
    of_offset = np.concatenate([of_offset, attached @ (solution.of_theta[system.points] @ pull)], axis=1)
    of_states = np.concatenate([of_states, solution.crossed @ pull], axis=2)
    return of_offset, of_states, np.concatenate([of_theta, solution.of_theta @ pull], axis=1)

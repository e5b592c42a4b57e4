"""The problem in the unknowns of the path alone, with its prior: its scale, a step, and what a solution costs."""

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.hyperparameters.evidence import GaussianLikelihood, complexity, held, solved
from baryscope.estimator.paths.prior import Prior
from baryscope.estimator.pivot.free_attitudes import Linearised, Solution, squares_of_used
from baryscope.estimator.registration.noise import GATE

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]


def scaled(problem: Linearised, variance: float) -> GaussianLikelihood:
    """The reduced problem in the unknowns of the path, for a variance of an observation of weight 1."""
    return GaussianLikelihood(problem.matrix / variance, problem.rhs / variance, problem.x)


def stepped(problem: Linearised, prior: Prior, theta: FloatArray, variance: float) -> Solution:
    """A step with given hyperparameters (h,)."""
    return problem.step(variance * held(scaled(problem, variance), prior, theta)[0])


def of_first(linear: GaussianLikelihood, prior: Prior, theta: FloatArray, count: int) -> GaussianLikelihood:
    """The problem in the first unknowns alone; the others (p - count,) have their prior for hyperparameters (h,)."""
    if count == len(linear.x):
        return linear
    precision = held(linear, prior, theta)[0][count:]
    across = linear.information[count:, :count]
    pull = linear.rhs[count:] - precision * linear.x[count:]
    left = solved(linear.information[count:, count:] + np.diag(precision), np.column_stack([across, pull]))
    own = linear.information[:count, :count] - across.T @ left[:, :-1]
    return GaussianLikelihood(own, linear.rhs[:count] - across.T @ left[:, -1], linear.x[:count])


def fixed_at(linear: GaussianLikelihood, fixed: IntArray, values: FloatArray) -> tuple[GaussianLikelihood, float]:
    """The problem in the others (p - k,) where some unknowns have values (k,), and what −2 ln p is greater by.

    fixed (k,): their indices.
    """
    kept = np.setdiff1d(np.arange(len(linear.x)), fixed)
    change = values - linear.x[fixed]
    rhs = linear.rhs[kept] - linear.information[np.ix_(kept, fixed)] @ change
    more = float(change @ linear.information[np.ix_(fixed, fixed)] @ change) - 2 * float(linear.rhs[fixed] @ change)
    return GaussianLikelihood(linear.information[np.ix_(kept, kept)], rhs, linear.x[kept]), more


def bounded_cost(
    problem: Linearised,
    weight: FloatArray,
    variance: float,
    prior: Prior,
    theta: FloatArray | None = None,
    gate: float = GATE,
) -> float:
    """−2 ln of the marginal likelihood of a solution, up to a constant, with outliers of a bounded cost.

    An observation that is not used costs as much as any outlier, and shifts of frames by noise what they are and what
    they could be. weight (n, m): robust; variance: of an observation of
    weight 1; theta (h,): hyperparameters from which those of the greatest likelihood are sought; gate: the cost of an
    outlier.
    """
    gained = np.minimum(squares_of_used(problem, weight) / variance - gate, 0.0)
    shifted = problem.noise_cost / variance + problem.noise_volume
    return float(gained.sum()) + shifted + complexity(scaled(problem, variance), prior, theta)

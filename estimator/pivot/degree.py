"""The degree of a polynomial path, chosen from the observations by an information criterion.

A polynomial of a lower degree is one of a higher degree whose last coefficients are zero. So one Gauss–Newton step at a
high degree gives the sum of squares at every lower degree without a fit of its own, with free attitudes in all of them.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.dynamics.paths import Polynomial, SampledPath
from baryscope.estimator.geometry.symmetric import symmetric_pseudo_inverse
from baryscope.estimator.pivot.drift import squares_by_size
from baryscope.estimator.pivot.free_attitudes import Solution, gauss_newton_step
from baryscope.estimator.pivot.refinement import (
    ROUNDING,
    SUBSAMPLE_FRAMES,
    in_subsample,
    least_variance,
    linear_solution,
    subsampled,
    values_for_path,
)
from baryscope.estimator.registration.body import Body
from baryscope.estimator.registration.clusters import Registered

FloatArray = NDArray[np.float64]

Criterion = Callable[[float, FloatArray, FloatArray], FloatArray]

HIGHEST_CHOSEN = 14  # highest degree that the data may choose
LOOKAHEAD = 3  # higher degrees without an improvement after which the search ends
IMPLAUSIBLE = 10.0  # sum of squares over that of the highest degree, attitudes fixed, above which a degree is too low


def akaike_unbiased(values: float, squares: FloatArray, unknowns: FloatArray) -> FloatArray:
    """AICu, lower is better: n ln(s²) + 2 n (k + 1)/(n − k − 2) with the unbiased variance s² = squares/(n − k).

    Source: McQuarrie, Shumway and Tsai, Statistics & Probability Letters 34, 1997. AICc has squares/n for s². The
    penalty of an unknown is about 3 here, 2 in AIC and AICc, ln n in BIC.

    values: n, the number of fitted values; squares (d,): the models' sums of squared residuals, in any unit;
    unknowns (d,): k, the number of unknowns of each model. Infinite where k + 2 >= n.
    """
    left = values - unknowns
    variance = np.where(left > 2, squares, 1.0) / np.where(left > 2, left, 1.0)
    penalty = 2 * values * (unknowns + 1) / np.where(left > 2, left - 2, 1.0)
    return np.where(left > 2, values * np.log(variance) + penalty, np.inf)


def choose_degree(
    registered: Registered,
    observations: Observations,
    time: FloatArray,
    span: tuple[float, float],
    criterion: Criterion = akaike_unbiased,
) -> int:
    """The degree at the first minimum of the criterion that none of the next LOOKAHEAD degrees improves.

    Each Gauss–Newton step starts from the degree chosen last, with a few more coefficients, until a degree is chosen
    again. The first degree is a low one: if the body turns little, steps from a high degree would stay there.

    registered: bodies and their origins in C; observations (n, m) with their initial weights; time (n,) in s; span:
    begin and end of the path, s.
    """
    subsample = subsampled(registered.bodies, observations, SUBSAMPLE_FRAMES)
    few_bodies, few, seen = in_subsample(registered, subsample), subsample.observations, time[subsample.rows]
    # At higher degrees path and offsets fit any positions.
    highest = max(0, min(HIGHEST_CHOSEN, len(seen) - len(few_bodies.bodies) - 2))
    degree = _lowest_plausible(few_bodies, Polynomial(highest, *span).at(seen))
    bodies, x = linear_solution(few_bodies, few, Polynomial(degree, *span).at(seen))
    values = values_for_path(bodies, few)
    least = values * least_variance(few, ROUNDING)
    tried: set[int] = set()
    while True:
        sampled = Polynomial(min(highest, degree + LOOKAHEAD + 1), *span).at(seen)
        solution = gauss_newton_step(bodies, few, sampled, np.pad(x, (0, sampled.jacobian.shape[2] - len(x))))
        squares = np.maximum(squares_by_degree(solution), least)
        unknowns = np.linspace(3.0, 3.0 * len(squares), len(squares))
        degree = _first_minimum(criterion(values, squares, unknowns))
        if degree in tried:
            return degree
        tried.add(degree)
        bodies, x = at_degree(solution, degree)


def squares_by_degree(solution: Solution) -> FloatArray:
    """The sums of squares (d + 1,) that the linearised problem predicts at degrees 0 … d.

    The solution is a step in the coefficients (3 (d + 1),) of degree d. At each lower degree the higher coefficients
    are fixed to zero, and all other unknowns are at their conditional optimum.
    """
    least = float(solution.squares.sum()) - solution.step
    return np.array([least + _constraint(solution, degree)[0] for degree in range(len(solution.x) // 3)])


def at_degree(solution: Solution, degree: int) -> tuple[tuple[Body, ...], FloatArray]:
    """Bodies and coefficients (3 (degree + 1),) after the step with the coefficients above `degree` fixed to zero."""
    change = _constraint(solution, degree)[1]
    bodies = tuple(
        body.moved(by_path @ change) for body, by_path in zip(solution.bodies, solution.points_path, strict=True)
    )
    return bodies, (solution.x - change)[: 3 * (degree + 1)]


def _constraint(solution: Solution, degree: int) -> tuple[float, FloatArray]:
    """The constraint that the coefficients above a degree are zero.

    Returns the increase of the sum of squares, and the vector to subtract from all coefficients.
    """
    higher = slice(3 * (degree + 1), None)
    multiplier = symmetric_pseudo_inverse(solution.covariance[higher, higher]) @ solution.x[higher]
    return float(solution.x[higher] @ multiplier), solution.covariance[:, higher] @ multiplier


def _lowest_plausible(registered: Registered, sampled: SampledPath) -> int:
    """The lowest degree whose linear fit to the bodies' origins is at most IMPLAUSIBLE times that of the highest."""
    squares = squares_by_size(registered, sampled, range(3, sampled.jacobian.shape[2] + 1, 3))
    return int(np.argmax(squares <= IMPLAUSIBLE * squares[-1]))


def _first_minimum(criterion: FloatArray) -> int:
    """The first index whose value none of the next LOOKAHEAD values is below."""
    best = 0
    for index in range(1, len(criterion)):
        if index > best + LOOKAHEAD:
            break
        if criterion[index] < criterion[best]:
            best = index
    return best

"""The degree of a polynomial path, which the observations choose by an information criterion.

A polynomial of a lower degree is one of a higher degree whose last coefficients are zero. So one Gauss–Newton step at a
high degree tells the sum of squares at every lower one, without a fit of its own, and holds the attitudes free in all.
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
    FEW_FRAMES,
    ROUNDING,
    in_few,
    least_variance,
    linear_solution,
    thinned,
    values_for_path,
)
from baryscope.estimator.registration.body import Body
from baryscope.estimator.registration.clusters import Registered

FloatArray = NDArray[np.float64]

Criterion = Callable[[float, FloatArray, FloatArray], FloatArray]

HIGHEST_CHOSEN = 14  # degree of a polynomial that the data may ask for
PATIENCE = 3  # degrees that may fail to be better before the search ends
GROSS = 10.0  # sum of squares over that of the highest degree, held attitudes, above which a degree is too low


def akaike_unbiased(values: float, squares: FloatArray, unknowns: FloatArray) -> FloatArray:
    """AICu, lower is better: n ln(s²) + 2 n (k + 1)/(n − k − 2) with the unbiased variance s² = squares/(n − k).

    Of McQuarrie, Shumway and Tsai, Statistics & Probability Letters 34, 1997. AICc takes squares/n for s²; so an
    unknown costs about 3 here, 2 in AIC and AICc, ln n in BIC.

    values: n, the number of values that are fitted; squares (d,): the models' sums of squared residuals, in any unit;
    unknowns (d,): k, how many each of them fits. Infinite where k + 2 >= n.
    """
    left = values - unknowns
    variance = squares / np.where(left > 2, left, 1.0)
    penalty = 2 * values * (unknowns + 1) / np.where(left > 2, left - 2, 1.0)
    return np.where(left > 2, values * np.log(variance) + penalty, np.inf)


def choose_degree(
    registered: Registered,
    observations: Observations,
    time: FloatArray,
    span: tuple[float, float],
    criterion: Criterion = akaike_unbiased,
) -> int:
    """The degree at the first minimum of the criterion that PATIENCE higher degrees do not beat.

    Each step is taken at the degree of the last choice, with a few more coefficients, until a choice comes again. The
    first degree is a low one: where the body turns little, the steps from a high degree would stay at high degrees.

    registered: bodies and the images of their origins; observations (n, m) with their first weights; time (n,) in s;
    span: when the path begins and ends, s.
    """
    thin = thinned(registered.bodies, observations, FEW_FRAMES)
    some, few, seen = in_few(registered, thin), thin.observations, time[thin.rows]
    # Beyond, path and offsets fit any positions.
    highest = max(0, min(HIGHEST_CHOSEN, len(seen) - len(some.bodies) - 2))
    degree = _lowest_plausible(some, Polynomial(highest, *span).at(seen))
    bodies, x = linear_solution(some, few, Polynomial(degree, *span).at(seen))
    values = values_for_path(bodies, few)
    least = values * least_variance(few, ROUNDING)
    tried: set[int] = set()
    while True:
        sampled = Polynomial(min(highest, degree + PATIENCE + 1), *span).at(seen)
        solution = gauss_newton_step(bodies, few, sampled, np.pad(x, (0, sampled.jacobian.shape[2] - len(x))))
        squares = np.maximum(squares_by_degree(solution), least)
        unknowns = np.linspace(3.0, 3.0 * len(squares), len(squares))
        degree = _first_minimum(criterion(values, squares, unknowns))
        if degree in tried:
            return degree
        tried.add(degree)
        bodies, x = at_degree(solution, degree)


def squares_by_degree(solution: Solution) -> FloatArray:
    """The sums of squares that a step in a polynomial's coefficients (3 (d + 1),) promises at degrees 0 … d, (d + 1,).

    At each degree the coefficients beyond are held at zero, and all else is at its best for that.
    """
    least = float(solution.squares.sum()) - solution.step
    return np.array([least + _hold(solution, degree)[0] for degree in range(len(solution.x) // 3)])


def at_degree(solution: Solution, degree: int) -> tuple[tuple[Body, ...], FloatArray]:
    """Bodies and coefficients (3 (degree + 1),) of the step to the best polynomial of a lower degree."""
    change = _hold(solution, degree)[1]
    bodies = tuple(
        body.moved(by_path @ change) for body, by_path in zip(solution.bodies, solution.points_path, strict=True)
    )
    return bodies, (solution.x - change)[: 3 * (degree + 1)]


def _hold(solution: Solution, degree: int) -> tuple[float, FloatArray]:
    """What holding the coefficients beyond a degree at zero adds to the squares, and takes off all coefficients."""
    beyond = slice(3 * (degree + 1), None)
    force = symmetric_pseudo_inverse(solution.covariance[beyond, beyond]) @ solution.x[beyond]
    return float(solution.x[beyond] @ force), solution.covariance[:, beyond] @ force


def _lowest_plausible(registered: Registered, sampled: SampledPath) -> int:
    """The lowest degree whose fit to the images of the bodies' origins is not much worse than that of the highest."""
    squares = squares_by_size(registered, sampled, range(3, sampled.jacobian.shape[2] + 1, 3))
    return int(np.argmax(squares <= GROSS * squares[-1]))


def _first_minimum(criterion: FloatArray) -> int:
    """The first index that the next PATIENCE ones are not below."""
    best = 0
    for index in range(1, len(criterion)):
        if index > best + PATIENCE:
            break
        if criterion[index] < criterion[best]:
            best = index
    return best

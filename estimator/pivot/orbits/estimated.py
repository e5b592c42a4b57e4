"""An orbit that is not given, where the path tells it."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from baryscope.estimator.hyperparameters.evidence import maximise
from baryscope.estimator.options import PathOptions
from baryscope.estimator.orbits.elements import NAMES
from baryscope.estimator.orbits.estimated import estimated_orbit_in, on_estimated_orbit
from baryscope.estimator.orbits.search import OrbitFit, likeliest_orbit
from baryscope.estimator.paths.extended_path import based_on
from baryscope.estimator.paths.interpolated_path import interpolated
from baryscope.estimator.paths.path import Path, SmoothPath
from baryscope.estimator.paths.seen_path import as_seen
from baryscope.estimator.paths.trajectory import smooth_in
from baryscope.estimator.pivot.free_attitudes import linearised
from baryscope.estimator.pivot.initial_solution import InitialSolution
from baryscope.estimator.pivot.joint_covariance import SPURIOUS
from baryscope.estimator.pivot.orbits.smooth_rotation import by_smooth_rotation
from baryscope.estimator.pivot.pivot_solution import DECISIVE, PivotSolution
from baryscope.estimator.pivot.reduced import of_first, scaled
from baryscope.estimator.pivot.refinement import refined
from baryscope.estimator.pivot.unexplained import gain_over
from baryscope.estimator.registration.noise import GATE
from baryscope.models.errors import ComputationError, InputError

FloatArray = NDArray[np.float64]

CUBIC = 12.0  # unknowns of a path, of which an orbit has as many
MOST_LINEARISED = 4  # times that the path is linearised about an orbit
NEAR = 0.5  # deviations from the elements about which it is linear
BY_CHANCE = 5.0  # deviations of the noise of a sum of squares, from one place to that where it is least


def with_estimated_orbit(
    found: PivotSolution, start: InitialSolution, options: PathOptions
) -> tuple[PivotSolution, InitialSolution]:
    """The solution on an orbit that a smooth path itself tells, if it is likelier there, and its start."""
    for fit in _orbits_of(found, options):
        try:
            other, fresh = _refined_on(fit, found, start, options)
        except (ComputationError, InputError):  # the latter of an orbit that is none
            continue
        if other.converged and _is_likelier(found, other, start, fit):
            return other, fresh
    return found, start


def _is_likelier(found: PivotSolution, other: PivotSolution, start: InitialSolution, fit: OrbitFit) -> bool:
    """Whether a solution on an orbit is likelier than one on a smooth path, which need not have converged."""
    if found.converged and gain_over(found, other, start) - fit.prior_cost >= DECISIVE:
        return True
    return _squares_by_chance(found, other) and _gain_there(found, other, start) >= DECISIVE


def _orbits_of(found: PivotSolution, options: PathOptions) -> Iterator[OrbitFit]:
    """The orbits that a smooth path may lie on; what is asked for as a polynomial stays one.

    Near the smooth path it is known how likely the orbit is, but where most of what the tracks tell there is spurious:
    then the path follows noise of the attitudes, as none on an orbit could, and the orbit is sought without that, too.
    """
    smooth = smooth_in(found.path)
    if smooth is None or options.trajectory is not None or options.acceleration is not None:
        return
    if found.slip > 0 or found.path_unknowns <= CUBIC:
        return
    theta = found.posterior.theta
    linear = of_first(scaled(found.problem, found.variance), found.path.prior, theta, smooth.size)
    fit, spurious = likeliest_orbit(linear, smooth, theta[: len(smooth.prior.hyperparameters)]), False
    if fit is None or fit.gain < DECISIVE:
        spurious = found.shown_spurious_share >= SPURIOUS
        told = by_smooth_rotation(found, smooth) if spurious else None
        other = None if told is None else likeliest_orbit(told, smooth, maximise(told, smooth.prior), gaussian=False)
        if other is not None and other.gain >= DECISIVE:
            yield other
    if fit is not None and (fit.gain >= DECISIVE or spurious):
        yield fit


def _refined_on(
    fit: OrbitFit, found: PivotSolution, start: InitialSolution, options: PathOptions
) -> tuple[PivotSolution, InitialSolution]:
    """The solution with the orbit's elements among the unknowns, about which the path is linearised until they are
    near, and its start.

    Raises:
        ComputationError: it diverges.
        InputError: it leads to an orbit that is none.
    """
    smooth = smooth_in(found.path)
    assert smooth is not None  # noqa: S101  on which the orbit was found
    others = found.solution.x[smooth.size :]
    at = replace(found, solution=found.solution.moved_to(np.concatenate([fit.coefficients, others])))
    elements, of_motion = fit.elements, fit.x
    for _ in range(MOST_LINEARISED):
        base = on_estimated_orbit(elements, of_motion, smooth.begin, smooth.end)
        path, x = based_on(found.path, base), np.concatenate([of_motion, np.zeros(len(NAMES)), others])
        fresh = replace(start.on(path, interpolated(path.at, path.frequency, start.time), x), slips=False)
        at = refined(fresh.near(at), options)
        departures = base.factors(at.solution.x, at.variance * at.solution.covariance)
        if all(abs(one.value) <= NEAR * one.deviation for one in departures):
            break
        elements = base.moved(at.solution.x)
        of_motion, _, others = np.split(at.solution.x[: path.size], [len(fit.x), base.size])
    return at, fresh


def _gain_there(found: PivotSolution, other: PivotSolution, start: InitialSolution) -> float:
    """2 ln of the Bayes factor of an orbit over a smooth path with bodies as they are on the orbit; −inf of none.

    With other offsets attitudes have other errors, which may make a smooth path there likelier by chance. But that a
    path of many coefficients lies on an orbit with wrong offsets would be a greater one.
    """
    smooth, orbital = smooth_in(found.path), estimated_orbit_in(other.path)
    assert smooth is not None and orbital is not None  # noqa: S101, PT018  as both were asked for
    path = based_on(other.path, smooth, orbital)
    x = np.concatenate([_coefficients(smooth, orbital, other.solution.x), other.solution.x[orbital.size :]])
    sampled = as_seen(path, interpolated(path.at, path.frequency, start.time), start.errors, x)
    problem = linearised(other.bodies, other.observations, sampled, x, other.shifts, other.offset_information)
    linear = scaled(problem, other.variance)
    theta = maximise(linear, path.prior)
    own = of_first(linear, path.prior, theta, smooth.size)
    fit = likeliest_orbit(own, smooth, theta[: len(smooth.prior.hyperparameters)])
    return -np.inf if fit is None else fit.gain


def _coefficients(smooth: SmoothPath, orbital: Path, x: FloatArray) -> FloatArray:
    """The coefficients (p,) of a smooth path through the places of another, which begins with unknowns of x (q,)."""
    at = chebyshev.chebpts1(smooth.degree + 1)
    time = (smooth.begin + smooth.end) / 2 + (smooth.end - smooth.begin) / 2 * at
    places = orbital.at(time).position(x[: orbital.size])
    return np.asarray(np.linalg.solve(chebyshev.chebvander(at, smooth.degree), places).ravel())


def _squares_by_chance(found: PivotSolution, other: PivotSolution) -> bool:
    """Whether noise alone may make the sum of squares of one solution so much less than that of another (Vuong 1989).

    Both are of the frames' own noise: what one frame has less of in one of them says nothing of the next one.
    """
    used = (found.observations.weight > 0) & (other.observations.weight > 0)
    variance = min(found.frame_variance, other.frame_variance)
    less = np.where(used, _bounded(other, variance) - _bounded(found, variance), 0.0).sum(axis=1)
    deviation = float(np.sqrt(found.lasting * len(less) * less.var()))
    return float(less.sum()) <= BY_CHANCE * deviation


def _bounded(found: PivotSolution, variance: float) -> FloatArray:
    """The squared residuals (n, m) of observations, over their variance, with outliers of a bounded cost."""
    weight = found.observations.weight
    squares = np.divide(found.untied_problem.squares, weight, out=np.zeros_like(weight), where=weight > 0)
    return np.minimum(squares / variance, GATE)

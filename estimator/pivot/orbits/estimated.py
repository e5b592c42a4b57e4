"""An orbit that is not given, where the path tells it."""

from dataclasses import replace

import numpy as np

from baryscope.estimator.dynamics.extended_path import based_on
from baryscope.estimator.dynamics.interpolated_path import interpolated
from baryscope.estimator.dynamics.trajectory import smooth_in
from baryscope.estimator.options import PathOptions
from baryscope.estimator.orbits.elements import NAMES
from baryscope.estimator.orbits.estimated import on_estimated_orbit
from baryscope.estimator.orbits.search import OrbitFit, likeliest_orbit
from baryscope.estimator.pivot.initial_solution import InitialSolution
from baryscope.estimator.pivot.joint_covariance import SPURIOUS
from baryscope.estimator.pivot.pivot_solution import DECISIVE, PivotSolution
from baryscope.estimator.pivot.reduced import of_first, scaled
from baryscope.estimator.pivot.refinement import refined
from baryscope.estimator.pivot.unexplained import gain_over
from baryscope.models.errors import ComputationError, InputError

CUBIC = 12.0  # unknowns of a path, of which an orbit has as many
MOST_LINEARISED = 4  # times that the path is linearised about an orbit
NEAR = 0.5  # deviations from the elements about which it is linear


def with_estimated_orbit(
    found: PivotSolution, start: InitialSolution, options: PathOptions
) -> tuple[PivotSolution, InitialSolution]:
    """The solution on an orbit that a smooth path itself tells, if it is likelier there, and its start."""
    fit = _orbit_of(found, options)
    if fit is None:
        return found, start
    try:
        other, fresh = _refined_on(fit, found, start, options)
    except (ComputationError, InputError):  # the latter of an orbit that is none
        return found, start
    gain = gain_over(found, other, start) - fit.prior_cost
    return (other, fresh) if other.converged and gain >= DECISIVE else (found, start)


def _orbit_of(found: PivotSolution, options: PathOptions) -> OrbitFit | None:
    """The orbit that a smooth path may lie on; what is asked for as a polynomial stays one.

    Near the smooth path it is known how likely the orbit is, but where most of what the tracks tell there is spurious:
    then the path follows noise of the attitudes, as none on an orbit could.
    """
    smooth = smooth_in(found.path)
    if smooth is None or options.trajectory is not None or options.acceleration is not None:
        return None
    if not found.converged or found.slip > 0 or found.path_unknowns <= CUBIC:
        return None
    theta = found.posterior.theta
    linear = of_first(scaled(found.problem, found.variance), found.path.prior, theta, smooth.size)
    fit = likeliest_orbit(linear, smooth, theta[: len(smooth.prior.hyperparameters)])
    if fit is None or (fit.gain < DECISIVE and found.shown_spurious_share < SPURIOUS):
        return None
    return fit


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

"""What explains a path better: no process noise, a corrected orbit, or one that no one gave; and whether it may follow
the rotation.

The significance of a hyperparameter is twice the logarithm of the likelihood ratio against no effect. Without an effect
it is 0 in half of all cases, and χ² with one degree of freedom in the others (Self and Liang 1987).
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.dynamics.extended import based_on, factors_of
from baryscope.estimator.dynamics.interpolated_path import interpolated
from baryscope.estimator.dynamics.process_noise import DENSITY, Disturbed
from baryscope.estimator.dynamics.trajectory import smooth_in
from baryscope.estimator.findings import FollowsRotation, WrongOrbit
from baryscope.estimator.observability import UNOBSERVABLE, Observability
from baryscope.estimator.options import PathOptions
from baryscope.estimator.orbits.elements import NAMES
from baryscope.estimator.orbits.error import NAMES as SHIFTS
from baryscope.estimator.orbits.error import ORBIT_ERROR, with_orbit_error
from baryscope.estimator.orbits.estimated import on_estimated_orbit
from baryscope.estimator.orbits.search import OrbitFit, likeliest_orbit
from baryscope.estimator.pivot.found import SIGNIFICANT, Pivot
from baryscope.estimator.pivot.free_attitudes import Linearised, linearised
from baryscope.estimator.pivot.joint_covariance import SPURIOUS
from baryscope.estimator.pivot.reduced import bounded_cost, of_first, scaled
from baryscope.estimator.pivot.refinement import Start, refined
from baryscope.models.errors import ComputationError, InputError
from baryscope.models.orbit import Orbit

FloatArray = NDArray[np.float64]
Position = Callable[[FloatArray], FloatArray]  # times (k,) in s → the path (k, 3) in C, m

FEIGNED = 0.4  # share of the information on an offset that is spurious, where a path may follow the rotation
FAINT = 1e-30  # m²/s³: a density without effect
HARMLESS = 0.5  # claim over the features' radius: the offset is off by some two radii, four deviations, at most
CURVED = 12.0  # unknowns of a smooth path that the tracks determine: more than those of a cubic may follow it
MOST_LINEARISED = 4  # times that the path is linearised about an orbit
NEAR = 0.5  # deviations from the elements about which it is linear


def with_needed_noise(found: Pivot, start: Start, options: PathOptions) -> Pivot:
    """The solution, or that which is reached from one without process noise, if it is likelier by more than chance.

    Where hardly more than noise tells the offsets, steps that may use process noise can end with wrong offsets that
    need it. Without it they come near the right ones.
    """
    path = start.path
    if not isinstance(path, Disturbed) or path.density is not None or smooth_in(path) is not None:
        return found
    if not (found.converged and found.has(DENSITY)) or found.shown_spurious_share < SPURIOUS:
        return found
    try:
        quiet = refined(replace(start, path=replace(path, density=FAINT), first_prior=None), options)
        near = replace(start, bodies=quiet.bodies, x=quiet.solution.x, observations=quiet.observations, weight=None)
        other = refined(replace(near, first_prior=path.prior.holding({DENSITY: np.log(FAINT)})), options)
    except ComputationError:
        return found
    variance = min(found.variance, other.variance)
    return other if _cost(other, start, variance) < _cost(found, start, variance) - SIGNIFICANT else found


def _cost(found: Pivot, start: Start, variance: float) -> float:
    """−2 ln of the marginal likelihood, up to a constant, of the observations of a start, with outliers of a bounded
    cost.
    """
    weight = np.where(start.observations.weight > 0, found.observations.weight, 0.0)
    return bounded_cost(_problem(found), weight, variance, found.path.prior, found.posterior.theta)


def with_corrected_orbit(found: Pivot, orbit: Orbit | None, start: Start, options: PathOptions) -> Pivot:
    """The solution with an error of the orbit among the unknowns, if that explains what else would be process noise."""
    path = found.path
    if orbit is None or path.name != "relative-orbit" or not isinstance(path, Disturbed):
        return found
    if not found.has(DENSITY):
        return found
    x, span = found.solution.x, (path.begin, path.end)
    wider = replace(path, base=with_orbit_error(path.base, orbit, lambda time: path.at(time).position(x), *span))
    more = wider.base.size - path.base.size
    again = replace(
        start,
        path=wider,
        sampled=interpolated(wider.at, wider.frequency, start.time),
        bodies=found.bodies,
        x=np.insert(x, path.base.size, np.zeros(more)),
        observations=found.observations,
        inliers=found.inliers,
        first_prior=None,
    )
    try:
        corrected = refined(again, options)
    except ComputationError:
        return found
    return corrected if corrected.converged and corrected.has(ORBIT_ERROR) else found


def with_estimated_orbit(found: Pivot, start: Start, options: PathOptions) -> tuple[Pivot, Start]:
    """The solution on an orbit that a smooth path itself tells, if it is likelier there, and its start."""
    fit = _orbit_of(found, options)
    if fit is None:
        return found, start
    try:
        other, again = _refined_on(fit, found, start, options)
    except (ComputationError, InputError):  # the latter of an orbit that is none
        return found, start
    return (other, again) if other.converged else (found, start)


def _orbit_of(found: Pivot, options: PathOptions) -> OrbitFit | None:
    """The orbit that a smooth path lies on, if that is likely; what is asked for as a polynomial stays one."""
    smooth = smooth_in(found.path)
    if smooth is None or options.trajectory is not None or options.acceleration is not None:
        return None
    if not found.converged or found.slip > 0 or found.path_unknowns <= CURVED:
        return None
    theta = found.posterior.theta
    linear = of_first(scaled(_problem(found), found.variance), found.path.prior, theta, smooth.size)
    fit = likeliest_orbit(linear, smooth, theta[: len(smooth.prior.hyperparameters)])
    return fit if fit is not None and fit.gain >= SIGNIFICANT else None


def _refined_on(fit: OrbitFit, found: Pivot, start: Start, options: PathOptions) -> tuple[Pivot, Start]:
    """The solution with the orbit's elements among the unknowns, about which the path is linearised until they are
    near, and its start.

    Raises:
        ComputationError: it diverges.
        InputError: it leads to an orbit that is none.
    """
    smooth = smooth_in(found.path)
    assert smooth is not None  # noqa: S101  on which the orbit was found
    others = found.solution.x[smooth.size :]
    moved = found.solution.moved_to(np.concatenate([fit.coefficients, others]))
    again = replace(start, observations=found.observations, inliers=found.inliers, first_prior=None, slips=False)
    elements, of_motion, bodies = fit.elements, fit.x, moved.bodies
    position: Position = lambda time: smooth.at(time).position(fit.coefficients)  # noqa: E731
    for _ in range(MOST_LINEARISED):
        base = on_estimated_orbit(elements, position, smooth.begin, smooth.end)
        path, x = based_on(found.path, base), np.concatenate([of_motion, np.zeros(len(NAMES)), others])
        sampled = interpolated(path.at, path.frequency, start.time)
        again = replace(again, path=path, sampled=sampled, bodies=bodies, x=x)
        other = refined(again, options)
        departures = base.factors(other.solution.x, other.variance * other.solution.covariance)
        if all(abs(one.value) <= NEAR * one.deviation for one in departures):
            break
        elements, bodies, position = base.moved(other.solution.x), other.bodies, _position_of(other)
        of_motion, _, others = np.split(other.solution.x[: path.size], [len(fit.x), base.size])
        again = replace(again, observations=other.observations)
    return other, again


def _position_of(found: Pivot) -> Position:
    return lambda time: found.path.at(time).position(found.solution.x)


def _problem(found: Pivot) -> Linearised:
    return linearised(found.bodies, found.observations, found.sampled, found.solution.x, found.shift, found.offsets)


def following_rotation(found: Pivot, observability: Observability) -> tuple[FollowsRotation, ...]:
    """The finding of a path that may follow the rotation, with an offset that is wrong by as much.

    Where hardly more than noise tells the offset, attitudes that outliers have spoilt, or that turn little, can make
    such a path likelier than the true one; then neither is to be trusted. That is so of significant process noise,
    along directions in which the claim does not hold any place in the body, and of a smooth path that is much curved,
    unless the claim is that the offset is not told anyway.
    """
    axes, radius = observability.body, observability.threshold / UNOBSERVABLE
    if smooth_in(found.path) is None:
        told = found.has(DENSITY) & (axes.deviations <= HARMLESS * radius)
    else:
        told = np.full(3, found.path_unknowns > CURVED and observability.observable.all())
    if not told.any():
        return ()
    share = found.shown_spurious_share_of(observability.cluster, axes.directions[told])
    if share <= FEIGNED:
        return ()
    return (FollowsRotation(share, found.path_unknowns),)


def wrong_orbit(found: Pivot, orbit: Orbit | None) -> tuple[WrongOrbit, ...]:
    """The finding of a wrong orbit, if the path has an error of it and that is significant."""
    if orbit is None or not found.has(ORBIT_ERROR):
        return ()
    factors = factors_of(found.path, found.solution.x, found.posterior.covariance)
    radial, along, across = [factor for factor in factors if factor.name in SHIFTS][:3]
    return (
        WrongOrbit(
            (radial.value, along.value, across.value),
            (radial.deviation, along.deviation, across.deviation),
            orbit.j2 is not None,
        ),
    )

"""What a path leaves unexplained: whether it needs its process noise, or that is a wrong orbit, or one without the
Earth's J2, or the path may follow the rotation.

The significance of a hyperparameter is twice the logarithm of the likelihood ratio against no effect. Without an effect
it is 0 in half of all cases, and χ² with one degree of freedom in the others (Self and Liang 1987).
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.evidence import cost, maximise
from baryscope.estimator.dynamics.extended import factors_of
from baryscope.estimator.dynamics.interpolated_path import interpolated
from baryscope.estimator.dynamics.orbit_error import NAMES, ORBIT_ERROR, with_orbit_error
from baryscope.estimator.dynamics.paths import Path
from baryscope.estimator.dynamics.process_noise import DENSITY, Disturbed
from baryscope.estimator.dynamics.relative_motion import orbit_in
from baryscope.estimator.dynamics.sampled_path import SampledPath
from baryscope.estimator.dynamics.seen import as_seen
from baryscope.estimator.dynamics.trajectory import chosen_path, smooth_in
from baryscope.estimator.findings import FollowsRotation, UntoldOblateness, WrongOrbit
from baryscope.estimator.geometry.symmetric import symmetric_pseudo_inverse
from baryscope.estimator.observability import UNOBSERVABLE, Observability
from baryscope.estimator.options import PathOptions
from baryscope.estimator.pivot.found import SIGNIFICANT, Pivot
from baryscope.estimator.pivot.free_attitudes import linearised
from baryscope.estimator.pivot.joint_covariance import SPURIOUS
from baryscope.estimator.pivot.reduced import bounded_cost, scaled
from baryscope.estimator.pivot.refinement import Start, refined
from baryscope.models.errors import ComputationError
from baryscope.models.orbit import Orbit

FloatArray = NDArray[np.float64]

FEIGNED = 0.4  # share of the information on an offset that is spurious, where a path may follow the rotation
FAINT = 1e-30  # m²/s³: a density without effect
HARMLESS = 0.5  # claim over the features' radius: the offset is off by some two radii, four deviations, at most
DECISIVE = 2 * float(np.log(10.0))  # of −2 ln p: strong evidence (Jeffreys 1961, Theory of Probability, app. B)
CURVED = 12.0  # unknowns of a smooth path that the tracks determine: more than those of a cubic may follow it


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
    problem = linearised(found.bodies, found.observations, found.sampled, found.solution.x, found.shift, found.offsets)
    return bounded_cost(problem, weight, variance, found.path.prior, found.posterior.theta)


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


def with_oblateness(
    found: Pivot, start: Start, orbit: Orbit | None, options: PathOptions
) -> tuple[Pivot, Start, Orbit | None]:
    """The solution, its start and the orbit, with the Earth's J2 where the tracks show that the orbit told lacks it.

    J2 is a force of a known size. So the tracks tell it from none where they hardly tell process noise, of whose
    densities that of J2 is but one, and which it is not: it acts along the whole path, and goes on beyond.
    """
    path, oblate = found.path, None if orbit is None else orbit.with_earths_j2()
    if oblate is None or path.name != "relative-orbit" or not isinstance(path, Disturbed) or path.density is not None:
        return found, start, orbit
    wider = chosen_path(options, oblate, path.begin, path.end, start.errors)
    assert isinstance(wider, Disturbed)  # noqa: S101  as that with the other orbit is
    wider = wider.with_modes(path.count)
    sampled = interpolated(wider.at, wider.frequency, start.time)
    x = _nearest(found.sampled.itself, found.solution.x, sampled, wider.prior.free)
    seen = as_seen(wider, sampled, start.errors, x)
    if not _is_likelier(found, seen, x):
        return found, start, orbit
    fresh = replace(start, path=wider, sampled=sampled, x=x, first_prior=None)
    near = replace(fresh, bodies=found.bodies, observations=found.observations, inliers=found.inliers, weight=None)
    try:
        other = refined(near, options)
    except ComputationError:
        return found, start, orbit
    variance = min(found.variance, other.variance)
    if not other.converged or _cost(other, start, variance) > _cost(found, start, variance):
        return found, start, orbit
    return other, fresh, oblate


def _nearest(path: SampledPath, x: FloatArray, other: SampledPath, free: NDArray[np.bool_]) -> FloatArray:
    """The unknowns x (p,) of another path, of which only those without a prior differ, that bring it near a path."""
    apart = path.position(x) - other.position(x)
    moment = other.moment(slice(0, other.frames), apart[:, :, None])[:, 0] / other.frames
    moved = x.copy()
    moved[free] += symmetric_pseudo_inverse(other.mean_square()[free][:, free]) @ moment[free]
    return moved


def _is_likelier(found: Pivot, sampled: SampledPath, x: FloatArray) -> bool:
    """Whether the tracks decide for another path, sampled at the unknowns x (p,), near that of a solution."""
    apart = sampled.position(x) - found.sampled.position(found.solution.x)
    told = float((found.observations.weight * found.observations.squares(apart[:, None])).sum()) / found.variance
    if told < DECISIVE:  # more than this they do not know of the difference
        return False
    return _least_cost(found, sampled, x) < _least_cost(found, found.sampled, found.solution.x) - DECISIVE


def _least_cost(found: Pivot, sampled: SampledPath, x: FloatArray) -> float:
    """−2 ln of the marginal likelihood, up to a constant, of what is likeliest near a path, to first order.

    The weights are those of the solution.
    """
    problem = linearised(found.bodies, found.observations, sampled, x, found.shift, found.offsets)
    linear, prior = scaled(problem, found.variance), found.path.prior
    squares = float(problem.squares.sum()) + problem.noise_cost + problem.offset_cost - problem.decrease_by_points
    return squares / found.variance + cost(linear, prior, maximise(linear, prior))


def untold_oblateness(told: Orbit | None, path: Path) -> tuple[UntoldOblateness, ...]:
    """The finding of an orbit whose J2 is not told, but on the path."""
    orbit = orbit_in(path)
    if told is None or told.j2 is not None or orbit is None or orbit.j2 is None:
        return ()
    return (UntoldOblateness(orbit.j2),)


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
    radial, along, across = [factor for factor in factors if factor.name in NAMES][:3]
    return (
        WrongOrbit(
            (radial.value, along.value, across.value),
            (radial.deviation, along.deviation, across.deviation),
            orbit.j2 is not None,
        ),
    )

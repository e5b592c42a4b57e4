"""The Earth's J2 on an orbit that is given without, where the tracks show it."""

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.evidence import Linear, cost, maximise
from baryscope.estimator.adjustment.subsample import SUBSAMPLE_FRAMES, subsampled
from baryscope.estimator.dynamics.interpolated_path import interpolated
from baryscope.estimator.dynamics.paths import Path
from baryscope.estimator.dynamics.prior import Prior
from baryscope.estimator.dynamics.process_noise import Disturbed
from baryscope.estimator.dynamics.relative_motion import orbit_in
from baryscope.estimator.dynamics.sampled_path import SampledPath
from baryscope.estimator.dynamics.seen import as_seen
from baryscope.estimator.dynamics.trajectory import chosen_path
from baryscope.estimator.findings import UntoldOblateness
from baryscope.estimator.geometry.symmetric import symmetric_pseudo_inverse
from baryscope.estimator.options import PathOptions
from baryscope.estimator.pivot.found import DECISIVE, Pivot
from baryscope.estimator.pivot.free_attitudes import linearised
from baryscope.estimator.pivot.reduced import fixed_at, scaled
from baryscope.estimator.pivot.refinement import Start, refined
from baryscope.estimator.pivot.unexplained import cost_of
from baryscope.models.errors import ComputationError
from baryscope.models.orbit import Orbit

FloatArray = NDArray[np.float64]


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
    fresh = start.on(wider, sampled, x)
    try:
        other = refined(fresh.near(found), options)
    except ComputationError:
        return found, start, orbit
    variance = min(found.variance, other.variance)
    if not other.converged or cost_of(other, start, variance) > cost_of(found, start, variance):
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
    """Whether the tracks decide for another path, sampled at the unknowns x (p,), near that of a solution.

    To first order, with the solution's weights: the shift from the one to the other, all of it or none, is an unknown.
    Of many frames some are looked at, each with the weight of those it stands for.
    """
    shift = sampled.position(x) - found.sampled.position(found.solution.x)
    told = float((found.observations.weight * found.observations.squares(shift[:, None])).sum()) / found.variance
    if told < DECISIVE:  # more than this they do not know of the difference
        return False
    few = subsampled(found.bodies, found.observations, SUBSAMPLE_FRAMES)
    observations, count = few.standing_for_all()
    between = found.sampled.frames_at(few.rows).extended(shift[few.rows, :, None])
    of_frames = None if found.shift is None else found.shift[few.rows] / count[:, None, None]
    at = np.append(found.solution.x, 0.0)
    problem = linearised(few.bodies, observations, between, at, of_frames, found.offsets)
    linear, prior = scaled(problem, found.variance), found.path.prior
    return _cost(linear, prior, 1.0) < _cost(linear, prior, 0.0) - DECISIVE


def _cost(linear: Linear, prior: Prior, share: float) -> float:
    """−2 ln p where the last unknown has a value, at its minimum by the hyperparameters."""
    others, more = fixed_at(linear, np.array([len(linear.x) - 1]), np.array([share]))
    return cost(others, prior, maximise(others, prior)) + more


def untold_oblateness(told: Orbit | None, path: Path) -> tuple[UntoldOblateness, ...]:
    """The finding of an orbit whose J2 is not told, but on the path."""
    orbit = orbit_in(path)
    if told is None or told.j2 is not None or orbit is None or orbit.j2 is None:
        return ()
    return (UntoldOblateness(orbit.j2),)

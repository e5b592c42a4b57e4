"""A push that nobody tells, as by drag, light or a leak, where the tracks show one.

Process noise may stand for it within the tracks, at a cost, but hardly where it leads far, and not ahead of them.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.hyperparameters.evidence import (
    GaussianLikelihood,
    conditional,
    cost,
    maximise,
    ranges,
    solved,
)
from baryscope.estimator.options import PathOptions
from baryscope.estimator.orbits.estimated import acting_orbit
from baryscope.estimator.orbits.push import PUSH, UnknownPushPath, may_be_pushed, unknown_push_in, with_any_push
from baryscope.estimator.paths.path import Path
from baryscope.estimator.paths.prior import Prior
from baryscope.estimator.paths.process_noise import DENSITY, ProcessNoisePath
from baryscope.estimator.pivot.initial_solution import InitialSolution
from baryscope.estimator.pivot.orbits.corrected import corrected_for_orbit, refined_on, start_on
from baryscope.estimator.pivot.orbits.estimated import linearised_anew
from baryscope.estimator.pivot.orbits.further_unknowns import FurtherUnknowns
from baryscope.estimator.pivot.pivot_solution import DECISIVE, SIGNIFICANT, PivotSolution
from baryscope.estimator.pivot.reduced import fixed_at
from baryscope.estimator.pivot.unexplained import gain_over
from baryscope.models.orbit import Orbit

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]


def with_push(
    found: PivotSolution, start: InitialSolution, orbit: Orbit | None, options: PathOptions
) -> tuple[PivotSolution, InitialSolution]:
    """The solution with a push among the unknowns, and its start, if the tracks show one.

    They do where they are likelier with it than with an error of the orbit, and than without by more than chance makes
    them in any of the axes that are looked at. Where they show process noise, and none is left beside a push, something
    acts anyway: then ten times as likely is enough.
    """
    path, acting, none = found.path, acting_orbit(orbit, found.path), (found, start)
    if acting is None or path.name != "relative-orbit" or not isinstance(path, ProcessNoisePath):
        return none
    if not may_be_pushed(path, options):
        return none
    pushes = with_any_push(path.base, acting, path.begin, path.end)
    noisy, price = found.has(DENSITY), 2 * float(np.log(len(pushes)))
    likeliest = _likeliest(found, path, pushes, price + (DECISIVE if noisy else SIGNIFICANT))
    pushed = None if likeliest is None else refined_on(likeliest, path, found, start, options)
    if likeliest is None or pushed is None:
        return none
    if gain_over(found, pushed, start) < price + (DECISIVE if noisy and not pushed.has(DENSITY) else SIGNIFICANT):
        return none
    corrected = corrected_for_orbit(found, orbit, start, options)
    if corrected is not None and gain_over(corrected, pushed, start) <= 0:
        return none
    fresh = start_on(likeliest, path, found, start)
    return linearised_anew(pushed, fresh, options) or (pushed, fresh)


def push_in(found: PivotSolution, base: Path) -> UnknownPushPath | None:
    """The push on a path with another base, of the size that a solution has found, if it has one."""
    part, index = unknown_push_in(found.path), found.path.prior.index(PUSH)
    return None if part is None or index is None else part.of_size(base, float(found.posterior.theta[index]))


def _likeliest(
    found: PivotSolution, path: ProcessNoisePath, pushes: Sequence[UnknownPushPath], least: float
) -> UnknownPushPath | None:
    """The likeliest of some pushes, to first order, with the solution's weights; None if none gains the least."""
    first = path.base.size
    sizes = [push.size - first for push in pushes]

    def columns(rows: IntArray) -> FloatArray:
        return np.concatenate([push.columns(found.time[rows]) for push in pushes], axis=2)

    further, prior = FurtherUnknowns.of(found, columns).linear, path.prior
    ends = len(found.solution.x) + np.cumsum(sizes)
    own = [np.arange(end - size, end) for end, size in zip(ends, sizes, strict=True)]
    alone, gains = _with_only(further, own, own[0][:0]), []
    for push, index in zip(pushes, own, strict=True):
        if _most(_with_only(further, own, index[: push.constants]), prior, push.constants) < least:
            gains.append(-np.inf)
            continue
        linear, wider = _with_only(further, own, index), prior.joined(push.own_prior)
        gains.append(-cost(linear, wider, maximise(linear, wider)))
    if np.isfinite(gains).any():
        gains = [gain + cost(alone, prior, maximise(alone, prior)) for gain in gains]
    best = int(np.argmax(gains))
    return pushes[best] if gains[best] >= least else None


def _with_only(further: GaussianLikelihood, every: Sequence[IntArray], own: IntArray) -> GaussianLikelihood:
    """The problem without the further unknowns of every index, but for some."""
    gone = np.setdiff1d(np.concatenate(every), own)
    return fixed_at(further, gone, np.zeros(len(gone)))[0]


def _most(linear: GaussianLikelihood, prior: Prior, count: int) -> float:
    """What −2 ln p is less by at most with the last unknowns: where nothing else explains what they do, nor a prior
    holds them.
    """
    free = prior.joined(Prior.none(count))
    mean, covariance = conditional(linear, free, ranges(linear, free)[:, 0])
    own = mean[-count:]
    return float(own @ solved(covariance[-count:, -count:], own[:, None])[:, 0])

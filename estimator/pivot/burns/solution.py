"""Unknown burns of the chaser as unknowns of the path: found by `search`, refined with free attitudes, and tested.

The only burn stays if the tracks are a thousand times likelier with it, at any time and of any duration, another one if
they are likelier, with the process noise of maximum likelihood in either case.
"""

from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.reweighting import rejects_many
from baryscope.estimator.findings import UnknownBurn
from baryscope.estimator.hyperparameters.evidence import GaussianLikelihood, cost, maximise
from baryscope.estimator.options import PathOptions
from baryscope.estimator.paths.burns import UNKNOWNS, BurnedPath, burned_in, burns_of
from baryscope.estimator.paths.path import Path
from baryscope.estimator.paths.prior import Prior
from baryscope.estimator.paths.process_noise import DENSITY, ProcessNoisePath
from baryscope.estimator.paths.trajectory import smooth_in
from baryscope.estimator.pivot.burns.equations import BurnEquations, BurnFit, burn_equations
from baryscope.estimator.pivot.burns.poses import Posed, RegisteredPoses
from baryscope.estimator.pivot.burns.search import likeliest, price, without
from baryscope.estimator.pivot.initial_solution import InitialSolution
from baryscope.estimator.pivot.joint_covariance import is_at_rest
from baryscope.estimator.pivot.pivot_solution import PivotSolution
from baryscope.estimator.pivot.reduced import fixed_at, scaled
from baryscope.estimator.pivot.refinement import refined
from baryscope.estimator.pivot.unexplained import gain_over
from baryscope.estimator.registration.clusters import Registered
from baryscope.models.errors import ComputationError
from baryscope.models.orbit import Orbit

FloatArray = NDArray[np.float64]

PATHS = ("relative-orbit", "polynomial")  # on which burns are looked for
LEFT_OUT, REJECTED = 0.01, 0.5  # share of frames that a path may leave out, and of their weight that is left then
FOLLOWS = 0.5  # share of the information on an offset that is spurious, where a smooth path may follow the rotation


def with_unknown_burns(
    found: PivotSolution, registered: Registered, orbit: Orbit | None, start: InitialSolution, options: PathOptions
) -> tuple[PivotSolution, InitialSolution]:
    """The solution with the burns among its unknowns that explain what else would be process noise, and its start.

    start: of the frames that are looked at, among which are those of `found`. Without such burns `found` itself.
    """
    if not may_have_burns(start.path, options):
        return found, start
    if not (found.has(DENSITY) or _left_out(found, start) > LEFT_OUT or _follows_rotation(found)):
        return found, start
    posed = RegisteredPoses.of(registered, start.observations, start.time, found.solution)
    return with_burns_by(posed, found, orbit, start, options) or (found, start)


def may_have_burns(path: Path, options: PathOptions) -> bool:
    """Whether burns are looked for on a path: it has process noise of an unknown density."""
    wanted = options.unknown_burns != "none" and path.name in PATHS
    return wanted and isinstance(path, ProcessNoisePath) and path.density is None


def with_burns_by(
    posed: Posed, found: PivotSolution, orbit: Orbit | None, start: InitialSolution, options: PathOptions
) -> tuple[PivotSolution, InitialSolution] | None:
    """The solution with the burns that poses show, and its start; None without any, or if it is no likelier.

    found: a solution without burns on the path of the start, which has process noise.
    """
    path = start.path
    assert isinstance(path, ProcessNoisePath)  # noqa: S101  see `may_have_burns`
    on_orbit = orbit if path.name == "relative-orbit" else None
    equations = burn_equations(posed, start.time, path.base, found.solution.x, on_orbit)
    if on_orbit is None and equations.width > equations.longest:
        return None
    try:
        return _with_likeliest(found, start, options, *likeliest(equations))
    except ComputationError:  # the search has led off
        return None


def _with_likeliest(
    found: PivotSolution, start: InitialSolution, options: PathOptions, equations: BurnEquations, fit: BurnFit
) -> tuple[PivotSolution, InitialSolution] | None:
    """The solution with the burns of a fit that are needed, and its start; None if it is no likelier.

    Raises:
        ComputationError: a solution with burns diverges.
    """
    while fit.burns:
        again = _start(start, equations, equations.without_smooth(fit))
        burned = refined(again, options)
        gains = np.array(_gains(burned))
        idle = np.flatnonzero(gains < price(len(gains)) - price(len(gains) - 1))
        if not len(idle):
            burned = burned if burned.converged else _gone_on(burned, again, options)
            if not burned.converged or gain_over(found, burned, start) <= 0:
                return None
            return _without_them(burned, start, options) or (burned, again)
        # Without one of them others may be needed: half of them, so that even many soon come to an end.
        fit = without(equations, fit, idle[np.argsort(gains[idle])[: (len(idle) + 1) // 2]])
    return None


def _without_them(
    burned: PivotSolution, start: InitialSolution, options: PathOptions
) -> tuple[PivotSolution, InitialSolution] | None:
    """The solution without burns that is reached from one with them, and its start, if it is likelier.

    Attitudes that many outliers have spoilt may be right in the one with burns alone, which then is likelier for that.
    """
    if not rejects_many(burned.observations.weight):
        return None
    near = start.near(burned)
    plain = refined(near, options)
    return (plain, near) if plain.converged and gain_over(burned, plain, start) > 0 else None


def _gone_on(found: PivotSolution, start: InitialSolution, options: PathOptions) -> PivotSolution:
    """The solution that is reached from one that has not converged, unless that is at rest.

    The search knows the attitudes of the registration, of which some are spoilt by outliers or by poor depths: from
    there it takes more rounds until the weights have settled.
    """
    if is_at_rest(found):
        return replace(found, converged=True)
    return refined(start.on(found.path, found.sampled.itself, found.solution.x).near(found), options)


def _left_out(found: PivotSolution, start: InitialSolution) -> float:
    """The share of frames whose observations agree with one another, but all are rejected by the path."""
    weight = found.observations.weight
    used, seen = weight.sum(axis=1), np.where(weight > 0, start.observations.weight, 0.0).sum(axis=1)
    return float((used < REJECTED * seen).sum() / max(float((seen > 0).sum()), 1.0))


def _follows_rotation(found: PivotSolution) -> bool:
    """Whether a smooth path may be so flexible for the sake of a burn, and hide the offset: it then needs no noise."""
    return smooth_in(found.path) is not None and found.spurious_share > FOLLOWS


def unknown_burns(path: Path, x: FloatArray, of_x: FloatArray) -> tuple[UnknownBurn, ...]:
    """The findings of the burns on a path, from the first to the last; x (p,): its unknowns, of_x: their covariance."""
    burns, burned = burns_of(path, x, of_x), burned_in(path)
    axes: Literal["lvlh", "inertial"] = "inertial" if burned is None or burned.orbit is None else "lvlh"
    return tuple(UnknownBurn.of(burn, axes) for burn in sorted(burns, key=lambda one: one.begin))


def _start(start: InitialSolution, equations: BurnEquations, fit: BurnFit) -> InitialSolution:
    """The start of the refinement from the search's solution."""
    path = start.path
    assert isinstance(path, ProcessNoisePath)  # noqa: S101  see `may_have_burns`
    offsets, of_base = fit.mean[: equations.offsets], equations.path_in(fit)
    about = None if fit.bend is None else of_base
    burned = BurnedPath(path.base, equations.orbit, fit.burns, path.begin, path.end, about)
    wider = replace(path, base=burned)
    return replace(
        start,
        path=wider,
        sampled=wider.at(start.time),
        bodies=equations.posed.bodies(offsets.reshape(-1, 3)),
        x=np.concatenate([of_base, burned.values, np.zeros(3 * path.count)]),
        weight=None,
        first_prior=None,
    )


def _gains(found: PivotSolution) -> list[float]:
    """What each burn gains in 2 ln p."""
    burned = burned_in(found.path)
    assert burned is not None  # noqa: S101  there are burns
    linear, prior = scaled(found.problem, found.variance), found.path.prior
    near = found.posterior.theta.copy()
    whole = cost(linear, prior, maximise(linear, prior, near))
    near[prior.index(DENSITY)] = np.nan  # noise stands for a burn that is left out: any may be likeliest
    return [
        _cost_without(linear, prior, np.arange(first, first + UNKNOWNS), near) - whole
        for first in range(burned.base.size, burned.size, UNKNOWNS)
    ]


def _cost_without(linear: GaussianLikelihood, prior: Prior, gone: NDArray[np.intp], near: FloatArray) -> float:
    """−2 ln p at its minimum if some unknowns are zero, beside that with them; near (h,): see `maximise`."""
    few, more = fixed_at(linear, gone, np.zeros(len(gone)))
    own = prior.of(np.setdiff1d(np.arange(len(linear.x)), gone))
    return cost(few, own, maximise(few, own, near)) + more

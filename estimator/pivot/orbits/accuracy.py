"""Errors of an orbit that is not exact, and of a push that nobody tells, where the answer rests on them.

Where a target turns too little, or about one axis alone, the features hardly tell the place of its centre of mass in
some direction. What tells of it then is the gravity gradient, in a low orbit a millionth of a metre per second squared
for each metre: an orbit that is a little off, or a push of as much, moves the answer by many times its claim. Most
often the path shows that there is none; where it does not, the claim has to allow for it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.findings import UntoldAccuracy
from baryscope.estimator.hyperparameters.evidence import conditional, cost, maximise, solved
from baryscope.estimator.options import PathOptions
from baryscope.estimator.orbits.error import (
    ORBIT_ERROR,
    SHARES,
    UNTOLD_TURN,
    InexactOrbitPath,
    inexact_parts,
    orbit_error,
)
from baryscope.estimator.orbits.estimated import acting_orbit, estimated_orbit_in
from baryscope.estimator.orbits.oblateness import oblateness_beside, oblateness_in, oblateness_on
from baryscope.estimator.orbits.push import untold_push_beside
from baryscope.estimator.paths.doubtful_path import DoubtfulPath
from baryscope.estimator.paths.forces import Force, ForcedPath
from baryscope.estimator.paths.path import Path
from baryscope.estimator.paths.prior import Prior
from baryscope.estimator.paths.process_noise import ProcessNoisePath, with_noise_of, without_noise
from baryscope.estimator.pivot.initial_solution import InitialSolution
from baryscope.estimator.pivot.orbits.corrected import refined_on, start_on
from baryscope.estimator.pivot.orbits.estimated import linearised_anew
from baryscope.estimator.pivot.orbits.further_unknowns import FurtherUnknowns
from baryscope.estimator.pivot.pivot_solution import DECISIVE, PivotSolution
from baryscope.models.orbit import Orbit

FloatArray = NDArray[np.float64]
Share: TypeAlias = float | FloatArray  # of the deviations of all components of a force, or of each

NEGLIGIBLE = 1e-6  # share of a force's deviations, that is as none
# Shares of what is likely where nothing is told. The tracks may exclude that, and not less, which matters. Of an orbit
# they may tell that it is right along the track and across, and leave open its period, which the other components are.
OF_PUSH = (1.0, 0.1)
OF_ORBIT = tuple(
    np.where(SHARES < 1, of_period, of_place)
    for of_place, of_period in ((1.0, 1.0), (0.1, 1.0), (0.01, 1.0), (0.1, 0.1), (0.01, 0.1), (0.01, 0.01))
)
RESTS = 2.0  # times as wide a claim, from which the answer rests on a force


def with_errors_of_orbit(
    found: PivotSolution, orbit: Orbit | None, start: InitialSolution, options: PathOptions
) -> PivotSolution:
    """The solution with an error of the orbit among the unknowns, if its accuracy is told, or the tracks do not exclude
    what is likely where it is not, and the answer rests on it; likewise with a constant push.

    Where the answer does not rest on what the tracks do not exclude, that is left to the time before and after them. Of
    an orbit that the tracks tell, the elements are unknowns already, but it may have no J2 yet. That has a known size:
    unless the tracks exclude it, it is among the unknowns, too. Without process noise models hold exactly, but for an
    error of a told size, and for J2 on an orbit that nobody tells. An orbit that is exact may be told without J2.
    """
    path, orbit = found.path, acting_orbit(orbit, found.path)
    if orbit is None or path.name != "relative-orbit":
        return found
    doubts, acting = _doubts(found, orbit, options), without_noise(path)
    base = acting
    for doubt in doubts:
        if doubt.rests:
            base = replace(doubt.part, base=base)
    other = None if base is acting else refined_on(base, path, found, start, options)
    left = [doubt.beside for doubt in doubts if not doubt.rests]
    if other is not None:
        anew = linearised_anew(other, start_on(base, path, found, start), options)
        other = other if anew is None else anew[0]
        found, left = other, [_Beside.of(other, beside.force) for beside in left]
    return _with_left_out(found, left)


def untold_accuracy(path: Path) -> tuple[UntoldAccuracy, ...]:
    """The finding of a path that allows for errors of the orbit, or a push, that nobody tells."""
    untold = {part.force.unit: part.deviation for part in inexact_parts(path) if not part.told}
    place, push = untold.get("m", 0.0), untold.get("m/s²", 0.0)
    return (UntoldAccuracy(place, push),) if place or push else ()


@dataclass(frozen=True, eq=False)
class _Doubt:
    """A force that the tracks do not exclude, beside a solution, and the part of a path that it is.

    rests: whether it has to be among the unknowns.
    """

    beside: "_Beside"
    part: InexactOrbitPath
    rests: bool

    @classmethod
    def of(cls, beside: "_Beside", size: float, *, told: bool) -> "_Doubt":
        """The doubt of a force of a size that is told, or that acts: m, m/s², or a share of J2."""
        acting, span = without_noise(beside.found.path), _span(beside.found)
        return cls(beside, InexactOrbitPath(acting, beside.force, *span, told, size), True)

    @classmethod
    def of_untold(cls, beside: "_Beside", shares: Sequence[Share]) -> "_Doubt | None":
        """The doubt of the first of some shares of a force's deviations that the tracks do not exclude, if one is.

        Of components that they exclude to be as great as is likely there may as well be nothing.
        """
        share = beside.first_possible(shares)
        if share is None:
            return None
        own, rests = beside.of_share(share), beside.matters(share)
        doubt = cls.of(own, float(own.force.deviations.max()), told=False)
        small = np.broadcast_to(share, beside.variances.shape) < 1
        if not (rests and small.any()):
            return replace(doubt, rests=rests)
        likely = beside.excess(share) < beside.excess(np.where(small, NEGLIGIBLE, share))
        return replace(doubt, part=replace(doubt.part, doubtful=np.flatnonzero(small), likely=likely))


def _doubts(found: PivotSolution, orbit: Orbit, options: PathOptions) -> tuple[_Doubt, ...]:
    """What may act beside what is among a solution's unknowns, unless the tracks exclude it or somebody does."""
    doubts: list[_Doubt | None] = []
    path, span = found.path, _span(found)
    estimated = estimated_orbit_in(path)
    if estimated is not None and oblateness_in(path) is None:
        oblateness = oblateness_on(orbit, found.position, span)
        if oblateness is not None:
            beside, size = _Beside.of(found, oblateness), float(oblateness.deviations[0])
            excess = beside.excess(1.0)
            acts = excess <= -DECISIVE
            doubts.append(_Doubt.of(beside, size, told=acts) if excess < DECISIVE else None)
    elif estimated is None and isinstance(path, ProcessNoisePath) and path.density is None:
        untold_oblateness = oblateness_beside(orbit, found.position, span)
        if untold_oblateness is not None:
            doubts.append(_Doubt.of_untold(_Beside.of(found, untold_oblateness), (1.0,)))
    if orbit.accuracy == 0:
        return tuple(doubt for doubt in doubts if doubt is not None)
    if estimated is None and path.prior.index(ORBIT_ERROR) is None:
        deviation = orbit.accuracy or UNTOLD_TURN * orbit.semi_major_axis
        untold = orbit.accuracy is None
        beside = _Beside.of(found, orbit_error(orbit, found.position, *span, deviation, untold=untold))
        if not untold:
            doubts.append(_Doubt.of(beside, deviation, told=True))
        elif isinstance(path, ProcessNoisePath):
            doubts.append(_Doubt.of_untold(beside, OF_ORBIT))
    push = untold_push_beside(path, orbit, options) if isinstance(path, ProcessNoisePath) else None
    if push is not None:
        doubts.append(_Doubt.of_untold(_Beside.of(found, push.force), OF_PUSH))
    return tuple(doubt for doubt in doubts if doubt is not None)


def _span(found: PivotSolution) -> tuple[float, float]:
    """Begin and end of the tracks, s."""
    return float(found.time[0]), float(found.time[-1])


def _with_left_out(found: PivotSolution, left: Sequence["_Beside"]) -> PivotSolution:
    """The solution with what forces beside it, of what its tracks do not exclude, do before and after these."""
    path, span = found.path, _span(found)
    base = without_noise(path)
    for beside in left:
        base = DoubtfulPath(base, path, beside.force, *span, *beside.left_out())
    return replace(found, path=with_noise_of(path, base)) if left else found


@dataclass(frozen=True, eq=False)
class _Beside:
    """A force beside a solution, to first order, with the solution's weights; some frames are looked at, with the
    weights of all. variances (c,): of the force's unknowns.
    """

    found: PivotSolution
    prior: Prior
    further: FurtherUnknowns
    force: Force
    variances: FloatArray

    @classmethod
    def of(cls, found: PivotSolution, force: Force) -> "_Beside":
        """The force beside a solution."""
        forced = ForcedPath(without_noise(found.path), force, *_span(found))
        further = FurtherUnknowns.of(found, lambda rows: forced.columns(found.time[rows]))
        return cls(found, found.path.prior, further, force, np.exp(forced.own_prior.offset))

    def of_share(self, share: Share) -> "_Beside":
        """A share of the force's deviations."""
        force = replace(self.force, deviations=share * self.force.deviations)
        return replace(self, force=force, variances=np.square(share) * self.variances)

    def first_possible(self, shares: Sequence[Share]) -> Share | None:
        """The first of some shares that the tracks do not exclude, None if they exclude all.

        If the answer rests on it, they must not exclude it for another one either.
        """
        share = next((one for one in shares if self.excess(one) < DECISIVE), None)
        if share is None or not self.matters(share):
            return share
        excesses = [self.excess(one) for one in shares]
        best = min(0.0, *excesses)
        return next(one for one, excess in zip(shares, excesses, strict=True) if excess - best < DECISIVE)

    def excess(self, share: Share) -> float:
        """By how much −2 ln of the marginal likelihood is more with a share of its deviations than without it."""
        return self._evidence(share) - self._without

    def matters(self, share: Share) -> bool:
        """Whether the claim is much wider with a share of its deviations, at any frame in any direction."""
        ratios = np.linalg.eigvals(np.linalg.solve(self._own_claim, self._claimed(share)))
        return bool(ratios.real.max() >= RESTS**2)

    def left_out(self) -> tuple[FloatArray, FloatArray]:
        """What the solution leaves out of the force: the mean (c, c) of the products of its unknowns, m², and what the
        path's unknowns take on of them, (p, c).
        """
        mean, covariance = conditional(self.further.linear, self._with(1.0), self.found.posterior.theta)
        own = len(self.variances)
        of_force = covariance[-own:, -own:]
        follows = solved(of_force, covariance[:-own, -own:].T).T
        return of_force + np.outer(mean[-own:], mean[-own:]), follows

    @cached_property
    def _without(self) -> float:
        return self._evidence(NEGLIGIBLE)

    @cached_property
    def _own_claim(self) -> FloatArray:
        return self._claimed(NEGLIGIBLE)

    def _evidence(self, share: Share) -> float:
        """−2 ln of the marginal likelihood for a share of its deviations, up to a constant."""
        prior = self._with(share)
        return cost(self.further.linear, prior, maximise(self.further.linear, prior))

    def _claimed(self, share: Share) -> FloatArray:
        """The covariance (n, 3, 3) of the path for a share of its deviations."""
        theta = self.found.posterior.theta
        return self.further.path.covariance(conditional(self.further.linear, self._with(share), theta)[1])

    def _with(self, share: Share) -> Prior:
        return self.prior.joined(Prior.known(np.square(share) * self.variances))

"""Errors of an orbit that is not exact, and of a push that nobody tells, where the answer rests on them.

Where a target turns too little, or about one axis alone, the features hardly tell the place of its centre of mass in
some direction. What tells of it then is the gravity gradient, in a low orbit a millionth of a metre per second squared
for each metre: an orbit that is a little off, or a push of as much, moves the answer by many times its claim. Most
often the path shows that there is none; where it does not, the claim has to allow for it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.findings import UntoldAccuracy
from baryscope.estimator.hyperparameters.evidence import conditional, cost, maximise
from baryscope.estimator.options import PathOptions
from baryscope.estimator.orbits.error import (
    ORBIT_ERROR,
    UNTOLD_TURN,
    InexactOrbitPath,
    inexact_parts,
    orbit_error,
)
from baryscope.estimator.orbits.estimated import acting_orbit, estimated_orbit_in
from baryscope.estimator.orbits.oblateness import oblateness_in, oblateness_on
from baryscope.estimator.orbits.push import unknown_push_in, untold_push
from baryscope.estimator.paths.forces import Force, ForcedPath, constant_of
from baryscope.estimator.paths.path import Path
from baryscope.estimator.paths.prior import Prior
from baryscope.estimator.paths.process_noise import ProcessNoisePath
from baryscope.estimator.pivot.initial_solution import InitialSolution
from baryscope.estimator.pivot.orbits.corrected import refined_on
from baryscope.estimator.pivot.orbits.further_unknowns import FurtherUnknowns
from baryscope.estimator.pivot.pivot_solution import DECISIVE, PivotSolution
from baryscope.models.orbit import Orbit

FloatArray = NDArray[np.float64]

NEGLIGIBLE = 1e-6  # share of a force's deviations, that is as none
# Shares of what is likely where nothing is told. The tracks may exclude that, and not less, which matters.
OF_ORBIT, OF_PUSH = (1.0, 0.1, 0.01), (1.0, 0.1)
RESTS = 2.0  # times as wide a claim, from which the answer rests on a force


def with_errors_of_orbit(
    found: PivotSolution, orbit: Orbit | None, start: InitialSolution, options: PathOptions
) -> PivotSolution:
    """The solution with an error of the orbit among the unknowns, if its accuracy is told, or the tracks do not exclude
    what is likely where it is not, and the answer rests on it; likewise with a constant push.

    Of an orbit that the tracks tell, the elements are unknowns already, but it may have no J2 yet. That has a known
    size: unless the tracks exclude it, it is among the unknowns, too, as it matters ahead.
    """
    path, estimated = found.path, estimated_orbit_in(found.path)
    orbit = acting_orbit(orbit, path)
    if orbit is None or orbit.accuracy == 0 or path.name != "relative-orbit" or not isinstance(path, ProcessNoisePath):
        return found
    parts = []
    if estimated is not None and oblateness_in(path) is None:
        oblateness = oblateness_on(orbit, found.position, (path.begin, path.end))
        if oblateness is not None:
            beside, size = _Beside.of(found, path, oblateness), float(oblateness.deviations[0])
            excess = beside.excess(1.0)
            if excess < DECISIVE:
                shown = excess <= -DECISIVE
                parts.append(InexactOrbitPath(path.base, oblateness, path.begin, path.end, shown, size))
    elif estimated is None and path.prior.index(ORBIT_ERROR) is None:
        told = orbit.accuracy is not None
        deviation = orbit.accuracy or UNTOLD_TURN * orbit.semi_major_axis
        displaced = orbit_error(orbit, found.position, path.begin, path.end, deviation)
        if share := 1.0 if told else _Beside.of(found, path, displaced).doubtful(OF_ORBIT):
            displaced = replace(displaced, deviations=share * displaced.deviations)
            parts.append(InexactOrbitPath(path.base, displaced, path.begin, path.end, told, share * deviation))
    if options.constant_acceleration == "none" and path.density is None and unknown_push_in(path) is None:
        pushed, size = constant_of("lvlh", orbit, path.begin, path.end), untold_push(orbit)
        pushed = replace(pushed, deviations=np.full(3, size))
        if share := _Beside.of(found, path, pushed).doubtful(OF_PUSH):
            pushed = replace(pushed, deviations=share * pushed.deviations)
            parts.append(InexactOrbitPath(path.base, pushed, path.begin, path.end, False, share * size))
    if not parts:
        return found
    base: Path = path.base
    for part in parts:
        base = replace(part, base=base)
    other = refined_on(base, path, found, start, options)
    return found if other is None else other


def untold_accuracy(path: Path) -> tuple[UntoldAccuracy, ...]:
    """The finding of a path that allows for errors of the orbit, or a push, that nobody tells."""
    untold = {part.force.unit: part.deviation for part in inexact_parts(path) if not part.told}
    place, push = untold.get("m", 0.0), untold.get("m/s²", 0.0)
    return (UntoldAccuracy(place, push),) if place or push else ()


@dataclass(frozen=True, eq=False)
class _Beside:
    """A force beside a solution, to first order, with the solution's weights; some frames are looked at, with the
    weights of all. variances (c,): of the force's unknowns.
    """

    found: PivotSolution
    prior: Prior
    further: FurtherUnknowns
    variances: FloatArray

    @classmethod
    def of(cls, found: PivotSolution, path: ProcessNoisePath, force: Force) -> "_Beside":
        """The force beside a solution on a path."""
        forced = ForcedPath(path.base, force, path.begin, path.end)
        further = FurtherUnknowns.of(found, lambda rows: forced.at(found.time[rows]).jacobian[:, :, path.base.size :])
        return cls(found, path.prior, further, np.exp(forced.prior.offset[path.base.size :]))

    def doubtful(self, shares: Sequence[float]) -> float:
        """The first of some shares of its deviations that the tracks do not exclude, if it matters; else 0."""
        share = next((one for one in shares if self.excess(one) < DECISIVE), 0.0)
        return share if share and self.matters(share) else 0.0

    def excess(self, share: float) -> float:
        """By how much −2 ln of the marginal likelihood is more with a share of its deviations than without it."""
        return self._evidence(share) - self._without

    def matters(self, share: float) -> bool:
        """Whether the claim is much wider with a share of its deviations, at any frame in any direction."""
        own, wider = self._claimed(NEGLIGIBLE), self._claimed(share)
        return bool(np.linalg.eigvals(np.linalg.solve(own, wider)).real.max() >= RESTS**2)

    @cached_property
    def _without(self) -> float:
        return self._evidence(NEGLIGIBLE)

    def _evidence(self, share: float) -> float:
        """−2 ln of the marginal likelihood for a share of its deviations, up to a constant."""
        prior = self._with(share)
        return cost(self.further.linear, prior, maximise(self.further.linear, prior))

    def _claimed(self, share: float) -> FloatArray:
        """The covariance (n, 3, 3) of the path for a share of its deviations."""
        theta = self.found.posterior.theta
        return self.further.path.covariance(conditional(self.further.linear, self._with(share), theta)[1])

    def _with(self, share: float) -> Prior:
        return self.prior.joined(Prior.known(share**2 * self.variances))

"""Errors of an orbit that is not exact, and of a push that nobody tells, where the answer rests on them.

Where a target turns too little, or about one axis alone, the features hardly tell the place of its centre of mass in
some direction. What tells of it then is the gravity gradient, in a low orbit a millionth of a metre per second squared
for each metre: an orbit that is a little off, or a push of as much, moves the answer by many times its claim. Most
often the path shows that there is none; where it does not, the claim has to allow for it.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.evidence import conditional, cost, maximise
from baryscope.estimator.dynamics.forces import Force, ForcedPath, constant_of
from baryscope.estimator.dynamics.paths import Path
from baryscope.estimator.dynamics.prior import Prior
from baryscope.estimator.dynamics.process_noise import ProcessNoisePath
from baryscope.estimator.findings import UntoldAccuracy
from baryscope.estimator.options import PathOptions
from baryscope.estimator.orbits.error import (
    ORBIT_ERROR,
    UNTOLD_TURN,
    InexactOrbitPath,
    inexact_parts,
    orbit_error,
)
from baryscope.estimator.orbits.push import unknown_push_in, untold_push
from baryscope.estimator.pivot.initial_solution import InitialSolution
from baryscope.estimator.pivot.orbits.corrected import refined_on
from baryscope.estimator.pivot.orbits.further_unknowns import FurtherUnknowns
from baryscope.estimator.pivot.pivot_solution import DECISIVE, PivotSolution
from baryscope.models.orbit import Orbit

FloatArray = NDArray[np.float64]

NEGLIGIBLE = 1e-6  # share of a force's deviations, that is as none
RESTS = 2.0  # times as wide a claim, from which the answer rests on a force


def with_errors_of_orbit(
    found: PivotSolution, orbit: Orbit | None, start: InitialSolution, options: PathOptions
) -> PivotSolution:
    """The solution with an error of the orbit among the unknowns, if its accuracy is told, or the tracks do not exclude
    what is likely where it is not, and the answer rests on it; likewise with a constant push.
    """
    path = found.path
    if orbit is None or orbit.accuracy == 0 or path.name != "relative-orbit" or not isinstance(path, ProcessNoisePath):
        return found
    parts = []
    if path.prior.index(ORBIT_ERROR) is None:
        told = orbit.accuracy is not None
        deviation = orbit.accuracy or UNTOLD_TURN * orbit.semi_major_axis
        displaced = orbit_error(orbit, found.position, path.begin, path.end, deviation)
        if told or _doubtful(found, path, displaced, (1.0,)):
            parts.append(InexactOrbitPath(path.base, displaced, path.begin, path.end, told, deviation))
    if options.constant_acceleration == "none" and path.density is None and unknown_push_in(path) is None:
        pushed, size = constant_of("lvlh", orbit, path.begin, path.end), untold_push(orbit)
        pushed = replace(pushed, deviations=np.full(3, size))
        if share := _doubtful(found, path, pushed, (1.0, 0.1)):
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
    return (UntoldAccuracy(untold.get("m", 0.0), untold.get("m/s²", 0.0)),) if untold else ()


def _doubtful(found: PivotSolution, path: ProcessNoisePath, force: Force, shares: Sequence[float]) -> float:
    """The first of some shares of a force's deviations that the tracks do not exclude, if the claim is much wider with
    it, at any frame in any direction; 0 if there is none.

    To first order, with the solution's weights; some frames are looked at, with the weights of all.
    """
    forced = ForcedPath(path.base, force, path.begin, path.end)
    further = FurtherUnknowns.of(found, lambda rows: forced.at(found.time[rows]).jacobian[:, :, path.base.size :])
    variances = np.exp(forced.prior.offset[path.base.size :])

    def judged(share: float) -> tuple[float, FloatArray]:
        prior = path.prior.joined(Prior.known(share**2 * variances))
        covariance = conditional(further.linear, prior, found.posterior.theta)[1]
        return cost(further.linear, prior, maximise(further.linear, prior)), further.path.covariance(covariance)

    exact, own = judged(NEGLIGIBLE)
    for share in shares:
        with_force, wider = judged(share)
        if with_force - exact < DECISIVE:
            return share if np.linalg.eigvals(np.linalg.solve(own, wider)).real.max() >= RESTS**2 else 0.0
    return 0.0

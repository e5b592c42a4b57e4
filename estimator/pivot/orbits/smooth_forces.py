"""The Earth's oblateness and a push that nobody tells: both change a path slowly, and pass for each other."""

from dataclasses import dataclass

from baryscope.estimator.options import PathOptions
from baryscope.estimator.paths.process_noise import DENSITY
from baryscope.estimator.pivot.initial_solution import InitialSolution
from baryscope.estimator.pivot.orbits.corrected import corrected_for_orbit
from baryscope.estimator.pivot.orbits.oblateness import with_oblateness
from baryscope.estimator.pivot.orbits.pushed import with_push
from baryscope.estimator.pivot.pivot_solution import PivotSolution
from baryscope.estimator.pivot.unexplained import gain_over
from baryscope.models.orbit import Orbit


@dataclass(frozen=True, eq=False)
class SmoothForces:
    """A solution with what smooth forces nobody tells, and its start.

    orbit: as told, or with the Earth's J2 if that acts; unpushed: a solution in which a push has been looked for in
    vain, None if not in this one.
    """

    found: PivotSolution
    start: InitialSolution
    orbit: Orbit | None
    unpushed: PivotSolution | None


def with_smooth_forces(
    found: PivotSolution, start: InitialSolution, told: Orbit | None, options: PathOptions
) -> SmoothForces:
    """The solution with J2 and a push that nobody tells, where the tracks show them; told: the orbit as given.

    What looks like a push, but leaves process noise, may be a burn: then burns are looked for first.
    """
    before = SmoothForces(found, start, told, found)
    found, start, orbit = with_oblateness(found, start, told, options)
    pushed, with_it = with_push(found, start, orbit, options)
    if pushed is not found and orbit is not told:  # J2 and a push may pass for an error of the orbit
        corrected = corrected_for_orbit(before.found, told, before.start, options)
        if corrected is not None and gain_over(pushed, corrected, start) > 0:
            return before
    if pushed is found:
        return SmoothForces(found, start, orbit, found)
    if pushed.has(DENSITY):
        return SmoothForces(found, start, orbit, None)
    return SmoothForces(pushed, with_it, orbit, None)

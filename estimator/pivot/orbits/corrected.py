"""An error of the orbit that is given, where it explains what else would be process noise."""

from dataclasses import replace

import numpy as np

from baryscope.estimator.findings import WrongOrbit
from baryscope.estimator.options import PathOptions
from baryscope.estimator.orbits.error import (
    NAMES,
    ORBIT_ERROR,
    InexactOrbitPath,
    with_orbit_error,
)
from baryscope.estimator.paths.extended_path import factors_of, parts_of
from baryscope.estimator.paths.forces import ForcedPath
from baryscope.estimator.paths.interpolated_path import interpolated
from baryscope.estimator.paths.path import Path
from baryscope.estimator.paths.process_noise import DENSITY, ProcessNoisePath, with_noise_of, without_noise
from baryscope.estimator.pivot.initial_solution import InitialSolution
from baryscope.estimator.pivot.joint_covariance import without_spurious_information
from baryscope.estimator.pivot.pivot_solution import PivotSolution
from baryscope.estimator.pivot.refinement import refined
from baryscope.models.errors import ComputationError
from baryscope.models.orbit import Orbit

SHOWN = 2.0  # deviations of one coordinate of a shift, from which it is one


def corrected_for_orbit(
    found: PivotSolution, orbit: Orbit | None, start: InitialSolution, options: PathOptions
) -> PivotSolution | None:
    """The solution with an error of the orbit among the unknowns, if that explains what else would be process noise."""
    path = found.path
    if orbit is None or path.name != "relative-orbit" or not isinstance(path, ProcessNoisePath):
        return None
    if not found.has(DENSITY):
        return None
    corrected = refined_on(
        with_orbit_error(path.base, orbit, found.position, path.begin, path.end), path, found, start, options
    )
    return corrected if corrected is not None and corrected.has(ORBIT_ERROR) else None


def start_on(base: Path, path: Path, found: PivotSolution, start: InitialSolution) -> InitialSolution:
    """The start at a solution on a base that has unknowns beside those of the path's own, which are zero."""
    wider, size = with_noise_of(path, base), without_noise(path).size
    x = np.insert(found.solution.x, size, np.zeros(base.size - size))
    return start.on(wider, interpolated(wider.at, wider.frequency, start.time), x)


def refined_on(
    base: Path, path: Path, found: PivotSolution, start: InitialSolution, options: PathOptions
) -> PivotSolution | None:
    """The solution on a base that has unknowns beside those of the path's own; None if there is none."""
    try:
        other = refined(start_on(base, path, found, start).near(found), options)
    except ComputationError:
        return None
    return other if other.converged else None


def orbit_error_in(found: PivotSolution, base: Path) -> InexactOrbitPath | None:
    """The error of the orbit on a path with another base, of the size that a solution has found, if it has one."""
    index = found.path.prior.index(ORBIT_ERROR)
    if index is None:
        return None
    part = next(one for one in parts_of(found.path) if isinstance(one, ForcedPath) and one.force.names == NAMES)
    size = float(np.exp(found.posterior.theta[index] / 2))
    known = replace(part.force, deviations=size * part.force.deviations, scale=None)
    return InexactOrbitPath(base, known, part.begin, part.end, True, size)


def wrong_orbit(found: PivotSolution, orbit: Orbit | None) -> tuple[WrongOrbit, ...]:
    """The finding of a wrong orbit, if the path has an error of it, and that is significant.

    Its deviation is that of the covariance without spurious information, by which the place has to be told, too: a path
    that follows the rotation may need an error of the orbit as it needs process noise.
    """
    if orbit is None or not found.has(ORBIT_ERROR):
        return ()
    factors = factors_of(found.path, found.solution.x, without_spurious_information(found).of_x)
    place = [factor for factor in factors if factor.name in NAMES][:3]
    if all(abs(one.value) < SHOWN * one.deviation for one in place):
        return ()
    radial, along, across = place
    return (
        WrongOrbit(
            (radial.value, along.value, across.value),
            (radial.deviation, along.deviation, across.deviation),
            orbit.j2 is not None,
        ),
    )

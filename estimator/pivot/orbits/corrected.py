"""An error of the orbit that is given, where it explains what else would be process noise."""

from dataclasses import replace

import numpy as np

from baryscope.estimator.dynamics.extended import factors_of
from baryscope.estimator.dynamics.interpolated_path import interpolated
from baryscope.estimator.dynamics.process_noise import DENSITY, Disturbed
from baryscope.estimator.findings import WrongOrbit
from baryscope.estimator.options import PathOptions
from baryscope.estimator.orbits.error import NAMES, ORBIT_ERROR, with_orbit_error
from baryscope.estimator.pivot.found import Pivot
from baryscope.estimator.pivot.refinement import Start, refined
from baryscope.models.errors import ComputationError
from baryscope.models.orbit import Orbit


def with_corrected_orbit(found: Pivot, orbit: Orbit | None, start: Start, options: PathOptions) -> Pivot:
    """The solution with an error of the orbit among the unknowns, if that explains what else would be process noise."""
    path = found.path
    if orbit is None or path.name != "relative-orbit" or not isinstance(path, Disturbed):
        return found
    if not found.has(DENSITY):
        return found
    wider = replace(path, base=with_orbit_error(path.base, orbit, found.position, path.begin, path.end))
    x = np.insert(found.solution.x, path.base.size, np.zeros(wider.base.size - path.base.size))
    sampled = interpolated(wider.at, wider.frequency, start.time)
    try:
        corrected = refined(start.on(wider, sampled, x).near(found), options)
    except ComputationError:
        return found
    return corrected if corrected.converged and corrected.has(ORBIT_ERROR) else found


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

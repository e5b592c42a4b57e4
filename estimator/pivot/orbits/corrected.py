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

"""What a path leaves unexplained: whether its process noise is a wrong orbit, or the path may follow the rotation.

The significance of a hyperparameter is twice the logarithm of the likelihood ratio against no effect. Without an effect
it is 0 in half of all cases, and χ² with one degree of freedom in the others (Self and Liang 1987).
"""

from dataclasses import replace

import numpy as np

from baryscope.estimator.dynamics.extended import factors_of
from baryscope.estimator.dynamics.interpolated_path import interpolated
from baryscope.estimator.dynamics.orbit_error import NAMES, ORBIT_ERROR, with_orbit_error
from baryscope.estimator.dynamics.process_noise import DENSITY, Disturbed
from baryscope.estimator.dynamics.trajectory import smooth_in
from baryscope.estimator.findings import FollowsRotation, WrongOrbit
from baryscope.estimator.observability import Observability
from baryscope.estimator.options import PathOptions
from baryscope.estimator.pivot.found import Pivot
from baryscope.estimator.pivot.refinement import Start, refined
from baryscope.models.errors import ComputationError
from baryscope.models.orbit import Orbit

FEIGNED = 0.4  # share of the information on an offset that is spurious, where a path may follow the rotation
CURVED = 12.0  # unknowns of a smooth path that the tracks determine: more than those of a cubic may follow it


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


def following_rotation(found: Pivot, observability: Observability) -> tuple[FollowsRotation, ...]:
    """The finding of a path that may follow the rotation, with an offset that is wrong by as much.

    Where hardly more than noise tells the offset, attitudes that outliers have spoilt can make such a path likelier
    than the true one; then neither is to be trusted. That is so of significant process noise, and of a smooth path that
    is much curved, unless the claim is that the offset is not told anyway.
    """
    able = found.has(DENSITY) if smooth_in(found.path) is None else found.path_unknowns > CURVED
    if not (able and observability.observable.all()):
        return ()
    share = found.shown_spurious_share_of(observability.cluster)
    if share <= FEIGNED:
        return ()
    return (FollowsRotation(share, found.path_unknowns),)


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

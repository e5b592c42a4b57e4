"""How many values observations have beyond the unknowns, and the least variance that is more than rounding."""

import numpy as np

from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.reweighting import NEGLIGIBLE
from baryscope.estimator.registration.body import Body
from baryscope.models.errors import ComputationError, Reason
from baryscope.models.words import counted


def values_for_path(bodies: tuple[Body, ...], observations: Observations) -> float:
    """Number of values less all unknowns except the path's.

    A frame has three unknowns of its rotation, a body three of each point less three of its orientation.
    """
    frames = sum(len(body.frames) for body in bodies)
    points = sum(3 * len(body.features) - 3 for body in bodies)
    return 3 * float(observations.weight.sum()) - 3 * frames - points


def degrees_of_freedom(bodies: tuple[Body, ...], observations: Observations, path_size: float) -> float:
    """Number of values less that of all unknowns, of which a path has path_size.

    Raises:
        ComputationError: no value is left.
    """
    dof = values_for_path(bodies, observations) - path_size
    if dof <= 0:
        frames = sum(len(body.frames) for body in bodies)
        raise ComputationError(
            f"{counted(frames, 'frame that shows', 'frames that show')} an attitude, with "
            f"{counted(observations.count, 'observation')}: too few for a path of {path_size:.3g} unknowns",
            Reason.TOO_FEW_FRAMES,
        )
    return dof


def degrees_of_freedom_of_points(observations: Observations, unknowns: float) -> float:
    """Number of values less that of the seen features' coordinates, of points of one body, and of other unknowns.

    At least 1.
    """
    seen = np.count_nonzero(observations.weight.max(axis=0, initial=0.0) > NEGLIGIBLE)
    return max(3 * float(observations.weight.sum()) - 3 * seen - unknowns, 1.0)


def least_variance(observations: Observations, rounding: float) -> float:
    """The variance of rounding for an observation of weight 1; rounding: relative to the greatest distance."""
    return 1e-9 if observations.precision is not None else (rounding * observations.farthest) ** 2

"""`joint`: the centre of rotation between two bodies, by either method, and the axis of a hinge."""

from typing import get_args

import numpy as np

from baryscope.estimator.joint.axis import hinge_axis
from baryscope.estimator.joint.bodies import Pair
from baryscope.estimator.joint.ml import maximum_likelihood
from baryscope.estimator.joint.result import Joint, Method, joint_of
from baryscope.estimator.joint.score import score
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import ComputationError, InputError

UNDETERMINED = 1e-10  # of the normal equations' greatest eigenvalue, below which a direction is rounding


def joint(parent: FeatureTracks | None, child: FeatureTracks, *, method: Method = "ml") -> Joint:
    """The centre of rotation between parent and child, or between the room and the child.

    Markers are left out where they are off their body, as where labels are swapped, and frames in which a body shows
    fewer than three others.

    Args:
        parent: markers of one body; None for the room.
        child: markers of the other, at the same times.
        method: ml, maximum likelihood with slack and skin as process noise; score, least squares as published.

    Raises:
        InputError: the times differ, or there is no such method.
        ComputationError: too few frames show three markers of each body, or these do not turn against each other.
    """
    if method not in get_args(Method):
        raise InputError(f"method: found {method!r}, expected one of {', '.join(get_args(Method))}")
    pair = Pair.of(parent, child)
    design, _ = pair.equations
    values = np.linalg.eigvalsh(np.einsum("kij,kil->jl", design, design))
    if values[0] < UNDETERMINED * values[-1]:
        raise ComputationError("parent and child turn about one axis or not at all: no single centre is determined")
    centre = score(pair) if method == "score" else maximum_likelihood(pair)
    axis = hinge_axis(pair) if centre.hinge else None
    return joint_of(pair, method, centre, float(np.sqrt(values[0] / values[-1])), axis)

"""`joint`: the centre of rotation between two bodies, by either method, and the axis of a hinge."""

from typing import get_args

import numpy as np

from baryscope.estimator.joint.axis import hinge_axis
from baryscope.estimator.joint.bodies import Pair
from baryscope.estimator.joint.ml import maximum_likelihood
from baryscope.estimator.joint.result import Joint, Method, joint_of
from baryscope.estimator.joint.score import score
from baryscope.estimator.plausibility import refuse_implausible
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.arguments import instance_of
from baryscope.models.errors import ComputationError, InputError

ACROSS = 0.5  # of the turn about a hinge's axis, that across it at most
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
        InputError: the times differ, a body is no tracks or cannot be one body in metres, or there is no such method.
        ComputationError: too few frames show three markers of each body, or these do not turn against each other.
    """
    if method not in get_args(Method):
        raise InputError(f"method: found {method!r}, expected one of {', '.join(get_args(Method))}")
    bodies = {"child": child} if parent is None else {"parent": parent, "child": child}
    for name, body in bodies.items():
        instance_of(name, body, FeatureTracks, "as of read_tracks, tracks_of or tracks_of_dataset")
        refuse_implausible(body, name)
    pair = Pair.of(parent, child)
    values, vectors = np.linalg.eigh(np.einsum("kij,kil->jl", *[pair.equations[0]] * 2))
    lost = values < UNDETERMINED * values[-1]
    if lost.sum() > 1:
        raise ComputationError("parent and child do not turn against each other: no centre is determined")
    told = vectors[:, ~lost]
    centre = score(pair, told) if method == "score" else maximum_likelihood(pair, told)
    axis = None if centre.observable else hinge_axis(pair)
    if axis is not None and axis.residual > ACROSS * axis.turned:
        axis = None
    return joint_of(pair, method, centre, float(np.sqrt(max(values[0], 0.0) / values[-1])), axis)

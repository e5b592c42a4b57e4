"""Frames that show two features of a body, too few for an attitude of their own: the path gives them one.

Two features and the centre of mass are three points. So where path and offset are told, frames join a body that show
two of its features: of the six values of a frame three tell its attitude, the others the distances between the points.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.normal_equations import attitude_covariances, attitude_information
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.dynamics.sampled_path import SampledPath
from baryscope.estimator.pivot.free_attitudes import Solution
from baryscope.estimator.pivot.rods import best_attitudes
from baryscope.estimator.registration.body import Body

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

FEW = 2  # features of a body; frames that show more and are not the body's have others among them, as outliers
KNOWN = 0.1  # rad, standard deviation of an attitude about an axis, up to which it is known
TOLD = 0.3  # share of the information on an offset that is spurious, up to which it is told
GATE = 25.0  # mean square of a frame's residuals over their variance, from which it does not show the body


def with_few_features(
    solution: Solution,
    weight: FloatArray,
    measured: Observations,
    sampled: SampledPath,
    variance: float,
    spurious: Callable[[], Sequence[FloatArray]],
) -> tuple[tuple[Body, ...], FloatArray] | None:
    """The bodies with more frames, and the weights (n, m) of observations with theirs; None if none joins.

    A frame joins the body of which it shows two features, and more of no other, if path and offset are known to a tenth
    of the features' distance. It need not fit well: outliers lose their weight later.

    Args:
        solution: the bodies, with points from the centre of mass, and the path's x.
        weight: (n, m), their robust weights.
        measured: all observations.
        sampled: the path.
        variance: of an observation of weight 1.
        spurious: gives the spurious information (3, 3) on each body's offset, in the weights' units.
    """
    bodies = solution.bodies
    free = np.ones(sampled.frames, dtype=np.bool_)
    for body in bodies:
        free[body.frames] = False
    count = np.array([np.count_nonzero(measured.weight[:, body.features] > 0, axis=1) for body in bodies])
    free &= count.max(axis=0) == FEW
    if not free.any():
        return None
    most, origin, of_offsets = count.argmax(axis=0), sampled.position(solution.x), spurious()
    found, weight, joined = list(bodies), weight.copy(), False
    for index, body in enumerate(bodies):
        frames = np.flatnonzero(free & (most == index))
        covariance = solution.offset_covariance[3 * index : 3 * index + 3, 3 * index : 3 * index + 3]
        far = KNOWN * float(np.sqrt(np.mean(np.sum(body.points**2, axis=1))))
        if not len(frames) or not _is_told(covariance, of_offsets[index], far**2 / variance):
            continue
        of_path = sampled.frames_at(frames).covariance(variance * solution.covariance)
        frames = frames[np.trace(of_path, axis1=1, axis2=2) < far**2]
        attitude, known = _attitudes(measured.features(body.features).frames(frames), body, origin[frames], variance)
        frames, attitude = frames[known], attitude[known]
        if not len(frames):
            continue
        block = np.ix_(frames, body.features)
        weight[block], joined = measured.weight[block], True
        every = np.concatenate([body.frames, frames])
        order = np.argsort(every)
        found[index] = replace(body, frames=every[order], attitude=np.concatenate([body.attitude, attitude])[order])
    return (tuple(found), weight) if joined else None


def _is_told(covariance: FloatArray, spurious: FloatArray, most: float) -> bool:
    """Whether an offset of covariance (3, 3) is told by more than spurious information, to at most a variance."""
    values, axes = np.linalg.eigh(covariance)
    root = axes * np.sqrt(np.maximum(values, 0.0))
    return bool(values[-1] < most and np.linalg.eigvalsh(root.T @ spurious @ root)[-1] < TOLD)


def _attitudes(own: Observations, body: Body, origin: FloatArray, variance: float) -> tuple[FloatArray, BoolArray]:
    """The attitudes (n, 3, 3) R_C_S of n frames, by the body's points about the origin (n, 3), and which are known."""
    apart = own.position - origin[:, None]
    attitude = best_attitudes(own, body.points, origin)
    squares = own.weight * own.squares(apart - np.einsum("kij,mj->kmi", attitude, body.points))
    fit = squares.sum(axis=1) < GATE * variance * np.count_nonzero(own.weight > 0, axis=1)
    of_attitude = attitude_covariances(attitude_information(own, attitude, body.points), variance)
    return attitude, fit & (np.linalg.eigvalsh(of_attitude)[:, -1] < KNOWN**2)

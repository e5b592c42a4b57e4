"""Frames to which the path gives an attitude: those that show too few features for one of their own, or have lost it.

Two features and the centre of mass are three points. So where path and offset are told, frames join a body that show
two of its features: of the six values of a frame three tell its attitude, the others the distances between the points.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.normal_equations import (
    at_best_attitudes,
    attitude_covariances,
    attitude_information,
)
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.reweighting import NEGLIGIBLE, REJECTED
from baryscope.estimator.adjustment.weighted_registration import CLEARLY
from baryscope.estimator.geometry.alignment import FEWEST_POINTS
from baryscope.estimator.paths.sampled_path import SampledPath
from baryscope.estimator.pivot.collinear import best_attitudes
from baryscope.estimator.pivot.free_attitudes import Solution
from baryscope.estimator.registration.body import Body
from baryscope.estimator.registration.noise import GATE

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

FEW = 2  # features of a body; frames that show more and are not the body's have others among them, as outliers
KNOWN = 0.1  # rad, standard deviation of an attitude about an axis, up to which it is known
TOLD = 0.3  # share of the information on an offset that is spurious, up to which it is told
FAR = 25.0  # mean square of a frame's residuals over their variance, from which it does not show the body
ROBUST_STEPS = 8  # from an attitude of all axes alike


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


def with_found_attitudes(
    bodies: tuple[Body, ...], weight: FloatArray, measured: Observations, origin: FloatArray, variance: float
) -> tuple[tuple[Body, ...], FloatArray] | None:
    """The bodies and weights (n, m) with attitudes that fit clearly better where some of a frame is rejected; or None.

    A path that was metres off at first has turned the attitudes of the frames that it was farthest from, and an outlier
    those of its frame, if only until it was rejected. Steps lead no attitude back that is off by a radian. One of all
    points of the body about the path does.

    Args:
        bodies: with points from the centre of mass.
        weight: (n, m), their robust weights.
        measured: all observations.
        origin: (n, 3) in C, m: the path.
        variance: of an observation of weight 1.
    """
    turned, weight, better_ones = list(bodies), weight.copy(), False
    for index, body in enumerate(bodies):
        block = body.block
        shown = weight[block] > 0
        rejected = np.count_nonzero(shown & (weight[block] < REJECTED), axis=1)
        # A single one is an outlier: a wrong attitude leaves others that do not fit.
        rows = np.flatnonzero((shown.sum(axis=1) >= FEWEST_POINTS) & (rejected > 1))
        if not len(rows):
            continue
        frames = body.frames[rows]
        seen = measured.features(body.features).frames(frames)
        own = seen.weighted(np.where(shown[rows], seen.weight, 0.0))
        about = body.points, origin[frames]
        attitude = _robust_attitudes(own, *about)
        squares, before = (_squares(own, one, *about) / variance for one in (attitude, body.attitude[rows]))
        better = np.minimum(squares, GATE).sum(axis=1) < np.minimum(before, GATE).sum(axis=1) - CLEARLY
        if better.any():
            found, better_ones = body.attitude.copy(), True
            found[rows[better]] = attitude[better]
            turned[index] = replace(body, attitude=found)
            right = np.where(squares[better] < GATE, 1.0, NEGLIGIBLE)
            weight[np.ix_(frames[better], body.features)] = own.weight[better] * right
    return (tuple(turned), weight) if better_ones else None


def _robust_attitudes(own: Observations, points: FloatArray, origin: FloatArray) -> FloatArray:
    """The attitudes (n, 3, 3) R_C_S of n frames by points (m, 3) about the origin (n, 3), with weights of least
    absolute residuals.

    All axes count alike at first, so that no attitude is wrong by much; a rig's covariances come by steps from there.
    """
    attitude = best_attitudes(own, points, origin)
    for _ in range(ROBUST_STEPS):
        plain = np.where(own.weight > 0, _squares(own, attitude, points, origin), np.nan)
        typical = np.maximum(np.nanmedian(plain, axis=1, keepdims=True), np.finfo(float).tiny)
        soft = own.weighted(np.where(own.weight > 0, own.weight / np.sqrt(1 + plain / typical), 0.0))
        attitude = at_best_attitudes(soft, attitude, origin, points)[0]
    return attitude


def _squares(own: Observations, attitude: FloatArray, points: FloatArray, origin: FloatArray) -> FloatArray:
    """The weighted squares (n, m) of the residuals at attitudes (n, 3, 3) of points (m, 3) about the origin (n, 3)."""
    apart = own.position - origin[:, None]
    return np.asarray(own.weight * own.squares(apart - np.einsum("kij,mj->kmi", attitude, points)))


def _is_told(covariance: FloatArray, spurious: FloatArray, most: float) -> bool:
    """Whether an offset of covariance (3, 3) is told by more than spurious information, to at most a variance."""
    values, axes = np.linalg.eigh(covariance)
    root = axes * np.sqrt(np.maximum(values, 0.0))
    return bool(values[-1] < most and np.linalg.eigvalsh(root.T @ spurious @ root)[-1] < TOLD)


def _attitudes(own: Observations, body: Body, origin: FloatArray, variance: float) -> tuple[FloatArray, BoolArray]:
    """The attitudes (n, 3, 3) R_C_S of n frames, by the body's points about the origin (n, 3), and which are known."""
    attitude = best_attitudes(own, body.points, origin)
    squares = _squares(own, attitude, body.points, origin)
    fit = squares.sum(axis=1) < FAR * variance * np.count_nonzero(own.weight > 0, axis=1)
    of_attitude = attitude_covariances(attitude_information(own, attitude, body.points), variance)
    return attitude, fit & (np.linalg.eigvalsh(of_attitude)[:, -1] < KNOWN**2)

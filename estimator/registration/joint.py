"""The joint between two moving bodies, by SCoRE (Ehrig, Taylor, Duda and Heller, J. Biomech. 39, 2006), two-sided.

The centre is at rest in both bodies: R_T_P u + c = R_T_C v + e at all times, T the axes of the tracks, P and C those of
parent and child; (u, v) by least squares. Without a parent the room is the parent: the calibration of a probe's tip.
Skin moves slowly and markers of a segment move together, so the residuals of neighbouring frames are not independent:
the covariance is that of Newey and West (Econometrica 55, 1987), prewhitened (Andrews and Monahan, Econometrica 60,
1992) by a first-order process.
Not covered: a shift of skin that depends on the joint's angle moves the centre itself.
"""

from dataclasses import dataclass

import numpy as np

from baryscope.estimator.geometry.alignment import align
from baryscope.estimator.tracks import BoolArray, FeatureTracks, FloatArray
from baryscope.models.errors import ComputationError, InputError

ROUNDS = 5  # of the mean shape, each from the poses of the last one
LAGS = 10  # of Bartlett's weights on the whitened scores
UNDETERMINED = 1e-10  # of the normal equations' greatest eigenvalue, below which a direction is rounding


@dataclass(frozen=True)
class Joint:
    """A centre of rotation.

    in_parent, in_child (3,), m: from the centroid of the markers, in the axes of the body in the first common frame;
    without a parent in_parent is in the tracks' axes. covariance (6, 6), m², of both. time (n,), s, and position
    (n, 3), m, in the tracks' axes: the mean of the two sides. residual (n, 3), m: their difference. correlation_time
    in s; effective_frames: how many independent frames weigh as much. ratio: of the least to the greatest singular
    value of the motion, near 0 for a hinge, whose centre is free along its axis. axis (3,), in the child's axes: that
    direction. child_markers (m, 3), m: their mean shape, in the child's axes.
    """

    time: FloatArray
    in_parent: FloatArray
    in_child: FloatArray
    covariance: FloatArray
    position: FloatArray
    residual: FloatArray
    correlation_time: float
    effective_frames: float
    ratio: float
    axis: FloatArray
    child_markers: FloatArray


def joint(parent: FeatureTracks | None, child: FeatureTracks) -> Joint:
    """The centre of rotation between parent and child, or between the room and the child.

    Frames in which a body shows fewer than three markers are left out.

    Raises:
        InputError: the times differ, or too few frames show three markers of each body.
        ComputationError: the bodies do not turn against each other.
    """
    if parent is not None and not np.array_equal(parent.time, child.time):
        raise InputError("parent and child have different times, expected tracks of one recording")
    both = child.seen.sum(axis=1) >= 3
    if parent is not None:
        both &= parent.seen.sum(axis=1) >= 3
    n = int(both.sum())
    if n < 4:
        raise InputError(f"{n} frames show three markers of each body, expected at least 4")
    R_T_C, e, markers = _poses(child, both)
    R_T_P, c = np.broadcast_to(np.eye(3), (n, 3, 3)), np.zeros((n, 3))
    if parent is not None:
        R_T_P, c, _ = _poses(parent, both)
    design = np.concatenate([R_T_P, -R_T_C], axis=2)
    normal = np.einsum("kij,kil->jl", design, design)
    values, vectors = np.linalg.eigh(normal)
    if values[0] < UNDETERMINED * values[-1]:
        raise ComputationError("parent and child turn about one axis or not at all: no single centre is determined")
    inverse = (vectors / values) @ vectors.T
    found = inverse @ np.einsum("kij,ki->j", design, e - c)
    residual = design @ found - (e - c)
    frames = _frames_per_independent_one(residual)
    scores = np.einsum("kij,ki->kj", design, residual)
    memory = (frames - 1) / (frames + 1)  # of a first-order process with that integrated autocorrelation
    innovation = (scores[1:] - memory * scores[:-1]) / (1 - memory)
    meat = innovation.T @ innovation
    for lag in range(1, LAGS):
        product = innovation[lag:].T @ innovation[:-lag]
        meat += (1 - lag / LAGS) * (product + product.T)
    independent = n / frames
    freedom = 3 * independent / max(3 * independent - 6, 1.0)
    u, v = found[:3], found[3:]
    time = child.time[both]
    return Joint(
        time=time,
        in_parent=u,
        in_child=v,
        covariance=freedom * inverse @ meat @ inverse,
        position=(R_T_P @ u + c + R_T_C @ v + e) / 2,
        residual=residual,
        correlation_time=frames * float(np.median(np.diff(time))),
        effective_frames=independent,
        ratio=float(np.sqrt(values[0] / values[-1])),
        axis=vectors[3:, 0] / np.linalg.norm(vectors[3:, 0]),
        child_markers=markers,
    )


def _poses(tracks: FeatureTracks, chosen: BoolArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """R_T_B (k, 3, 3), the centroid of the markers' mean shape (k, 3), m, and that shape (m, 3), in B."""
    position, weights = tracks.position[chosen], tracks.seen[chosen].astype(np.float64)
    complete = np.nonzero(weights.all(axis=1))[0]
    if not complete.size:
        raise InputError(f"no frame shows all of {', '.join(tracks.labels)}, expected one at least")
    shape = position[complete[0]]
    for _ in range(ROUNDS):
        shape = shape - shape.mean(axis=0)
        pose = align(position, shape, weights)
        if not (pose.spread > 0).all():
            raise ComputationError(f"markers {', '.join(tracks.labels)} are in one line: no attitude")
        local = np.einsum("kji,kmj->kmi", pose.rotation, np.nan_to_num(position) - pose.translation[:, None])
        shape = np.einsum("km,kmi->mi", weights, local) / weights.sum(axis=0)[:, None]
    shape = shape - shape.mean(axis=0)
    pose = align(position, shape, weights)
    return pose.rotation, pose.translation, shape


def _frames_per_independent_one(residual: FloatArray) -> float:
    """The integrated autocorrelation 1 + 2 Σ ρ, summed to the first lag at which ρ is not positive."""
    total, squares = 1.0, float(np.sum(residual**2))
    for lag in range(1, len(residual) // 2):
        rho = float(np.sum(residual[lag:] * residual[:-lag])) / max(squares, 1e-300)
        if rho <= 0:
            break
        total += 2 * rho
    return total

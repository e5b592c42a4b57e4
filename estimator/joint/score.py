"""The joint between two moving bodies, by SCoRE (Ehrig, Taylor, Duda and Heller, J. Biomech. 39, 2006), two-sided.

The centre is at rest in both bodies: R_T_P u + c = R_T_C v + e at all times, T the axes of the tracks, P and C those of
parent and child; (u, v) by least squares. Without a parent the room is the parent: the calibration of a probe's tip.
Skin moves slowly and markers of a segment move together, so the residuals of neighbouring frames are not independent:
the covariance is that of Newey and West (Econometrica 55, 1987), prewhitened (Andrews and Monahan, Econometrica 60,
1992) by a first-order process.
Noise of the attitudes seems to tell where on a hinge's axis the centre is. That information is taken back (see
`adjustment.spurious`), as if markers moved each by itself by as much as the joint's residuals are.
Not covered: a shift of skin that depends on the joint's angle moves the centre itself.
"""

from dataclasses import dataclass

import numpy as np

from baryscope.estimator.adjustment.normal_equations import attitude_covariances, turn_information
from baryscope.estimator.adjustment.spurious import farthest, spurious_information_columns, three_sigma_factor
from baryscope.estimator.geometry.alignment import align
from baryscope.estimator.geometry.so3 import cross_matrices
from baryscope.estimator.tracks import BoolArray, FeatureTracks, FloatArray
from baryscope.models.errors import ComputationError, InputError

ROUNDS = 5  # of the mean shape, each from the poses of the last one
LAGS = 10  # of Bartlett's weights on the whitened scores
UNDETERMINED = 1e-10  # of the normal equations' greatest eigenvalue, below which a direction is rounding


@dataclass(frozen=True)
class Joint:
    """A centre of rotation.

    Attributes:
        time: (n,), s, of the frames that show both bodies.
        in_parent, in_child: (3,), m, from the markers' centroid, in the axes that the body has in the first common
            frame which shows all of its markers; without a parent in_parent is in the tracks' axes.
        covariance: (6, 6), m², of both.
        position: (n, 3), m, in the tracks' axes: the mean of the two sides.
        residual: (n, 3), m: the difference of the two sides.
        correlation_time: of the residuals, s.
        effective_frames: how many independent frames weigh as much.
        ratio: of the least to the greatest singular value of the motion.
        hinge: whether the bodies turn about one axis as far as the noise lets tell. The centre is then free along it,
            and the covariance there that of three radii of the markers.
        axis: (3,), in the child's axes: the direction in which the centre is least certain, that of a hinge.
        parent_rms, child_rms: (m,), m, of each marker from the rigid body, per coordinate.
        child_markers: (m, 3), m: their mean shape, in the child's axes.
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
    hinge: bool
    axis: FloatArray
    parent_rms: FloatArray
    child_rms: FloatArray
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
    moving = _body(child, both)
    ground = None if parent is None else _body(parent, both)
    R_T_C, e = moving.rotation, moving.place
    R_T_P, c = np.broadcast_to(np.eye(3), (n, 3, 3)), np.zeros((n, 3))
    if ground is not None:
        R_T_P, c = ground.rotation, ground.place
    design = np.concatenate([R_T_P, -R_T_C], axis=2)
    normal = np.einsum("kij,kil->jl", design, design)
    values, vectors = np.linalg.eigh(normal)
    if values[0] < UNDETERMINED * values[-1]:
        raise ComputationError("parent and child turn about one axis or not at all: no single centre is determined")
    inverse = (vectors / values) @ vectors.T
    found = inverse @ np.einsum("kij,ki->j", design, e - c)
    residual = design @ found - (e - c)
    frames = _frames_per_independent_one(residual)
    independent = n / frames
    spurious = three_sigma_factor(max(int(independent), 1)) * _spurious(ground, moving, residual)
    variance = float(np.mean(residual**2)) * frames
    reach = farthest(moving.markers)
    free, _ = spurious_information_columns(inverse, np.zeros((6, 0)), spurious, variance / reach**2)
    scores = np.einsum("kij,ki->kj", design, residual)
    memory = (frames - 1) / (frames + 1)  # of a first-order process with that integrated autocorrelation
    innovation = (scores[1:] - memory * scores[:-1]) / (1 - memory)
    meat = innovation.T @ innovation
    for lag in range(1, LAGS):
        product = innovation[lag:].T @ innovation[:-lag]
        meat += (1 - lag / LAGS) * (product + product.T)
    freedom = 3 * independent / max(3 * independent - 6, 1.0)
    u, v = found[:3], found[3:]
    time, weakest = child.time[both], vectors[:, 0]
    return Joint(
        time=time,
        in_parent=u,
        in_child=v,
        covariance=freedom * (inverse @ meat @ inverse + variance * free @ free.T),
        position=(R_T_P @ u + c + R_T_C @ v + e) / 2,
        residual=residual,
        correlation_time=frames * float(np.median(np.diff(time))),
        effective_frames=independent,
        ratio=float(np.sqrt(values[0] / values[-1])),
        hinge=bool(values[0] <= weakest @ spurious @ weakest),
        axis=weakest[3:] / np.linalg.norm(weakest[3:]),
        parent_rms=np.zeros(0) if ground is None else ground.rms,
        child_rms=moving.rms,
        child_markers=moving.markers,
    )


@dataclass(frozen=True, eq=False)
class _Body:
    """rotation R_T_B (k, 3, 3); place (k, 3), m, of the centroid of the mean shape; markers (m, 3), m, that shape in B;
    rms (m,), m, of their residuals per coordinate; weights (k, m), 1 where a marker is seen."""

    rotation: FloatArray
    place: FloatArray
    markers: FloatArray
    rms: FloatArray
    weights: FloatArray


def _body(tracks: FeatureTracks, chosen: BoolArray) -> _Body:
    """The rigid body of the markers in the chosen frames."""
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
    left = position - shape @ np.swapaxes(pose.rotation, 1, 2) - pose.translation[:, None]
    rms = np.sqrt(np.nanmean(left**2, axis=(0, 2)))
    return _Body(pose.rotation, pose.translation, shape, rms, weights)


def _spurious(parent: _Body | None, child: _Body, residual: FloatArray) -> FloatArray:
    """The information on (u, v), (6, 6), that the noise φ of attitudes seems to give: E [φ]×ᵀ [φ]× = tr C − C."""
    found = np.zeros((6, 6))
    bodies = [(slice(3, 6), child)] if parent is None else [(slice(0, 3), parent), (slice(3, 6), child)]
    for own, body in bodies:
        # The joint's residual is of the centroids of all bodies; as one of a marker by itself it is larger.
        of_markers = np.mean(residual**2) * body.weights.sum(axis=1).mean() / len(bodies)
        information = turn_information(body.weights, cross_matrices(body.markers))
        of_turn = attitude_covariances(information, float(max(of_markers, np.mean(body.rms**2)))).sum(axis=0)
        found[own, own] = np.trace(of_turn) * np.eye(3) - of_turn
    return found


def _frames_per_independent_one(residual: FloatArray) -> float:
    """The integrated autocorrelation 1 + 2 Σ ρ, summed to the first lag at which ρ is not positive."""
    total, squares = 1.0, float(np.sum(residual**2))
    for lag in range(1, len(residual) // 2):
        rho = float(np.sum(residual[lag:] * residual[:-lag])) / max(squares, 1e-300)
        if rho <= 0:
            break
        total += 2 * rho
    return total

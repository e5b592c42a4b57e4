"""Two bodies as rigid ones: their poses in the frames that show both, and what noise of the poses seems to tell."""

from dataclasses import dataclass

import numpy as np

from baryscope.estimator.adjustment.normal_equations import attitude_covariances, turn_information
from baryscope.estimator.geometry.alignment import align
from baryscope.estimator.geometry.extent import rms_radius
from baryscope.estimator.geometry.so3 import cross_matrices
from baryscope.estimator.tracks import BoolArray, FeatureTracks, FloatArray
from baryscope.models.errors import ComputationError, InputError, Reason
from baryscope.models.words import counted

ROUNDS = 5  # of the mean shape, each from the poses of the last one


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid body in k frames.

    rotation R_T_B (k, 3, 3); place (k, 3), m, of the centroid of the mean shape; markers (m, 3), m, that shape in B;
    residual (k, m, 3), m, in T, of each marker from it, NaN where not seen; rms (m,), m, of them per coordinate;
    weights (k, m), 1 where a marker is seen.
    """

    rotation: FloatArray
    place: FloatArray
    markers: FloatArray
    residual: FloatArray
    rms: FloatArray
    weights: FloatArray

    @classmethod
    def of(cls, tracks: FeatureTracks, chosen: BoolArray) -> "Body":
        """The rigid body of the markers in the chosen frames.

        Raises:
            ComputationError: no frame shows all markers, or they are in one line.
        """
        position, weights = tracks.position[chosen], tracks.seen[chosen].astype(np.float64)
        complete = np.nonzero(weights.all(axis=1))[0]
        if not complete.size:
            raise ComputationError(
                f"no frame shows all of {', '.join(tracks.labels)}, expected one at least", Reason.TOO_FEW_FRAMES
            )
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
        return cls(pose.rotation, pose.translation, shape, left, rms, weights)

    def attitude_noise(self, variance: float) -> FloatArray:
        """The covariances (k, 3, 3), rad², of the attitudes in B, for markers with so much noise per coordinate, m²."""
        return attitude_covariances(turn_information(self.weights, cross_matrices(self.markers)), variance)

    @property
    def radius(self) -> float:
        """The rms distance of the markers from their centroid, m."""
        return rms_radius(self.markers)

    @property
    def own_variance(self) -> float:
        """That of markers which move each by itself, m² per coordinate: six of their coordinates go into a pose."""
        seen = float(self.weights.sum(axis=1).mean())
        return float(np.mean(self.rms**2)) * seen / (seen - 2)


@dataclass(frozen=True, eq=False)
class Pair:
    """Parent (None: the room) and child, and the times (k,), s, of the frames that show both."""

    time: FloatArray
    parent: Body | None
    child: Body

    @classmethod
    def of(cls, parent: FeatureTracks | None, child: FeatureTracks) -> "Pair":
        """The bodies of two recordings. Frames in which one shows fewer than three markers are left out.

        Raises:
            InputError: the times differ.
            ComputationError: too few frames show three markers of each body, or the markers of one are in one line.
        """
        if parent is not None and not np.array_equal(parent.time, child.time):
            raise InputError("parent and child have different times, expected tracks of one recording")
        both = child.seen.sum(axis=1) >= 3
        if parent is not None:
            both &= parent.seen.sum(axis=1) >= 3
        n = int(both.sum())
        if n < 4:
            shown = counted(n, "frame shows", "frames show")
            raise ComputationError(f"{shown} three markers of each body, expected at least 4", Reason.TOO_FEW_FRAMES)
        return cls(child.time[both], None if parent is None else Body.of(parent, both), Body.of(child, both))

    @property
    def parent_pose(self) -> tuple[FloatArray, FloatArray]:
        """R_T_P (k, 3, 3), and the centroid (k, 3), m, in T."""
        n = len(self.time)
        if self.parent is None:
            return np.broadcast_to(np.eye(3), (n, 3, 3)), np.zeros((n, 3))
        return self.parent.rotation, self.parent.place

    @property
    def relative(self) -> FloatArray:
        """R_P_C (k, 3, 3)."""
        return np.asarray(np.swapaxes(self.parent_pose[0], 1, 2) @ self.child.rotation)

    @property
    def equations(self) -> tuple[FloatArray, FloatArray]:
        """A (k, 3, 6) and b (k, 3) of R_T_P u + c = R_T_C v + e, written A (u, v) = b, in T."""
        R_T_P, c = self.parent_pose
        return np.concatenate([R_T_P, -self.child.rotation], axis=2), self.child.place - c

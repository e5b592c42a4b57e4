"""Two bodies as rigid ones: their poses in the frames that show both, and what noise of the poses seems to tell."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from baryscope.estimator.adjustment.normal_equations import attitude_covariances, turn_information
from baryscope.estimator.geometry.alignment import FEWEST_POINTS, align
from baryscope.estimator.geometry.extent import rms_radius
from baryscope.estimator.geometry.so3 import cross_matrices
from baryscope.estimator.registration.flips import steady
from baryscope.estimator.registration.screening import screen
from baryscope.estimator.tracks import BoolArray, FeatureTracks, FloatArray
from baryscope.models.errors import ComputationError, InputError, Reason
from baryscope.models.words import counted

ROUNDS = 5  # of the mean shape, each from the poses of the last one
LEAST_FRAMES = 4  # that show both bodies
REPEATS = 5  # of the bodies, each without the frames that are off the last one
LARGEST_SLIDE = 0.3  # rms of a coordinate of what slides in a joint, at most, in the markers' radius
NOISY = 6.0  # times the median of the residuals' lengths, which noise alone does not exceed
TURNED = 0.5  # rad, by which attitudes are wrong at most, of bodies that are not turned over
SOFT = 0.2  # of the markers' distances, by which skin changes one at most: what is beyond is another marker, or none


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid body in k frames.

    rotation R_T_B (k, 3, 3); place (k, 3), m, of the centroid of the mean shape; markers (m, 3), m, that shape in B;
    residual (k, m, 3), m, in T, of each marker from it, NaN where not seen; rms (m,), m, of them per coordinate;
    weights (k, m), 1 where a marker is seen; left_out (n, m): where one is seen in the n frames of the recording,
    but off the body, as where labels are swapped.
    """

    rotation: FloatArray
    place: FloatArray
    markers: FloatArray
    residual: FloatArray
    rms: FloatArray
    weights: FloatArray
    left_out: BoolArray

    @classmethod
    def of(cls, tracks: FeatureTracks, used: BoolArray, chosen: BoolArray) -> "Body":
        """The rigid body of the markers in the chosen frames (n,), from the observations that are used (n, m).

        Raises:
            ComputationError: no frame shows all markers, or they are in one line.
        """
        position = np.where(used[chosen, :, None], tracks.position[chosen], np.nan)
        weights = used[chosen].astype(np.float64)
        complete = np.nonzero(weights.all(axis=1))[0]
        if not complete.size:
            raise ComputationError(_never_together(tracks, used), Reason.TOO_FEW_FRAMES)
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
        return cls(pose.rotation, pose.translation, shape, left, rms, weights, tracks.seen & ~used)

    def attitude_noise(self, variance: float) -> FloatArray:
        """The covariances (k, 3, 3), rad², of the attitudes in B, for markers with so much noise per coordinate, m²."""
        return attitude_covariances(turn_information(self.weights, cross_matrices(self.markers)), variance)

    def astray(self, time: FloatArray) -> BoolArray:
        """In which frames (k,) at times (k,), s, a marker is off the body, or the body off its rotation: where two
        swapped labels are nearly a mirror image, all distances fit.
        """
        m = len(self.markers)
        length = np.linalg.norm(self.residual, axis=2)
        soft = SOFT * self.radius * np.sqrt(2 * m / (m - 1))  # the root is that of the markers' rms distance
        far = np.nan_to_num(length).max(axis=1) > max(soft, NOISY * float(np.nanmedian(length)))
        return np.asarray(far | ~steady(time / np.median(np.diff(time)), self.rotation))

    @property
    def radius(self) -> float:
        """The rms distance of the markers from their centroid, m."""
        return rms_radius(self.markers)

    @property
    def own_variance(self) -> float:
        """The variance of markers that move each by itself, m² per coordinate: six coordinates go into a pose."""
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
        """The bodies of two recordings, without markers in frames in which they are off their body, as where labels are
        swapped, and without frames in which a body shows fewer than three others, or the joint is torn apart.

        Raises:
            InputError: the times differ.
            ComputationError: too few frames show three markers of each body, or the markers of one are in one line.
        """
        if parent is not None and not np.array_equal(parent.time, child.time):
            raise InputError("parent and child have different times, expected tracks of one recording")
        recordings = [child] if parent is None else [child, parent]
        used = [screen(one.position, one.seen, soft=SOFT) for one in recordings]
        for _ in range(REPEATS):
            both = np.all([own.sum(axis=1) >= FEWEST_POINTS for own in used], axis=0)
            _refuse_few(recordings, both)
            bodies = [Body.of(one, own, both) for one, own in zip(recordings, used, strict=True)]
            pair = cls(child.time[both], None if parent is None else bodies[1], bodies[0])
            astray = [body.astray(pair.time) for body in bodies]
            if not np.any(astray):
                astray = [pair.apart()] * len(bodies)  # which of them is turned over, nothing tells
            if not np.any(astray):
                break
            for own, wrong in zip(used, astray, strict=True):
                own[np.flatnonzero(both)[wrong]] = False
        return pair

    def apart(self) -> BoolArray:
        """In which frames (k,) the two sides are farther apart than by any slide or wrong attitude: a body is turned
        over there, as by swapped labels in a few frames between gaps, which no frames nearby tell.
        """
        design, wanted = self.equations
        found = np.linalg.lstsq(design.reshape(-1, 6), wanted.ravel(), rcond=None)[0]
        length = np.linalg.norm(design @ found - wanted, axis=1)
        lever = max(np.linalg.norm(found[3:]), 0.0 if self.parent is None else np.linalg.norm(found[:3]))
        largest = max(np.sqrt(3) * LARGEST_SLIDE * self.child.radius, TURNED * lever, NOISY * np.median(length))
        return np.asarray(length > largest)

    @property
    def parent_pose(self) -> tuple[FloatArray, FloatArray]:
        """R_T_P (k, 3, 3), and the centroid (k, 3), m, in T."""
        n = len(self.time)
        if self.parent is None:
            return np.broadcast_to(np.eye(3), (n, 3, 3)), np.zeros((n, 3))
        return self.parent.rotation, self.parent.place

    @cached_property
    def relative(self) -> FloatArray:
        """R_P_C (k, 3, 3)."""
        return np.asarray(np.swapaxes(self.parent_pose[0], 1, 2) @ self.child.rotation)

    @property
    def equations(self) -> tuple[FloatArray, FloatArray]:
        """A (k, 3, 6) and b (k, 3) of R_T_P u + c = R_T_C v + e, written A (u, v) = b, in T."""
        R_T_P, c = self.parent_pose
        return np.concatenate([R_T_P, -self.child.rotation], axis=2), self.child.place - c


def _refuse_few(recordings: list[FeatureTracks], both: BoolArray) -> None:
    """Check that enough frames (n,) show three markers of each body on it.

    Raises:
        ComputationError: they don't.
    """
    n = int(both.sum())
    if n >= LEAST_FRAMES:
        return
    seen = int(np.all([one.seen.sum(axis=1) >= FEWEST_POINTS for one in recordings], axis=0).sum())
    shown = counted(n, "frame shows", "frames show")
    off = "" if seen < LEAST_FRAMES else f" that keep their distances ({seen} show three: labels may be swapped)"
    raise ComputationError(
        f"{shown} three markers of each body{off}, expected at least {LEAST_FRAMES}", Reason.TOO_FEW_FRAMES
    )


def _never_together(tracks: FeatureTracks, used: BoolArray) -> str:
    """Why no frame shows all markers of a body."""
    names = ", ".join(tracks.labels)
    hidden = [tracks.labels[index] for index in np.flatnonzero(tracks.seen.sum(axis=0) == 0)]
    if hidden:
        verb = "is" if len(hidden) == 1 else "are"
        return f"{', '.join(hidden)} {verb} never seen, expected a frame that shows all of {names}"
    if not tracks.seen.all(axis=1).any():
        return f"no frame shows all of {names}, expected one at least"
    off = np.argmax((tracks.seen & ~used).sum(axis=0))
    return f"no frame shows all of {names} as one rigid body: {tracks.labels[off]} is off it most often"

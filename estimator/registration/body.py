"""A rigid body: features that are seen together, their points in body axes, and the attitude in every frame."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.geometry.gauge import offset_by_points, turn_by_points
from baryscope.estimator.geometry.indices import Index, block_of
from baryscope.estimator.geometry.so3 import cross_matrices
from baryscope.estimator.registration.intervals import Interval

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Body:
    """Features that are seen together: one rigid body with its own axes S.

    features (m,) and frames (n,): indices into the tracks; points (m, 3) in S, m; attitude (n, 3, 3) R_C_S;
    intervals: those in which the body is seen; in_line: whether the features are in a line, by which they have no
    attitude: how they are turned about it follows from where the centre of mass is.
    """

    features: IntArray
    frames: IntArray
    points: FloatArray
    attitude: FloatArray
    intervals: tuple[Interval, ...] = ()
    in_line: bool = False

    def like(self, other: "Body") -> "Body":
        """The body with those features that another has, too."""
        return self.of_features(np.isin(self.features, other.features))

    def of_features(self, some: BoolArray) -> "Body":
        """The body with some (m,) of its features."""
        return replace(self, features=self.features[some], points=self.points[some])

    def in_frames(self, some: BoolArray | slice) -> "Body":
        """The body with some (n,) of its frames."""
        return replace(self, frames=self.frames[some], attitude=self.attitude[some])

    def places(self, origin: FloatArray) -> FloatArray:
        """Where its features are in its frames, (n, m, 3) in C, m; origin (all frames, 3) in C: of its points."""
        turned = self.attitude.reshape(-1, 3) @ self.points.T  # of all frames in one multiplication
        found = turned.reshape(len(self.frames), 3, len(self.points)).swapaxes(1, 2)
        found += origin[self.frames][:, None]
        return found

    @cached_property
    def block(self) -> tuple[Index, Index]:
        """The index of its features in its frames in arrays (all frames, all features, ...), see `block_of`."""
        return block_of(self.frames, self.features)

    @cached_property
    def offset_by_points(self) -> FloatArray:
        """The Jacobian (3, 3 m) of the points' centroid by the points, in axes attached to them."""
        return offset_by_points(self.points)

    def moved(self, change: FloatArray, told: BoolArray | slice = slice(None)) -> "Body":
        """The body with its points changed by (3 m,) in m, less the rotation of the axes attached to the points.

        told (m,): to which of them, all unless given. One that nothing tells may move by more than the body is long: a
        rotation by as much, which is linear in the change, would distort the others.
        """
        moves = change.reshape(-1, 3)
        turn = turn_by_points(self.points[told]) @ moves[told].ravel()
        return replace(self, points=self.points + moves - self.points @ cross_matrices(turn[None])[0].T)


def places_of(bodies: Sequence[Body], origin: FloatArray, otherwise: FloatArray) -> FloatArray:
    """The positions (n, m, 3) in C, m, of features of bodies with points from an origin (n, 3) in C; where no body has
    the feature, those otherwise (n, m, 3).
    """
    places = otherwise.copy()
    for body in bodies:
        places[body.block] = body.places(origin)
    return places

"""The model of a tumbling body on a path at the frames, and of the movements of whole frames that it does not tell."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.camera.shared import SharedErrors
from baryscope.estimator.dynamics.rotation import Attitudes
from baryscope.estimator.geometry.so3 import cross_matrices, exp_rotation
from baryscope.estimator.ml.jacobians import Knots
from baryscope.estimator.paths.sampled_path import SampledPath

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FrameNoise:
    """Movements of all points of a frame together, independent from frame to frame: their covariances in C.

    turn (n, 3, 3): of a rotation about the origin of C, rad², as by the camera's attitude; shift (n, 3, 3): of a
    translation, m². For weights that are inverse variances; other weights scale both by the variance of weight 1.
    """

    turn: FloatArray
    shift: FloatArray

    @classmethod
    def of(cls, errors: SharedErrors | None, slip: float, frames: int, variance: float) -> "FrameNoise | None":
        """The noise of a camera's attitude, and of a position that slips, for a variance of an observation of weight 1.

        None where there is neither. slip: standard deviation of the position's white noise, m.
        """
        noisy = errors is not None and errors.noisy
        if not noisy and slip == 0:
            return None
        shift = np.tile(slip**2 / variance * np.eye(3), (frames, 1, 1))
        if errors is None or not noisy:
            return cls(np.zeros_like(shift), shift)
        return cls(errors.turn_covariance() / variance, shift)

    def movements(self, block: FloatArray, rhs: FloatArray, attitude: FloatArray, origin: FloatArray) -> FloatArray:
        """The likeliest movements ν = (C⁻¹ + B)⁻¹ r (n, 6) in B, φ before τ, for blocks B (n, 6, 6) and r (n, 6)."""
        return np.asarray(np.einsum("kij,kj->ki", self.gain(block, attitude, origin), rhs))

    @staticmethod
    def carried(movements: FloatArray, attitude: FloatArray, points: FloatArray) -> FloatArray:
        """What movements (n, 6) in B do to points (m, 3) in B, (n, m, 3) in C, m."""
        arms = np.cross(movements[:, None, :3], points) + movements[:, None, 3:]
        return np.asarray(arms @ np.swapaxes(attitude, 1, 2))

    def gain(self, block: FloatArray, attitude: FloatArray, origin: FloatArray) -> FloatArray:
        """(C⁻¹ + B)⁻¹ (n, 6, 6), for information B, block (n, 6, 6), on the same movements in B; C may be singular."""
        covariance = self._of_poses(attitude, origin)
        found = covariance @ np.linalg.inv(np.eye(6) + block @ covariance)
        return np.asarray((found + np.swapaxes(found, 1, 2)) / 2)

    def _of_poses(self, attitude: FloatArray, origin: FloatArray) -> FloatArray:
        """The covariance (n, 6, 6) as movements (φ, τ) in B, of bodies with attitude (n, 3, 3) at origin (n, 3)."""
        R_B_C = np.swapaxes(attitude, 1, 2)
        by_turn = np.concatenate([R_B_C, -R_B_C @ cross_matrices(origin)], axis=1)
        by_shift = np.concatenate([np.zeros_like(R_B_C), R_B_C], axis=1)
        return np.asarray(
            by_turn @ self.turn @ np.swapaxes(by_turn, 1, 2) + by_shift @ self.shift @ np.swapaxes(by_shift, 1, 2)
        )

    def frames(self, part: slice) -> "FrameNoise":
        """The noise of some frames."""
        return FrameNoise(self.turn[part], self.shift[part])


@dataclass(frozen=True, eq=False)
class Model:
    """Motion, path and frame noise at the frames, and points, at which the equations are linearised.

    motion and path sampled at the frames, the path as it is seen; origin (n, 3): its positions in C, m; points (m, 3)
    in B, m. knots: Jacobians for blocks of frames; None: those of every frame. turned (n, 3): the rotation vectors in C
    by which a camera sees the attitudes turned.
    """

    motion: Attitudes
    path: SampledPath
    origin: FloatArray
    points: FloatArray
    noise: FrameNoise | None = None
    knots: Knots | None = None
    turned: FloatArray | None = None

    @cached_property
    def attitude(self) -> FloatArray:
        """The attitudes (n, 3, 3) as they are seen."""
        R = self.motion.attitude
        return R if self.turned is None else exp_rotation(self.turned) @ R

    @property
    def rotation_size(self) -> int:
        """The number of the rotation's unknowns."""
        return self.motion.size

    @property
    def size(self) -> int:
        """The number of unknowns y."""
        return self.rotation_size + self.path.size

"""The drifting pivot as one linear least-squares problem, for an initial path: c_k = g(t_k; x) + R_k d.

It has one equation for each frame with an attitude. c_k is the origin of the body's axes S in C, d its offset from the
centre of mass in S, g the path.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.normal_equations import normal_blocks, turn_information
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.geometry.so3 import cross_matrices
from baryscope.estimator.geometry.symmetric import symmetric_inverses, symmetric_pseudo_inverse
from baryscope.estimator.hyperparameters.evidence import RIDGE, GaussianLikelihood, conditional, improved
from baryscope.estimator.paths.prior import Prior
from baryscope.estimator.paths.sampled_path import SampledPath
from baryscope.estimator.pivot.offset_prior import a_priori_information
from baryscope.estimator.registration.body import Body
from baryscope.estimator.registration.clusters import Registered

FloatArray = NDArray[np.float64]

ROUNDING = 1e-14  # relative to Σ c²: the rounding error of the difference of two such sums
NOISE_ROUNDS = 4  # of noise and hyperparameters by turns


@dataclass(frozen=True, eq=False)
class Drift:
    """The path's unknowns x (p,) and each body's offset d (3,) in its axes S, m."""

    x: FloatArray
    offsets: tuple[FloatArray, ...]


@dataclass(frozen=True, eq=False)
class DriftEquations:
    """The normal equations of c_k = g + R_k d: matrix (3 k + p, 3 k + p) and rhs for the k bodies' offsets and then x.

    total: the weighted Σ c_k², m²; values: the number of coordinates of all c_k; offsets: 3 k; noise: standard
    deviation of a coordinate of weight 1.
    """

    matrix: FloatArray
    rhs: FloatArray
    total: float
    values: int
    offsets: int
    noise: float

    def solved(self, prior: Prior) -> Drift:
        """Least squares, or, with a prior of x, the posterior mean for likeliest hyperparameters and noise."""
        matrix, rhs, d = self.matrix, self.rhs, self.offsets
        if prior.free.all():
            found = symmetric_pseudo_inverse(matrix) @ rhs
            return Drift(found[d:], tuple(found[:d].reshape(-1, 3)))
        information, right, inverse = self._without_offsets
        least, total = ROUNDING * self.total, self.total - float(rhs[:d] @ inverse @ rhs[:d])
        variance, x, theta = max(self.noise**2, least), np.zeros(len(right)), None
        for _ in range(NOISE_ROUNDS):
            linear = GaussianLikelihood(information / variance, right / variance, np.zeros_like(x))
            theta = improved(linear, prior, theta)
            x, covariance = conditional(linear, prior, theta)
            left = self.values - d - float(np.vdot(linear.information, covariance))
            squares = total - 2 * float(right @ x) + float(x @ information @ x)
            variance = max(squares / max(left, 1.0), least)
        offsets = inverse @ (rhs[:d] - matrix[:d, d:] @ x)
        return Drift(x, tuple(offsets.reshape(-1, 3)))

    def of_path(self, variance: float, x: FloatArray) -> GaussianLikelihood:
        """What they tell of the path's unknowns alone, about x (p,), for a variance of a coordinate of weight 1."""
        information, right, _ = self._without_offsets
        return GaussianLikelihood(information / variance, (right - information @ x) / variance, x)

    @cached_property
    def _without_offsets(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The equations (p, p) and (p,) of x, with the offsets eliminated, and the inverse (3 k, 3 k) of theirs."""
        matrix, rhs, d = self.matrix, self.rhs, self.offsets
        inverse = symmetric_pseudo_inverse(matrix[:d, :d])
        information = matrix[d:, d:] - matrix[d:, :d] @ inverse @ matrix[:d, d:]
        return information, rhs[d:] - matrix[d:, :d] @ inverse @ rhs[:d], inverse


def drift_equations(registered: Registered, roots: list[FloatArray], path: SampledPath, noise: float) -> DriftEquations:
    """The equations of registered bodies, with the prior of their offsets.

    roots has an array for the frames of each: (n,) or (n, 3, 3) in C, of the inverse covariances of c_k; noise: the
    standard deviation of c_k where that is 1.
    """
    about_zero = noise**2 * a_priori_information(registered.bodies)
    p, d = path.size, 3 * len(registered.bodies)
    matrix, rhs, total, known = np.zeros((d + p, d + p)), np.zeros(d + p), 0.0, path.offset
    for index, (body, origin, root) in enumerate(zip(registered.bodies, registered.origins, roots, strict=True)):
        own = slice(3 * index, 3 * index + 3)
        left = origin - known[body.frames]
        rows = np.concatenate([body.attitude, path.jacobian[body.frames], left[:, :, None]], axis=2)
        scaled = (root[:, None, None] * rows if root.ndim == 1 else root @ rows).reshape(-1, 4 + p)
        outer = scaled.T @ scaled
        matrix[own, own] = outer[:3, :3] + about_zero[index] * np.eye(3)
        matrix[own, d:] += outer[:3, 3:-1]
        matrix[d:, own] += outer[3:-1, :3]
        matrix[d:, d:] += outer[3:-1, 3:-1]
        rhs[own] = outer[:3, -1]
        rhs[d:] += outer[3:-1, -1]
        total += float(outer[-1, -1])
    values = 3 * sum(len(root) for root in roots)
    return DriftEquations(matrix, rhs, total, values, d, noise)


def frame_roots(
    bodies: tuple[Body, ...], observations: Observations, offsets: tuple[FloatArray, ...]
) -> list[FloatArray]:
    """The roots of the inverse covariances of c_k − R_k d for each frame of each body, see `drift_equations`.

    Without precisions, (n,), of the inverse mean variance.
    """
    found = frame_covariances(bodies, observations, offsets)
    if observations.precision is None:
        return [np.sqrt(3 / np.trace(one, axis1=1, axis2=2)) for one in found]
    return [roots_in_C(body.attitude, one) for body, one in zip(bodies, found, strict=True)]


def roots_in_C(attitude: FloatArray, covariance: FloatArray) -> FloatArray:
    """W (n, 3, 3) in C with Wᵀ W the inverse of covariances (n, 3, 3) in S, for attitudes (n, 3, 3) R_C_S."""
    values, along = np.linalg.eigh(covariance)
    values = np.maximum(values, RIDGE * values[:, -1:])  # of far offsets two are lost in the rounding of the third
    return np.swapaxes(attitude @ along / np.sqrt(values)[:, None], 1, 2)


def frame_covariances(
    bodies: tuple[Body, ...], observations: Observations, offsets: tuple[FloatArray, ...]
) -> list[FloatArray]:
    """The covariance (n, 3, 3) of c_k − R_k d in S for each frame of each body.

    It is that of the centroid, 1/n for n points of weight 1, and that of the attitude times the lever arm; with
    precisions, both from the frame's pose.
    """
    if observations.precision is not None:
        return [_of_pose(body, observations, offset) for body, offset in zip(bodies, offsets, strict=True)]
    found = []
    for body, offset in zip(bodies, offsets, strict=True):
        w = observations.weight[body.block]
        arms = cross_matrices(body.points)
        total = np.maximum(w.sum(axis=1), 1e-300)
        centroid = (w @ body.points) / total[:, None]
        # Σ w [b]× [b]×ᵀ about the centroid a: subtract total · (a·a 1 − a aᵀ).
        parallel_axis = (
            np.einsum("ki,ki->k", centroid, centroid)[:, None, None] * np.eye(3)
            - centroid[:, :, None] * centroid[:, None]
        )
        turn = turn_information(w, arms) - total[:, None, None] * parallel_axis
        # c_k is the centroid in C less R_k times the centroid in S: the attitude acts on the sum of both arms.
        lever = cross_matrices(offset + centroid)
        moved = lever @ symmetric_inverses(turn) @ np.swapaxes(lever, 1, 2)
        found.append(np.eye(3) / total[:, None, None] + moved)
    return found


def _of_pose(body: Body, observations: Observations, offset: FloatArray) -> FloatArray:
    """The covariance of c_k − R_k d, τ + d × φ for small changes (φ, τ) of the pose, with precisions."""
    own = observations.frames(body.frames).features(body.features)
    block, _ = normal_blocks(own, body.attitude, np.zeros((len(body.frames), 3)), body.points).of_poses()
    scale = 1 / np.sqrt(np.maximum(np.diagonal(block, axis1=1, axis2=2), 1e-300))
    block = block * scale[:, :, None] * scale[:, None] + RIDGE * np.eye(6)
    covariance = np.linalg.inv(block) * scale[:, :, None] * scale[:, None]
    to = np.concatenate([cross_matrices(offset[None])[0], np.eye(3)], axis=1)
    return np.asarray(to @ covariance @ to.T)

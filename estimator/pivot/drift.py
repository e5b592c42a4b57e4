"""The drifting pivot as one linear least-squares problem, for an initial path: c_k = g(t_k; x) + R_k d.

It has one equation for each frame with an attitude. c_k is the origin of the body's axes S in C, d its offset from the
centre of mass in S, g the path.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.evidence import Linear, conditional, maximise
from baryscope.estimator.adjustment.normal_equations import turn_information
from baryscope.estimator.dynamics.paths import SampledPath
from baryscope.estimator.dynamics.prior import Prior
from baryscope.estimator.geometry.so3 import cross_matrices
from baryscope.estimator.geometry.symmetric import symmetric_inverses, symmetric_pseudo_inverse
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
    deviation of a coordinate from the registration, m.
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
        inverse = symmetric_pseudo_inverse(matrix[:d, :d])
        information = matrix[d:, d:] - matrix[d:, :d] @ inverse @ matrix[:d, d:]
        right = rhs[d:] - matrix[d:, :d] @ inverse @ rhs[:d]
        least, total = ROUNDING * self.total, self.total - float(rhs[:d] @ inverse @ rhs[:d])
        variance, x, theta = max(self.noise**2, least), np.zeros(len(right)), None
        for _ in range(NOISE_ROUNDS):
            linear = Linear(information / variance, right / variance, np.zeros_like(x))
            theta = maximise(linear, prior, theta)
            x, covariance = conditional(linear, prior, theta)
            left = self.values - d - float(np.vdot(linear.information, covariance))
            squares = total - 2 * float(right @ x) + float(x @ information @ x)
            variance = max(squares / max(left, 1.0), least)
        offsets = inverse @ (rhs[:d] - matrix[:d, d:] @ x)
        return Drift(x, tuple(offsets.reshape(-1, 3)))


def drift_equations(registered: Registered, weights: list[FloatArray], path: SampledPath) -> DriftEquations:
    """Those of registered bodies; weights has an array (n,) for the frames of each."""
    p, d = path.size, 3 * len(registered.bodies)
    matrix, rhs, total, known = np.zeros((d + p, d + p)), np.zeros(d + p), 0.0, path.offset
    for index, (body, origin, weight) in enumerate(zip(registered.bodies, registered.origins, weights, strict=True)):
        own = slice(3 * index, 3 * index + 3)
        left = origin - known[body.frames]
        rows = np.concatenate([body.attitude, path.jacobian[body.frames], left[:, :, None]], axis=2)
        scaled = (rows * np.sqrt(weight)[:, None, None]).reshape(-1, 4 + p)
        outer = scaled.T @ scaled
        matrix[own, own] = outer[:3, :3]
        matrix[own, d:] += outer[:3, 3:-1]
        matrix[d:, own] += outer[3:-1, :3]
        matrix[d:, d:] += outer[3:-1, 3:-1]
        rhs[own] = outer[:3, -1]
        rhs[d:] += outer[3:-1, -1]
        total += float(outer[-1, -1])
    values = 3 * sum(len(weight) for weight in weights)
    return DriftEquations(matrix, rhs, total, values, d, registered.noise)


def frame_weights(bodies: tuple[Body, ...], weight: FloatArray, offsets: tuple[FloatArray, ...]) -> list[FloatArray]:
    """A weight for each frame of each body: the inverse mean variance of c_k − R_k d, for weights (n, m)."""
    return [3 / np.trace(found, axis1=1, axis2=2) for found in frame_covariances(bodies, weight, offsets)]


def frame_covariances(
    bodies: tuple[Body, ...], weight: FloatArray, offsets: tuple[FloatArray, ...]
) -> list[FloatArray]:
    """The covariance (n, 3, 3) of c_k − R_k d in S for each frame of each body, for weights (n, m).

    It is that of the centroid, 1/n for n points of weight 1, and that of the attitude times the lever arm.
    """
    found = []
    for body, offset in zip(bodies, offsets, strict=True):
        w = weight[np.ix_(body.frames, body.features)]
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

"""The Kalman filter of `ekf`, forwards and backwards over the linearised system, for several process noises at once.

The filter runs with known parameters θ: its covariances P are those of the process noise alone, and its means are
affine in θ. The frames' likelihoods add up to a quadratic form in θ (de Jong 1991). So θ needs no prior, and a path
without process noise costs no precision. Backwards runs the disturbance smoother (Bryson and Frazier's adjoint).
"""

from dataclasses import dataclass

import numpy as np

from baryscope.estimator.ekf.linearised import Linearised
from baryscope.estimator.tracks import BoolArray, FloatArray

SYMMETRISED = 8  # nodes between two symmetrisations of the covariance
BLOCK = 256  # nodes whose contributions to the cost are added at once


@dataclass(frozen=True, eq=False)
class ProcessNoise:
    """Process noise of k members, in the units of the observations' weights.

    units (n - 1, 2, d, d): covariances of each step's path and rotation for a density of 1; density (k, 2): of both;
    shift (k,): variance of a white noise of the path's position, the same in every coordinate.
    """

    units: FloatArray
    density: FloatArray
    shift: FloatArray

    def of(self, members: slice) -> "ProcessNoise":
        """The noise of some members."""
        return ProcessNoise(self.units, self.density[members], self.shift[members])


@dataclass(frozen=True, eq=False)
class Forward:
    """The result of the filter for k members.

    cost (k, c, c): the quadratic form in (1, θ) of the weighted innovations; rounding (k, c, c): how far it was from
    symmetric, a sample of its rounding errors; log_determinant (k,) of their covariances over those of the
    observations. For the smoother, at each of n nodes, empty if not kept: predicted (n, k, d, c + d), the affine state
    and its covariance P before the update; innovations (n, k, 6, c + d), e and −M G P with M = (Λ⁻¹ + S)⁻¹; precision
    (n, k, 6, 6), M.
    """

    cost: FloatArray
    rounding: FloatArray
    log_determinant: FloatArray
    predicted: FloatArray
    innovations: FloatArray
    precision: FloatArray


@np.errstate(over="ignore", invalid="ignore")  # of a system that has lost the motion
def filtered(system: Linearised, noise: ProcessNoise, keep: bool) -> Forward:
    """Run the filter; keep: what the smoother needs."""
    n, d, c, k = len(system.observed), *system.first.shape, len(noise.density)
    kept = n if keep else 0
    units = noise.units.reshape(n - 1, 2, d * d)
    predicted, innovations = np.empty((kept, k, d, c + d)), np.zeros((kept, k, 6, c + d))
    precision = np.zeros((kept, k, 6, 6))
    cost, log_determinant = np.tile(system.static, (k, 1, 1)), np.zeros(k)
    shift = noise.shift[:, None, None] * np.diag([1.0] * 3 + [0.0] * 3)
    both = np.zeros((k, d, c + d))  # the affine state and the covariance
    both[:, :, :c] = system.first
    for begin in range(0, n, BLOCK):
        size = min(BLOCK, n - begin)
        expected, corrected, whitened = np.zeros((3, k, size, 6, c))
        ratio = np.tile(np.eye(6), (size, k, 1, 1))
        for at in range(size):
            j = begin + at
            if j:
                F = system.transition[j - 1]
                both = F @ both
                both[:, :, : system.drive.shape[2]] += system.drive[j - 1]
                P = both[:, :, c:] @ F.T
                if at % SYMMETRISED == 0:
                    P = 0.5 * (P + P.transpose(0, 2, 1))
                both[:, :, c:] = P + (noise.density @ units[j - 1]).reshape(k, d, d)
            if keep:
                predicted[j] = both
            if not system.seen[j]:
                continue
            G, information = system.observed[j], system.information[j]
            seen = G @ both
            GP = seen[:, :, c:]
            S = GP @ G.T + shift
            ratio[at] += information @ S
            residual = -information @ seen
            residual[:, :, :c] += system.rhs[j]
            innovation = _solved(ratio[at], residual)
            both += GP.transpose(0, 2, 1) @ innovation
            e = innovation[:, :, :c]
            expected[:, at], whitened[:, at] = seen[:, :, :c], e
            corrected[:, at] = S @ e
            if keep:
                innovations[j] = innovation
        corrected += expected
        own = system.rhs[begin : begin + size].reshape(-1, c)
        for member in range(k):
            half = own.T @ corrected[member].reshape(-1, c)
            half += expected[member].reshape(-1, c).T @ whitened[member].reshape(-1, c)
            cost[member] -= half
        log_determinant += np.linalg.slogdet(ratio)[1].sum(axis=0)
        if keep:
            part = slice(begin, begin + size)
            precision[part] = _solved(ratio, np.broadcast_to(system.information[part, None], ratio.shape))
    asymmetry = 0.5 * np.abs(cost - cost.transpose(0, 2, 1))
    return Forward(
        0.5 * (cost + cost.transpose(0, 2, 1)), asymmetry, log_determinant, predicted, innovations, precision
    )


def _solved(matrix: FloatArray, rhs: FloatArray) -> FloatArray:
    """The solutions (..., 6, c) of linear systems (..., 6, 6); NaN for members that have lost the motion."""
    try:
        return np.asarray(np.linalg.solve(matrix, rhs))
    except np.linalg.LinAlgError:
        regular: BoolArray = np.asarray(np.isfinite(matrix).all(axis=(-2, -1)))
        regular[regular] = np.linalg.cond(matrix[regular]) < 1 / np.finfo(float).eps
        found = np.full(rhs.shape, np.nan)
        found[regular] = np.linalg.solve(matrix[regular], rhs[regular])
        return found


@np.errstate(over="ignore", invalid="ignore")
def smoothed(system: Linearised, forward: Forward) -> tuple[FloatArray, FloatArray]:
    """The state (n, k, d, c), affine in θ, and its covariance (n, k, d, d) for known θ, from all observations."""
    n, k, d, width = forward.predicted.shape
    c = width - d
    adjoint = np.empty((n, k, d, width))
    information = forward.precision @ system.observed[:, None]
    both = np.zeros((k, d, width))  # the adjoint of the state, and its covariance
    for j in range(n - 1, -1, -1):
        if j < n - 1:
            F = system.transition[j]
            both = F.T @ both
            both[:, :, c:] = both[:, :, c:] @ F
        if system.seen[j]:
            G, innovation = system.observed[j], forward.innovations[j]
            both[:, :, c:] += both[:, :, c:] @ innovation[:, :, c:].transpose(0, 2, 1) @ G
            inner = innovation[:, :, c:] @ both
            inner[:, :, :c] += innovation[:, :, :c]
            inner[:, :, c:] += information[j]
            both = both + G.T @ inner
        adjoint[j] = both
    P = forward.predicted[..., c:]
    return forward.predicted[..., :c] + P @ adjoint[..., :c], P - P @ adjoint[..., c:] @ P

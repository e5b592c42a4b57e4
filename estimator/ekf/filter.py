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
BLOCK = 256  # nodes whose contributions to the cost are added, and whose smoothed states are found, at once


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
class FilterHistory:
    """What the smoother needs from the filter for k members, at each of n nodes.

    predicted (n, k, d, c + d): the affine state and its covariance P before the update; innovations (n, k, 6, c + d),
    e and −M G P with M = (Λ⁻¹ + S)⁻¹; precision (n, k, 6, 6), M. Zero where nothing is seen.
    """

    predicted: FloatArray
    innovations: FloatArray
    precision: FloatArray

    @classmethod
    def room(cls, system: Linearised, members: int) -> "FilterHistory":
        """Room for that many members."""
        n, d, c = len(system.observed), *system.first.shape
        sizes = ((n, members, d, c + d), (n, members, 6, c + d), (n, members, 6, 6))
        return cls(*(np.zeros(size) for size in sizes))

    def of(self, members: slice) -> "FilterHistory":
        """The room of some members."""
        return FilterHistory(self.predicted[:, members], self.innovations[:, members], self.precision[:, members])


@dataclass(frozen=True, eq=False)
class Forward:
    """The result of the filter for k members.

    cost (k, c, c): the quadratic form in (1, θ) of the weighted innovations; rounding (k, c, c): how far it was from
    symmetric, a sample of its rounding errors; log_determinant (k,) of their covariances over those of the
    observations.
    """

    cost: FloatArray
    rounding: FloatArray
    log_determinant: FloatArray


@np.errstate(over="ignore", invalid="ignore")  # of a system that has lost the motion
def filtered(system: Linearised, noise: ProcessNoise, history: FilterHistory | None = None) -> Forward:
    """Run the filter; history: where what the smoother needs is written, if it is to run."""
    n, d, c, k = len(system.observed), *system.first.shape, len(noise.density)
    units = noise.units.reshape(n - 1, 2, d * d)
    cost, log_determinant = np.tile(system.static, (k, 1, 1)), np.zeros(k)
    shift = noise.shift[:, None, None] * np.diag([1.0] * 3 + [0.0] * 3) if noise.shift.any() else None
    both = np.zeros((k, d, c + d))  # the affine state and the covariance
    both[:, :, :c] = system.first
    for begin in range(0, n, BLOCK):
        part = slice(begin, min(begin + BLOCK, n))
        size = part.stop - begin
        rhs = np.concatenate([system.rhs[part], np.zeros((size, 6, d))], axis=2)
        expected, whitened, S = np.zeros((k, size, 6, c)), np.zeros((k, size, 6, c)), np.zeros((size, k, 6, 6))
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
            if history:
                history.predicted[j] = both
            if not system.seen[j]:
                continue
            G, information = system.observed[j], system.information[j]
            seen = G @ both
            GP = seen[:, :, c:]
            S[at] = GP @ G.T
            if shift is not None:
                S[at] += shift
            ratio[at] += information @ S[at]
            innovation = _inverse(ratio[at]) @ (rhs[at] - information @ seen)
            both += GP.transpose(0, 2, 1) @ innovation
            expected[:, at], whitened[:, at] = seen[:, :, :c], innovation[:, :, :c]
            if history:
                history.innovations[j] = innovation
        corrected = S.transpose(1, 0, 2, 3) @ whitened + expected
        own = system.rhs[part].reshape(-1, c)
        for member in range(k):
            half = own.T @ corrected[member].reshape(-1, c)
            half += expected[member].reshape(-1, c).T @ whitened[member].reshape(-1, c)
            cost[member] -= half
        log_determinant += np.linalg.slogdet(ratio)[1].sum(axis=0)
        if history:
            history.precision[part] = _inverse(ratio) @ system.information[part, None]
    asymmetry = 0.5 * np.abs(cost - cost.transpose(0, 2, 1))
    return Forward(0.5 * (cost + cost.transpose(0, 2, 1)), asymmetry, log_determinant)


def _inverse(matrix: FloatArray) -> FloatArray:
    """The inverses of matrices (..., 6, 6); NaN for members that have lost the motion."""
    try:
        return np.asarray(np.linalg.inv(matrix))
    except np.linalg.LinAlgError:
        regular: BoolArray = np.asarray(np.isfinite(matrix).all(axis=(-2, -1)))
        regular[regular] = np.linalg.cond(matrix[regular]) < 1 / np.finfo(float).eps
        found = np.full(matrix.shape, np.nan)
        found[regular] = np.linalg.inv(matrix[regular])
        return found


@np.errstate(over="ignore", invalid="ignore")
def smoothed(system: Linearised, history: FilterHistory) -> tuple[FloatArray, FloatArray]:
    """The state (n, k, d, c), affine in θ, and its covariance (n, k, d, d) for known θ, from all observations.

    They take the place of the predicted ones: fresh memory for both costs more than finding them.
    """
    n, k, d, width = history.predicted.shape
    c = width - d
    state, covariance = history.predicted[..., :c], history.predicted[..., c:]
    both = np.zeros((k, d, width))  # the adjoint of the state, and its covariance
    for begin in reversed(range(0, n, BLOCK)):
        part = slice(begin, min(begin + BLOCK, n))
        adjoint = np.empty((part.stop - begin, k, d, width))
        information = history.precision[part] @ system.observed[part, None]
        for j in reversed(range(begin, part.stop)):
            if j < n - 1:
                F = system.transition[j]
                both = F.T @ both
                both[:, :, c:] = both[:, :, c:] @ F
            if system.seen[j]:
                G, innovation = system.observed[j], history.innovations[j]
                both[:, :, c:] += both[:, :, c:] @ innovation[:, :, c:].transpose(0, 2, 1) @ G
                inner = innovation[:, :, c:] @ both
                inner[:, :, :c] += innovation[:, :, :c]
                inner[:, :, c:] += information[j - begin]
                both += G.T @ inner
            adjoint[j - begin] = both
        moved = covariance[part] @ adjoint
        state[part] += moved[..., :c]
        covariance[part] -= moved[..., c:] @ covariance[part]
    return state, covariance

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
BLOCK = 32  # nodes whose contributions to the cost are added, and whose smoothed states are found, at once


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
        rhs, drive = _widened(system.rhs[part], c + d), _widened(system.drive[part], c + d)
        added = (noise.density @ units[part]).reshape(-1, k, d, d)
        seen, innovation = np.zeros((k, size, 6, c + d)), np.zeros((k, size, 6, c + d))
        ratio = np.tile(np.eye(6), (size, k, 1, 1))
        for at in range(size):
            j = begin + at
            if history:
                history.predicted[j] = both
            if system.seen[j]:
                G, information = system.observed[j], system.information[j]
                expected = np.matmul(G, both, out=seen[:, at])
                told = information @ expected
                ratio[at] += told[:, :, c:] @ G.T
                if shift is not None:
                    ratio[at] += information @ shift
                whitened = np.matmul(_inverse(ratio[at]), rhs[at] - told, out=innovation[:, at])
                both += expected[:, :, c:].transpose(0, 2, 1) @ whitened
            if j < n - 1:
                F = system.transition[j]
                both = F @ both
                both += drive[at]
                P = both[:, :, c:] @ F.T
                if j % SYMMETRISED == 0:
                    P = 0.5 * (P + P.transpose(0, 2, 1))
                np.add(P, added[at], out=both[:, :, c:])
        S = seen[..., c:] @ system.observed[part].transpose(0, 2, 1)
        if shift is not None:
            S += shift[:, None]
        corrected = S @ innovation[..., :c] + seen[..., :c]
        own = system.rhs[part].reshape(-1, c)
        for member in range(k):
            half = own.T @ corrected[member].reshape(-1, c)
            half += seen[member].reshape(-1, c + d)[:, :c].T @ innovation[member].reshape(-1, c + d)[:, :c]
            cost[member] -= half
        log_determinant += np.linalg.slogdet(ratio)[1].sum(axis=0)
        if history:
            history.innovations[part] = innovation.swapaxes(0, 1)
            history.precision[part] = _inverse(ratio) @ system.information[part, None]
    asymmetry = 0.5 * np.abs(cost - cost.transpose(0, 2, 1))
    return Forward(0.5 * (cost + cost.transpose(0, 2, 1)), asymmetry, log_determinant)


def _widened(columns: FloatArray, width: int) -> FloatArray:
    """Matrices (n, d, width) of the columns (n, d, c) and zeros."""
    found = np.zeros((*columns.shape[:2], width))
    found[:, :, : columns.shape[2]] = columns
    return found


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
        G, innovation, steps = system.observed[part, None], history.innovations[part], system.transition[part, None]
        back = np.eye(d) + G.swapaxes(2, 3) @ innovation[..., c:]
        back[: len(steps)] = back[: len(steps)] @ steps.swapaxes(2, 3)  # from the last node the adjoint is zero
        told = np.concatenate([innovation[..., :c], history.precision[part] @ G], axis=3)
        adjoint = G.swapaxes(2, 3) @ told
        for at in reversed(range(len(adjoint))):
            both = back[at] @ both
            both[:, :, c:] = both[:, :, c:] @ back[at].transpose(0, 2, 1)
            adjoint[at] += both
            both = adjoint[at]
        moved = covariance[part] @ adjoint
        state[part] += moved[..., :c]
        covariance[part] -= moved[..., c:] @ covariance[part]
    return state, covariance

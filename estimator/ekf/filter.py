"""The Kalman filter of `ekf`, forwards and backwards over the linearised system, for several process noises at once.

The filter runs with known parameters θ: its covariances P are those of the process noise alone, and its means are
affine in θ. The frames' likelihoods add up to a quadratic form in θ (de Jong 1991). So θ needs no prior, and a path
without process noise costs no precision. Observations are whitened: nodes that tell of a pose in part, or not at all,
are no exception, and the form is a sum of squares, not a difference of large ones. Backwards runs the disturbance
smoother (Bryson and Frazier's adjoint).
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
    """What the smoother needs from the filter for k members, at each of n nodes, of observations whitened.

    predicted (n, k, d, c + d): the affine state and its covariance P before the update; innovations (n, k, 6, c + d),
    M e and −M H P with their precision M (n, k, 6, 6). Zero where nothing is seen.
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

    cost (k, c, c): the quadratic form in (1, θ) of the weighted innovations; rounding (k, c, c): a sample of its
    rounding errors; log_determinant (k,) of their covariances over those of the observations.
    """

    cost: FloatArray
    rounding: FloatArray
    log_determinant: FloatArray


@np.errstate(over="ignore", invalid="ignore")  # of a system that has lost the motion
def filtered(system: Linearised, noise: ProcessNoise, history: FilterHistory | None = None) -> Forward:
    """Run the filter; history: where what the smoother needs is written, if it is to run.

    The members lie side by side in one matrix, as most of what is done with one is done with all: rows of the state,
    then columns of each member.
    """
    n, d, c, k = len(system.observed), *system.first.shape, len(noise.density)
    width, moved = c + d, system.drive.shape[2]
    white, units = system.whitened, noise.units.reshape(n - 1, 2, d * d)
    H, shift = white.observed, noise.shift[:, None, None] if noise.shift.any() else None
    cost, log_determinant = np.tile(white.left, (k, 1, 1)), np.full(k, system.log_determinant)
    both = np.zeros((d, k, width))  # the affine state and the covariance
    both[:, :, :c] = system.first[:, None]
    blocks = np.empty((2, BLOCK, 6, k, width))  # fresh memory for each would take a tenth longer
    for begin in range(0, n, BLOCK):
        part = slice(begin, min(begin + BLOCK, n))
        size = part.stop - begin
        added = (noise.density @ units[part]).reshape(-1, k, d, d).transpose(0, 2, 1, 3)
        blocks[...] = 0.0
        innovation, weighted = blocks[:, :size]  # e, and M e
        innovation[..., :c] = white.rhs[part, :, None]
        ratio, precision = np.tile(np.eye(6), (size, k, 1, 1)), np.tile(np.eye(6), (size, k, 1, 1))
        for at in range(size):
            j = begin + at
            if history:
                history.predicted[j] = both.transpose(1, 0, 2)
            if system.seen[j]:
                expected = (H[j] @ both.reshape(d, -1)).reshape(6, k, width)
                innovation[at] -= expected
                ratio[at] += (expected[:, :, c:] @ H[j].T).transpose(1, 0, 2)
                if shift is not None:
                    slipping = white.from_pose[j, :, :3]
                    ratio[at] += shift * (slipping @ slipping.T)
                precision[at] = _inverse(ratio[at])
                e, told = innovation[at].transpose(1, 0, 2), weighted[at].transpose(1, 0, 2)
                np.matmul(precision[at], e, out=told)
                both += (expected[:, :, c:].transpose(1, 2, 0) @ told).transpose(1, 0, 2)
            if j < n - 1:
                F = system.transition[j]
                both = (F @ both.reshape(d, -1)).reshape(d, k, width)
                both[:, :, :moved] += system.drive[j][:, None]
                P = both[:, :, c:] @ F.T
                if j % SYMMETRISED == 0:
                    P = 0.5 * (P + P.transpose(2, 1, 0))
                np.add(P, added[at], out=both[:, :, c:])
        e, told = (one.reshape(6 * size, k, width)[:, :, :c] for one in (innovation, weighted))
        cost += e.transpose(1, 2, 0) @ told.transpose(1, 0, 2)
        log_determinant += np.linalg.slogdet(ratio)[1].sum(axis=0)
        if history:
            history.innovations[part] = weighted.transpose(0, 2, 1, 3)
            history.precision[part] = precision
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
        H, innovation, steps = (
            one[part] for one in (system.whitened.observed[:, None], history.innovations, system.transition[:, None])
        )
        back = np.eye(d) + H.swapaxes(2, 3) @ innovation[..., c:]
        back[: len(steps)] = back[: len(steps)] @ steps.swapaxes(2, 3)  # from the last node the adjoint is zero
        told = np.concatenate([innovation[..., :c], history.precision[part] @ H], axis=3)
        adjoint = H.swapaxes(2, 3) @ told
        for at in reversed(range(len(adjoint))):
            both = back[at] @ both
            both[:, :, c:] = both[:, :, c:] @ back[at].transpose(0, 2, 1)
            adjoint[at] += both
            both = adjoint[at]
        moved = covariance[part] @ adjoint
        state[part] += moved[..., :c]
        covariance[part] -= moved[..., c:] @ covariance[part]
    return state, covariance

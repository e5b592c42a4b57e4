"""The noise of a coordinate from the residuals of registrations, without the influence of outliers."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.registration.procrustes import Registration

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

MEDIAN = 2.366  # of χ² with three degrees of freedom, as of a squared residual
MAX_PAIRS = 500  # pairs whose distances are looked at, at most
QUARTILE = 0.6745  # of the standard Gaussian
EFFICIENCY = 0.25  # of the median of the differences of distances: for how many independent values each counts
MIN_DOF = 20.0  # degrees of freedom of the registrations, below which distances tell the noise
GATE = 20.0  # squared residual over the variance that the median tells, beyond which there is an outlier: 1 in 6,000


@dataclass(frozen=True)
class Noise:
    """The standard deviation of a coordinate, m, and of how many values: their degrees of freedom."""

    deviation: float
    values: float


def pooled_noise(registrations: Sequence[Registration], blocks: Sequence[FloatArray]) -> Noise | None:
    """The noise of a coordinate from all registrations of the points (n, m, 3) in `blocks`.

    None if these have too few degrees of freedom. Outliers are found by the median of the squared residuals, each over
    its share of the degrees of freedom.
    """
    squares, shares, values = [], [], []
    for fitted, points in zip(registrations, blocks, strict=True):
        seen = ~np.isnan(points[..., 0])
        count = 3 * int(seen.sum())
        dof = count - 6 * len(points) - 3 * int(seen.any(axis=0).sum()) + 6
        if dof > 0:
            residual = np.nan_to_num(points - fitted.rigid_points)[seen]
            squares.append(np.einsum("ki,ki->k", residual, residual))
            shares.append(np.full(len(residual), dof / count))
            values.append(np.full(len(residual), 3 * dof / count))
    if sum(float(value.sum()) for value in values) < MIN_DOF:
        return None
    square, share, value = np.concatenate(squares), np.concatenate(shares), np.concatenate(values)
    inlier = square <= GATE * max(float(np.median(square / share)) / MEDIAN, 1e-300) * share
    left = float(value[inlier].sum())
    return Noise(float(np.sqrt(square[inlier].sum() / left)), left)


def noise_of_distances(position: FloatArray, used: BoolArray) -> Noise:
    """The noise of a coordinate from the distances of features, which are constant on a body.

    position (n, m, 3) in m; used (n, m). It is the median of a distance's differences from one sighting of its pair to
    the next; 0 if no two features are seen together twice. A body that is no larger than the noise makes it too small,
    by a third or so.
    """
    seen = used.astype(np.float64)
    differences = [np.zeros(0)]
    for first, second in np.argwhere(np.triu(seen.T @ seen, 1) >= 2)[:MAX_PAIRS].tolist():
        rows = used[:, first] & used[:, second]
        distance = np.linalg.norm(position[rows, first] - position[rows, second], axis=1)
        differences.append(np.abs(np.diff(distance)))
    difference = np.concatenate(differences)
    if not len(difference):
        return Noise(0.0, 0.0)
    rigid = int(3 * used.sum() - 6 * (used.sum(axis=1) >= 2).sum())  # values, less the unknowns of the poses
    return Noise(float(np.median(difference)) / QUARTILE / 2, EFFICIENCY * max(min(len(difference), rigid), 0))

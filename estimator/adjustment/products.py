"""Products of errors of the attitude and of the centre of mass, for methods whose attitudes follow from few unknowns.

Where the centre of mass is off by δ in B, an attitude error φ moves all points of a frame by φ × δ. That is of second
order, and no linearised problem knows it. The errors φ that the unknowns make are a few modes over time, so that each
pair of a mode and an axis of δ moves the observations in a known pattern, by a random number of variance 1.
See `spurious.NoisyAttitudes` for attitudes that are free.
"""

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.geometry.symmetric import symmetric_inverses

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

MODES = 8  # of the attitude's errors, at most: rate and inertia have as many
DISTINCT = 1e-10  # of the greatest variance of scaled unknowns: less is rounding
NEGLIGIBLE = 0.1  # rms shift of the frames by products of errors, over the least deviation of the position


def independent(covariance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Combinations of variance 1 of unknowns with a covariance (q, q): columns L (q, k), and L⁻ᵀ.

    The covariance is L Lᵀ, and L⁻ᵀ turns covariances with the unknowns into those with the combinations.
    """
    scale = np.sqrt(np.maximum(np.diag(covariance), np.finfo(float).tiny))
    values, axes = np.linalg.eigh(covariance / np.outer(scale, scale))
    kept = values > DISTINCT * values[-1]
    axes, deviation = axes[:, kept], np.sqrt(values[kept])
    return scale[:, None] * axes * deviation, axes / deviation / scale[:, None]


def are_negligible(turns: FloatArray, offset: FloatArray, position: FloatArray) -> bool:
    """Whether the products of errors are so small that there are no patterns; False where this is not certain.

    Args:
        turns: covariances (n, 3, 3) in B of the attitude errors less their mean, rad².
        offset, position: as in `product_shifts`.
    """
    # E |φ × δ|² = tr Φ tr Δ − tr Φ Δ, and the least eigenvalue is at least 1 / tr P⁻¹.
    moved = np.trace(turns, axis1=1, axis2=2) * np.trace(offset) - np.einsum("kij,ji->k", turns, offset)
    inverse = np.trace(symmetric_inverses(position), axis1=1, axis2=2)
    return bool(inverse.min() > 0 and moved.mean() * inverse.max() <= NEGLIGIBLE**2)


def product_shifts(
    turns: FloatArray, offset: FloatArray, position: FloatArray, seen: BoolArray | slice = slice(None)
) -> FloatArray:
    """The patterns (n, 3, k) in B, m, by which products of errors of one standard deviation move the frames.

    There are none where they are negligible.

    Args:
        turns: (n, 3, r), attitude errors in B, rad, by independent causes of variance 1.
        offset: covariance (3, 3) in B of the offset, m².
        position: covariances (n, 3, 3) of the position, m².
        seen: the frames with observations. The mean of an attitude error over them turns the axes only.
    """
    own = turns - turns[seen].mean(axis=0)
    flat = own[seen].reshape(-1, own.shape[2])
    own = own @ np.linalg.eigh(flat.T @ flat)[1][:, ::-1][:, :MODES]
    values, axes = np.linalg.eigh((offset + offset.T) / 2)
    deviations = axes * np.sqrt(np.maximum(values, 0.0))
    pairs = np.cross(own[:, :, :, None], deviations[None, :, None, :], axis=1).reshape(len(own), 3, -1)
    least = float(np.linalg.eigvalsh(position)[:, 0].min())
    moved = float((pairs[seen] ** 2).sum(axis=(1, 2)).mean())
    return pairs if moved > NEGLIGIBLE**2 * least else pairs[:, :, :0]

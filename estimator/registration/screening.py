"""Screening of outliers before there is any pose: by distances between features.

On a rigid body all distances are constant. An observation is an outlier if its distances to most other features differ
from the typical ones of their pairs.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
LIMIT = 5.0  # standard deviations of a distance that still fits
PARTNERS = 12  # distances examined for each feature, at most
SAMPLE = 1500  # frames of the sample that decides whether all frames are screened, and of a chunk
CHUNK = 8_000_000  # distances in a chunk at most: 200 MB of differences
OUTLIER_SHARE = 0.001  # share of distances in the sample that do not fit, from which all frames are screened
DENSEST_SHARE = 0.25  # share of a pair's distances that its typical distance is computed from
DENSEST_WIDTH = 2 * 0.3186  # standard deviations that the central quarter of a Gaussian spans


def screen(position: FloatArray, seen: BoolArray) -> BoolArray:
    """The inliers (n, m) among positions (n, m, 3) in m: observations whose distances to the others fit.

    seen (n, m). If hardly any distance in a sample of frames is an outlier, all observations are inliers, except those
    of features that do not belong to the body at all.
    """
    n, m = seen.shape
    pairs = _pairs(m)
    rows = np.unique(np.linspace(0, n - 1, min(n, SAMPLE)).astype(int))
    typical, spread = _typical_distances(position[rows], seen[rows], pairs)
    known = np.isfinite(typical)
    seen = seen & ~_not_of_body(typical, spread, pairs, m)
    fitting, compared = 0, 0
    for part in _chunks(len(rows), len(pairs)):
        fits, both = _fits(position[rows[part]], seen[rows[part]], pairs, typical, spread)
        fitting, compared = fitting + int(fits[:, known].sum()), compared + int(both[:, known].sum())
    if not compared or 1 - fitting / compared < OUTLIER_SHARE:
        return seen.copy()
    inliers = np.zeros_like(seen)
    for part in _chunks(n, len(pairs)):
        fits, both = _fits(position[part], seen[part], pairs, typical, spread)
        inliers[part] = seen[part] & _agreeing(fits, both, pairs, m)
    return inliers


def _chunks(frames: int, pairs: int) -> Iterator[slice]:
    """Slices of so many frames with CHUNK distances at most, and SAMPLE frames."""
    size = max(1, min(SAMPLE, CHUNK // max(pairs, 1)))
    return (slice(first, first + size) for first in range(0, frames, size))


def _not_of_body(typical: FloatArray, spread: FloatArray, pairs: NDArray[np.intp], m: int) -> BoolArray:
    """Features (m,) without a constant distance to any other, while others have some: they are not on this body."""
    tried, kept = np.zeros(m, dtype=bool), np.zeros(m, dtype=bool)
    tried[pairs[np.isfinite(spread)].ravel()] = True
    kept[pairs[np.isfinite(typical)].ravel()] = True
    return tried & ~kept if kept.sum() >= 3 else np.zeros(m, dtype=bool)


def _pairs(m: int) -> NDArray[np.intp]:
    """Pairs of features (k, 2): all pairs, or each feature with the next PARTNERS ones if there are many."""
    if m <= 2 * PARTNERS:
        return np.array([(i, j) for i in range(m) for j in range(i + 1, m)], dtype=np.intp).reshape(-1, 2)
    i = np.repeat(np.arange(m), PARTNERS)
    j = (i + np.tile(np.arange(1, PARTNERS + 1), m)) % m
    return np.stack([i, j], axis=1)


def _distances(position: FloatArray, pairs: NDArray[np.intp]) -> FloatArray:
    return np.asarray(np.linalg.norm(position[:, pairs[:, 0]] - position[:, pairs[:, 1]], axis=2))


def _typical_distances(position: FloatArray, seen: BoolArray, pairs: NDArray[np.intp]) -> tuple[FloatArray, FloatArray]:
    """Typical distance of each pair and its standard deviation (k,), in m, from the densest quarter of its values.

    NaN for pairs that are seen together in fewer than eight frames, and for distances that are not constant.
    """
    typical, spread = np.full(len(pairs), np.nan), np.full(len(pairs), np.nan)
    step = max(1, CHUNK // max(len(position), 1))
    for first in range(0, len(pairs), step):
        own = pairs[first : first + step]
        both = seen[:, own[:, 0]] & seen[:, own[:, 1]]
        count = both.sum(axis=0)
        ordered = np.sort(np.where(both, _distances(position, own), np.inf), axis=0)
        for k in np.nonzero(count >= 8)[0]:
            values = ordered[: count[k], k]
            size = max(int(np.ceil(DENSEST_SHARE * count[k])), 4)
            width = values[size - 1 :] - values[: count[k] - size + 1]
            start = int(np.argmin(width))
            typical[first + k] = values[start : start + size].mean()
            spread[first + k] = width[start] / DENSEST_WIDTH
    # All pairs have about the same noise: a pair that is wrong more often than right has a larger spread; not used.
    median = np.nanmedian(spread) if np.isfinite(spread).any() else np.nan
    return np.where(spread < 4 * median + 1e-12, typical, np.nan), np.maximum(spread, median)


def _fits(
    position: FloatArray, seen: BoolArray, pairs: NDArray[np.intp], typical: FloatArray, spread: FloatArray
) -> tuple[BoolArray, BoolArray]:
    both = seen[:, pairs[:, 0]] & seen[:, pairs[:, 1]] & np.isfinite(typical)
    distance = np.where(both, _distances(np.where(seen[..., None], position, 0.0), pairs), 0.0)
    near = np.abs(distance - np.nan_to_num(typical)) <= LIMIT * np.nan_to_num(spread) + 1e-9 * np.nan_to_num(typical)
    return np.asarray(both & near), np.asarray(both)


def _agreeing(fits: BoolArray, both: BoolArray, pairs: NDArray[np.intp], m: int) -> BoolArray:
    """Features (n, m) that remain in each frame when the one with most misfits is removed repeatedly until all fit."""
    n = len(fits)
    left = np.ones((n, m), dtype=bool)
    of_feature = np.repeat(np.arange(len(pairs)), 2), pairs.ravel()
    incidence = sparse.csr_array((np.ones(2 * len(pairs)), of_feature), shape=(len(pairs), m))
    for _ in range(m):
        alive = left[:, pairs[:, 0]] & left[:, pairs[:, 1]]
        misfits = (alive & both & ~fits).astype(np.float64) @ incidence
        share = misfits / np.maximum((alive & both).astype(np.float64) @ incidence, 1)
        worst = np.argmax(share, axis=1)
        wrong = share[np.arange(n), worst] > 0
        if not wrong.any():
            break
        left[wrong, worst[wrong]] = False
    return left

"""Wrong observations, found before there is any pose: by distances between features that do not stay as they are.

On a rigid body all distances are constant. Where a feature's distances to most others are not their usual ones, it is
not that feature.
"""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
LIMIT = 5.0  # deviations of a distance that still fits
PARTNERS = 12  # distances looked at for each feature, at most
SAMPLE = 1500  # frames that tell whether there is anything to look for
SUSPECT = 0.01  # share of distances that do not fit from which on all frames are searched


def screen(position: FloatArray, seen: BoolArray) -> BoolArray:
    """Which observations (n, m) of positions (n, m, 3) to believe at first: those whose distances fit.

    All of them, if in a sample of frames hardly any distance is unusual.
    """
    n, m = seen.shape
    pairs = _pairs(m)
    rows = np.unique(np.linspace(0, n - 1, min(n, SAMPLE)).astype(int))
    usual, spread = _usual(position[rows], seen[rows], pairs)
    known = np.isfinite(usual)
    seen = seen & ~_erratic(usual, spread, pairs, m)
    fits, both = _fits(position[rows], seen[rows], pairs, usual, spread)
    if not both[:, known].any() or 1 - fits[:, known].sum() / max(both[:, known].sum(), 1) < SUSPECT:
        return seen.copy()
    inliers = np.zeros_like(seen)
    for first in range(0, n, SAMPLE):
        part = slice(first, first + SAMPLE)
        fits, both = _fits(position[part], seen[part], pairs, usual, spread)
        inliers[part] = seen[part] & _agreeing(fits, both, pairs, m)
    return inliers


def _erratic(usual: FloatArray, spread: FloatArray, pairs: NDArray[np.intp], m: int) -> BoolArray:
    """Features (m,) that keep no usual distance to any other, while others do: they are not of this body at all."""
    tried, kept = np.zeros(m, dtype=bool), np.zeros(m, dtype=bool)
    tried[pairs[np.isfinite(spread)].ravel()] = True
    kept[pairs[np.isfinite(usual)].ravel()] = True
    return tried & ~kept if kept.sum() >= 3 else np.zeros(m, dtype=bool)


def _pairs(m: int) -> NDArray[np.intp]:
    """Pairs of features (k, 2): all of them, or a ring of the next few for each where there are many."""
    if m <= 2 * PARTNERS:
        return np.array([(i, j) for i in range(m) for j in range(i + 1, m)], dtype=np.intp).reshape(-1, 2)
    i = np.repeat(np.arange(m), PARTNERS)
    j = (i + np.tile(np.arange(1, PARTNERS + 1), m)) % m
    return np.stack([i, j], axis=1)


def _distances(position: FloatArray, pairs: NDArray[np.intp]) -> FloatArray:
    return np.asarray(np.linalg.norm(position[:, pairs[:, 0]] - position[:, pairs[:, 1]], axis=2))


def _usual(position: FloatArray, seen: BoolArray, pairs: NDArray[np.intp]) -> tuple[FloatArray, FloatArray]:
    """The usual distance of each pair and its spread (k,): those of the densest quarter of its values; NaN if never."""
    distance = _distances(position, pairs)
    both = seen[:, pairs[:, 0]] & seen[:, pairs[:, 1]]
    count = both.sum(axis=0)
    ordered = np.sort(np.where(both, distance, np.inf), axis=0)
    usual, spread = np.full(len(pairs), np.nan), np.full(len(pairs), np.nan)
    for k in np.nonzero(count >= 8)[0]:
        values = ordered[: count[k], k]
        size = max(int(np.ceil(0.25 * count[k])), 4)
        width = values[size - 1 :] - values[: count[k] - size + 1]
        start = int(np.argmin(width))
        usual[k] = values[start : start + size].mean()
        # A quarter of a Gaussian's values lies within ±0.319 of its deviations.
        spread[k] = width[start] / (2 * 0.3186)
    # One noise for all: a pair that is wrong more often than right has a spread of its own, and no vote.
    typical = np.nanmedian(spread) if np.isfinite(spread).any() else np.nan
    return np.where(spread < 4 * typical + 1e-12, usual, np.nan), np.maximum(spread, typical)


def _fits(
    position: FloatArray, seen: BoolArray, pairs: NDArray[np.intp], usual: FloatArray, spread: FloatArray
) -> tuple[BoolArray, BoolArray]:
    both = seen[:, pairs[:, 0]] & seen[:, pairs[:, 1]] & np.isfinite(usual)
    distance = np.where(both, _distances(np.where(seen[..., None], position, 0.0), pairs), 0.0)
    near = np.abs(distance - np.nan_to_num(usual)) <= LIMIT * np.nan_to_num(spread) + 1e-9 * np.nan_to_num(usual)
    return np.asarray(both & near), np.asarray(both)


def _agreeing(fits: BoolArray, both: BoolArray, pairs: NDArray[np.intp], m: int) -> BoolArray:
    """Features (n, m) left when, frame by frame, the one that fits the fewest others goes, until all fit."""
    n = len(fits)
    left = np.ones((n, m), dtype=bool)
    first = np.zeros((len(pairs), m))
    first[np.arange(len(pairs)), pairs[:, 0]] = 1
    first[np.arange(len(pairs)), pairs[:, 1]] = 1
    for _ in range(m):
        alive = left[:, pairs[:, 0]] & left[:, pairs[:, 1]]
        misfits = (alive & both & ~fits).astype(np.float64) @ first
        share = misfits / np.maximum((alive & both).astype(np.float64) @ first, 1)
        worst = np.argmax(share, axis=1)
        wrong = share[np.arange(n), worst] > 0
        if not wrong.any():
            break
        left[wrong, worst[wrong]] = False
    return left

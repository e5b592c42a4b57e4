"""Screening of outliers before there is any pose: by distances between features.

On a rigid body all distances are constant. An observation is an outlier if its distances to most other features differ
from the typical ones of their pairs by more than noise does, which may be much greater along the line of sight.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.geometry.evenly import evenly_spaced
from baryscope.estimator.registration.rigid_groups import other_bodies

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
LIMIT = 5.0  # standard deviations of a distance that still fits
PARTNERS = 12  # distances examined for each feature, at most
SAMPLE = 1500  # frames of the sample that decides whether all frames are screened, and of a chunk
CHUNK = 8_000_000  # distances in a chunk at most: 200 MB of differences
WITH_COVARIANCES = 8  # times as much memory for each
OUTLIER_SHARE = 0.001  # share of distances in the sample that do not fit, from which all frames are screened
DENSEST_SHARE = 0.25  # share of a pair's distances that its typical distance is computed from
FEWEST = 8  # values of a distance from which its typical one is computed
MOST = 0.9  # quantile of a distance's deviations, that stands for the greatest
DENSEST_WIDTH = 2 * 0.3186  # standard deviations that the central quarter of a Gaussian spans


def screen(position: FloatArray, seen: BoolArray, covariance: FloatArray | None = None, soft: float = 0.0) -> BoolArray:
    """The inliers (n, m) among positions (n, m, 3) in m: observations whose distances to the others fit.

    seen (n, m); covariance (n, m, 3, 3) of the positions in m², up to a common factor, as they are not equally good in
    all directions; None if they are. If hardly any distance in a sample of frames is an outlier, all observations are
    inliers, except those of features that do not belong to the body at all, or to another one.

    soft: deviations up to this share of the body's typical distances fit in any case, as those of markers on skin,
    which are no noise: they are small where a subject stands still. What is beyond is an outlier, be it the only one.
    """
    n, m = seen.shape
    pairs = _pairs(m)
    rows = evenly_spaced(n, SAMPLE)
    for group in () if soft else bodies_beside(position, seen):
        seen = seen & ~np.isin(np.arange(m), group)
    typical, spread = _typical_distances(_Seen.of(position, seen, covariance, rows), pairs, soft)
    known = np.isfinite(typical)
    seen = seen & ~_not_of_body(typical, spread, pairs, m)
    fitting, compared = 0, 0
    numbers = len(pairs) * (1 if covariance is None else WITH_COVARIANCES)
    for part in _chunks(len(rows), numbers) if not soft else ():
        fits, both = _fits(_Seen.of(position, seen, covariance, rows[part]), pairs, typical, spread)
        fitting, compared = fitting + int(fits[:, known].sum()), compared + int(both[:, known].sum())
    if not soft and (not compared or 1 - fitting / compared < OUTLIER_SHARE):
        return seen.copy()
    inliers = np.zeros_like(seen)
    for part in _chunks(n, numbers):
        fits, both = _fits(_Seen.of(position, seen, covariance, part), pairs, typical, spread)
        inliers[part] = seen[part] & _agreeing(fits, both, pairs, m)
    return inliers


def bodies_beside(position: FloatArray, seen: BoolArray) -> list[NDArray[np.intp]]:
    """Groups of features, by index, of rigid bodies that move against the one that is looked at; see `other_bodies`.

    position (n, m, 3) in m; seen (n, m).
    """
    pairs = _pairs(seen.shape[1])
    rows = evenly_spaced(len(seen), min(SAMPLE, max(CHUNK // (3 * max(len(pairs), 1)), 1)))
    i, j = pairs.T
    shown = np.where(seen[rows][..., None], position[rows], np.nan)
    return other_bodies(pairs, shown[:, i] - shown[:, j], seen)


@dataclass(frozen=True, eq=False)
class Distances:
    """Pairs of features (k, 2) with a typical distance (k,), m, and by how much each frame's is off, (n, k), m.

    off: NaN where not both are seen.
    """

    pairs: NDArray[np.intp]
    typical: FloatArray
    off: FloatArray


def distances_between(position: FloatArray, seen: BoolArray) -> Distances:
    """The distances between features at positions (n, m, 3) in m; seen (n, m)."""
    pairs = _pairs(seen.shape[1])
    rows = evenly_spaced(len(seen), SAMPLE)
    typical, _ = _typical_distances(_Seen.of(position, seen, None, rows), pairs, 0.0)
    known = np.isfinite(typical)
    pairs, typical = pairs[known], typical[known]
    off = np.full((len(seen), len(pairs)), np.nan)
    for part in _chunks(len(seen), len(pairs)):
        distance = _Seen.of(position, seen, None, part).distances(pairs)[0]
        both = seen[part][:, pairs[:, 0]] & seen[part][:, pairs[:, 1]]
        off[part] = np.where(both, distance - typical, np.nan)
    return Distances(pairs, typical, off)


@dataclass(frozen=True, eq=False)
class _Seen:
    """Some frames: position (n, m, 3) in m, 0 where nothing is seen; seen (n, m); covariance (n, m, 3, 3) in m²."""

    position: FloatArray
    seen: BoolArray
    covariance: FloatArray | None

    @classmethod
    def of(
        cls, position: FloatArray, seen: BoolArray, covariance: FloatArray | None, rows: slice | NDArray[np.intp]
    ) -> "_Seen":
        own = seen[rows]
        told = None if covariance is None else np.where(own[..., None, None], covariance[rows], 0.0)
        return cls(np.where(own[..., None], position[rows], 0.0), own, told)

    def distances(self, pairs: NDArray[np.intp]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Of each pair: the distance (n, k) in m, its deviation by noise along it, and that of the noise across it.

        Where all directions are equally good, the deviations are 1 and 0, for a spread in m.
        """
        i, j = pairs.T
        apart = self.position[:, i] - self.position[:, j]
        distance = np.linalg.norm(apart, axis=2)
        if self.covariance is None:
            return distance, np.ones((1, len(pairs))), np.zeros((1, len(pairs)))
        upper = self.covariance.reshape(*self.seen.shape, 9)[..., [0, 4, 8, 1, 2, 5]]
        both = upper[:, i] + upper[:, j]
        x, y, z = np.moveaxis(apart / np.maximum(distance, 1e-300)[..., None], 2, 0)
        along = np.einsum("nks,nks->nk", both, np.stack([x * x, y * y, z * z, 2 * x * y, 2 * x * z, 2 * y * z], axis=2))
        across = np.maximum(both[..., :3].sum(axis=2) - along, 0.0)
        along = np.maximum(along, 0.0) + across**2 / np.maximum(distance**2 + across, 1e-300)  # its direction is noisy
        return distance, np.sqrt(along), np.sqrt(across)


def _chunks(frames: int, numbers: int) -> Iterator[slice]:
    """Slices of so many frames, of so many numbers each, with CHUNK at most, and SAMPLE frames."""
    size = max(1, min(SAMPLE, CHUNK // max(numbers, 1)))
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


def _typical_distances(frames: _Seen, pairs: NDArray[np.intp], soft: float) -> tuple[FloatArray, FloatArray]:
    """Typical distance of each pair (k,) in m, and by how much it spreads (k,), from the densest quarter of its values.

    The spread is in units of the deviations of `_Seen.distances`. NaN for pairs that are seen together in fewer than
    FEWEST frames, and for distances that are not constant. With `soft` as of `screen`, which is for positions without
    covariances, it is at least that share of the typical distances, over LIMIT.
    """
    typical, spread = np.full(len(pairs), np.nan), np.full(len(pairs), np.nan)
    step = max(1, CHUNK // max(len(frames.seen) * (1 if frames.covariance is None else WITH_COVARIANCES), 1))
    for first in range(0, len(pairs), step):
        own = pairs[first : first + step]
        both = frames.seen[:, own[:, 0]] & frames.seen[:, own[:, 1]]
        distance, along, _ = frames.distances(own)
        for k in np.nonzero(both.sum(axis=0) >= FEWEST)[0]:
            rows = both[:, k]
            values = distance[rows, k]
            typical[first + k], spread[first + k] = _densest(values)
            if frames.covariance is not None:
                # Where there is little noise along a distance, that across it matters, and is no Gaussian there.
                deviation = along[rows, k]
                most = deviation >= min(np.quantile(deviation, MOST) / 2, np.sort(deviation)[-FEWEST])
                _, spread[first + k] = _densest((values - typical[first + k])[most] / deviation[most])
    # All pairs have about the same noise: a pair that is wrong more often than right has a larger spread; not used.
    median = np.nanmedian(spread) if np.isfinite(spread).any() else np.nan
    least = soft / LIMIT * float(np.sqrt(np.nanmean(typical**2))) if soft and np.isfinite(typical).any() else 0.0
    constant = spread < max(4 * median + 1e-12, least)
    return np.where(constant, typical, np.nan), np.maximum(spread, max(median, least))


def _densest(values: FloatArray) -> tuple[float, float]:
    """The mean of the densest quarter of values, and the standard deviation of a Gaussian with one as dense."""
    ordered = np.sort(values)
    size = max(int(np.ceil(DENSEST_SHARE * len(ordered))), 4)
    width = ordered[size - 1 :] - ordered[: len(ordered) - size + 1]
    start = int(np.argmin(width))
    return float(ordered[start : start + size].mean()), float(width[start] / DENSEST_WIDTH)


def _fits(
    frames: _Seen, pairs: NDArray[np.intp], typical: FloatArray, spread: FloatArray
) -> tuple[BoolArray, BoolArray]:
    """Which distances (n, k) fit, and which are compared. Noise across a distance makes it longer."""
    both = frames.seen[:, pairs[:, 0]] & frames.seen[:, pairs[:, 1]] & np.isfinite(typical)
    distance, along, across = frames.distances(pairs)
    expected, limit = np.nan_to_num(typical), LIMIT * np.nan_to_num(spread)
    less = expected - limit * along - 1e-9 * expected
    more = np.hypot(expected + limit * along, limit * across) + 1e-9 * expected
    return np.asarray(both & (distance >= less) & (distance <= more)), np.asarray(both)


def _agreeing(fits: BoolArray, both: BoolArray, pairs: NDArray[np.intp], m: int) -> BoolArray:
    """Features (n, m) that remain in each frame when the one with most misfits is removed repeatedly until all fit."""
    from scipy import sparse  # slow to load, and few commands need it

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

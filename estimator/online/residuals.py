"""How the samples of a flight are off the map of the online filter, feature by feature.

A unit tells its map (`body.features`) and not which points it has left out. So each sample is put to the map again, as
fmu/csrc/online/registration.c does: the pose is free, what does not fit with p = 1e-4 is left out, and a sample of
which no more than half fits has no pose.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from baryscope.estimator.geometry.alignment import FEWEST_POINTS, align
from baryscope.estimator.geometry.extent import rms_coordinates
from baryscope.estimator.geometry.so3 import cross_matrices, exp_rotation
from baryscope.models.words import brief

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

GATE = float(chdtri(3, 1e-4))
ROUNDS = 6
TRIPLES = 60
ROUGHLY = 9.0  # a pose from three points has up to three times the noise
STILL = 1e-9  # rad, a last step
RIDGE = 1e-12  # of the trace of normal equations
AT_ONCE = 4096  # samples


@dataclass(frozen=True, eq=False)
class MapResiduals:
    """n samples of m features against a map.

    time (n,), s; labels; residuals (n, m, 3) in C, m, NaN where there is none; used (n, m): what is seen of features
    that are in the map, in samples of three of them or more; rejected (n, m): of these, what does not fit.
    """

    time: FloatArray
    labels: tuple[str, ...]
    residuals: FloatArray
    used: BoolArray
    rejected: BoolArray

    __repr__ = brief

    @cached_property
    def feature_rms(self) -> FloatArray:
        """Rms of each feature's residuals per coordinate, (m,), m, without rejected ones; NaN if none is left."""
        return rms_coordinates(self.residuals, ~self.rejected)


def residuals_of_map(
    time: FloatArray, labels: tuple[str, ...], position: FloatArray, covariance: FloatArray, body: FloatArray
) -> MapResiduals:
    """Put samples to a map.

    Args:
        time: of the samples, (n,), s.
        labels: of the features, m.
        position: of the features, (n, m, 3) in C, m; NaN where one is not seen.
        covariance: of the positions, (n, m, 3, 3), m².
        body: the features in axes of the body, (m, 3), m; NaN for those that are not in the map.
    """
    known = np.asarray(np.isfinite(body).all(axis=1))
    used = np.isfinite(position).all(axis=2) & known
    used &= used.sum(axis=1, keepdims=True) >= FEWEST_POINTS
    residuals, fits = np.full_like(position, np.nan), np.zeros_like(used)
    points = np.where(known[:, None], body, 0.0)
    for begin in range(0, len(time), AT_ONCE):
        part = slice(begin, begin + AT_ONCE)
        seen = used[part]
        sample = _Samples(
            np.where(seen[..., None], position[part], 0.0),
            np.linalg.inv(np.where(seen[..., None, None], covariance[part], np.eye(3))),
            points,
        )
        residuals[part], fits[part] = _against_map(sample, seen)
    return MapResiduals(time, labels, residuals, used, used & ~fits)


@dataclass(frozen=True, eq=False)
class _Samples:
    """Positions y (n, m, 3) with weights W (n, m, 3, 3) of points b (m, 3); zero and any where not seen."""

    y: FloatArray
    W: FloatArray
    b: FloatArray

    def of(self, rows: NDArray[np.intp]) -> "_Samples":
        return _Samples(self.y[rows], self.W[rows], self.b)

    def off(self, R: FloatArray, c: FloatArray) -> tuple[FloatArray, FloatArray]:
        """What the positions are off poses R (n, 3, 3), c (n, 3) by, and the weighted squares of that, (n, m)."""
        e = self.y - c[:, None] - self.b @ np.swapaxes(R, 1, 2)
        return e, np.einsum("nmi,nmij,nmj->nm", e, self.W, e)

    def posed(self, fits: BoolArray) -> tuple[FloatArray, FloatArray]:
        """The poses that the points that fit (n, m), three or more in each, are nearest to, by their weights."""
        started = align(self.y, self.b, fits.astype(np.float64))
        R, c = started.rotation, started.translation
        W = np.where(fits[..., None, None], self.W, 0.0)
        for _ in range(ROUNDS):
            arm = self.b @ np.swapaxes(R, 1, 2)
            turned = -cross_matrices(arm.reshape(-1, 3)).reshape(*arm.shape, 3)
            J = np.concatenate([np.broadcast_to(np.eye(3), turned.shape), turned], axis=3)
            WJ = W @ J
            N = np.einsum("nmia,nmib->nab", J, WJ)
            N += RIDGE * np.trace(N, axis1=1, axis2=2)[:, None, None] * np.eye(6)  # points may be in a line
            step = np.linalg.solve(N, np.einsum("nmia,nmi->na", WJ, self.off(R, c)[0])[..., None])[..., 0]
            c, R = c + step[:, :3], exp_rotation(step[:, 3:]) @ R
            if np.abs(step[:, 3:]).max(initial=0.0) < STILL:
                break
        return R, c


def _against_map(sample: _Samples, seen: BoolArray) -> tuple[FloatArray, BoolArray]:
    """Residuals (n, m, 3), NaN where none, and which points (n, m) fit."""
    found, fits = _settled(sample, seen, seen)
    for row in np.flatnonzero(seen.any(axis=1) & ~_are_most(fits, seen)):
        one, here = sample.of(np.array([row])), seen[[row]]
        found[row], fits[row] = (part[0] for part in _settled(one, here, _agreed(one, here)))
    posed = _are_most(fits, seen)[:, None]
    return np.where((seen & posed)[..., None], found, np.nan), fits & posed


def _settled(sample: _Samples, seen: BoolArray, fits: BoolArray) -> tuple[FloatArray, BoolArray]:
    """Residuals (n, m, 3) and which points fit (n, m) in the end, from those with which a pose begins.

    What fits worst goes, one after the other, since it draws the pose to itself; once all fit, those come back that do.
    """
    fits, most = fits.copy(), seen.shape[1]
    found, squares = np.zeros_like(sample.y), np.full(seen.shape, np.inf)
    rows = np.flatnonzero(fits.sum(axis=1) >= FEWEST_POINTS)
    for round in range(most + ROUNDS):
        if not rows.size:
            break
        part = sample.of(rows)
        found[rows], squares[rows] = part.off(*part.posed(fits[rows]))
        worst = np.where(fits[rows], squares[rows], 0.0)
        left = worst.max(axis=1, initial=0.0) > GATE
        back = seen[rows] & (squares[rows] < GATE) & ~left[:, None] & (round < most) & ~fits[rows]
        fits[rows[left], worst[left].argmax(axis=1)] = False
        fits[rows] |= back
        rows = rows[(left | back.any(axis=1)) & (fits[rows].sum(axis=1) >= FEWEST_POINTS)]
    return found, fits & (squares < GATE)


def _agreed(sample: _Samples, seen: BoolArray) -> BoolArray:
    """Of one sample, the points (1, m) on whose pose most agree, of the poses of some of all triples."""
    triples = np.array(list(combinations(np.flatnonzero(seen[0]).tolist(), 3)))
    triples = triples[:: -(-len(triples) // TRIPLES)]
    chosen = np.zeros((len(triples), seen.shape[1]), dtype=bool)
    np.put_along_axis(chosen, triples, True, axis=1)
    each = sample.of(np.zeros(len(triples), dtype=np.intp))
    squares = each.off(*each.posed(chosen))[1]
    best = np.where(seen, np.minimum(squares, ROUGHLY * GATE), 0.0).sum(axis=1).argmin()
    return np.asarray(seen & (squares[best] < ROUGHLY * GATE))


def _are_most(fits: BoolArray, seen: BoolArray) -> BoolArray:
    """Of which samples (n,) enough points fit for a pose, and more than half."""
    count = fits.sum(axis=1)
    return np.asarray((count >= FEWEST_POINTS) & (2 * count > seen.sum(axis=1)))

"""Robust polynomial fit of a path in time, across gaps, of a degree that the data choose."""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from baryscope.estimator.options import HIGHEST_DEGREE

FloatArray = NDArray[np.float64]

MAX_ROWS = 2000  # of a least-squares problem: longer series are averaged first
BLOCKS = 20  # contiguous blocks that cross-validation leaves out one at a time
MAX_ROUNDS = 10  # of reweighting
MAX_EXCURSION = 3.0  # greatest distance of the path from the samples' centre over that of the samples
ROUNDING = 1e-9  # relative to the positions: residuals below this are rounding errors
# Standard deviations beyond which a sample has no weight. Wider than the customary 4.7: the bias of a moving target
# oscillates about the path with heavy tails, and cutting these on one side shifts the path (see tests and docs).
TUKEY = 8.0


@dataclass(frozen=True)
class PathFit:
    """A polynomial path: coefficients (degree + 1, 3) in m, of Chebyshev polynomials of time scaled to [-1, 1]."""

    coefficients: FloatArray
    begin: float
    end: float
    rms: float  # weighted, in m per coordinate
    rejected: int  # samples left without weight

    @property
    def degree(self) -> int:
        """The polynomial's degree."""
        return len(self.coefficients) - 1

    def __call__(self, time: FloatArray) -> FloatArray:
        """The path at time (n,) in s, (n, 3) in m."""
        return np.asarray(chebyshev.chebval(_scaled(time, self.begin, self.end), self.coefficients).T)

    def velocity(self, time: FloatArray) -> FloatArray:
        """The path's velocity at time (n,) in s, (n, 3) in m/s."""
        half = 0.5 * (self.end - self.begin) or 1.0
        slope = chebyshev.chebder(self.coefficients) / half
        return np.asarray(chebyshev.chebval(_scaled(time, self.begin, self.end), slope).T)


def fit_path(
    time: FloatArray, position: FloatArray, weights: FloatArray, span: tuple[float, float], degree: int | None
) -> PathFit:
    """Fit samples position (n, 3) in m at time (n,) in s with weights (n,) >= 0; `span`: begin and end of the path, s.

    Without a degree, BLOCKS blocks of time are left out one after the other. The lowest degree is chosen whose
    prediction error is within one standard error of the best, and whose path does not overshoot in gaps.
    Outliers are weighted down by Tukey's biweight of the distance, scaled by its median.
    """
    highest = HIGHEST_DEGREE if degree is None else degree
    highest = min(highest, len(np.unique(time)) - 1)
    basis = np.asarray(chebyshev.chebvander(_scaled(time, *span), highest), dtype=np.float64)
    start = min(highest, 8)
    robust = _reweighted(basis[:, : start + 1], position, weights)
    if degree is None:
        chosen = _best_degree(time, basis, position, robust, span)
        robust = _reweighted(basis[:, : chosen + 1], position, weights)
        chosen = _best_degree(time, basis, position, robust, span)
    else:
        chosen = highest
    robust = _reweighted(basis[:, : chosen + 1], position, weights)
    if degree is None:
        chosen = _bounded_degree(basis, position, robust, chosen)
    coefficients = _solve(basis[:, : chosen + 1], position, robust)
    residual = position - basis[:, : chosen + 1] @ coefficients
    rms = float(np.sqrt(np.sum(robust[:, None] * residual**2) / (3 * robust.sum())))
    return PathFit(coefficients, *span, rms, int(np.sum((robust == 0) & (weights > 0))))


def _scaled(time: FloatArray, begin: float, end: float) -> FloatArray:
    half = 0.5 * (end - begin)
    return np.asarray((time - 0.5 * (begin + end)) / (half if half > 0 else 1.0))


def _solve(basis: FloatArray, position: FloatArray, weights: FloatArray) -> FloatArray:
    rows = _rows(basis, position, weights)
    return np.asarray(np.linalg.lstsq(rows[:, :-3], rows[:, -3:], rcond=None)[0])


def _rows(basis: FloatArray, position: FloatArray, weights: FloatArray, longest: int = MAX_ROWS) -> FloatArray:
    """Rows [basis | position] (k, columns + 3) times the root of their weights, for least squares.

    A long series is averaged in groups of neighbours to at most MAX_ROWS rows, basis and position alike, which keeps
    the equations exact. The loss of information is negligible if the path hardly bends within a group.
    """
    rows = np.hstack([basis, position]) * weights[:, None]
    size = -(-len(rows) // longest)
    if size > 1:
        edges = np.arange(0, len(rows), size)
        rows, weights = np.add.reduceat(rows, edges), np.add.reduceat(weights, edges)
    return rows / np.sqrt(np.where(weights > 0, weights, 1.0))[:, None]


def _reweighted(basis: FloatArray, position: FloatArray, weights: FloatArray) -> FloatArray:
    """Weights times Tukey's biweight of the distance to the fit, by iteration."""
    robust = weights
    for _ in range(MAX_ROUNDS):
        residual = position - basis @ _solve(basis, position, robust)
        distance = np.sqrt(weights * np.einsum("ni,ni->n", residual, residual))
        used = distance[weights > 0]
        # 1.54: the median length of a three-dimensional unit Gaussian
        limit = TUKEY * max(float(np.median(used)) / 1.54, ROUNDING * float(np.abs(position).max()))
        factor = np.clip(1 - (distance / limit) ** 2, 0, 1) ** 2 if limit > 0 else np.ones_like(distance)
        if np.abs(weights * factor - robust).max() < 1e-3 * weights.max():
            break
        robust = weights * factor
    return robust


def _best_degree(
    time: FloatArray, basis: FloatArray, position: FloatArray, weights: FloatArray, span: tuple[float, float]
) -> int:
    """The lowest degree whose error in left-out blocks is within one standard error of the best."""
    blocks = _blocks(time, weights, span)
    if len(blocks) < 3:
        return 0
    columns = basis.shape[1]
    triangles = [
        _triangle(_rows(basis[block], position[block], weights[block], MAX_ROWS // BLOCKS)) for block in blocks
    ]
    errors = np.full((columns, len(blocks)), np.inf)
    for index, block in enumerate(blocks):
        others = np.vstack([triangle for other, triangle in enumerate(triangles) if other != index])
        factor = _triangle(others)
        total = weights[block].sum()
        for count in range(1, columns + 1):
            head = factor[:count, :count]
            if len(factor) < count or np.abs(np.diag(head)).min() < 1e-10 * np.abs(np.diag(head)).max():
                break
            coefficients = np.linalg.solve(head, factor[:count, columns:])
            left = triangles[index] @ np.vstack([coefficients, np.zeros((columns - count, 3)), -np.eye(3)])
            errors[count - 1, index] = np.sum(left**2) / total
    # Logarithms, as the blocks at the ends are extrapolated, and their errors would dominate a mean.
    solved = np.isfinite(errors).all(axis=1)
    floor = (ROUNDING * np.abs(position).max()) ** 2
    logarithms = np.log(errors[solved] + max(floor, 1e-300))
    best = int(np.argmin(logarithms.mean(axis=1)))
    worse = logarithms - logarithms[best]
    standard_error = worse.std(axis=1, ddof=1) / np.sqrt(len(blocks))
    return int(np.argmax(worse.mean(axis=1) <= standard_error))


def _bounded_degree(basis: FloatArray, position: FloatArray, weights: FloatArray, degree: int) -> int:
    """The highest degree up to `degree` whose path stays near the samples in the whole span, gaps and ends included."""
    used = position[weights > 0]
    centre = used.mean(axis=0)
    limit = MAX_EXCURSION * np.linalg.norm(used - centre, axis=1).max()
    everywhere = np.linspace(-1, 1, 501)
    while degree > 0:
        path = chebyshev.chebval(everywhere, _solve(basis[:, : degree + 1], position, weights)).T
        if np.linalg.norm(path - centre, axis=1).max() <= limit:
            break
        degree -= 1
    return degree


def _triangle(rows: FloatArray) -> FloatArray:
    """The triangular factor R of rows = Q R, which has all the information of the least-squares problem."""
    return np.asarray(np.linalg.qr(rows, mode="r"))


def _blocks(time: FloatArray, weights: FloatArray, span: tuple[float, float]) -> list[NDArray[np.intp]]:
    edges = np.linspace(span[0], span[1], BLOCKS + 1)[1:-1]
    label = np.searchsorted(edges, time)
    indices = [np.nonzero((label == value) & (weights > 0))[0] for value in range(BLOCKS)]
    return [index for index in indices if index.size]

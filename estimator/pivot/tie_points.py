"""Tie points between bodies that share too few features, or collinear ones, for a common attitude.

The products b_j · b_k of a body's points from the centre of mass do not depend on its axes. They are the distances of
the features from it and from one another. Two bodies with common features have equal products, so these are
constrained to be equal, with the covariance of the separate bodies. A label that belongs to a different point in the
second body fails the test of this hypothesis and is no tie point.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.stats import chi2

from baryscope.estimator.geometry.gauge import offset_by_points
from baryscope.estimator.geometry.symmetric import symmetric_pseudo_inverse
from baryscope.estimator.pivot.free_attitudes import Solution

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

SIGNIFICANCE = 1e-4  # probability that the same features are taken for different points
LINEARITY = 5.0  # least standard deviation of a product over the second-order term that its linear model neglects
MAX_TIE_POINTS = 8  # points compared between two bodies: more features are averaged in groups
ROUNDING = 1e-12  # relative to the greatest variance: the variance of products that depend on others


@dataclass(frozen=True, eq=False)
class TiePoints:
    """Two bodies, by their indices in the solution, and the features (k,) that they share.

    rows: the features' indices in either body; means (g, k): the compared points, as features or means of some;
    compared (c, g²): the combinations of their products that must agree.
    """

    bodies: tuple[int, int]
    features: IntArray
    rows: tuple[IntArray, IntArray]
    means: FloatArray
    compared: FloatArray


@dataclass(frozen=True, eq=False)
class _Misclosures:
    """Products of the first bodies less those of the second: values (c,) in m², and their covariance (c, c).

    with_points: their covariance with the points of each tied body, conditional on x, (3 m, c); by_path (c, p): a
    change δx changes them by −by_path δx. All covariances are for weights that are inverse variances.
    """

    values: FloatArray
    covariance: FloatArray
    with_points: dict[int, FloatArray]
    by_path: FloatArray


def tie_bodies(solution: Solution, variance: float) -> tuple[Solution, tuple[TiePoints, ...], tuple[TiePoints, ...]]:
    """The solution with tie points between bodies that share features, the tie points, and those refused.

    variance: of an observation of weight 1.
    """
    tied, refused = [], []
    for bodies, features in _sharing(solution):
        jointly = _comparable(solution, variance, bodies, features)
        if jointly is None:
            continue
        if _fits(solution, variance, jointly):
            tied.append(jointly)
            continue
        singly = (_comparable(solution, variance, bodies, features[k : k + 1]) for k in range(len(features)))
        changed = [tie for tie in singly if tie is not None and not _fits(solution, variance, tie)]
        same = np.setdiff1d(features, [tie.features[0] for tie in changed])
        rest = _comparable(solution, variance, bodies, same) if changed and len(same) else None
        if rest is not None and _fits(solution, variance, rest):
            tied.append(rest)
            refused += changed
        else:
            refused.append(jointly)
    return (_constrained(solution, tied) if tied else solution), tuple(tied), tuple(refused)


def _sharing(solution: Solution) -> Iterator[tuple[tuple[int, int], IntArray]]:
    """Each body with the last bodies before it that share its features: the pair's indices, and the features (k,)."""
    for second, body in enumerate(solution.bodies):
        remaining = body.features
        for first in reversed(range(second)):
            shared = np.intersect1d(solution.bodies[first].features, body.features)
            if len(np.intersect1d(shared, remaining)):
                remaining = np.setdiff1d(remaining, shared)
                yield (first, second), shared


def _comparable(solution: Solution, variance: float, bodies: tuple[int, int], features: IntArray) -> TiePoints | None:
    """The tie points of two bodies with the products that a linear model can compare; None if there are none."""
    first, second = (np.nonzero(np.equal.outer(features, solution.bodies[index].features))[1] for index in bodies)
    means = _means(solution.bodies[bodies[0]].points[first])
    complete = TiePoints(bodies, features, (first, second), means, np.eye(len(means) ** 2))
    values, axes = np.linalg.eigh(_misclosures(solution, [complete]).covariance)
    spread = max(
        _greatest_variance(solution, index, rows, means) for index, rows in zip(bodies, complete.rows, strict=True)
    )
    comparable = (values > ROUNDING * values[-1]) & (values > (LINEARITY * spread) ** 2 * variance)
    return replace(complete, compared=axes[:, comparable].T) if comparable.any() else None


def _means(points: FloatArray) -> FloatArray:
    """Averages (g, k) that reduce points (k, 3) to MAX_TIE_POINTS: of neighbours along their principal direction."""
    k = len(points)
    if k <= MAX_TIE_POINTS:
        return np.eye(k)
    centred = points - points.mean(axis=0)
    order = np.argsort(centred @ np.linalg.svd(centred, full_matrices=False)[2][0])
    means = np.zeros((MAX_TIE_POINTS, k))
    for group, members in enumerate(np.array_split(order, MAX_TIE_POINTS)):
        means[group, members] = 1 / len(members)
    return means


def _fits(solution: Solution, variance: float, tie: TiePoints) -> bool:
    """Whether the misclosures of tie points are compatible with noise (χ² test)."""
    misclosures = _misclosures(solution, [tie])
    square = float(misclosures.values @ symmetric_pseudo_inverse(misclosures.covariance) @ misclosures.values)
    return bool(chi2.sf(square / max(variance, 1e-300), len(misclosures.values)) > SIGNIFICANCE)


def _greatest_variance(solution: Solution, index: int, rows: IntArray, means: FloatArray) -> float:
    """The greatest variance of means of some points of a body, relative to that of an observation."""
    columns = (3 * rows[:, None] + np.arange(3)).ravel()
    by_path = solution.points_path[index][columns]
    covariance = solution.points_covariance[index][np.ix_(columns, columns)] + by_path @ solution.covariance @ by_path.T
    average = np.kron(means, np.eye(3))
    variances = np.einsum("gi,ij,gj->g", average, covariance, average, optimize=True)
    return float(variances.reshape(-1, 3).sum(axis=1).max())


def _misclosures(solution: Solution, ties: list[TiePoints]) -> _Misclosures:
    """The misclosures of tie points in the solution without them."""
    used = sorted({index for tie in ties for index in tie.bodies})
    values = [np.zeros(len(tie.compared)) for tie in ties]
    slopes: list[list[sparse.csr_array | None]] = [[None] * len(used) for _ in ties]
    for row, tie in enumerate(ties):
        for index, shared, sign in zip(tie.bodies, tie.rows, (1.0, -1.0), strict=True):
            product, slope = _products(solution.bodies[index].points, shared, tie.means)
            values[row] += sign * tie.compared @ product
            slopes[row][used.index(index)] = sparse.csr_array(sign * tie.compared @ slope)
    slope = sparse.block_array(slopes, format="csr")
    own = sparse.block_diag([sparse.csr_array(solution.points_covariance[index]) for index in used], format="csr")
    with_points = own @ slope.T
    by_path = slope @ np.concatenate([solution.points_path[index] for index in used])
    covariance = (slope @ with_points).toarray() + by_path @ solution.covariance @ by_path.T
    ends = np.cumsum([len(solution.points_path[index]) for index in used])[:-1]
    of_each = np.split(with_points.toarray(), ends)
    return _Misclosures(np.concatenate(values), covariance, dict(zip(used, of_each, strict=True)), by_path)


def _products(points: FloatArray, rows: IntArray, means: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The products b_j · b_k (g²,) of means of some of a body's points (m, 3), and their Jacobian (g², 3 m)."""
    b = means @ points[rows]
    slope = np.zeros((len(b), len(b), *points.shape))
    slope[:, :, rows] = np.einsum("jl,ki->jkli", means, b) + np.einsum("kl,ji->jkli", means, b)
    return (b @ b.T).ravel(), slope.reshape(len(b) ** 2, -1)


def _constrained(solution: Solution, ties: list[TiePoints]) -> Solution:
    """The solution with the misclosures constrained to zero, and its covariances."""
    misclosures = _misclosures(solution, ties)
    inverse = symmetric_pseudo_inverse(misclosures.covariance)
    # Cross-covariances with the misclosures: of x, of each body's points, of the offsets.
    path_cross = -solution.covariance @ misclosures.by_path.T
    bodies, offset_crosses = [], []
    for index, (body, by_path) in enumerate(zip(solution.bodies, solution.points_path, strict=True)):
        point_cross = -by_path @ path_cross
        if index in misclosures.with_points:
            point_cross += misclosures.with_points[index]
        offset_crosses.append(offset_by_points(body.points) @ point_cross)
        bodies.append(body.moved(-point_cross @ inverse @ misclosures.values))
    offset_cross = np.concatenate(offset_crosses)
    return replace(
        solution,
        bodies=tuple(bodies),
        x=solution.x - path_cross @ inverse @ misclosures.values,
        covariance=solution.covariance - path_cross @ inverse @ path_cross.T,
        offset_covariance=solution.offset_covariance - offset_cross @ inverse @ offset_cross.T,
        offset_path=solution.offset_path - offset_cross @ inverse @ path_cross.T,
    )

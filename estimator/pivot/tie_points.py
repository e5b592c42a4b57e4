"""Ties between bodies that share features too few, or too much in a line, to give them common axes.

Whatever its axes, a rigid body keeps the products b_j · b_k of its points seen from the centre of mass: the distances
of features from it and from one another. Two bodies that see the same features agree on them, so these products are
made equal by least squares, with the covariance that the bodies have without. A label that stands for another point
in the second body fails that test and ties nothing.
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

CHANCE = 1e-4  # of features that are the same to look as different as ones that are not
CURVED = 5.0  # times what a linear model of a product leaves out, that it must deviate by to tie
MOST = 8  # points that two bodies are tied by: more features than these are taken together in groups
ROUNDING = 1e-12  # of the greatest variance: that of products which follow from others


@dataclass(frozen=True, eq=False)
class TiePoints:
    """Two bodies, by their places in the solution, and the features (k,) that they share.

    rows: those features' places in either body; means (g, k): the points that are compared, each feature or the mean of
    some; compared (c, g²): the combinations of their products that must agree.
    """

    bodies: tuple[int, int]
    features: IntArray
    rows: tuple[IntArray, IntArray]
    means: FloatArray
    compared: FloatArray


@dataclass(frozen=True, eq=False)
class _Gaps:
    """By how much the first bodies' products exceed the second ones': values (c,) in m², and their covariance (c, c).

    with_points: their covariance with each tied body's points for known x, (3 m, c); by_path (c, p): they follow x by
    −by_path δx, as the points do. All for observations whose weights are inverse variances.
    """

    values: FloatArray
    covariance: FloatArray
    with_points: dict[int, FloatArray]
    by_path: FloatArray


def tie_bodies(solution: Solution, variance: float) -> tuple[Solution, tuple[TiePoints, ...], tuple[TiePoints, ...]]:
    """The solution with bodies tied that share features, the ties that were made, and those that do not fit.

    variance: of an observation of weight 1.
    """
    made, refused = [], []
    for bodies, features in _sharing(solution):
        whole = _comparable(solution, variance, bodies, features)
        if whole is None:
            continue
        if _fits(solution, variance, whole):
            made.append(whole)
            continue
        singly = (_comparable(solution, variance, bodies, features[k : k + 1]) for k in range(len(features)))
        changed = [one for one in singly if one is not None and not _fits(solution, variance, one)]
        same = np.setdiff1d(features, [one.features[0] for one in changed])
        rest = _comparable(solution, variance, bodies, same) if changed and len(same) else None
        if rest is not None and _fits(solution, variance, rest):
            made.append(rest)
            refused += changed
        else:
            refused.append(whole)
    return (_closed(solution, made) if made else solution), tuple(made), tuple(refused)


def _sharing(solution: Solution) -> Iterator[tuple[tuple[int, int], IntArray]]:
    """Each body with the nearest ones before it that share its features."""
    for second, body in enumerate(solution.bodies):
        waiting = body.features
        for first in reversed(range(second)):
            shared = np.intersect1d(solution.bodies[first].features, body.features)
            if len(np.intersect1d(shared, waiting)):
                waiting = np.setdiff1d(waiting, shared)
                yield (first, second), shared


def _comparable(solution: Solution, variance: float, bodies: tuple[int, int], features: IntArray) -> TiePoints | None:
    """What a linear model can compare of the features that two bodies share, if anything."""
    first, second = (np.nonzero(np.equal.outer(features, solution.bodies[index].features))[1] for index in bodies)
    means = _means(solution.bodies[bodies[0]].points[first])
    whole = TiePoints(bodies, features, (first, second), means, np.eye(len(means) ** 2))
    values, axes = np.linalg.eigh(_gaps(solution, [whole]).covariance)
    spread = max(_greatest(solution, index, rows, means) for index, rows in zip(bodies, whole.rows, strict=True))
    known = (values > ROUNDING * values[-1]) & (values > (CURVED * spread) ** 2 * variance)
    return replace(whole, compared=axes[:, known].T) if known.any() else None


def _means(points: FloatArray) -> FloatArray:
    """What makes MOST points at most of (k, 3): themselves, or means of neighbours along their length, (g, k)."""
    k = len(points)
    if k <= MOST:
        return np.eye(k)
    centred = points - points.mean(axis=0)
    order = np.argsort(centred @ np.linalg.svd(centred, full_matrices=False)[2][0])
    means = np.zeros((MOST, k))
    for group, members in enumerate(np.array_split(order, MOST)):
        means[group, members] = 1 / len(members)
    return means


def _fits(solution: Solution, variance: float, one: TiePoints) -> bool:
    """Whether the gaps that a tie would close may be there by chance."""
    gaps = _gaps(solution, [one])
    square = float(gaps.values @ symmetric_pseudo_inverse(gaps.covariance) @ gaps.values)
    return bool(chi2.sf(square / max(variance, 1e-300), len(gaps.values)) > CHANCE)


def _greatest(solution: Solution, index: int, rows: IntArray, means: FloatArray) -> float:
    """The greatest variance of means of some points of a body, over that of an observation."""
    columns = (3 * rows[:, None] + np.arange(3)).ravel()
    by_path = solution.points_path[index][columns]
    covariance = solution.points_covariance[index][np.ix_(columns, columns)] + by_path @ solution.covariance @ by_path.T
    whole = np.kron(means, np.eye(3))
    return float(np.einsum("gi,ij,gj->g", whole, covariance, whole, optimize=True).reshape(-1, 3).sum(axis=1).max())


def _gaps(solution: Solution, ties: list[TiePoints]) -> _Gaps:
    """What there is between bodies before it is closed."""
    used = sorted({index for one in ties for index in one.bodies})
    values = [np.zeros(len(one.compared)) for one in ties]
    slopes: list[list[sparse.csr_array | None]] = [[None] * len(used) for _ in ties]
    for row, one in enumerate(ties):
        for index, shared, sign in zip(one.bodies, one.rows, (1.0, -1.0), strict=True):
            product, slope = _products(solution.bodies[index].points, shared, one.means)
            values[row] += sign * one.compared @ product
            slopes[row][used.index(index)] = sparse.csr_array(sign * one.compared @ slope)
    slope = sparse.block_array(slopes, format="csr")
    own = sparse.block_diag([sparse.csr_array(solution.points_covariance[index]) for index in used], format="csr")
    with_points = own @ slope.T
    by_path = slope @ np.concatenate([solution.points_path[index] for index in used])
    covariance = (slope @ with_points).toarray() + by_path @ solution.covariance @ by_path.T
    ends = np.cumsum([len(solution.points_path[index]) for index in used])[:-1]
    of_each = np.split(with_points.toarray(), ends)
    return _Gaps(np.concatenate(values), covariance, dict(zip(used, of_each, strict=True)), by_path)


def _products(points: FloatArray, rows: IntArray, means: FloatArray) -> tuple[FloatArray, FloatArray]:
    """All b_j · b_k of means of some of a body's points (m, 3), (g²,), and their change with all of them, (g², 3 m)."""
    b = means @ points[rows]
    slope = np.zeros((len(b), len(b), *points.shape))
    slope[:, :, rows] = np.einsum("jl,ki->jkli", means, b) + np.einsum("kl,ji->jkli", means, b)
    return (b @ b.T).ravel(), slope.reshape(len(b) ** 2, -1)


def _closed(solution: Solution, ties: list[TiePoints]) -> Solution:
    """The most likely solution without the gaps, and its covariances."""
    gaps = _gaps(solution, ties)
    inverse = symmetric_pseudo_inverse(gaps.covariance)
    path_gaps = -solution.covariance @ gaps.by_path.T  # covariance of x with the gaps
    bodies, held_gaps = [], []
    for index, (body, by_path) in enumerate(zip(solution.bodies, solution.points_path, strict=True)):
        point_gaps = -by_path @ path_gaps
        if index in gaps.with_points:
            point_gaps += gaps.with_points[index]
        held_gaps.append(offset_by_points(body.points) @ point_gaps)
        bodies.append(body.moved(-point_gaps @ inverse @ gaps.values))
    offset_gaps = np.concatenate(held_gaps)
    return replace(
        solution,
        bodies=tuple(bodies),
        x=solution.x - path_gaps @ inverse @ gaps.values,
        covariance=solution.covariance - path_gaps @ inverse @ path_gaps.T,
        offset_covariance=solution.offset_covariance - offset_gaps @ inverse @ offset_gaps.T,
        offset_path=solution.offset_path - offset_gaps @ inverse @ path_gaps.T,
    )

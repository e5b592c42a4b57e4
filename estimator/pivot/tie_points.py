"""Tie points between bodies that share too few features, or collinear ones, for a common attitude.

The products b_j · b_k of a body's points from the centre of mass do not depend on its axes. They are the distances of
the features from it and from one another. Two bodies with common features have equal products, so these are
constrained to be equal, with the covariance of the separate bodies. A label that belongs to a different point in the
second body fails the test of this hypothesis and is no tie point; one that is as far from the centre of mass as before
is found by what the others make of it, if they are enough. But where no place of a common label agrees, and all
are nearer to each other than those of different features are, the bodies disagree by more than they claim: the path or
an attitude is wrong. A body whose offset is known by the noise of its attitudes is not tied: its covariance is too
small. Covariances are kept as factors, so that they stay positive semidefinite whatever the condition of the bodies.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from baryscope.estimator.adjustment.frame_shifts import FrameShifts
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.spurious import NoisyAttitudes
from baryscope.estimator.geometry.symmetric import factor_of, symmetric_pseudo_inverse
from baryscope.estimator.pivot.free_attitudes import Solution

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

SIGNIFICANCE = 1e-4  # probability that the same features are taken for different points
DOUBTFUL = 0.5  # odds that bodies disagree, above which they say so: their claims are then not to be relied on
LINEARITY = 5.0  # least standard deviation of a product over the second-order term that its linear model neglects
MAX_TIE_POINTS = 8  # points compared between two bodies: more features are averaged in groups
MAX_SPURIOUS = 1 / 3  # share of spurious information on an offset, above which its body is not tied
FEWEST, MOST_OTHERS = 3, 0.25  # points that agree, at least, where others of the same distances do not: a share, or one
RANK = 1e-3  # relative to the greatest: a combination of normalised misclosures that second-order terms alone make
ROUNDING = 1e-12  # relative to the greatest variance: the variance of products that depend on others


@dataclass(frozen=True, eq=False)
class TiePoints:
    """Two bodies, by their indices in the solution, and the features (k,) that they share.

    rows: the features' indices in either body; means (g, k): the compared points, as features or means of some;
    compared (c, g²): the combinations of their products that must agree. disagreement: of refused ones that are the
    same points, how many times as far apart as claimed; None of different points.
    """

    bodies: tuple[int, int]
    features: IntArray
    rows: tuple[IntArray, IntArray]
    means: FloatArray
    compared: FloatArray
    disagreement: float | None = None


@dataclass(frozen=True, eq=False)
class _Misclosures:
    """Products of the first bodies less those of the second: values (c,) in m², and a factor F (c, k) of their
    covariance F Fᵀ, for weights that are inverse variances. The k columns are those of `_Factors`.
    """

    values: FloatArray
    factor: FloatArray

    @property
    def covariance(self) -> FloatArray:
        """The covariance (c, c) of the values."""
        return np.asarray(self.factor @ self.factor.T)


@dataclass(frozen=True, eq=False)
class _Factors:
    """Factors of the joint covariance of all bodies' points and x, with common columns of independent unit variances.

    points: (3 m, k) for each body; x (p, k).
    """

    points: tuple[FloatArray, ...]
    x: FloatArray

    @classmethod
    def of(cls, solution: Solution) -> "_Factors":
        """The factors of a solution: columns of each body's points, behind these of what x does to all."""
        alone = [factor_of(covariance) for covariance in solution.points_covariance]
        of_x = factor_of(solution.covariance)
        ends = np.cumsum([0, *(factor.shape[1] for factor in alone)])
        points = []
        for index, (factor, by_path) in enumerate(zip(alone, solution.by_path, strict=True)):
            whole = np.zeros((len(factor), ends[-1] + of_x.shape[1]))
            whole[:, ends[index] : ends[index + 1]] = factor
            whole[:, ends[-1] :] = -by_path @ of_x
            points.append(whole)
        return cls(tuple(points), np.concatenate([np.zeros((len(of_x), ends[-1])), of_x], axis=1))


def tie_bodies(
    solution: Solution,
    variance: float,
    observations: Observations,
    origin: FloatArray,
    shifts: FrameShifts | None = None,
    frame_variance: float | None = None,
) -> tuple[Solution, tuple[TiePoints, ...], tuple[TiePoints, ...]]:
    """The solution with tie points between bodies that share features, the tie points, and those refused.

    variance: of an observation of weight 1; observations (n, m) of the solution; origin (n, 3): its path in C, m;
    shifts: of the frames; frame_variance: as variance, in a frame by itself, if errors last.
    """
    sharing = list(_sharing(solution))
    if not sharing or solution.null_space.shape[1]:
        return solution, (), ()
    alone = variance if frame_variance is None else frame_variance
    noisy = (NoisyAttitudes.of(body, observations, origin, alone, shifts) for body in solution.bodies)
    known = [_spurious_share(solution, index, one) <= MAX_SPURIOUS for index, one in enumerate(noisy)]
    tied, refused, factors = [], [], _Factors.of(solution)
    compare = _Comparison(solution, factors, variance)
    for bodies, features in sharing:
        jointly = compare.comparable(bodies, features) if known[bodies[0]] and known[bodies[1]] else None
        if jointly is None:
            continue
        if compare.fits(jointly):
            tied.append(jointly)
            continue
        singly = (compare.comparable(bodies, features[k : k + 1]) for k in range(len(features)))
        changed = [tie for tie in singly if tie is not None and not compare.fits(tie)]
        same = np.setdiff1d(features, [tie.features[0] for tie in changed])
        rest = compare.comparable(bodies, same) if changed and len(same) else None
        if rest is None or not compare.fits(rest):
            rest, changed = compare.without_others(jointly)
        if rest is not None:
            tied.append(rest)
        refused += changed
    return (compare.constrained(tied) if tied else solution), tuple(tied), tuple(refused)


def _spurious_share(solution: Solution, index: int, noisy: NoisyAttitudes) -> float:
    """The greatest share of spurious information in the information on the offset of a body of noisy attitudes."""
    own = slice(3 * index, 3 * index + 3)
    factor = factor_of(solution.offset_covariance[own, own])
    return float(np.linalg.eigvalsh(factor.T @ noisy.spurious_information().likely @ factor)[-1])


def _sharing(solution: Solution) -> Iterator[tuple[tuple[int, int], IntArray]]:
    """Each body with the last bodies before it that share its features: the pair's indices, and the features (k,)."""
    for second, body in enumerate(solution.bodies):
        remaining = body.features
        for first in reversed(range(second)):
            shared = np.intersect1d(solution.bodies[first].features, body.features)
            if len(np.intersect1d(shared, remaining)):
                remaining = np.setdiff1d(remaining, shared)
                yield (first, second), shared


@dataclass(frozen=True, eq=False)
class _Comparison:
    """The comparison of a solution's bodies; variance: of an observation of weight 1."""

    solution: Solution
    factors: _Factors
    variance: float

    def comparable(self, bodies: tuple[int, int], features: IntArray) -> TiePoints | None:
        """The tie points of two bodies with the products that a linear model can compare; None if there are none."""
        first, second = (
            np.nonzero(np.equal.outer(features, self.solution.bodies[index].features))[1] for index in bodies
        )
        means = _means(self.solution.bodies[bodies[0]].points[first])
        complete = TiePoints(bodies, features, (first, second), means, np.eye(len(means) ** 2))
        values, axes = np.linalg.eigh(self.misclosures([complete]).covariance)
        spread = max(
            float(self.excess(index, rows, means).diagonal().max())
            for index, rows in zip(bodies, complete.rows, strict=True)
        )
        usable = (values > ROUNDING * values[-1]) & (values > (LINEARITY * spread) ** 2 * self.variance)
        return replace(complete, compared=axes[:, usable].T) if usable.any() else None

    def fits(self, tie: TiePoints) -> bool:
        """Whether the misclosures of tie points are compatible with noise (χ² test)."""
        return self._chance(tie) > SIGNIFICANCE

    def _chance(self, tie: TiePoints) -> float:
        """The probability of so great misclosures by noise."""
        return float(chdtrc(len(tie.compared), self._square(tie)))

    def without_others(self, tie: TiePoints) -> tuple[TiePoints | None, list[TiePoints]]:
        """Tie points that fit, without those few of some that do not that are other points, though none is at another
        distance from the centre of mass, and these. If they are not few, there is none, and all are refused.
        """
        same = tie.features
        for _ in range(max(int(MOST_OTHERS * len(same)), 1)):
            if len(same) <= FEWEST:
                break
            fewer = (self.comparable(tie.bodies, np.delete(same, k)) for k in range(len(same)))
            best = max((one for one in fewer if one is not None), key=self._chance, default=None)
            if best is None:
                break
            if self.fits(best):
                others = np.isin(tie.features, best.features, invert=True)
                rows = (tie.rows[0][others], tie.rows[1][others])
                return best, [replace(tie, features=tie.features[others], rows=rows)]
            same = best.features
        return None, [self.judged(tie)]

    def judged(self, tie: TiePoints) -> TiePoints:
        """Refused tie points, with the bodies' disagreement unless different points are clearly likelier.

        Of labels that come back on other features, squared distances from the centre of mass differ by as much as those
        of any two features do. The chance c of so small a difference, the product over the labels of the share of such
        pairs, makes its density c/(2 v). If bodies claim κ times too little, with a density 1/κ² of κ > 1, a difference
        v of r deviations has the density √(2/π)/(2 r v): √(2/π)/(r c) are the odds for that.
        """
        first, second = (np.sum(self.solution.bodies[index].points ** 2, axis=1) for index in tie.bodies)
        pairs = np.abs(first[:, None] - second)
        apart, others = pairs[tie.rows], np.ones_like(pairs, dtype=bool)
        others[tie.rows] = False
        nearer = np.array([np.count_nonzero(pairs[others] <= one) for one in apart])
        chance = float(np.prod((nearer + 1) / (others.sum() + 1)))
        ratio = float(np.sqrt(self._square(tie) / len(tie.compared)))
        odds = np.sqrt(2 / np.pi) / (ratio * chance)
        return replace(tie, disagreement=ratio) if odds > DOUBTFUL else tie

    def _square(self, tie: TiePoints) -> float:
        """The squared misclosures of tie points in units of their covariance: χ²."""
        misclosures = self.misclosures([tie])
        square = float(misclosures.values @ symmetric_pseudo_inverse(misclosures.covariance) @ misclosures.values)
        return max(square, 0.0) / max(self.variance, 1e-300)

    def excess(self, index: int, rows: IntArray, means: FloatArray) -> FloatArray:
        """By how much the products (g, g) of means of some points of a body are too large on average.

        That is the trace of the means' covariance, here relative to the variance of an observation.
        """
        factor = self.factors.points[index].reshape(-1, 3, self.factors.x.shape[1])[rows]
        averaged = np.tensordot(means, factor, 1).reshape(len(means), -1)
        return np.asarray(averaged @ averaged.T)

    def misclosures(self, ties: list[TiePoints]) -> _Misclosures:
        """The misclosures of tie points in the solution without them, of products without their excess."""
        values, factors = [], []
        for tie in ties:
            value, factor = np.zeros(len(tie.compared)), np.zeros((len(tie.compared), self.factors.x.shape[1]))
            for index, rows, sign in zip(tie.bodies, tie.rows, (1.0, -1.0), strict=True):
                product, slope = _products(self.solution.bodies[index].points[rows], tie.means)
                excess = self.variance * self.excess(index, rows, tie.means)
                columns = (3 * rows[:, None] + np.arange(3)).ravel()
                value += sign * tie.compared @ (product - excess.ravel())
                factor += sign * (tie.compared @ slope) @ self.factors.points[index][columns]
            values.append(value)
            factors.append(factor)
        return _Misclosures(np.concatenate(values), np.concatenate(factors))

    def constrained(self, ties: list[TiePoints]) -> Solution:
        """The solution with the misclosures constrained to zero, and its covariances.

        The constraint F ξ = 0 removes the row space of F from the factors of all covariances.
        """
        solution, misclosures = self.solution, self.misclosures(ties)
        scale = 1 / np.maximum(np.linalg.norm(misclosures.factor, axis=1), 1e-300)
        left, sizes, right = np.linalg.svd(scale[:, None] * misclosures.factor, full_matrices=False)
        kept = sizes > RANK * sizes[0]
        right = right[kept]
        # The least ξ that closes the misclosures.
        closing = right.T @ ((left[:, kept].T @ (scale * misclosures.values)) / sizes[kept])
        moved = tuple(
            body.moved(-factor @ closing) for body, factor in zip(solution.bodies, self.factors.points, strict=True)
        )
        attached = zip(solution.bodies, self.factors.points, strict=True)
        of_offsets = np.concatenate([body.offset_by_points @ factor for body, factor in attached])
        of_x, of_offsets = (factor - (factor @ right.T) @ right for factor in (self.factors.x, of_offsets))
        return replace(
            solution,
            bodies=moved,
            x=solution.x - self.factors.x @ closing,
            covariance=of_x @ of_x.T,
            offset_covariance=of_offsets @ of_offsets.T,
            offset_path=of_offsets @ of_x.T,
        )


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


def _products(points: FloatArray, means: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The products b_j · b_k (g²,) of means of points (k, 3), and their Jacobian (g², 3 k)."""
    b = means @ points
    slope = np.einsum("jl,ki->jkli", means, b) + np.einsum("kl,ji->jkli", means, b)
    return (b @ b.T).ravel(), slope.reshape(len(b) ** 2, -1)

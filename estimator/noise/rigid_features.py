"""Which features keep their places on the body, as the residuals of an estimate tell.

The time is cut into windows, in each of which a feature has a mean place in axes of the body, and in each of which the
body is placed anew, by least squares. A feature's weight is that of its own noise within the windows, so that features
with more noise than others do not seem to move for it, and what is compared is how long errors last: the mean of errors
that last has more variance than its number of observations tells. Attitudes that noise has turned by an angle of a
feature's noise over the body's radius move means by second order, by that angle times the noise, which is allowed for.

Which features move, the residuals do not tell at once, as features far out draw the attitude, and then it is the others
that seem to. So those are sought, a little more than half of all, that leave the least squares behind (least trimmed
squares: Rousseeuw 1984, by concentration from many small samples: Rousseeuw and Van Driessen 2006, Data Mining and
Knowledge Discovery 12), and to these the others are added, that one first which adds the least, as long as what it adds
is no more than chance beside what is there (Atkinson and Riani 2000, Robust Diagnostic Regression Analysis), but at
least white noise. The ratio of the two is an F statistic, on which what all errors have in common has no influence.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc, fdtrc

from baryscope.estimator.adjustment.diagnostics import information_in_body
from baryscope.estimator.geometry.alignment import FEWEST_POINTS
from baryscope.estimator.geometry.evenly import evenly_spaced
from baryscope.estimator.geometry.extent import rms_radius
from baryscope.estimator.geometry.so3 import cross_matrices
from baryscope.estimator.geometry.symmetric import symmetric_inverses
from baryscope.estimator.result import Estimate
from baryscope.estimator.tracks import FeatureTracks

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

WINDOWS = 32  # of the time, at most
SHORTEST, LONGEST = 3, 50  # frames of a window, at least, and how many are looked at
FEWEST = 20  # observations of a feature, in frames with an attitude
COMMON = 20.0  # degrees of freedom for which the noise of all features counts in that of one
LONGER = 2.0  # times as long as those of others last errors that matter
CHANCE = 0.01  # probability that one of the features seems to move, below which that is none
SAMPLES = 20  # of three features: where a third of all move, three in ten have none, and none of 20 by chance of 1e-3
CONCENTRATIONS = 3  # rounds from a sample, at most
MOST = 60  # features that are looked at, those seen most often
TINY = 1e-9  # of a typical element on the diagonal: holds what is not determined, as the axes of the body


@dataclass(frozen=True, eq=False)
class WindowMeans:
    """Mean residuals of features in windows, in axes of the body, of those features that are seen often enough.

    features (m,): their indices in the estimate; arms (m, 3): places on the body, of rms 1; information (k, m, 3, 3) of
    each mean if a feature's errors were white noise as within the windows, 1/m², 0 where a feature is not seen, and
    weighted (k, m, 3), that times the mean; excess (m,): the mean squares over those of white noise, of so many degrees
    of freedom (m,).
    """

    features: IntArray
    arms: FloatArray
    information: FloatArray
    weighted: FloatArray
    excess: FloatArray
    freedom: FloatArray

    @classmethod
    def of(cls, found: Estimate, tracks: FeatureTracks) -> "WindowMeans | None":
        """Those of an estimate's residuals, weighed as tracks in C tell, without features of which most are rejected;
        None if these are too few.
        """
        if found.attitude is None:
            return None
        frames = evenly_spaced(len(found.time), WINDOWS * LONGEST)
        shown = found.used[frames] & ~found.rejected[frames] & np.isfinite(found.residuals[frames][..., 0])
        shown &= ~np.isin(found.labels, found.rejected_features)
        posed = (shown.sum(axis=1) >= FEWEST_POINTS) & np.isfinite(found.attitude[frames]).all(axis=(1, 2))
        frames, shown = frames[posed], shown[posed]
        count = min(WINDOWS, len(frames) // SHORTEST)
        often = shown.sum(axis=0)
        features = np.sort(np.argsort(often, kind="stable")[-MOST:])
        features = features[often[features] > FEWEST]
        if count < 2 or len(features) <= FEWEST_POINTS:
            return None
        starts = np.arange(count) * len(frames) // count
        own = _InBody.of(found, tracks, frames, features, shown[:, features])
        information, weighted, seen, freedom = (
            np.add.reduceat(each, starts, axis=0)
            for each in (own.information, own.weighted, own.seen.astype(np.float64), own.freedom)
        )
        of_means = np.divide(freedom, seen, out=np.zeros_like(freedom), where=seen > 0)
        within, between = (freedom - of_means).sum(axis=0), of_means.sum(axis=0) - 3
        known = between > 0
        if known.sum() <= FEWEST_POINTS:
            return None
        inner = own.squares.sum(axis=0) - _squares(information, weighted).sum(axis=0)
        of_all = max(float(inner.sum() / within.sum()), np.finfo(float).tiny)
        variance = (inner + COMMON * of_all) / (within + COMMON)
        inverse = symmetric_inverses(information)
        second_order = (variance * own.spread / own.radius) ** 2
        covariance = variance[:, None, None] * inverse + second_order[:, None, None] * np.eye(3)
        precision = np.where((seen > 0)[..., None, None], symmetric_inverses(covariance), 0.0)
        weighed = (precision @ inverse @ weighted[..., None])[..., 0]
        excess = _squares(precision, weighed).sum(axis=0) / np.maximum(between, 1.0)
        return cls(features, own.arms, precision, weighed, excess, between)._of(known)

    def _of(self, known: BoolArray) -> "WindowMeans":
        """Those of some of the features (m,)."""
        information, weighted = self.information[:, known], self.weighted[:, known]
        return WindowMeans(
            self.features[known], self.arms[known], information, weighted, self.excess[known], self.freedom[known]
        )

    @property
    def suspicious(self) -> bool:
        """Whether errors last at all, of one feature or of all, by more than chance."""
        squares = self.excess * self.freedom
        of_one = len(squares) * chdtrc(self.freedom, squares).min()
        return bool(min(of_one, chdtrc(self.freedom.sum(), squares.sum())) < CHANCE)

    def moving(self) -> IntArray:
        """The indices, in the estimate, of the features that move on the body, where the others keep their places."""
        equations = _Equations.of(self)
        kept = self._closest(equations)
        left, freedom = equations.left(kept), self._freedom(kept)
        while not kept.all():
            own = equations.left_by_each(equations.poses(kept)) / self._freedom_of_each
            more = kept.copy()
            more[np.argmin(np.where(kept, np.inf, own))] = True
            left_by_more, freedom_of_more = equations.left(more), self._freedom(more)
            gained = freedom_of_more - freedom
            if gained > 0:
                ratio = (left_by_more - left) / gained / max(left / freedom, 1.0)
                if ratio > LONGER and len(kept) * fdtrc(gained, freedom, ratio) < CHANCE:
                    break
            kept, left, freedom = more, left_by_more, freedom_of_more
        return self.features[~kept]

    def _closest(self, equations: "_Equations") -> BoolArray:
        """More than half of the features (m,) that leave the least squares for their degrees of freedom."""
        many, rng = len(self.features), np.random.default_rng(0)
        size, least, closest = max(many // 2, FEWEST_POINTS) + 1, np.inf, np.ones(many, dtype=bool)
        for sample in [np.arange(many), *(rng.permutation(many)[:FEWEST_POINTS] for _ in range(SAMPLES))]:
            kept = np.isin(np.arange(many), sample)
            for _ in range(CONCENTRATIONS):
                own = equations.left_by_each(equations.poses(kept)) / self._freedom_of_each
                before, kept = kept, np.isin(np.arange(many), np.argsort(own)[:size])
                if (kept == before).all():
                    break
            freedom = self._freedom(kept)
            cost = equations.left(kept) / freedom if freedom > 0 else np.inf
            if cost < least:
                least, closest = cost, kept
        return closest

    @property
    def _freedom_of_each(self) -> FloatArray:
        """The degrees of freedom (m,) of the means of each feature beside its place on the body, at least 1."""
        return np.asarray(np.maximum(3.0 * self.information.any(axis=(2, 3)).sum(axis=0) - 3.0, 1.0))

    def _freedom(self, kept: BoolArray) -> float:
        """The degrees of freedom of the means of kept features (m,) beside places on the body and of the body."""
        seen = self.information[:, kept].any(axis=(2, 3))
        many = seen.sum(axis=1)
        placed = np.select([many >= FEWEST_POINTS, many == FEWEST_POINTS - 1, many == 1], [6, 5, 3], 0)
        return float(3 * seen.sum() - placed.sum() - (3 * seen.any(axis=0).sum() - 6))


@dataclass(frozen=True, eq=False)
class _Equations:
    """For each feature, of the body's rotations and shifts in the windows: normal matrix (m, 6 k, 6 k), right hand side
    (m, 6 k) and squares (m,), without what the feature's place on the body takes.
    """

    normal: FloatArray
    right: FloatArray
    squares: FloatArray

    @classmethod
    def of(cls, means: WindowMeans) -> "_Equations":
        """Those of mean residuals."""
        count, many = means.information.shape[:2]
        jacobian = _by_pose(means.arms)
        by_pose = means.information @ jacobian  # (k, m, 3, 6)
        whole, total = symmetric_inverses(means.information.sum(axis=0)), means.weighted.sum(axis=0)
        normal = -np.einsum("kmia,mij,lmjb->mkalb", by_pose, whole, by_pose, optimize=True)
        window = np.arange(count)
        normal[:, window, :, window] += np.einsum("mia,kmib->kmab", jacobian, by_pose, optimize=True)
        right = np.einsum("mia,kmi->mka", jacobian, means.weighted)
        right -= np.einsum("kmia,mij,mj->mka", by_pose, whole, total, optimize=True)
        squares = _squares(means.information, means.weighted).sum(axis=0)
        squares -= np.einsum("mi,mij,mj->m", total, whole, total)
        return cls(normal.reshape(many, 6 * count, 6 * count), right.reshape(many, 6 * count), squares)

    def poses(self, kept: BoolArray) -> FloatArray:
        """The rotations and shifts (6 k,) by features that are kept (m,)."""
        size = self.normal.shape[1]
        matrix = (kept.astype(np.float64) @ self.normal.reshape(-1, size**2)).reshape(size, size)
        return np.asarray(np.linalg.solve(_held(matrix), kept @ self.right))

    def left(self, kept: BoolArray) -> float:
        """The squares of kept features (m,) that their poses leave."""
        return float(self.squares[kept].sum() - (kept @ self.right) @ self.poses(kept))

    def left_by_each(self, poses: FloatArray) -> FloatArray:
        """The squares (m,) of each feature that poses (6 k,) leave."""
        return np.asarray(self.squares - 2 * self.right @ poses + (self.normal @ poses) @ poses)


@dataclass(frozen=True, eq=False)
class _InBody:
    """Residuals of frames in axes of the body, each frame's pose fitted to them.

    seen (n, m); arms (m, 3): the features' places on the body, from their centroid, of rms 1; information (n, m, 3, 3),
    0 where nothing is seen; weighted (n, m, 3): that times the residual; squares (n, m): that times the residual twice;
    freedom (n, m): the expectation of the squares with true information, less than 3 by what the frame's pose takes;
    radius: the rms distance of the places from their centroid, m; spread (m,): the mean trace of an observation's
    covariance, in the unit of the inverse of `information`.
    """

    seen: BoolArray
    arms: FloatArray
    information: FloatArray
    weighted: FloatArray
    squares: FloatArray
    freedom: FloatArray
    radius: float
    spread: FloatArray

    @classmethod
    def of(
        cls, found: Estimate, tracks: FeatureTracks, frames: IntArray, features: IntArray, seen: BoolArray
    ) -> "_InBody":
        """Those of some frames (n,) and features (m,) of an estimate, where these are seen (n, m)."""
        assert found.attitude is not None  # noqa: S101  as its caller has seen
        turn, at = found.attitude[frames], (frames[:, None], features)
        source = found.sources(tracks.labels)[features]
        residual = np.where(seen[..., None], found.residuals[at], 0.0) @ turn
        place = tracks.position[frames[:, None], source] - found.residuals[at] - found.position[frames, None]
        place = np.where(seen[..., None], place, 0.0) @ turn
        arms = place.sum(axis=0) / seen.sum(axis=0)[:, None]
        radius = rms_radius(arms)
        arms = (arms - arms.mean(axis=0)) / radius
        own = None if tracks.covariance is None else tracks.covariance[frames[:, None], source]
        information, spread = information_in_body(seen, own, turn), np.full(len(features), 3.0)
        if own is not None:
            spread = np.mean(np.trace(own, axis1=2, axis2=3), axis=0, where=seen)
        jacobian = _by_pose(arms)
        of_pose = np.einsum("mia,nmij,mjb->nmab", jacobian, information, jacobian, optimize=True)
        inverse = np.linalg.inv(_held(of_pose.sum(axis=1)))
        moment = np.einsum("mia,nmij,nmj->na", jacobian, information, residual, optimize=True)
        residual = residual - np.einsum("mia,nab,nb->nmi", jacobian, inverse, moment, optimize=True)
        weighted = np.einsum("nmij,nmj->nmi", information, residual)
        taken = np.einsum("nmab,nba->nm", of_pose, inverse, optimize=True)
        squares = np.einsum("nmi,nmi->nm", weighted, residual)
        freedom = np.maximum(3.0 * seen - taken, 0.0)
        return cls(seen, arms, information, weighted, squares, freedom, radius, spread)


def _by_pose(arms: FloatArray) -> FloatArray:
    """Jacobian (m, 3, 6) of places on the body by a small rotation, rad, and a shift of it."""
    return np.concatenate([-cross_matrices(arms), np.broadcast_to(np.eye(3), (len(arms), 3, 3))], axis=2)


def _squares(information: FloatArray, weighted: FloatArray) -> FloatArray:
    """The squares (k, m) of means in units of their deviations, of information (k, m, 3, 3) and that times the mean."""
    return np.asarray(np.einsum("kmi,kmij,kmj->km", weighted, symmetric_inverses(information), weighted, optimize=True))


def _held(matrix: FloatArray) -> FloatArray:
    """Normal matrices (..., k, k) with what holds unknowns that they do not determine."""
    size = np.trace(matrix, axis1=-2, axis2=-1)[..., None, None] / matrix.shape[-1]
    return np.asarray(matrix + TINY * np.where(size > 0, size, 1.0) * np.eye(matrix.shape[-1]))

"""How much noisier depths are than the places across the line of sight, as the distances between features tell.

A stereo rig, or any camera, knows the depth worse than the place in the image. Where its tracks come without
covariances, the noise of a distance tells by how much, without any pose: for a pair of features whose connection has
the cosine c with the line of sight its variance is k (1 − c² + ρ² c²), ρ the ratio of the deviations along and across,
k the pair's own, and c² the mean of those with the features' two lines of sight, which differ by too much for a large
ρ. The likelihood is that of Student's distribution, in which outliers count for little, and its maximum over the k is
sought with ρ. As pairs share features, and frames that follow one another may share errors, the ratio of the
likelihoods with ρ and without counts for as much less as the derivatives by ρ, summed over blocks of frames, scatter
more than they would if all distances were independent (Chandler and Bate 2007, Biometrika 94).

Features that stay in a plane across the line of sight, as three of a target that turns about it, have distances of
which depths are no part. Nor is what is above true where depths are so noisy that they turn the connection, by an angle
of the deviation ε = ρ √k / d for a distance d: the cosine is that of noise then, and ρ too small. The second order of
the distance adds ρ² ε² / 2 to its variance over k. Where distances do not tell, or only in that way, the features' own
places do, if the frames follow one another so closely that a cubic polynomial is what moves in five of them: what is
left, a fourth divided difference, is noise. Less the mean of all features it is their own, without what moves a frame
as a whole, as a pivot that slips or a camera that shakes. If frames do not follow so closely, such a ρ is the least
that it may be, and tells nothing below 1. Where depths turn connections so far that none is along the line of sight,
any great ρ is as likely as any greater: of these it is that one deviation below, if no chance makes it great.

A camera's depths are noisier, if by how much is not told; so two deviations are enough for such a ratio. What is then
by chance is near 1 where tracks tell much; where they tell little, as three features far away, noise that passes for
alike in all axes made a spin seem to wobble, and told of its axis what nothing does.

Tracks with covariances tell both deviations, but a rig's may be off in depth as nowhere else. Of such tracks the ratio
is that to what is told: ρ is the factor on the deviations along the line of sight, and k that on all variances.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.geometry.evenly import evenly_spaced
from baryscope.estimator.registration.screening import distances_between
from baryscope.estimator.tracks import FeatureTracks

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

SAMPLE = 600  # frames that are looked at, at most
MOST_PAIRS = 40  # of features, whose distances are looked at
DOF = 4.0  # of Student's distribution
ROUNDS = 60  # of a fit, at most
MOST_STEP, STEADY = 1.0, 1e-3  # of ln ρ²: the longest step, and what needs no further one
GREATEST = 2 * np.log(1000)  # |ln ρ²|, at which it is no longer sought: that of a rig at 700 times its baseline
BLOCKS, LEAST_BLOCKS = 24, 6  # of the frames: their sums tell how errors depend on those of frames nearby
CHANCE = 3.5  # standard deviations, below which a ratio other than 1 is chance
CHANCE_UNTOLD = 2.0  # the same of depths that are noisier, as a camera's are, where no covariance tells that
RATIO = 1.25  # ρ, below which it is no matter
TELLING = 1.5  # ρ: distances that would not show one as great do not tell it
LEAST_STEP = 0.05  # of ln ρ², to which the least is sought
TURNED = 0.1  # ρ² ε²: a greater one makes ρ more than 5 % too small
DIFFERENCE = 5  # frames of a divided difference
NOISE = -0.6  # correlation of a divided difference with the next, up to which it is noise
ROUNDING, BODY = 1e-9, 0.1  # of a typical distance: what is less is no noise, what is more changes it


@dataclass(frozen=True)
class DepthRatio:
    """ratio: deviation along the line of sight over that across it; of_rig: they grow with the range as those of a
    stereo rig, at whose mean `distance`, m, the ratio holds.
    """

    ratio: float
    of_rig: bool
    distance: float

    def deviations(self, deviation: float) -> tuple[float, float]:
        """Those across and along the line of sight, m, for an rms deviation of a coordinate, m."""
        across = deviation * float(np.sqrt(3 / (2 + self.ratio**2)))
        return across, self.ratio * across

    def covariance(self, place: FloatArray) -> FloatArray:
        """The covariance (n, m, 3, 3) of observations at places (n, m, 3), with an rms deviation of 1 of a coordinate.

        place: in C, m, with the rig at the origin, NaN where nothing is seen, which gets that of no direction.
        """
        distance, sight = np.linalg.norm(place, axis=2), _directions(place)
        known = np.isfinite(distance) & (distance > 0)
        growth = np.where(known, distance / self.distance, 1.0) ** 2 if self.of_rig else np.ones_like(distance)
        own, depth = (one**2 for one in self.deviations(1.0))
        across, along = (own * growth)[..., None, None], (depth * growth**2)[..., None, None]
        outer = sight[..., :, None] * sight[..., None, :]
        return np.asarray(across * np.eye(3) + (along - across) * outer)


def depth_ratio(tracks: FeatureTracks, right: BoolArray) -> DepthRatio | None:
    """How much noisier, or better, depths are, beside what covariances of the tracks tell; None if it is no matter, or
    chance.

    right (n, m): the observations that count. The rig is at the origin of C.
    """
    rows = evenly_spaced(len(right), SAMPLE)
    lengths, blocks = _Lengths.of_pairs(tracks, right, rows), min(BLOCKS, len(rows) // 2)
    if blocks < LEAST_BLOCKS:
        return None
    told = tracks.covariance is not None
    found = _Ratio.of(lengths, blocks, told=told) if lengths.off.size else None
    if found is not None and found.tells:
        return found.shown
    own, whole = (
        None if differences is None else _Ratio.of(differences, blocks, told=told)
        for differences in (_Lengths.of_differences(tracks, right, own=own) for own in (True, False))
    )
    if own is not None and (own.tells or own.shown is not None):
        return own.shown
    # Where depths turn connections, distances tell the least that ρ may be, and so do features that are seen alone:
    # what moves a frame as a whole is not along the line of sight only. What features themselves exclude, it is not.
    least = [one.shown for one in (whole, found) if one is not None and one.shown is not None and one.shown.ratio > 1]
    return least[0] if least and (own is None or own.allows(least[0])) else None


def with_noisier_depths(covariance: FloatArray, place: FloatArray, factor: float) -> FloatArray:
    """The covariance (n, m, 3, 3) in C, m², of observations at places (n, m, 3) with deviations along the line of sight
    times a factor.
    """
    sight = _directions(place)
    scaling = np.eye(3) + (factor - 1) * sight[..., :, None] * sight[..., None, :]
    scaled = scaling @ covariance @ scaling
    return np.asarray((scaled + np.swapaxes(scaled, -1, -2)) / 2)  # symmetric but for rounding


def deviations(covariance: FloatArray, place: FloatArray) -> tuple[float, float]:
    """The rms deviations, m, across and along the lines of sight to places (k, 3) in C, of covariances (k, 3, 3)."""
    along = _variances(covariance, _directions(place))
    across = (np.trace(covariance, axis1=-2, axis2=-1) - along) / 2
    return float(np.sqrt(across.mean())), float(np.sqrt(along.mean()))


def _directions(place: FloatArray) -> FloatArray:
    """Lines of sight (..., 3) to places in C; zero where nothing is seen."""
    distance = np.linalg.norm(place, axis=-1, keepdims=True)
    known = np.isfinite(distance) & (distance > 0)
    return np.where(known, place, 0.0) / np.where(known, distance, 1.0)


def _variances(covariance: FloatArray, axis: FloatArray) -> FloatArray:
    """Those (...) of covariances (..., 3, 3) along axes (..., 3)."""
    return np.asarray(np.einsum("...i,...ij,...j->...", axis, covariance, axis))


@dataclass(frozen=True, eq=False)
class _Lengths:
    """Lengths: by how much they are off the typical ones, (n, k), m, where they are seen, (n, k).

    across, along (n, k): parts of the variance as told by places across and along the line of sight, in 1 for each, or
    m²; range_squared (n, k), over that of the mean `distance`, m, 1 where variances are told; alike (k,): the index of
    those whose deviation is the same but for these; turned (k,): ρ² ε² for ρ = k = 1, 0 for those of no connection.
    """

    off: FloatArray
    seen: BoolArray
    across: FloatArray
    along: FloatArray
    range_squared: FloatArray
    distance: float
    alike: IntArray
    turned: FloatArray

    @classmethod
    def of_pairs(cls, tracks: FeatureTracks, right: BoolArray, rows: IntArray) -> "_Lengths":
        """Distances in some rows of tracks that are noisy, but less than the body is large."""
        position, seen = tracks.position[rows], right[rows]
        distances = distances_between(position, seen)
        few = evenly_spaced(len(distances.pairs), MOST_PAIRS)
        off, typical = distances.off[:, few], distances.typical[few]
        both = np.isfinite(off)
        off = np.where(both, off, 0.0)
        noise = np.sqrt(np.sum(off**2, axis=0) / np.maximum(both.sum(axis=0), 1))
        kept = (noise > ROUNDING * typical) & (noise < BODY * typical)
        off, both, (i, j) = off[:, kept], both[:, kept], distances.pairs[few][kept].T
        shown = np.where(seen[..., None], position, 0.0)
        away, sight, apart = np.linalg.norm(shown, axis=2), _directions(shown), _directions(shown[:, i] - shown[:, j])
        cosines = np.array([np.einsum("nki,nki->nk", apart, sight[:, end]) for end in (i, j)])
        depth, side = np.ones((2, 2, *off.shape))  # told variances of either end
        away = (away[:, i] + away[:, j]) / 2
        mean = float(away[both].mean()) if both.any() else 1.0
        growth = np.where(both, away / mean, 1.0) ** 2
        if tracks.covariance is not None:
            told = np.where(both[..., None, None], [tracks.covariance[rows[:, None], end] for end in (i, j)], np.eye(3))
            depth, growth = _variances(told, np.array([sight[:, i], sight[:, j]])), np.ones(off.shape)
            side = (np.trace(told, axis1=-2, axis2=-1) - depth) / 2
        along, across = np.mean(cosines**2 * depth, axis=0), np.mean((1 - cosines**2) * side, axis=0)
        whole, part = (np.sum(np.mean(one, axis=0) * both, axis=0) / both.sum(axis=0) for one in (depth, side))
        turned = whole**2 / (part * typical[kept] ** 2)
        return cls(off, both, across, along, growth, mean, np.arange(off.shape[1]), turned)

    @classmethod
    def of_differences(cls, tracks: FeatureTracks, right: BoolArray, *, own: bool) -> "_Lengths | None":
        """Fourth divided differences of positions, less their mean over the features if `own`, along the line of sight
        and two axes across it; None if they are no noise.

        Those of white noise that follow one another have a correlation of −0.8, those of a motion nearly 1.
        """
        windows = _Windows.of(tracks.time)
        rows, middle = windows.begins[:, None] + np.arange(DIFFERENCE), windows.begins + DIFFERENCE // 2
        few = evenly_spaced(right.shape[1], MOST_PAIRS)
        known = right[:, few][rows].all(axis=1)
        known &= known.sum(axis=1, keepdims=True) >= (2 if own else 1)
        few, known = few[known.any(axis=0)], known[:, known.any(axis=0)]
        if len(few) < 2:
            return None
        place = tracks.position[middle[:, None], few]
        sight = np.where(known[..., None], place, place[known].mean(axis=0))
        away, axes = np.linalg.norm(sight, axis=2, keepdims=True), _axes(sight)
        shown = np.where(known[:, None, :, None], tracks.position[:, few][rows], 0.0)
        off = np.einsum("nw,nwmi,nmai->nma", windows.factor, shown, axes, optimize=True)
        # The mean along each feature's own axes: so no depth of one is added across the line of sight of another.
        here, others = known[..., None], np.maximum(known.sum(axis=1), 1)[:, None, None]
        if own:
            off = np.where(here, off - np.sum(off, axis=1, keepdims=True, where=here) / others, 0.0)
        both = windows.follow[:, None] & known[:-1] & known[1:]
        products, squares = (np.sum(off[:-1][both] * one[both], axis=0) for one in (off[1:], off[:-1]))
        distance = float(away[known].mean())
        # Where depths are noise, what moves across the line of sight may yet be no noise.
        noise = all(products[axis].sum() < NOISE * squares[axis].sum() for axis in (slice(0, 1), slice(1, 3)))
        if not noise or np.sqrt(squares.sum() / both.sum()) <= ROUNDING * distance:
            return None
        whole, growth = np.ones(off.shape), np.broadcast_to((away / distance) ** 2, off.shape)
        if tracks.covariance is not None:
            told = np.einsum("nw,nwmij->nmij", windows.factor**2, tracks.covariance[:, few][rows])
            whole, growth = np.where(here, _variances(told[:, :, None], axes), 1.0), whole
        if own:
            whole = whole * (1 - 2 / others) + np.sum(whole, axis=1, keepdims=True, where=here) / others**2
        columns = (off, np.broadcast_to(known[..., None], off.shape), whole * [0, 1, 1], whole * [1, 0, 0], growth)
        off, seen, across, along, growth = (one.reshape(len(off), -1) for one in columns)
        alike = np.repeat(np.arange(len(few)), 3)
        return cls(off, seen, across, along, growth, distance, alike, np.zeros(len(alike)))

    def summed(self, values: FloatArray) -> FloatArray:
        """The sum of values (n, k) over frames and all columns that are alike, for each column (k,)."""
        return np.asarray(np.bincount(self.alike, values.sum(axis=0))[self.alike])

    def told(self, slope: FloatArray, square: FloatArray, count: FloatArray) -> tuple[FloatArray, float]:
        """The scores (n,) of each frame and the information, see `_Fit`, for slopes (n, k) of the logarithms of the
        variances, and weighted squares (n, k) over these; count (k,): of what is seen of all that are alike.
        """
        slope = np.where(self.seen, slope, 0.0)
        slope = np.where(self.seen, slope - self.summed(slope) / count, 0.0)  # with the scale that fits it
        information = 0.5 * DOF / (DOF + 3) * float((slope**2).sum())
        return np.asarray(0.5 * (slope * (square - 1)).sum(axis=1)), information


@dataclass(frozen=True, eq=False)
class _Windows:
    """Successive frames that are looked at together: begins (w,), whether the next ones begin a frame later, follow
    (w − 1,), and the factors (w, DIFFERENCE) of a divided difference, of square sum 1.
    """

    begins: IntArray
    follow: BoolArray
    factor: FloatArray

    @classmethod
    def of(cls, time: FloatArray) -> "_Windows":
        """Windows in blocks that are spread over the time (n,), s; none is longer than twice what most are."""
        count, each = len(time) - DIFFERENCE + 1, max(SAMPLE // BLOCKS, 1)
        begins = np.arange(count)
        if count > SAMPLE:
            begins = (np.linspace(0, count - each, BLOCKS).astype(int)[:, None] + np.arange(each)).ravel()
        length = time[begins + DIFFERENCE - 1] - time[begins]
        begins = begins[length <= 2 * np.median(length)]
        own = time[begins[:, None] + np.arange(DIFFERENCE)]
        own = (own - own[:, :1]) / (own[:, -1:] - own[:, :1])
        factor = 1 / np.prod(own[:, :, None] - own[:, None, :] + np.eye(DIFFERENCE), axis=2)
        return cls(begins, np.diff(begins) == 1, factor / np.linalg.norm(factor, axis=1, keepdims=True))


def _axes(sight: FloatArray) -> FloatArray:
    """Axes (n, m, 3, 3), the first of which is along a line of sight (n, m, 3); the others change steadily with it."""
    sight = _directions(sight)
    other = np.eye(3)[np.argmin(np.abs(sight.mean(axis=(0, 1))))]
    across = np.cross(sight, other)
    across /= np.linalg.norm(across, axis=2, keepdims=True)
    return np.stack([sight, across, np.cross(sight, across)], axis=2)


@dataclass(frozen=True, eq=False)
class _Ratio:
    """What lengths tell of the ratio: `shown` unless it is chance; tells: whether that is all there is to it, as it is
    shown, or one of TELLING would have been, and depths do not turn connections.

    best: its likeliest value; dependence: by how much less ratios of likelihoods count than those of independent ones.
    """

    lengths: _Lengths
    best: "_Fit"
    dependence: float
    shown: DepthRatio | None
    tells: bool

    @classmethod
    def of(cls, lengths: _Lengths, blocks: int, *, told: bool) -> "_Ratio":
        """The ratio of lengths in so many blocks of frames; told: whether it is that to covariances."""
        alike = _Fit.of(lengths, of_rig=False)
        of_a_rig = _Fit.of(lengths, of_rig=True, near=alike)
        best = max(alike, of_a_rig, key=lambda fit: fit.likelihood)
        of_rig = best is of_a_rig
        equal = _Fit.of(lengths, of_rig=of_rig, near=best, log_ratio=0.0)
        dependence = max(1.0, equal.dependence(blocks))
        of = partial(cls, lengths, best, dependence)
        tells = 2 * np.log(TELLING) * np.sqrt(equal.information / dependence) >= CHANCE
        linear = best.turned <= TURNED
        matters = 2 * np.log(RATIO) <= abs(best.log_ratio) and best.log_ratio > -GREATEST  # none is that much better
        chance = CHANCE_UNTOLD if best.log_ratio > 0 and not told else CHANCE
        if not matters or 2 * (best.likelihood - equal.likelihood) / dependence < chance**2:
            return of(None, tells and linear)
        log_ratio = best.log_ratio
        if log_ratio == GREATEST:
            sure, log_ratio = (
                _least(lengths, best, deviations * np.sqrt(dependence), of_rig=of_rig) for deviations in (chance, 1.0)
            )
            if sure < 2 * np.log(TELLING):
                return of(None, tells=False)
        return of(DepthRatio(float(np.exp(log_ratio / 2)), of_rig, lengths.distance), linear)

    def allows(self, ratio: DepthRatio) -> bool:
        """Whether a ratio, as other lengths show it, may by chance be that of these."""
        log_ratio = 2 * float(np.log(ratio.ratio))
        fit = _Fit.of(self.lengths, of_rig=ratio.of_rig, near=self.best, log_ratio=log_ratio)
        return 2 * (self.best.likelihood - fit.likelihood) / self.dependence < CHANCE**2


def _least(lengths: _Lengths, greatest: "_Fit", deviations: float, *, of_rig: bool) -> float:
    """The ln ρ² so many deviations below the greatest that is sought, where lengths are as likely with any greater."""
    less, more, decrease = 0.0, float(GREATEST), deviations**2 / 2
    while more - less > LEAST_STEP:
        middle = (less + more) / 2
        fit = _Fit.of(lengths, of_rig=of_rig, near=greatest, log_ratio=middle)
        less, more = (middle, more) if greatest.likelihood - fit.likelihood > decrease else (less, middle)
    return more


@dataclass(frozen=True, eq=False)
class _Fit:
    """The maximum of the likelihood: ln ρ², and the logarithm of the likelihood there.

    scores (n,): of each frame, the derivative of that logarithm by ln ρ²; information: the expectation of its square,
    for all frames, if all distances are independent; turned: ρ² ε², the median of all lengths; scale, mean (k,): those
    of Student's distribution of each column.
    """

    log_ratio: float
    likelihood: float
    scores: FloatArray
    information: float
    turned: float
    scale: FloatArray
    mean: FloatArray

    @classmethod
    def of(
        cls, lengths: _Lengths, *, of_rig: bool, near: "_Fit | None" = None, log_ratio: float | None = None
    ) -> "_Fit":
        """The fit of k (1 − c² + ρ² c²), or as told, growing with a rig's range, to lengths; near: one to begin from.

        log_ratio: ln ρ², unless that is sought.
        """
        free = log_ratio is None
        off, seen, growth = lengths.off, lengths.seen, lengths.range_squared if of_rig else 1.0
        across, along = lengths.across * growth, lengths.along * growth**2
        count = lengths.summed(seen.astype(np.float64))
        if near is not None:
            scale, mean = near.scale, near.mean
        else:
            scale, mean = lengths.summed(off**2) / count, np.zeros(off.shape[1])
        log_ratio = (0.0 if near is None else near.log_ratio) if log_ratio is None else log_ratio
        for _ in range(ROUNDS):
            growing = np.exp(log_ratio) * along
            shape = np.where(seen, across + growing, 1.0)
            square = (off - mean) ** 2
            weight = np.where(seen, (DOF + 1) / (DOF + square / (scale * shape)), 0.0)
            weighted = weight * square
            before, scale = scale, np.maximum(lengths.summed(weighted / shape) / count, 1e-300)
            mean = (weight * off / shape).sum(axis=0) / (weight / shape).sum(axis=0)
            moved = log_ratio
            if free:
                scores, information = lengths.told(growing / shape, weighted / (scale * shape), count)
                step = np.clip(scores.sum() / max(information, 1e-300), -MOST_STEP, MOST_STEP)
                moved = float(np.clip(log_ratio + step, -GREATEST, GREATEST))
            steady = max(abs(moved - log_ratio), float(np.abs(np.log(scale / before)).max())) < STEADY
            log_ratio = moved
            if steady:
                break
        if not free:
            scores, information = lengths.told(growing / shape, weighted / (scale * shape), count)
        logarithm = np.log(scale * shape) + (DOF + 1) * np.log1p(square / (DOF * scale * shape))
        turned = float(np.median(np.exp(2 * log_ratio) * scale * lengths.turned))
        return cls(log_ratio, -0.5 * float(logarithm[seen].sum()), scores, information, turned, scale, mean)

    def dependence(self, blocks: int) -> float:
        """The variance of the scores, summed over so many blocks of frames, over that of independent distances."""
        sums = np.array([part.sum() for part in np.array_split(self.scores, blocks)])
        return float(blocks * np.var(sums, ddof=1)) / max(self.information, 1e-300)

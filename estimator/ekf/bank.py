"""The bank of hypotheses of `ekf`: densities of the process noise of path and rotation, and their probabilities.

A density is zero with probability 1/2; else every factor of ten of it, over sixteen of them, is as probable as any
other. The levels at which the likelihood is evaluated lie at factors of the density whose effect over the time span
equals the noise of a single observation. Where the tracks tell a density better than to a factor of ten, the
intervals between levels are halved.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from math import log, log10

import numpy as np

from baryscope.estimator.options import Density
from baryscope.estimator.tracks import FloatArray

DECADES = 16  # of a density, over which its logarithm is uniformly distributed
COARSE = tuple(10.0**power for power in range(-4, 9, 2))  # levels that are tried first
FINE = 10.0  # factor between neighbouring levels
GENEROUS = 1e4  # level of a noise that leaves the other one free to be judged
MAX_REFINEMENTS = 12  # moves of the bank to a better neighbour
CLOSE = 0.4  # decades, within which a density need not be evaluated beside another
STEEPEST = 2.0  # logarithm by which neighbours differ where one is probable, above which a level is tried between
HALVINGS = 10  # of a factor of ten
ROUNDING = 1e-9  # difference of logarithms of one density
CREDIBLE = 0.05  # probability on either side of the bounds of a density
NEGLIGIBLE = 0.02  # probability below which a member does not enter the result,
ALL = 0.9  # unless those that do have less than this together, as where many are equally probable

Bounds = tuple[float, float]  # least and greatest density


@dataclass(frozen=True)
class Member:
    """A hypothesis: density of the path's process noise, m²/s³, or m² of a position, and of the rotation's, rad²/s³."""

    path: float
    turn: float


@dataclass(frozen=True)
class Axis:
    """The hypotheses for one density: its unit level, and the density if it is given."""

    level: float
    option: Density

    @property
    def free(self) -> bool:
        """Whether the density is to be estimated."""
        return self.option == "auto"

    @property
    def given(self) -> float:
        """The density where it is not estimated."""
        return 0.0 if isinstance(self.option, str) else self.option

    def at(self, level: float) -> float:
        """The density at a level, or the given one."""
        return level * self.level if self.free else self.given

    @property
    def coarse(self) -> list[float]:
        """The densities that are tried first."""
        return [0.0, *(self.at(level) for level in COARSE)] if self.free else [self.given]

    def around(self, density: float) -> list[float]:
        """The neighbours of a density, if it is to be estimated."""
        if not self.free:
            return []
        return [0.0, density / FINE, density * FINE] if density else [self.at(COARSE[0])]

    def log_prior(self, density: float) -> float:
        """Logarithm of the probability of a factor of ten around the density, or of none, but for a constant."""
        return -log(DECADES) if self.free and density > 0 else 0.0


def level_of(variance: float, span: float) -> float:
    """The density of an acceleration that moves by `variance` over a span in s."""
    return 3 * variance / span**3


@dataclass(eq=False)
class Bank:
    """The search for the most probable member; scores: the log-likelihoods of the members evaluated so far."""

    path: Axis
    turn: Axis
    evaluate: Callable[[Sequence[Member]], FloatArray]
    scores: dict[Member, float] = field(default_factory=dict)

    def best(self, start: Member | None) -> Member:
        """The most probable member: from `start`, or from the coarse levels."""
        if start is None:
            generous = self.path.at(GENEROUS)
            best = self._best([Member(generous, turn) for turn in self.turn.coarse])
            best = self._best([replace(best, path=path) for path in self.path.coarse])
        else:
            best = start
        for _ in range(MAX_REFINEMENTS):
            found = self._best([best, *self._around(best)])
            if found == best:
                break
            best = found
        return best

    def scaled(self, member: Member, factor: float) -> Member:
        """A member with densities that are estimated times a factor."""
        path, turn = (factor if axis.free else 1.0 for axis in (self.path, self.turn))
        return Member(path * member.path, turn * member.turn)

    def posterior(self, best: Member) -> tuple[list[Member], FloatArray]:
        """The members with their probabilities (k,), as if path and rotation were independent around the best one.

        What is likely along either density is evaluated first, wherever it lies.
        """
        self._survey(best)
        paths, path_weight = self._weights(self.path, best)
        turns, turn_weight = self._weights(self.turn, best)
        weight = np.outer(path_weight, turn_weight).ravel()
        members = [Member(path, turn) for path, turn in product(paths, turns)]
        descending = np.sort(weight)[::-1]
        enough = descending[np.searchsorted(np.cumsum(descending), ALL)]
        kept = weight >= min(NEGLIGIBLE, float(enough))
        return [member for member, keep in zip(members, kept, strict=True) if keep], weight[kept] / weight[kept].sum()

    def mean(self, best: Member) -> Member:
        """The mean densities over all members along either density from the best one, with the improbable ones.

        What noise adds ahead grows with its density: one of ten times as much and a tenth of the probability adds as
        much to the mean square.
        """
        self._survey(best)
        (paths, path_weight), (turns, turn_weight) = (self._weights(axis, best) for axis in (self.path, self.turn))
        return Member(float(path_weight @ paths), float(turn_weight @ turns))

    def bounds(self, best: Member) -> tuple[Bounds, Bounds]:
        """The bounds that hold 90 % of the density of path and rotation, along either from the best member."""
        self._survey(best)
        return self._bounds(self.path, best), self._bounds(self.turn, best)

    def significance(self, best: Member) -> float:
        """2 ln of the likelihood of the path's density over that of none, as far as it is known along it."""
        scores = self._along(self.path, best)
        return 2 * (max(scores.values()) - scores[0.0])

    def _bounds(self, axis: Axis, best: Member) -> Bounds:
        densities, weight = self._weights(axis, best)
        positive = np.array(densities) > 0
        if not positive.any():
            return 0.0, 0.0
        below = (np.cumsum(weight) - weight / 2)[positive]  # half of a level's own
        low, high = np.exp(np.interp([CREDIBLE, 1 - CREDIBLE], below, np.log(np.array(densities)[positive]))).tolist()
        return (0.0 if weight[~positive].sum() >= CREDIBLE else low), high

    def _survey(self, best: Member) -> None:
        """Evaluate, along either density from the best member, the coarse levels, and beside all that is probable."""
        free = [axis for axis in (self.path, self.turn) if axis.free]
        new = [best, *(self._with(axis, best, density) for axis in free for density in axis.coarse)]
        while new:
            self._best(new)
            new = [self._with(axis, best, density) for axis in free for density in self._beside(axis, best)]
        for axis in free:
            self._narrow(axis, best)

    def _narrow(self, axis: Axis, best: Member) -> None:
        """Evaluate levels along a density from the best member, until no two of which one counts are far apart."""
        for _ in range(HALVINGS):
            probable = self._probable(axis, best)
            score = np.array([value for density, value in probable.items() if density > 0])
            level = np.log([density for density in probable if density > 0])
            counts = np.maximum(score[1:], score[:-1]) > max(probable.values()) - STEEPEST
            far = counts & (_rise(level, score) > STEEPEST)
            if not far.any():
                break
            middle = np.exp((level[1:] + level[:-1])[far] / 2)
            self._best([self._with(axis, best, density) for density in middle.tolist()])

    def _beside(self, axis: Axis, best: Member) -> list[float]:
        """The densities beside probable ones that are not known yet."""
        probable = self._probable(axis, best)
        known, least = [density for density in probable if density > 0], max(probable.values()) + log(NEGLIGIBLE)
        return [
            near
            for density in known
            for near in (density / FINE, density * FINE)
            if probable[density] > least
            and known[0] < near < known[-1]
            and min(abs(log10(near / other)) for other in known) > CLOSE
        ]

    def _with(self, axis: Axis, best: Member, density: float) -> Member:
        """The best member with another density of the path or the rotation."""
        return replace(best, path=density) if axis is self.path else replace(best, turn=density)

    def _along(self, axis: Axis, best: Member) -> dict[float, float]:
        """The scores evaluated so far along a density, ascending, from the best member."""
        every = sorted({member.path if axis is self.path else member.turn for member in self.scores})
        members = {density: self._with(axis, best, density) for density in every}
        return {density: self.scores[member] for density, member in members.items() if member in self.scores}

    def _probable(self, axis: Axis, best: Member) -> dict[float, float]:
        """The logarithms of likelihood and prior along a density, as far as they are known, ascending in it."""
        return {density: score + axis.log_prior(density) for density, score in self._along(axis, best).items()}

    def _weights(self, axis: Axis, best: Member) -> tuple[list[float], FloatArray]:
        """Densities, ascending, and their probabilities."""
        probable = self._probable(axis, best)
        densities, logarithm = list(probable), np.array(list(probable.values()))
        width = np.ones(len(densities))
        positive = [k for k, density in enumerate(densities) if density > 0]
        if len(positive) > 1:
            width[positive] = _widths(np.log10([densities[k] for k in positive]), logarithm[positive])
        weight = width * np.exp(logarithm - logarithm.max())
        return densities, weight / weight.sum()

    def _around(self, best: Member) -> list[Member]:
        """Neighbours of a member along both axes."""
        paths, turns = self.path.around(best.path), self.turn.around(best.turn)
        return [replace(best, path=path) for path in paths] + [replace(best, turn=turn) for turn in turns]

    def _best(self, members: Sequence[Member]) -> Member:
        new = [member for member in dict.fromkeys(members) if member not in self.scores]
        if new:
            self.scores.update(zip(new, self.evaluate(new).tolist(), strict=True))
        return max(members, key=self.log_posterior)

    def log_posterior(self, member: Member) -> float:
        """Logarithm of a member's likelihood and prior, but for a constant."""
        return self.scores[member] + self.path.log_prior(member.path) + self.turn.log_prior(member.turn)


def _rise(level: FloatArray, score: FloatArray) -> FloatArray:
    """How far apart scores (k,) of successive levels (k,) are, or that of a peak between them, which their neighbours'
    slopes lead to (k - 1,).
    """
    apart, change = np.diff(level), np.diff(score)
    slope = np.divide(change, apart, out=np.zeros_like(change), where=apart > ROUNDING)
    slope = np.concatenate([[0.0], slope, [0.0]])
    return np.asarray(np.maximum(np.abs(change), np.minimum(slope[:-2], -slope[2:]) * apart))


def _widths(levels: FloatArray, logarithm: FloatArray) -> FloatArray:
    """The decades (k,) that levels (k,), ascending, stand for, of a probability with that logarithm (k,).

    By the trapezoidal rule, and to either end as far as the one inside. To a far level at which the probability is much
    smaller it is as far as to the near one on the other side, since where levels are close it falls as closely.
    """
    apart, drop = np.diff(levels) / 2, np.diff(logarithm)
    below, above = np.append(apart[0], apart), np.append(apart, apart[-1])
    falls_below, falls_above = np.append(0.0, drop) > STEEPEST, np.append(-drop, 0.0) > STEEPEST
    least = np.minimum(below, above)
    return np.where(falls_below, least, below) + np.where(falls_above, least, above)

"""The bank of hypotheses of `ekf`: densities of the process noise of path and rotation, and their probabilities.

A density is zero with probability 1/2; else every factor of ten of it, over sixteen of them, is as probable as any
other. The levels at which the likelihood is evaluated lie at factors of the density whose effect over the time span
equals the noise of a single observation.
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
NEGLIGIBLE = 0.02  # probability below which a member does not enter the result,
ALL = 0.9  # unless those that do have less than this together, as where many are equally probable


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

    def _survey(self, best: Member) -> None:
        """Evaluate, along either density from the best member, the coarse levels, and beside all that is probable."""
        free = [axis for axis in (self.path, self.turn) if axis.free]
        new = [best, *(self._with(axis, best, density) for axis in free for density in axis.coarse)]
        while new:
            self._best(new)
            new = [self._with(axis, best, density) for axis in free for density in self._beside(axis, best)]

    def _beside(self, axis: Axis, best: Member) -> list[float]:
        """The densities beside probable ones that are not known yet."""
        probable = {density: score + axis.log_prior(density) for density, score in self._along(axis, best).items()}
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

    def _weights(self, axis: Axis, best: Member) -> tuple[list[float], FloatArray]:
        """Densities, ascending, and their probabilities."""
        scores = self._along(axis, best)
        densities = list(scores)
        width = np.ones(len(densities))
        positive = [k for k, density in enumerate(densities) if density > 0]
        if len(positive) > 1:
            width[positive] = np.abs(np.gradient(np.log10([densities[k] for k in positive])))
        logarithm = np.array([scores[density] + axis.log_prior(density) for density in densities])
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

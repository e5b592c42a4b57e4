"""The passes with the other one of two gravity gradients, where tracks do not tell which acts, and their odds."""

from dataclasses import dataclass, replace

import numpy as np

from baryscope.estimator.ekf.linearised import linearised
from baryscope.estimator.ekf.passes import Passes, passes
from baryscope.estimator.ekf.solution import log_likelihoods
from baryscope.estimator.ml.search import UNLIKELY, probability_of
from baryscope.estimator.tracks import FloatArray
from baryscope.models.errors import ComputationError


@dataclass(frozen=True, eq=False)
class LikelyPasses:
    """The passes of the likelier model, and those of the other one, of a probability of at most a half, if it counts.

    alike: whether these differ ahead of the tracks only.
    """

    best: Passes
    other: Passes | None = None
    probability: float = 0.0
    alike: bool = False


def likely_passes(found: Passes) -> LikelyPasses:
    """Passes that have come to rest, and those from the start's rival, if it has one; by all observations."""
    rival = found.problem.start.rival
    if rival is None or not found.converged:
        return LikelyPasses(found)
    problem = replace(found.problem, start=rival.start)
    if rival.alike:
        return replace(_likely(found, replace(found, problem=problem), rival.excess), alike=True)
    try:
        other = passes(problem)
    except ComputationError:
        return LikelyPasses(found)
    if not other.converged:
        return LikelyPasses(found)
    excess = _excess(found, other)
    return _likely(found, other, excess) if excess >= 0 else _likely(other, found, -excess)


def _likely(best: Passes, other: Passes, excess: float) -> LikelyPasses:
    probability = probability_of(excess)
    return LikelyPasses(best, other, probability) if probability > UNLIKELY else LikelyPasses(best)


def _excess(found: Passes, other: Passes) -> float:
    """−2 ln of the odds of other passes, for the same weights of the observations and the same noise."""
    both = found, other
    weight = np.minimum(*(one.last.observations.weight for one in both))
    variance = min(one.last.frame_variance for one in both)
    lasting = max(one.last.lasting for one in both)
    own, another = (_log_evidence(one, weight, variance, lasting) for one in both)
    return 2 * (own - another)


def _log_evidence(found: Passes, weight: FloatArray, variance: float, lasting: float) -> float:
    """ln p(observations | model), up to a constant, with the likeliest of the probable process noises."""
    problem, about, last = found.problem, found.about, found.last
    noise, members, bank = problem.frame_noise(variance), found.members, last.bank
    assert bank is not None  # noqa: S101  passes that have come to rest have one
    system = linearised(about, problem.start.nodes, last.observations.weighted(weight), noise)
    prior = problem.prior(about, about.x + found.shift, variance)
    dof = problem.dof(last.observations.weighted(weight))
    likelihood = log_likelihoods(system, problem.noise(members, variance), prior, dof, lasting * variance)
    priors = [bank.path.log_prior(one.path) + bank.turn.log_prior(one.turn) for one in members]
    return float(np.max(likelihood + priors))

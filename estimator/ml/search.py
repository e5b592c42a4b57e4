"""From a solution of `pivot` to the likeliest tumble, and to another model of it that is likely, too.

Whether a gravity gradient acts, tracks tell that last for long enough. Where they do not, both models are followed: the
posterior odds of two are those of p(observations | model), by Laplace's approximation. The one that tells the inertia
better has to fit better for that.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from baryscope.estimator.adjustment.degrees_of_freedom import least_variance
from baryscope.estimator.hyperparameters import evidence
from baryscope.estimator.ml.initial_tumble import Tumble, fit_tumbles
from baryscope.estimator.ml.iteration import ROUNDING, STAGE
from baryscope.estimator.ml.maximum import MaximumAPosteriori, maximised
from baryscope.estimator.ml.relabelling import relabelled
from baryscope.estimator.options import PathOptions
from baryscope.estimator.pivot.pivot_solution import PivotSolution
from baryscope.estimator.progress import Rounds
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.attitude import INERTIA_BASIS
from baryscope.models.errors import ComputationError, Reason
from baryscope.models.orbit import Orbit

FloatArray = NDArray[np.float64]

UNDECIDED = 30.0  # −2 ln of the odds that attitudes tell, up to which all observations are asked
UNLIKELY = 1e-4  # probability of a model that does not count
ALIKE = 1e-3  # squared distance of rate and inertia of two fits, in units of the covariance, that makes no difference


@dataclass(frozen=True, eq=False)
class AlternativeTumble:
    """Another model of the tumble than the likeliest one, and its posterior probability, at most a half."""

    maximum: MaximumAPosteriori
    probability: float


@dataclass(frozen=True, eq=False)
class LikelyTumbles:
    """The maximum of the likelihood, and the other model if it is likely, too.

    tracks, and the solution of `pivot`, with a column for each point, if labels do not tell these apart.
    """

    tracks: FeatureTracks
    pivot: PivotSolution
    best: MaximumAPosteriori
    other: AlternativeTumble | None = None


def likeliest_tumble(
    tracks: FeatureTracks, solved: PivotSolution, torques: tuple[Orbit | None, ...], options: PathOptions, done: Rounds
) -> tuple[FeatureTracks, PivotSolution, MaximumAPosteriori]:
    """The maximum of the likelihood, and tracks and solution of `pivot` with a column for each point, if labels do not.

    torques: the orbits whose gravity gradient may act, None for none. By attitudes alone it is told which does.

    Raises:
        ComputationError: no tumble is found.
    """
    tracks, pivot, tumbles = _fitted(tracks, solved, torques, done)
    return tracks, pivot, _maximum(tracks, pivot, tumbles[0], options, done)


def likely_tumbles(
    tracks: FeatureTracks, solved: PivotSolution, torques: tuple[Orbit | None, ...], options: PathOptions, done: Rounds
) -> LikelyTumbles:
    """The likeliest tumble by all observations, and the other model if it is likely, too.

    Raises:
        ComputationError: no tumble is found.
    """
    tracks, pivot, tumbles = _fitted(tracks, solved, torques, done)
    best = _maximum(tracks, pivot, tumbles[0], options, done)
    if len(tumbles) < 2:
        return LikelyTumbles(tracks, pivot, best)
    excess = tumbles[1].excess - tumbles[0].excess
    if excess > UNDECIDED:
        return LikelyTumbles(tracks, pivot, best)
    if are_alike(*tumbles):
        other = replace(best, rotation=replace(best.rotation, orbit=tumbles[1].rotation.orbit))
        return LikelyTumbles(tracks, pivot, best, AlternativeTumble(other, probability_of(excess)))
    try:
        other = _maximum(tracks, pivot, tumbles[1], options, done)
    except ComputationError:
        return LikelyTumbles(tracks, pivot, best)
    if not other.converged:
        return LikelyTumbles(tracks, pivot, best)
    if not best.converged:
        return LikelyTumbles(tracks, pivot, other)
    excess = _excess(best, other)
    if excess < 0:
        best, other, excess = other, best, _excess(other, best)
    probability = probability_of(excess)
    likely = AlternativeTumble(other, probability) if probability > UNLIKELY else None
    return LikelyTumbles(tracks, pivot, best, likely)


def probability_of(excess: float) -> float:
    """The probability of one of two models of which this is −2 ln of the odds."""
    return float(expit(-excess / 2))


def _fitted(
    tracks: FeatureTracks, solved: PivotSolution, torques: tuple[Orbit | None, ...], done: Rounds
) -> tuple[FeatureTracks, PivotSolution, tuple[Tumble, ...]]:
    """Tracks and solution with a column for each point, and the rotations that fit the attitudes, likeliest first."""
    tracks, pivot = relabelled(tracks, solved)
    noise = max(pivot.frame_variance, least_variance(pivot.observations, ROUNDING))
    tumbles = fit_tumbles(pivot.bodies, pivot.observations, noise, tracks.time, torques, pivot.shifts)
    done.did(STAGE)
    return tracks, pivot, tumbles


def are_alike(one: Tumble, other: Tumble) -> bool:
    """Whether rate and inertia of two fits are the same, but for far less than their covariance."""
    rate, inertia = one.rotation.rate - other.rotation.rate, one.rotation.inertia - other.rotation.inertia
    apart = np.concatenate([rate, np.tensordot(INERTIA_BASIS, inertia)])
    return bool(apart @ one.information @ apart < ALIKE)


def _excess(best: MaximumAPosteriori, other: MaximumAPosteriori) -> float:
    """−2 ln of the odds of another model, for the same weights of the observations and the same noise."""
    weight = np.minimum(best.observations.weight, other.observations.weight)
    variance = min(best.variance, other.variance)
    costs = [_cost(one, weight, variance) for one in (best, other)]
    return costs[1] - costs[0]


def _cost(found: MaximumAPosteriori, weight: FloatArray, variance: float) -> float:
    """−2 ln p(observations | model), up to a constant, for weights (n, m) and the variance of one of weight 1."""
    own = found.observations.weight
    squares = np.where(weight > 0, found.equations.squares / np.where(own > 0, own, 1.0), 0.0)
    values, priors = found.priors.values(found.rotation, found.x), found.priors
    linear = priors.bounded(priors.linear(found.equations, values, variance))
    weak = priors.cost(values, np.zeros_like(values))
    by_data = (float(np.vdot(weight, squares)) + found.equations.noise_cost) / variance
    return by_data + weak + evidence.cost(linear, priors.own, found.posterior.theta)


def _maximum(
    tracks: FeatureTracks, pivot: PivotSolution, tumble: Tumble, options: PathOptions, done: Rounds
) -> MaximumAPosteriori:
    """The maximum of the likelihood from a fit to attitudes.

    Raises:
        ComputationError: there is none.
    """
    try:
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            best = maximised(tracks, pivot, tumble, options, done)
        finite = bool(np.isfinite(best.equations.cost) and np.isfinite(best.posterior.covariance).all())
    except np.linalg.LinAlgError:
        finite = False
    if not finite:
        raise ComputationError("no rotation with a torque follows the attitudes over the whole time", Reason.DIVERGED)
    return best

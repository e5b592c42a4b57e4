"""An estimate of two models of the tumble between which the tracks do not decide.

It is that of the likelier one. Its covariance is the mean square distance from it of what both models tell: that of
each by its probability, and for the other one the difference of the answers. Attitudes, rates and inertias are compared
in axes attached to the features, as their covariances are.
"""

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from baryscope.estimator.adjustment.diagnostics import main_cluster, observability_of
from baryscope.estimator.details import FilterDetails, TumbleDetails
from baryscope.estimator.geometry.gauge import attached_turn
from baryscope.estimator.geometry.so3 import exp_rotation, log_rotation
from baryscope.estimator.prediction import Point, Prediction, Predictor
from baryscope.estimator.result import Cluster, Estimate, Motion

FloatArray = NDArray[np.float64]
Value = TypeVar("Value")


def _known(value: Value | None) -> Value:
    """What an estimate by `ml` or `ekf` has, though one by another method may not."""
    assert value is not None  # noqa: S101
    return value


@dataclass(frozen=True)
class Odds:
    """The probability of the other model."""

    probability: float

    def of_both(self, own: FloatArray, other: FloatArray, apart: FloatArray) -> FloatArray:
        """The covariance (..., k, k) of two by theirs, and by the difference (..., k) of the answers."""
        moved = other + apart[..., :, None] * apart[..., None, :]
        return np.asarray((1 - self.probability) * own + self.probability * moved)

    def of_deviations(self, own: ArrayLike, other: ArrayLike, apart: ArrayLike) -> FloatArray:
        """The standard deviations of two by theirs (...) and differences (...)."""
        own, other, apart = np.asarray(own), np.asarray(other), np.asarray(apart)
        return np.asarray(np.sqrt((1 - self.probability) * own**2 + self.probability * (other**2 + apart**2)))


@dataclass(frozen=True, eq=False)
class PredictedMixture:
    """The predictor of two models."""

    likelier: Predictor
    other: Predictor
    odds: Odds

    def at(self, time: FloatArray, point: Point) -> Prediction:
        """See `Predictor`."""
        own, other = self.likelier.at(time, point), self.other.at(time, point)
        apart = np.concatenate([other.position - own.position, other.velocity - own.velocity], axis=1)
        return replace(own, covariance=self.odds.of_both(own.covariance, other.covariance, apart))


def with_other(found: Estimate, other: Estimate, probability: float) -> Estimate:
    """The estimate by `ml` or `ekf` with what another model, of a probability of at most a half, tells of the same
    clusters.
    """
    odds, pairs = Odds(probability), tuple(zip(found.clusters, other.clusters, strict=True))
    covariance = odds.of_both(_known(found.covariance), _known(other.covariance), other.position - found.position)
    clusters = tuple(_of_cluster(own, another, odds) for own, another in pairs)
    turn = _turn(*pairs[main_cluster(found.clusters)])
    return replace(
        found,
        covariance=covariance,
        clusters=clusters,
        observability=observability_of(clusters, covariance),
        motion=_motion(found.motion, other.motion, turn, odds),
        details=_details(found, other, covariance, turn, odds),
        predictor=PredictedMixture(_known(found.predictor), _known(other.predictor), odds),
    )


def _turn(own: Cluster, other: Cluster) -> FloatArray:
    """The rotation (3, 3) into a cluster's axes from those of the same features by another model."""
    points = own.points - own.centre_of_mass
    moved = (other.points - other.centre_of_mass) - points
    return exp_rotation(-attached_turn(points) @ moved.ravel())


def _of_cluster(own: Cluster, other: Cluster, odds: Odds) -> Cluster:
    apart = _turn(own, other) @ other.centre_of_mass - own.centre_of_mass
    return replace(own, covariance=odds.of_both(_known(own.covariance), _known(other.covariance), apart))


def _motion(own: Motion, other: Motion, turn: FloatArray, odds: Odds) -> Motion:
    """turn (3, 3): from the axes of the other model."""
    velocities, attitudes = (
        (_known(own.velocity), _known(other.velocity)),
        (_known(own.attitude), _known(other.attitude)),
    )
    rates = _known(own.angular_rate), _known(other.angular_rate)
    apart = {
        "velocity_covariance": velocities[1] - velocities[0],
        "attitude_covariance": log_rotation(np.swapaxes(attitudes[0], 1, 2) @ attitudes[1] @ turn.T),
        "angular_rate_covariance": rates[1] @ turn.T - rates[0],
    }
    wider = {name: odds.of_both(getattr(own, name), getattr(other, name), one) for name, one in apart.items()}
    return replace(own, **wider)


def _details(
    found: Estimate, another: Estimate, covariance: FloatArray, turn: FloatArray, odds: Odds
) -> TumbleDetails | FilterDetails:
    """covariance (n, 3, 3) of both; turn (3, 3): from the axes of the other model; both have the same epoch."""
    own, other = found.details, another.details
    if isinstance(own, FilterDetails):
        return replace(own, final_covariance=covariance[-1])
    assert isinstance(own, TumbleDetails)  # noqa: S101  as those of `ml` are
    assert isinstance(other, TumbleDetails)  # noqa: S101
    rate = turn @ other.angular_rate - own.angular_rate
    inertia = np.linalg.norm(turn @ other.inertia @ turn.T - own.inertia)
    return replace(
        own,
        angular_rate_deviation=odds.of_deviations(own.angular_rate_deviation, other.angular_rate_deviation, rate),
        inertia_deviation=float(odds.of_deviations(own.inertia_deviation, other.inertia_deviation, inertia)),
    )

"""Covariances of methods that don't estimate a camera's errors, widened by them: consider parameters (Schmidt 1966).

The estimate is taken to follow what the camera sees, so that constant errors add what they move at the path. Noise of
the attitude adds to each frame's own noise; the covariance is at most as many times wider as a frame's noise is.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.camera.shared import SharedErrors
from baryscope.estimator.claims import with_wider
from baryscope.estimator.geometry.so3 import cross_matrices
from baryscope.estimator.paths.extended_path import named_factors
from baryscope.estimator.prediction import Point, Prediction, Predictor
from baryscope.estimator.result import Cluster, Estimate, Motion
from baryscope.estimator.tracks import FeatureTracks, errors_of
from baryscope.estimator.widening import UNCHANGED, beyond

FloatArray = NDArray[np.float64]


def considered(result: Estimate, tracks: FeatureTracks) -> Estimate:
    """The result of a method that has the errors of the tracks' camera not among its unknowns, wider by them.

    They stand among its factors with their prior.
    """
    errors = errors_of(tracks)
    if errors is None:
        return result
    named = named_factors(errors.names, errors.units, np.zeros_like(errors.deviations), errors.deviations)
    result = replace(result, forces=result.forces + named)
    if result.covariance is None or result.observability is None:
        return result
    factor = _by_noise(result, tracks, errors)
    added = errors.consider_covariance(result.position)
    clusters = tuple(_cluster(cluster, factor, errors) for cluster in result.clusters)
    effects = _Effects.of(result.time, errors)
    velocity = np.zeros_like(result.position) if result.velocity is None else result.velocity
    rates = effects.on(result.time, result.position, velocity)[:, 3:]
    motion = _motion(result, factor, rates @ np.swapaxes(rates, 1, 2), errors)
    found = with_wider(result, factor * result.covariance + added, clusters, motion, UNCHANGED)
    return found if result.predictor is None else replace(found, predictor=_Wider(result.predictor, factor, effects))


@dataclass(frozen=True, eq=False)
class _Effects:
    """What k errors of one standard deviation each do, at the frames' times (n,) in s.

    still (n, 3, k): what they move a point at the origin of C by, m; turns (n, 3, k): rotation vectors in C, rad, by
    which they turn what is seen; stretch (k,): how much it grows.
    """

    time: FloatArray
    still: FloatArray
    turns: FloatArray
    stretch: FloatArray

    @classmethod
    def of(cls, time: FloatArray, errors: SharedErrors) -> "_Effects":
        """The effects of a camera's errors at times (n,)."""
        stretch = np.zeros(len(errors.deviations))
        if errors.scale is not None:
            stretch[errors.scale] = errors.rig.scale_deviation
        still = errors.shifts(np.zeros((len(time), 3))) * errors.deviations
        return cls(time, still, errors.turns() * errors.deviations, stretch)

    def on(self, time: FloatArray, position: FloatArray, velocity: FloatArray) -> FloatArray:
        """What they move position and velocity (n, 3) in C of a point at times (n,) by, (n, 6, k), m and m/s.

        Away from the frames the errors are those in the nearest one, and go on with their rates there.
        """
        away = beyond(time, float(self.time[0]), float(self.time[-1]))
        still, turns = (self._at(values, time - away) for values in (self.still, self.turns))
        still_rate, turn_rate = (self._at(self._rate(values), time - away) for values in (self.still, self.turns))
        drift = still_rate - cross_matrices(position) @ turn_rate
        moved = still - cross_matrices(position) @ turns + position[:, :, None] * self.stretch
        speed = drift - cross_matrices(velocity) @ turns + velocity[:, :, None] * self.stretch
        return np.concatenate([moved + away[:, None, None] * drift, speed], axis=1)

    def _rate(self, values: FloatArray) -> FloatArray:
        return np.zeros_like(values) if len(self.time) < 2 else np.gradient(values, self.time, axis=0)

    def _at(self, values: FloatArray, time: FloatArray) -> FloatArray:
        """Values (n, 3, k) of the frames, interpolated to times within them."""
        last = len(self.time) - 1
        right = np.clip(np.searchsorted(self.time, time), min(1, last), last)
        left = np.maximum(right - 1, 0)
        length = np.where(right > left, self.time[right] - self.time[left], 1.0)
        share = ((time - self.time[left]) / length)[:, None, None]
        return np.asarray((1 - share) * values[left] + share * values[right])


@dataclass(frozen=True, eq=False)
class _Wider:
    """Predictions `own`, their covariance wider by a factor and by what a camera's errors do."""

    own: Predictor
    factor: float
    effects: _Effects

    def at(self, time: FloatArray, point: Point) -> Prediction:
        """See `Predictor`."""
        found = self.own.at(time, point)
        moved = self.effects.on(time, found.position, found.velocity)
        return replace(found, covariance=self.factor * found.covariance + moved @ np.swapaxes(moved, 1, 2))


def _by_noise(result: Estimate, tracks: FeatureTracks, errors: SharedErrors) -> float:
    """The variance of a frame's position with the noise of the camera's attitude over that without, in the mean."""
    if not errors.noisy or result.method == "score":  # whose noise is that of whole frames already
        return 1.0
    count = result.used.sum(axis=1)
    own = result.noise.lasting * result.noise.a_posteriori**2
    if tracks.covariance is not None:
        own *= float(np.mean(np.trace(tracks.covariance[tracks.seen], axis1=1, axis2=2))) / 3
    shared = np.trace(errors.shift_covariance(result.position), axis1=1, axis2=2) / 3
    return 1.0 + float(np.mean((count * shared)[count > 0])) / max(own, 1e-300)


def _cluster(cluster: Cluster, factor: float, errors: SharedErrors) -> Cluster:
    """The cluster with the offset of a body that is seen in a wrong scale."""
    if cluster.covariance is None:
        return cluster
    offset = errors.rig.scale_deviation * cluster.centre_of_mass
    return replace(cluster, covariance=factor * cluster.covariance + np.outer(offset, offset))


def _motion(result: Estimate, factor: float, of_velocity: FloatArray, errors: SharedErrors) -> Motion:
    """Wider velocity, by of_velocity (n, 3, 3), and attitude, by the boresight."""
    motion = result.motion
    velocity, attitude = motion.velocity_covariance, motion.attitude_covariance
    if velocity is not None:
        velocity = factor * velocity + of_velocity
    if attitude is not None and motion.attitude is not None:
        R, turns = motion.attitude, errors.turns() * errors.deviations
        attitude = factor * attitude + np.swapaxes(R, 1, 2) @ turns @ np.swapaxes(turns, 1, 2) @ R
    return replace(motion, velocity_covariance=velocity, attitude_covariance=attitude)

"""Covariances of methods that don't estimate a camera's errors, widened by them: consider parameters (Schmidt 1966).

The estimate is taken to follow what the camera sees, so that constant errors add what they move at the path. Noise of
the attitude adds to each frame's own noise; the covariance is at most as many times wider as a frame's noise is.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.camera.shared import SharedErrors
from baryscope.estimator.claims import with_wider
from baryscope.estimator.dynamics.extended import named_factors
from baryscope.estimator.prediction import Widening
from baryscope.estimator.result import Cluster, Estimate, Motion
from baryscope.estimator.tracks import FeatureTracks, errors_of

FloatArray = NDArray[np.float64]

ESTIMATING = ("pivot", "ml")  # the methods that have these errors among their unknowns


def considered(result: Estimate, tracks: FeatureTracks) -> Estimate:
    """The result of tracks, wider by the errors of their camera, which stand among its factors with their prior."""
    errors = errors_of(tracks)
    if errors is None or result.method in ESTIMATING:
        return result
    named = named_factors(errors.names, errors.units, np.zeros_like(errors.deviations), errors.deviations)
    result = replace(result, forces=result.forces + named)
    if result.covariance is None or result.observability is None:
        return result
    factor = _by_noise(result, tracks, errors)
    added = errors.consider_covariance(result.position)
    clusters = tuple(_cluster(cluster, factor, errors) for cluster in result.clusters)
    of_velocity = _velocity_covariance(result, errors)
    by = Widening(factor, _of_a_coordinate(added), _of_a_coordinate(of_velocity))
    motion = _motion(result, factor, of_velocity, errors)
    return with_wider(result, factor * result.covariance + added, clusters, motion, by)


def _of_a_coordinate(covariance: FloatArray) -> float:
    """The mean variance of a coordinate in covariances (n, 3, 3)."""
    return float(np.trace(covariance, axis1=1, axis2=2).mean() / 3)


def _velocity_covariance(result: Estimate, errors: SharedErrors) -> FloatArray:
    """What the rate at which the errors' shifts change adds to the velocity's covariance, (n, 3, 3), (m/s)²."""
    if len(result.time) < 2:
        return np.zeros((len(result.time), 3, 3))
    rates = np.gradient(errors.shifts(result.position) * errors.deviations, result.time, axis=0)
    return np.asarray(rates @ np.swapaxes(rates, 1, 2))


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

"""Covariances of a method that does not estimate a camera's errors, wider by them: consider parameters (Schmidt 1966).

The estimate is taken to follow what the camera sees, so that constant errors add what they move at the path.
"""

from dataclasses import replace

import numpy as np

from baryscope.estimator.camera.shared import SharedErrors
from baryscope.estimator.claims import with_wider
from baryscope.estimator.paths.extended_path import named_factors
from baryscope.estimator.result import Cluster, Estimate
from baryscope.estimator.tracks import FeatureTracks, errors_of
from baryscope.estimator.widening import UNCHANGED


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
    clusters = tuple(_cluster(cluster, errors) for cluster in result.clusters)
    covariance = result.covariance + errors.consider_covariance(result.position)
    return with_wider(result, covariance, clusters, result.motion, UNCHANGED)


def _cluster(cluster: Cluster, errors: SharedErrors) -> Cluster:
    """The cluster with the offset of a body that is seen in a wrong scale."""
    if cluster.covariance is None:
        return cluster
    offset = errors.rig.scale_deviation * cluster.centre_of_mass
    return replace(cluster, covariance=cluster.covariance + np.outer(offset, offset))

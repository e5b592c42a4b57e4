"""Least-squares adjustment of point observations, shared by the methods that have a covariance.

Normal equations, stereo covariances, robust weights, removal of spurious information, diagnostics of a result.
Uses geometry, registration, tracks and result.
"""

from baryscope.estimator.adjustment.diagnostics import (
    attitude_series,
    cluster_of,
    covered_by,
    main_cluster,
    observability_of,
    rejected_by,
    residuals_of,
)
from baryscope.estimator.adjustment.normal_equations import (
    CHUNK_SIZE,
    Pieces,
    at_best_attitudes,
    attitude_information,
    pieces,
    turn_information,
)
from baryscope.estimator.adjustment.observations import Observations, as_slice
from baryscope.estimator.adjustment.reweighting import GATE, MEDIAN, NEGLIGIBLE, reweighted
from baryscope.estimator.adjustment.spurious import (
    spurious_information,
    spurious_information_columns,
    three_sigma_factor,
)
from baryscope.estimator.adjustment.stereo import moved_to, observations_of

__all__ = [
    "CHUNK_SIZE",
    "GATE",
    "MEDIAN",
    "NEGLIGIBLE",
    "Observations",
    "Pieces",
    "as_slice",
    "at_best_attitudes",
    "attitude_information",
    "attitude_series",
    "cluster_of",
    "covered_by",
    "main_cluster",
    "moved_to",
    "observability_of",
    "observations_of",
    "pieces",
    "rejected_by",
    "residuals_of",
    "reweighted",
    "spurious_information",
    "spurious_information_columns",
    "three_sigma_factor",
    "turn_information",
]

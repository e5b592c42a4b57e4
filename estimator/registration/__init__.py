"""From tracks to rigid bodies with an attitude in every frame.

Intervals of continuous tracking, generalised Procrustes registration, screening of outliers, clusters of features.
Uses geometry, options and tracks.
"""

from baryscope.estimator.registration.body import Body
from baryscope.estimator.registration.clusters import Registered, find_bodies
from baryscope.estimator.registration.intervals import (
    Interval,
    collinear_features,
    cut_intervals,
    find_intervals,
    sampling_interval,
    too_few_features,
)
from baryscope.estimator.registration.procrustes import Registration, register
from baryscope.estimator.registration.screening import screen

__all__ = [
    "Body",
    "Interval",
    "Registered",
    "Registration",
    "collinear_features",
    "cut_intervals",
    "find_bodies",
    "find_intervals",
    "register",
    "sampling_interval",
    "screen",
    "too_few_features",
]

"""What only one method, or one family of methods, knows of its result."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class TiedClusters:
    """Two clusters by their numbers, and the labels of the tie points: features that both see."""

    clusters: tuple[int, int]
    labels: tuple[str, ...]


@dataclass(frozen=True)
class PivotDetails:
    """Of `pivot`: which clusters are tied by features that they share."""

    tie_points: tuple[TiedClusters, ...] = ()


@dataclass(frozen=True, eq=False)
class TumbleDetails:
    """Of `ml`: the rotational state at the epoch.

    epoch in s; attitude (3, 3) R_C_B; angular_rate (3,) in B, rad/s, and its deviations (3,); inertia (3, 3) in B over
    its trace, and its deviation (Frobenius norm); gravity_gradient: whether that turns the target.
    """

    epoch: float
    attitude: FloatArray
    angular_rate: FloatArray
    angular_rate_deviation: FloatArray
    inertia: FloatArray
    inertia_deviation: float
    gravity_gradient: bool


@dataclass(frozen=True, eq=False)
class FilterDetails:
    """Of `ekf`: the process noise that was chosen, and the filter's own end.

    order: of the path's derivative that noise drives; path_noise: m by which it carries the centre of mass off in the
    span of the time; turn_noise: share of itself by which noise changes the rate while the target turns by a radian;
    gravity_gradient: whether that turns the target; nis: mean normalised innovation squared, 1 is expected; restarts of
    the attitude; log_likelihood of the innovations; final_covariance (3, 3) of the position at the last frame, m²;
    angular_rate (3,) there, rad/s in B; inertia (3, 3) over its trace.
    """

    order: int
    path_noise: float
    turn_noise: float
    gravity_gradient: bool
    nis: float
    restarts: int
    log_likelihood: float
    final_covariance: FloatArray
    angular_rate: FloatArray
    inertia: FloatArray


@dataclass(frozen=True)
class ScoreDetails:
    """Of `score`: rms of c_k + R_k u − v per coordinate, m: how far from at rest the centre is."""

    centre_residual: float


@dataclass(frozen=True, eq=False)
class ScrewDetails:
    """Of the screw methods: what was chosen from the data, and how the axes fared.

    chosen: names of the options that the data chose; sampling_interval in s; screw_angle: median, rad; axis_angle:
    median angle between successive axes, rad; segment_rms, segment_median: length of the shortest segments between
    them, m; fit_rms of the polynomial, m per coordinate; axis_spread (3,), rising, and its directions (3, 3), a row
    each: the mean of 1 − a aᵀ, how well each direction is seen; screws and intersections: how many came to what end;
    com_scatter: of the centre of mass in each cluster's axes, (3,) each, m.
    """

    chosen: tuple[str, ...]
    sampling_interval: float
    screw_angle: float
    axis_angle: float
    segment_rms: float
    segment_median: float
    fit_rms: float
    axis_spread: FloatArray
    axis_directions: FloatArray
    screws: dict[str, int] = field(default_factory=dict)
    intersections: dict[str, int] = field(default_factory=dict)
    com_scatter: tuple[FloatArray, ...] = ()


Details = PivotDetails | TumbleDetails | FilterDetails | ScoreDetails | ScrewDetails

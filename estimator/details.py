"""Results that are specific to a method, or to a family of methods."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class TiedClusters:
    """Two clusters by their indices, and the labels of their tie points."""

    clusters: tuple[int, int]
    labels: tuple[str, ...]


@dataclass(frozen=True)
class PivotDetails:
    """Of `pivot`: the tie points between clusters.

    position_noise: standard deviation of white noise of the position, m, that costs the centre as much as its slips.
    """

    tie_points: tuple[TiedClusters, ...] = ()
    position_noise: float = 0.0


@dataclass(frozen=True, eq=False)
class TumbleDetails:
    """Of `ml`: the rotational state at the epoch.

    epoch in s; attitude (3, 3) R_C_B; angular_rate (3,) in B, rad/s, and its standard deviations (3,); inertia (3, 3)
    in B over its trace, and its standard deviation (Frobenius norm); gravity_gradient: whether the model has this
    torque. torque_noise: estimated density of the white angular acceleration, rad²/s³, None if it is given or there is
    none; torque_noise_bounds: that hold 90 %. position_noise: standard deviation of white noise of the position, m,
    that costs the centre as much as its slips.
    """

    epoch: float
    attitude: FloatArray
    angular_rate: FloatArray
    angular_rate_deviation: FloatArray
    inertia: FloatArray
    inertia_deviation: float
    gravity_gradient: bool
    torque_noise: float | None = None
    torque_noise_bounds: tuple[float, float] | None = None
    position_noise: float = 0.0


@dataclass(frozen=True, eq=False)
class FilterDetails:
    """Of `ekf`: the chosen process noise, and the filter's final state.

    process_noise: spectral density of the path's acceleration, m²/s³ (for a fixed point the variance of its position's
    noise, m²); torque_noise: that of the angular acceleration, rad²/s³; with their bounds, which hold 90 %;
    gravity_gradient: whether the model has this torque; nis: mean normalised innovation squared, 1 is expected;
    log_likelihood of the innovations; final_covariance (3, 3) of the position at the last frame, m²; angular_rate (3,)
    there, rad/s in B; inertia (3, 3) over its trace.
    """

    process_noise: float
    process_noise_bounds: tuple[float, float]
    torque_noise: float
    torque_noise_bounds: tuple[float, float]
    gravity_gradient: bool
    nis: float
    log_likelihood: float
    final_covariance: FloatArray
    angular_rate: FloatArray
    inertia: FloatArray


@dataclass(frozen=True)
class ScoreDetails:
    """Of `score`: centre_residual, the rms of c_k + R_k u − v per coordinate, m, which is large if the centre moves."""

    centre_residual: float


@dataclass(frozen=True, eq=False)
class ScrewDetails:
    """Of the screw methods: the options chosen from the data, and statistics of the axes.

    chosen: names of the options that the data chose; sampling_interval in s; screw_angle: median, rad; axis_angle:
    median angle between successive axes, rad; segment_rms, segment_median: length of the shortest segments between
    them, m; fit_rms of the polynomial, m per coordinate; axis_spread (3,), ascending, and axis_directions (3, 3), a row
    each: eigenvalues and eigenvectors of the mean of 1 − a aᵀ, the observability of directions; screws and
    intersections: their number for each status; com_scatter: standard deviation of the centre of mass in each
    cluster's axes, (3,) each, m.
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

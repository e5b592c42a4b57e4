"""The sensor: which features are seen when, and their measured positions with noise and gross errors."""

from dataclasses import dataclass
from functools import cache

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from baryscope.models.columns import ColumnFunction
from baryscope.models.scenario import Scenario
from baryscope.models.sensor.directions import axes_along
from baryscope.models.sensor.draws import Purpose, standard_normals, uniforms
from baryscope.models.sensor.outliers import blunders, slides, swaps
from baryscope.models.stereo import FACING_TOLERANCE, facing_cosine, in_images, project, triangulate

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Observations:
    """What the chaser measures in a run: n frames, m features.

    Attributes:
        position: (n, m, 3), m in frame C; NaN where a feature is not seen.
        seen: (n, m), where `position` holds numbers.
        covariance: (n, m, 3, 3), m² in frame C, at the measured point, as a rig computes it; NaN where a feature is
            not seen; None for isotropic noise.
        wrong: (n, m), observations with a gross error: of another feature than the label says, or displaced.
    """

    position: FloatArray
    seen: BoolArray
    covariance: FloatArray | None
    wrong: BoolArray


def observe(
    scenario: Scenario,
    time: FloatArray,
    features_C: FloatArray,
    normals_C: FloatArray,
    target_C: FloatArray | None = None,
    attitude: FloatArray | None = None,
) -> Observations:
    """Simulate the scenario's tracking and sensor on the true positions of the features.

    A feature is seen while a tracking interval names it, while it faces the chaser (if the scenario asks for that),
    unless the observation is dropped, and if a rig measures in its images a disparity that tells a depth. Noise,
    dropout and blunders are drawn by counter (`draws`) for every feature at every time, as in the unit StereoRig: a
    change of one of them, or of the intervals, leaves the others as they were. Only swaps depend on which features are
    seen.

    Args:
        scenario: gives intervals, visibility, sensor and seed.
        time: (n,), s.
        features_C: (n, m, 3), m, in the order of the scenario's features.
        normals_C: (n, m, 3), outward unit normals.
        target_C: (n, 3), m, the target's CoM, at which a stereo rig points; needed with a rig.
        attitude: (n, 4), the quaternion (w, x, y, z) of R_I_B; needed if features slide.

    Raises:
        ValueError: the shapes do not match, or `target_C` or `attitude` is needed and missing.
    """
    shape = (time.size, len(scenario.features.points), 3)
    if features_C.shape != shape or normals_C.shape != shape:
        raise ValueError(f"features {features_C.shape} and normals {normals_C.shape}, expected {shape} for both")

    seed, outliers = scenario.run.seed, scenario.sensor.outliers
    noise = standard_normals(seed, Purpose.NOISE, shape[:2])
    dropping, blundering = np.moveaxis(uniforms(seed, Purpose.FATE, shape[:2])[..., :2], -1, 0)
    kept = dropping >= scenario.sensor.dropout
    slide_seed, swap_seed = np.random.SeedSequence(seed).spawn(2)
    error_C = blunders(outliers, blundering, seed) + slides(scenario, time, attitude, slide_seed)

    measured, covariance = _measured(scenario, features_C + error_C, target_C, noise)
    seen = visible(scenario, time, features_C, normals_C) & kept & np.isfinite(measured[..., 0])
    frame, source = np.arange(time.size)[:, None], swaps(outliers, time, seen, swap_seed)
    return Observations(
        position=np.where(seen[..., None], measured[frame, source], np.nan),
        seen=seen,
        covariance=None if covariance is None else np.where(seen[..., None, None], covariance[frame, source], np.nan),
        wrong=seen & (np.any(error_C[frame, source], axis=2) | (source != np.arange(shape[1]))),
    )


def _measured(
    scenario: Scenario, points_C: FloatArray, target_C: FloatArray | None, noise: FloatArray
) -> tuple[FloatArray, FloatArray | None]:
    """Positions (n, m, 3) and, from a rig, their covariances (n, m, 3, 3), from standard normal numbers (n, m, 3)."""
    rig = scenario.sensor.stereo
    if rig is None:
        return points_C + scenario.sensor.noise * noise, None
    R_C_V = _rig_axes(target_C)
    pixels = project(rig, R_C_V, points_C) + rig.pixel_noise * noise
    return triangulate(rig, R_C_V, np.where(in_images(rig, pixels)[..., None], pixels, np.nan))


def _rig_axes(target_C: FloatArray | None) -> FloatArray:
    """R_C_V of the scenario's rig, (n, 3, 3)."""
    if target_C is None:
        raise ValueError("target_C is missing, expected the target's position, at which a stereo rig points")
    return axes_along(target_C)


def observation_covariance(
    scenario: Scenario, features_C: FloatArray, target_C: FloatArray | None = None
) -> FloatArray:
    """True covariance of the noise of each observation, to first order, at the true point, for a Cramér–Rao bound.

    Args:
        scenario: gives the sensor.
        features_C: (n, m, 3), m, where the features are.
        target_C: (n, 3), m, the target's CoM, at which a stereo rig points; needed with a rig.

    Returns:
        (n, m, 3, 3), m² in frame C; NaN where a point is not in front of the rig or not in its images.

    Raises:
        ValueError: the scenario has a rig and `target_C` is missing.
    """
    rig = scenario.sensor.stereo
    if rig is None:
        return np.broadcast_to(scenario.sensor.noise**2 * np.eye(3), (*features_C.shape, 3))
    R_C_V = _rig_axes(target_C)
    pixels = project(rig, R_C_V, features_C)
    return triangulate(rig, R_C_V, np.where(in_images(rig, pixels)[..., None], pixels, np.nan))[1]


def visible(scenario: Scenario, time: FloatArray, features_C: FloatArray, normals_C: FloatArray) -> BoolArray:
    """Features that are tracked and, if the scenario asks for that, face the chaser, at each time, (n, m)."""
    seen = tracked(scenario, time)
    if scenario.tracking.visibility == "facing":
        limit = np.cos(np.deg2rad(scenario.tracking.max_incidence_deg)) - FACING_TOLERANCE
        seen &= incidence_cosine(features_C, normals_C) >= limit
    return seen


def tracked(scenario: Scenario, time: FloatArray) -> BoolArray:
    """Features that the scenario's intervals name at each time, (n, m); all features if there are no intervals.

    An interval includes its start and excludes its end; the last end of all is included.
    """
    labels, intervals = scenario.features.labels, scenario.tracking.intervals
    if not intervals:
        return np.ones((time.size, len(labels)), dtype=bool)
    last = max(interval.end for interval in intervals)
    order = np.argsort(time)
    starts = np.searchsorted(time, [interval.start for interval in intervals], sorter=order)
    ends = [np.searchsorted(time, i.end, "right" if i.end == last else "left", order) for i in intervals]
    # The number of intervals that name a feature changes at their ends; memory does not grow with the intervals.
    change = np.zeros((time.size + 1, len(labels)), dtype=np.intp)
    column = {label: index for index, label in enumerate(labels)}
    for interval, start, end in zip(intervals, starts, ends, strict=True):
        named = [column[label] for label in set(interval.features)]
        change[start, named] += 1
        change[end, named] -= 1
    seen = np.empty((time.size, len(labels)), dtype=bool)
    seen[order] = np.cumsum(change[:-1], axis=0) > 0
    return seen


def incidence_cosine(features_C: FloatArray, normals_C: FloatArray) -> FloatArray:
    """Cosine of the angle between each normal and the direction to the chaser, the origin of C, (n, m)."""
    found = _incidence()(features_C.reshape(-1, 3).T, normals_C.reshape(-1, 3).T)
    return found.reshape(features_C.shape[:2])


@cache
def _incidence() -> ColumnFunction:
    point, normal = ca.SX.sym("point", 3), ca.SX.sym("normal", 3)
    return ColumnFunction("incidence", [point, normal], facing_cosine(point, normal))

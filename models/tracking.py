"""The sensor: which features of a run are seen when, and the noisy positions that are measured of them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.models.scenario import Scenario

FACING_TOLERANCE = 1e-12  # of a cosine, so that a feature exactly at the limit counts as seen


@dataclass(frozen=True, eq=False)
class Observation:
    """What the chaser measures.

    Attributes:
        position: (n, m, 3), m in frame C; NaN where a feature is not seen.
        seen: (n, m), where `position` holds numbers.
    """

    position: NDArray[np.float64]
    seen: NDArray[np.bool_]


def observe(
    scenario: Scenario,
    time: NDArray[np.float64],
    features_C: NDArray[np.float64],
    normals_C: NDArray[np.float64],
) -> Observation:
    """Measure the true positions of the features as the scenario's tracking and sensor do.

    A feature is seen while an interval names it, while it faces the chaser (if the scenario asks for that), and
    where the sighting is not dropped. Noise and dropout are drawn from separate streams of the scenario's seed,
    for every feature at every time, so that changing one of them, or the intervals, leaves the rest as it was.

    Args:
        scenario: gives intervals, visibility, noise, dropout and seed.
        time: (n,), s.
        features_C: (n, m, 3), m, in the order of the scenario's features.
        normals_C: (n, m, 3), outward unit normals.

    Raises:
        ValueError: the shapes do not belong together.
    """
    shape = (time.size, len(scenario.features.points), 3)
    if features_C.shape != shape or normals_C.shape != shape:
        raise ValueError(f"features {features_C.shape} and normals {normals_C.shape}, expected {shape} for both")

    noise_seed, dropout_seed = np.random.SeedSequence(scenario.run.seed).spawn(2)
    noise = np.random.default_rng(noise_seed).standard_normal(shape)
    kept = np.random.default_rng(dropout_seed).random(shape[:2]) >= scenario.sensor.dropout

    seen = tracked(scenario, time) & kept
    if scenario.tracking.visibility == "facing":
        seen &= incidence_cosine(features_C, normals_C) >= (
            np.cos(np.deg2rad(scenario.tracking.max_incidence_deg)) - FACING_TOLERANCE
        )
    measured = features_C + scenario.sensor.noise * noise
    return Observation(np.where(seen[:, :, None], measured, np.nan), seen)


def tracked(scenario: Scenario, time: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which features the scenario's intervals name at each time, (n, m); all of them where there are no intervals.

    An interval holds its start but not its end, except that of the one that ends last.
    """
    labels, intervals = scenario.features.labels, scenario.tracking.intervals
    if not intervals:
        return np.ones((time.size, len(labels)), dtype=bool)
    last = max(interval.end for interval in intervals)
    during = np.stack(
        [
            (interval.start <= time) & ((time < interval.end) | (time == interval.end) & (interval.end == last))
            for interval in intervals
        ],
        axis=1,
    )
    members = np.array([[label in interval.features for label in labels] for interval in intervals])
    return np.asarray((during[:, :, None] & members).any(axis=1))


def incidence_cosine(features_C: NDArray[np.float64], normals_C: NDArray[np.float64]) -> NDArray[np.float64]:
    """Cosine of the angle between each normal and the direction to the chaser, the origin of C, (n, m)."""
    reach = np.linalg.norm(features_C, axis=2)
    return np.asarray(-np.einsum("nmi,nmi->nm", features_C, normals_C) / np.where(reach > 0, reach, 1.0))

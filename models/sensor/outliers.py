"""Gross errors: blunders, features that slide along the surface, and swapped labels."""

from functools import cache

import casadi as ca
import numpy as np
from numpy.random import SeedSequence
from numpy.typing import NDArray

from baryscope.models.columns import ColumnFunction
from baryscope.models.frames import rotation_from_quaternion
from baryscope.models.scenario import Outliers, Scenario
from baryscope.models.sensor.directions import axes_along
from baryscope.models.sensor.draws import Purpose, standard_normals

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]


def blunders(outliers: Outliers, fate: FloatArray, seed: int) -> FloatArray:
    """Position errors of single observations, (n, m, 3), m in C.

    Each observation is a blunder with the probability `outliers.share`. Its error is normal, isotropic and of rms
    length `outliers.size`. The other errors are 0.

    Args:
        outliers: share and size.
        fate: (n, m), uniform numbers; an observation is a blunder where they are below the share.
        seed: of the errors.
    """
    if outliers.share == 0:
        return np.zeros((*fate.shape, 3))
    offset = outliers.size / np.sqrt(3) * standard_normals(seed, Purpose.BLUNDER, fate.shape)
    return np.where(fate[..., None] < outliers.share, offset, 0.0)


def slides(scenario: Scenario, time: FloatArray, attitude: FloatArray | None, seed: SeedSequence) -> FloatArray:
    """Displacements of features that slide along the surface, (n, m, 3), m in C.

    Features are drawn at random. Each starts to slide at a random time of the run, and moves at the scenario's speed in
    a random direction, fixed in B, in the plane normal to its surface normal.

    Args:
        scenario: gives the features' normals, how many slide and how fast.
        time: (n,), s.
        attitude: (n, 4), the quaternion (w, x, y, z) of R_I_B; None if no feature slides.
        seed: of the random numbers.

    Raises:
        ValueError: features slide and the attitude is missing.
    """
    outliers, points = scenario.sensor.outliers, scenario.features.points
    if outliers.sliding == 0:
        return np.zeros((time.size, len(points), 3))
    if attitude is None:
        raise ValueError("attitude is missing, expected the target's attitude for features that slide")
    rng = np.random.default_rng(seed)
    rank, start = rng.permutation(len(points)), rng.random(len(points)) * scenario.duration
    heading = 2 * np.pi * rng.random(len(points))
    axes_B = axes_along(np.array([point.normal for point in points]))
    direction_B = np.cos(heading)[:, None] * axes_B[..., 0] + np.sin(heading)[:, None] * axes_B[..., 1]
    length = np.where(rank < outliers.sliding, outliers.sliding_speed * np.maximum(time[:, None] - start, 0), 0.0)
    return length[..., None] * (direction_B @ np.swapaxes(_attitude()(attitude.T), 1, 2))


@cache
def _attitude() -> ColumnFunction:
    """q (w, x, y, z) → R."""
    q = ca.SX.sym("q", 4)
    return ColumnFunction("attitude", [q], rotation_from_quaternion(q))


def swaps(outliers: Outliers, time: FloatArray, seen: BoolArray, seed: SeedSequence) -> IntArray:
    """Index of the feature that is observed under each label, (n, m): its own, or that of a swapped partner.

    Time is divided into stretches. The features seen in a stretch are paired at random; with an odd number, one stays
    alone. Each pair is swapped with the probability that gives the scenario's share of swapped observations. A swap
    lasts for the stretch and concerns the frames in which both features are seen.

    Args:
        outliers: share of swapped observations and length of the stretches.
        time: (n,), s.
        seen: (n, m).
        seed: of the random numbers.
    """
    own = np.broadcast_to(np.arange(seen.shape[1]), seen.shape)
    if outliers.swapped == 0:
        return own
    stretches, stretch = np.unique(np.floor_divide(time, outliers.stretch), return_inverse=True)
    count, m = len(stretches), seen.shape[1]
    present = np.zeros((count, m), dtype=bool)
    np.logical_or.at(present, stretch, seen)

    order_seed, choice_seed = seed.spawn(2)
    draws = np.where(present, np.random.default_rng(order_seed).random((count, m)), np.inf)
    order = np.argsort(draws, axis=1)
    paired = present.sum(axis=1, keepdims=True) // 2 * 2
    probability = outliers.swapped * present.sum(axis=1, keepdims=True) / np.maximum(paired, 1)
    place = np.arange(m)
    chosen = (np.random.default_rng(choice_seed).random((count, m)) < probability)[:, place // 2 * 2]
    opposite = np.where(chosen & (place < paired), place ^ 1, place)
    partner = np.empty((count, m), dtype=np.intp)
    np.put_along_axis(partner, order, np.take_along_axis(order, opposite, axis=1), axis=1)

    partner = partner[stretch]
    return np.where(seen & np.take_along_axis(seen, partner, axis=1), partner, own)

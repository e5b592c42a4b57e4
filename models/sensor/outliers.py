"""Sightings that are wrong: blunders, features that slide along the surface, and labels that change places."""

from functools import cache

import casadi as ca
import numpy as np
from numpy.random import SeedSequence
from numpy.typing import NDArray

from baryscope.models.columns import ColumnFunction
from baryscope.models.directions import axes_along
from baryscope.models.frames import rotation_from_quaternion
from baryscope.models.scenario import Outliers, Scenario

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]


def blunders(outliers: Outliers, shape: tuple[int, int], seed: SeedSequence) -> FloatArray:
    """By how much single sightings are off, (n, m, 3), m in C: a share of them by normal numbers, the rest by 0."""
    if outliers.share == 0:
        return np.zeros((*shape, 3))
    which, where = (np.random.default_rng(part) for part in seed.spawn(2))
    struck = which.random(shape) < outliers.share
    offset = outliers.size / np.sqrt(3) * where.standard_normal((*shape, 3))
    return np.where(struck[..., None], offset, 0.0)


def slides(scenario: Scenario, time: FloatArray, attitude: FloatArray | None, seed: SeedSequence) -> FloatArray:
    """By how much features have slid from their places, (n, m, 3), m in C.

    Some features, drawn at random, set out at a time drawn from the whole run and go straight on in the plane normal to
    their normal, fixed in B, at the scenario's speed.

    Args:
        scenario: gives the features' normals, how many slide and how fast.
        time: (n,), s.
        attitude: (n, 4), the quaternion (w, x, y, z) of R_I_B; None only where nothing slides.
        seed: of what is drawn.

    Raises:
        ValueError: features slide and there is no attitude.
    """
    outliers, points = scenario.sensor.outliers, scenario.features.points
    if outliers.sliding == 0:
        return np.zeros((time.size, len(points), 3))
    if attitude is None:
        raise ValueError("features that slide need the target's attitude")
    rng = np.random.default_rng(seed)
    rank, start = rng.permutation(len(points)), rng.random(len(points)) * scenario.duration
    heading = 2 * np.pi * rng.random(len(points))
    axes_B = axes_along(np.array([point.normal for point in points]))
    way_B = np.cos(heading)[:, None] * axes_B[..., 0] + np.sin(heading)[:, None] * axes_B[..., 1]
    length = np.where(rank < outliers.sliding, outliers.sliding_speed * np.maximum(time[:, None] - start, 0), 0.0)
    return length[..., None] * (way_B @ np.swapaxes(_attitude()(attitude.T), 1, 2))


@cache
def _attitude() -> ColumnFunction:
    """q (w, x, y, z) → R."""
    q = ca.SX.sym("q", 4)
    return ColumnFunction("attitude", [q], rotation_from_quaternion(q))


def swaps(outliers: Outliers, time: FloatArray, seen: BoolArray, seed: SeedSequence) -> IntArray:
    """Whose sighting stands under each label, (n, m): its own index, or that of a feature that it is swapped with.

    Time is cut into stretches. In each, the features that are seen in it are drawn into pairs, and a pair is swapped
    with the probability that makes the share of swapped sightings the scenario's, though an odd feature is left alone.
    It stays so for the stretch, in the frames in which both are seen.

    Args:
        outliers: share of swapped sightings and length of the stretches.
        time: (n,), s.
        seen: (n, m).
        seed: of what is drawn.
    """
    own = np.broadcast_to(np.arange(seen.shape[1]), seen.shape)
    if outliers.swapped == 0:
        return own
    stretches, stretch = np.unique(np.floor_divide(time, outliers.stretch), return_inverse=True)
    count, m = len(stretches), seen.shape[1]
    present = np.zeros((count, m), dtype=bool)
    np.logical_or.at(present, stretch, seen)

    order_seed, choice_seed = seed.spawn(2)
    lots = np.where(present, np.random.default_rng(order_seed).random((count, m)), np.inf)
    order = np.argsort(lots, axis=1)
    paired = present.sum(axis=1, keepdims=True) // 2 * 2
    chance = outliers.swapped * present.sum(axis=1, keepdims=True) / np.maximum(paired, 1)
    place = np.arange(m)
    chosen = (np.random.default_rng(choice_seed).random((count, m)) < chance)[:, place // 2 * 2]
    opposite = np.where(chosen & (place < paired), place ^ 1, place)
    partner = np.empty((count, m), dtype=np.intp)
    np.put_along_axis(partner, order, np.take_along_axis(order, opposite, axis=1), axis=1)

    partner = partner[stretch]
    return np.where(seen & np.take_along_axis(seen, partner, axis=1), partner, own)

"""Pseudo-intersections of pairs of lines: the midpoint of the shortest segment between them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Intersections:
    """Pseudo-intersections of n pairs of lines.

    middle (n, 3) and length (n,) of the shortest segment, in m; sine (n,) of the angle between the lines; valid (n,),
    False where they are nearly parallel, with NaN for middle and length.
    """

    middle: FloatArray
    length: FloatArray
    sine: FloatArray
    valid: NDArray[np.bool_]


def intersect(
    axis_1: FloatArray, point_1: FloatArray, axis_2: FloatArray, point_2: FloatArray, least_sine: FloatArray
) -> Intersections:
    """Intersect lines given by unit axes (n, 3) and points (n, 3) in m.

    Lines count as parallel if the sine of their angle is at most `least_sine` (n,): the error of the midpoint along the
    axes is proportional to 1/sine.
    """
    normal = np.cross(axis_1, axis_2)
    sine = np.linalg.norm(normal, axis=1)
    valid = sine > np.maximum(least_sine, 1e-9)
    square = np.where(valid, sine, 1.0) ** 2
    between = point_2 - point_1
    # Along each line, from its point to the foot of the common normal.
    along_1 = np.einsum("ni,ni->n", np.cross(between, axis_2), normal) / square
    along_2 = np.einsum("ni,ni->n", np.cross(between, axis_1), normal) / square
    foot_1 = point_1 + along_1[:, None] * axis_1
    foot_2 = point_2 + along_2[:, None] * axis_2
    length = np.abs(np.einsum("ni,ni->n", between, normal)) / np.sqrt(square)
    middle = np.where(valid[:, None], 0.5 * (foot_1 + foot_2), np.nan)
    return Intersections(middle, np.where(valid, length, np.nan), sine, valid)

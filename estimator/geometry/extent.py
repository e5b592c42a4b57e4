"""How large a body of points is, and how large vectors are."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


def rms_radius(points: FloatArray) -> float:
    """The rms distance of points (m, 3) from their centroid."""
    return float(np.sqrt(np.mean(np.sum((points - points.mean(axis=0)) ** 2, axis=1))))


def rms_width(points: FloatArray) -> float:
    """The rms distance of points (m, 3) from the line that is nearest to all of them."""
    lengths = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return float(np.sqrt(np.sum(lengths[1:] ** 2) / len(points)))


def rms_coordinates(vectors: FloatArray, counted: BoolArray) -> FloatArray:
    """The rms per coordinate (m,) of vectors (n, m, 3) that are counted (n, m) and not NaN; NaN where none is."""
    counted = counted & np.isfinite(vectors[..., 0])
    squares = np.where(counted, np.einsum("kmi,kmi->km", vectors, vectors), 0.0).sum(axis=0)
    count = counted.sum(axis=0)
    return np.sqrt(np.where(count > 0, squares / np.maximum(3 * count, 1), np.nan))

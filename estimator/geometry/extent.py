"""How large a body of points is."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def rms_radius(points: FloatArray) -> float:
    """The rms distance of points (m, 3) from their centroid."""
    return float(np.sqrt(np.mean(np.sum((points - points.mean(axis=0)) ** 2, axis=1))))


def rms_width(points: FloatArray) -> float:
    """The rms distance of points (m, 3) from the line that is nearest to all of them."""
    lengths = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return float(np.sqrt(np.sum(lengths[1:] ** 2) / len(points)))

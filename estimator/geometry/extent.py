"""How large a body of points is."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def rms_radius(points: FloatArray) -> float:
    """The rms distance of points (m, 3) from their centroid."""
    return float(np.sqrt(np.mean(np.sum((points - points.mean(axis=0)) ** 2, axis=1))))

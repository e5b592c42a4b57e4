"""Coordinate axes aligned with a direction."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def axes_along(direction: FloatArray) -> FloatArray:
    """Right-handed axes with z along the direction.

    x is normal to z and to the coordinate axis farthest from z. That axis is at least 54.7° away, so no direction is
    singular. x jumps where another coordinate axis becomes the farthest.

    Args:
        direction: (n, 3), any length above zero.

    Returns:
        R, (n, 3, 3), whose columns are x, y and z: `p = R @ p_along`.
    """
    z = direction / np.linalg.norm(direction, axis=1, keepdims=True)
    x = np.cross(np.eye(3)[np.argmin(np.abs(z), axis=1)], z)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=-1)

"""Which inertias a body can have: its principal moments obey the triangle inequality."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

THINNEST = 1e-3  # least second moment of the mass over the inertia's trace


def of_a_body(inertia: FloatArray) -> FloatArray:
    """The inertia (3, 3) of trace 1 whose principal moments obey the triangle inequality, nearest to the given one.

    The second moments of the mass, ½ tr J − J, get eigenvalues of at least THINNEST. Where the tracks do not determine
    the inertia, a fitted one may cone many times as fast as any body.
    """
    values, vectors = np.linalg.eigh(inertia / np.trace(inertia))
    mass = np.maximum(0.5 - values, THINNEST)
    mass *= 0.5 / mass.sum()
    return np.asarray((vectors * (0.5 - mass)) @ vectors.T)

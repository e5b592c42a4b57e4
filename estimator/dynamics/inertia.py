"""Which inertias a body can have: its principal moments obey the triangle inequality."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

INERTIA_DEVIATION = 0.5  # standard deviation of the prior of the five elements of the inertia of trace 1
THINNEST = 1e-3  # least second moment of the mass over the inertia's trace


def mass_of(inertia: FloatArray) -> FloatArray:
    """The second moments of the mass (3, 3), ∫ r rᵀ dm = ½ tr J − J: positive definite for the inertia of a body."""
    return np.asarray(np.trace(inertia) / 2 * np.eye(3) - inertia)


def inertia_of(mass: FloatArray) -> FloatArray:
    """The inertia (3, 3) of second moments M (3, 3) of the mass: tr M − M."""
    return np.asarray(np.trace(mass) * np.eye(3) - mass)


def of_a_body(inertia: FloatArray) -> FloatArray:
    """The inertia (3, 3) of trace 1 whose principal moments obey the triangle inequality, nearest to the given one.

    The second moments of the mass get eigenvalues of at least THINNEST. Where the tracks do not determine the inertia,
    a fitted one may cone many times as fast as any body.
    """
    values, vectors = np.linalg.eigh(mass_of(inertia / np.trace(inertia)))
    values = np.maximum(values, THINNEST)
    return inertia_of((vectors * (0.5 * values / values.sum())) @ vectors.T)

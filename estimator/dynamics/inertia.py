"""Which inertias a body can have: its principal moments obey the triangle inequality."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.models.attitude import INERTIA_BASIS

FloatArray = NDArray[np.float64]

INERTIA_DEVIATION = 0.5  # standard deviation of the prior of the five elements of the inertia of trace 1
THINNEST = 1e-3  # least second moment of the mass over the inertia's trace
BEYOND = 0.02  # standard deviation of a negative second moment of the mass, of which no body has one, over the trace


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


@dataclass(frozen=True, eq=False)
class Excess:
    """By how much an inertia of trace 1 exceeds that of any body: its greatest moment less the half, in deviations.

    value: 0 for that of a body; slope (5,): its derivative by the coefficients of INERTIA_BASIS.
    """

    value: float
    slope: FloatArray

    @classmethod
    def of(cls, inertia: FloatArray) -> "Excess":
        """The excess of an inertia (3, 3) of trace 1."""
        values, vectors = np.linalg.eigh(inertia)
        value = (float(values[-1]) - 0.5) / BEYOND
        if value <= 0:
            return cls(0.0, np.zeros(len(INERTIA_BASIS)))
        axis = vectors[:, -1]
        return cls(value, np.einsum("kij,i,j->k", INERTIA_BASIS, axis, axis) / BEYOND)

    @property
    def cost(self) -> float:
        """Its share of −2 ln p."""
        return self.value**2

    @property
    def information(self) -> FloatArray:
        """What it tells (5, 5) of the coefficients, by Gauss and Newton."""
        return np.outer(self.slope, self.slope)

    @property
    def pull(self) -> FloatArray:
        """Half the slope (5,) of −2 ln p."""
        return self.value * self.slope

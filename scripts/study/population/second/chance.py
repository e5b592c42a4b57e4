"""Random numbers of which several parts of a case have need."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

TURN = 2 * np.pi  # rad


def unit(rng: np.random.Generator, n: int | None = None) -> FloatArray:
    """A direction (3,), or n of them (n, 3), evenly over the sphere."""
    v = rng.standard_normal(3 if n is None else (n, 3))
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A number between the two, evenly in its logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))

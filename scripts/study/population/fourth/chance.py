"""Random streams of a case, and what its parts draw from them."""

import numpy as np

from baryscope.study.population.interface import FloatArray

CASE, SAMPLE = 777, 999  # so that no stream is one of another population


def of_case(seed: int, index: int) -> np.random.Generator:
    """The stream of what is true."""
    return np.random.default_rng([seed, index, CASE])


def of_sample(seed: int, index: int, draw: int) -> np.random.Generator:
    """The stream of noise and blunders."""
    return np.random.default_rng([seed, index, SAMPLE, draw])


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A number whose logarithm is uniform between those of the limits."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def directions(rng: np.random.Generator, count: int) -> FloatArray:
    """Unit vectors (count, 3), uniform on the sphere."""
    return normalised(rng.standard_normal((count, 3)))


def direction(rng: np.random.Generator) -> FloatArray:
    """A unit vector (3,), uniform on the sphere."""
    return np.asarray(directions(rng, 1)[0])


def normalised(v: FloatArray) -> FloatArray:
    """Vectors (..., 3) of unit length along others."""
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))


def rotation(rng: np.random.Generator) -> FloatArray:
    """A rotation matrix (3, 3), uniform over the group."""
    q, r = np.linalg.qr(rng.standard_normal((3, 3)))
    q = q * np.sign(np.diag(r))
    return np.asarray(q if np.linalg.det(q) > 0 else q[:, [1, 0, 2]])

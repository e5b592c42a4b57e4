"""Random streams of a case, one for each of its parts, and what is drawn from them again and again."""

import numpy as np

from baryscope.study.population.interface import FloatArray

PARTS = ("plan", "body", "times", "motion", "forces", "tumble", "view", "sensor", "sample")


def stream(seed: int, index: int, part: str, draw: int = 0) -> np.random.Generator:
    """The stream of a part of a case: what one part draws moves no other."""
    return np.random.default_rng([seed, index, PARTS.index(part), draw])


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A number whose logarithm is uniform between those of the limits."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def direction(rng: np.random.Generator) -> FloatArray:
    """A unit vector (3,), uniform on the sphere."""
    v = rng.standard_normal(3)
    return np.asarray(v / np.linalg.norm(v))


def rotation(rng: np.random.Generator) -> FloatArray:
    """A rotation matrix (3, 3), uniform over the group."""
    q = rng.standard_normal(4)
    return np.asarray(matrices(q[None] / np.linalg.norm(q))[0])


def matrices(q: FloatArray) -> FloatArray:
    """R (n, 3, 3) of unit quaternions (w, x, y, z) (n, 4)."""
    w, x, y, z = q.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)

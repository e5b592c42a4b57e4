"""A body that turns about a point in a laboratory: on an air bearing, or led by a hand."""

from dataclasses import dataclass

import numpy as np

from baryscope.models.orbit import Orbit
from baryscope.study.population.interface import FloatArray
from baryscope.study.population.third.dice import direction, log_uniform, matrices, rotation
from baryscope.study.population.third.timing import Timing
from baryscope.study.population.third.tumble import Tumbled, turned_by

ANY_ORBIT = Orbit(7e6, 0.001, 1.0)  # there is none
SWINGS = 3  # frequencies of a hand about each axis


@dataclass(frozen=True, eq=False)
class Pivot:
    """path (n, 3), that of the point, and jacobian (n, 3, 6) by its place and velocity; words: if it slips."""

    path: FloatArray
    jacobian: FloatArray
    words: tuple[str, ...]

    def at(self, time: FloatArray, other: FloatArray) -> FloatArray:
        """The path (k, 3) at other times (k,), evenly from one of `time` (n,) to the next; then it stays."""
        return np.stack([np.interp(other, time, axis) for axis in self.path.T], axis=1)


def pivot(rng: np.random.Generator, time: FloatArray, distance: float, slips: bool) -> Pivot:
    """A point at a distance, m; if it slips, it walks at random by 0.01 to 1 mm (standard deviation at the end)."""
    elapsed = time - time[0]
    jacobian = np.concatenate([np.broadcast_to(np.eye(3), (len(time), 3, 3)), np.multiply.outer(elapsed, np.eye(3))], 2)
    path = np.broadcast_to(distance * direction(rng), (len(time), 3))
    if not slips:
        return Pivot(path.copy(), jacobian, ())
    size = log_uniform(rng, 1e-5, 1e-3)
    steps = np.sqrt(np.diff(time, prepend=time[0]) / elapsed[-1])[:, None] * rng.standard_normal((len(time), 3))
    return Pivot(path + size * np.cumsum(steps, axis=0), jacobian, (f"pivot slips {1e3 * size:.2g} mm",))


def led(
    rng: np.random.Generator, inertia: FloatArray, timing: Timing, limited: bool
) -> tuple[Tumbled, tuple[str, ...]]:
    """A rotation that a hand leads, and words for it: free turns, or, limited, within a cone of 20 to 60°.

    Its rotation vector is a sum of sines about each axis, for free turns with a steady turn besides.
    """
    cone = np.radians(rng.uniform(20, 60)) if limited else np.radians(rng.uniform(60, 140))
    base = timing.rate / cone / 1.5
    frequency = base * rng.uniform(0.5, 1.5, (3, SWINGS))
    phase = rng.uniform(0, 2 * np.pi, (3, SWINGS))
    share = rng.uniform(0.2, 1.0, (3, SWINGS)) * np.array([1.0, 1.0, rng.uniform(0.1, 1.0)])[:, None]
    share *= cone / np.sqrt((share.sum(axis=1) ** 2).sum())
    steady = 0.0 if limited else timing.rate * rng.uniform(0, 0.5)
    begin = rotation(rng)
    first = timing.time[0]

    def vector(t: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Rotation vectors (n, 3) and their rates."""
        angle = frequency * (t[:, None, None] - first) + phase
        return (share * np.sin(angle)).sum(axis=2), (share * frequency * np.cos(angle)).sum(axis=2)

    def rate(t: FloatArray) -> FloatArray:
        """Rates (n, 3) in B: those of the steady turn about z of the first frame, and of the vector."""
        phi, change = vector(t)
        turned = turns(phi)
        return np.asarray(np.einsum("nji,j->ni", turned, [0, 0, steady]) + body_rates(phi, change))

    def at(t: FloatArray) -> tuple[FloatArray, FloatArray]:
        about_z = np.outer(steady * (t - first), [0, 0, 1])
        return begin @ turns(about_z) @ turns(vector(t)[0]), rate(t)

    elapsed = timing.time - first
    turn = turned_by(lambda t: rate(np.array([first + t]))[0], inertia, elapsed)
    words = (f"joint limited to {np.degrees(cone):.0f}°",) if limited else ()
    return Tumbled(*at(timing.time), turn, at), words


def turns(phi: FloatArray) -> FloatArray:
    """R (n, 3, 3) of rotation vectors (n, 3), rad."""
    half = np.linalg.norm(phi, axis=1, keepdims=True) / 2
    return matrices(np.concatenate([np.cos(half), 0.5 * np.sinc(half / np.pi) * phi], axis=1))


def body_rates(phi: FloatArray, change: FloatArray) -> FloatArray:
    """Rates (n, 3) in the turned axes of rotation vectors (n, 3) that change at `change` (n, 3)."""
    angle = np.maximum(np.linalg.norm(phi, axis=1, keepdims=True), 1e-6)
    first = np.cross(phi, change)
    second = np.cross(phi, first)
    return np.asarray(change - (1 - np.cos(angle)) / angle**2 * first + (angle - np.sin(angle)) / angle**3 * second)

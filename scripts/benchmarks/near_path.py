"""The path of the benchmark's peers, linear near the start: six unknowns in all, or a chain of states with noise.

White acceleration of density q makes the state (position, velocity) a Gauss–Markov process: from knot to knot it goes
by the orbit's transition, with an increment of covariance q [T³/3 T²/2; T²/2 T] an axis (Bar-Shalom, Li, Kirubarajan,
Estimation with Applications to Tracking and Navigation, 2001, §6.2.2). Between knots its mean, given both states, is
the cubic that they define (Barfoot, Tong, Särkkä, Batch Continuous-Time Trajectory Estimation, RSS 2014).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.paths.path import Path
from baryscope.estimator.paths.sampled_path import SampledPath

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

KNOT = 10.0  # s between states; at 1e-12 m²/s³ the path departs from the cubic by an rms of q^½ T^(3/2)/14 = 2 µm


@dataclass(frozen=True, eq=False)
class NearPath:
    """A path that is start (n, 3), m, and, linear in u (b, 6), the changes of b blocks of six unknowns in m.

    Attributes:
        block: (n, k), the blocks that a frame depends on.
        jacobian: (n, 3, 6 k), by these.
        increment: (b − 1, 6, 12), by two successive blocks, of increments of unit covariance; (0, 6, 12) without noise.
    """

    start: FloatArray
    block: IntArray
    jacobian: FloatArray
    increment: FloatArray

    @property
    def blocks(self) -> int:
        """The number of blocks."""
        return int(self.block.max()) + 1

    def position(self, u: FloatArray) -> FloatArray:
        """The path (n, 3) for u (b, 6)."""
        return np.asarray(
            self.start + np.einsum("kij,kj->ki", self.jacobian, u[self.block].reshape(len(self.start), -1))
        )

    def increments(self, u: FloatArray) -> FloatArray:
        """The increments, flat, for u (b, 6)."""
        pairs = np.concatenate([u[:-1], u[1:]], axis=1)[: len(self.increment)]
        return np.asarray(np.einsum("bij,bj->bi", self.increment, pairs).ravel())


def without_noise(path: SampledPath, x: FloatArray) -> NearPath:
    """The path near x (6,)."""
    n = path.frames
    return NearPath(path.position(x), np.zeros((n, 1), dtype=np.intp), path.jacobian, np.zeros((0, 6, 12)))


def with_noise(path: Path, x: FloatArray, time: FloatArray, density: float) -> NearPath:
    """The path near x (6,) at ascending times (n,) in s, with white acceleration of a density in m²/s³.

    A block is the change of position, and that of velocity times the knots' distance in s.
    """
    knots = np.linspace(time[0], time[-1], max(2, round((time[-1] - time[0]) / KNOT) + 1))
    step = float(knots[1] - knots[0])
    before = np.clip(np.searchsorted(knots, time, "right") - 1, 0, len(knots) - 2)
    s = (time - knots[before]) / step
    cubics = np.stack([(1 + 2 * s) * (1 - s) ** 2, s * (1 - s) ** 2, s * s * (3 - 2 * s), s * s * (s - 1)], axis=1)
    jacobian = np.einsum("kc,ij->kicj", cubics, np.eye(3)).reshape(len(time), 3, 12)
    transition, root = transitions(path, knots), np.linalg.inv(np.kron(increment_root(density, step), np.eye(3)))
    increment = np.concatenate([-root @ transition, np.broadcast_to(root, transition.shape)], axis=2)
    return NearPath(path.at(time).position(x), np.stack([before, before + 1], axis=1), jacobian, increment)


def transitions(path: Path, time: FloatArray) -> FloatArray:
    """The transitions (n − 1, 6, 6) of (position, velocity × step) of a path of six unknowns at even times (n,), m."""
    step = float(time[1] - time[0])
    state = np.concatenate([path.at(time).jacobian, step * path.rate_at(time).jacobian], axis=1)
    return np.asarray(state[1:] @ np.linalg.inv(state[:-1]))


def increment_root(density: float, step: float) -> FloatArray:
    """The lower root (2, 2) of the covariance of an increment of (position, velocity × step) of an axis, m.

    What the orbit's curvature adds is of relative order (angle turned in the step)².
    """
    return np.asarray(np.linalg.cholesky(density * step**3 * np.array([[1 / 3, 1 / 2], [1 / 2, 1.0]])))


def disturbance(path: Path, time: FloatArray, density: float, rng: np.random.Generator) -> FloatArray:
    """What white acceleration adds to a path of six unknowns at even times (n,) in s, (n, 3), m; none at the first."""
    drawn = (
        rng.normal(size=(len(time) - 1, 6)) @ np.kron(increment_root(density, float(time[1] - time[0])), np.eye(3)).T
    )
    state, found = np.zeros(6), np.zeros((len(time), 3))
    for k, (transition, increment) in enumerate(zip(transitions(path, time), drawn, strict=True)):
        state = transition @ state + increment
        found[k + 1] = state[:3]
    return found

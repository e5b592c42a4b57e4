"""The free rotation of a rigid body by Euler's equations and DOP853, and its derivatives by rate and inertia."""

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from baryscope.study.population.fourth.bodies import Mass
from baryscope.study.population.fourth.chance import direction, normalised
from baryscope.study.population.interface import FloatArray

TOLERANCE = 1e-12
ABSOLUTE = np.concatenate([np.full(4, 1e-12), np.full(3, 1e-14)])  # of quaternions, and rates in rad/s
STEP = 1e-6  # of the rate, and of the inertia's trace
SPINS = {"tumble": 0.72, "near spin": 0.22, "pure spin": 0.06}
SHAPES = np.array(  # directions of an inertia (5, 3, 3) that keep its trace
    [
        [[0, 1, 0], [1, 0, 0], [0, 0, 0]],
        [[0, 0, 1], [0, 0, 0], [1, 0, 0]],
        [[0, 0, 0], [0, 0, 1], [0, 1, 0]],
        [[1, 0, 0], [0, -1, 0], [0, 0, 0]],
        [[0, 0, 0], [0, 1, 0], [0, 0, -1]],
    ],
    dtype=float,
)


@dataclass(frozen=True, eq=False)
class Tumble:
    """inertia (3, 3) in B, in any unit; rate (3,) in B, rad/s, and quaternion (w, x, y, z) of R_C_B at `begin`, s."""

    inertia: FloatArray
    rate: FloatArray
    quaternion: FloatArray
    begin: float

    def at(self, time: FloatArray) -> tuple[FloatArray, FloatArray]:
        """R_C_B (n, 3, 3) and rates (n, 3) in B, rad/s, at ascending times (n,) from `begin` on, s."""
        attitude, rate = turned(self.inertia[None], self.rate[None], self.quaternion, self.begin, time)
        return attitude[0], rate[0]

    def turn(self, time: FloatArray) -> FloatArray:
        """Rotation vectors (n, 3, 8) in B by the first rate, and by SHAPES of the inertia over its trace, at times
        (n,), by central differences.
        """
        size, trace = float(np.linalg.norm(self.rate)), float(np.trace(self.inertia))
        rates = STEP * size * np.eye(8, 3)
        inertias = STEP * trace * np.concatenate([np.zeros((3, 3, 3)), SHAPES])
        all_inertias = self.inertia + np.concatenate([inertias, -inertias])
        all_rates = self.rate + np.concatenate([rates, -rates])
        after, before = np.split(turned(all_inertias, all_rates, self.quaternion, self.begin, time)[0], 2)
        change = np.swapaxes(before, 2, 3) @ after
        vectors = Rotation.from_matrix(change.reshape(-1, 3, 3)).as_rotvec().reshape(8, -1, 3)
        return np.asarray(np.moveaxis(vectors, 0, 2) / (2 * STEP * np.repeat([size, 1], [3, 5])))


def drawn(rng: np.random.Generator, mass: Mass, rate: float, begin: float) -> tuple[Tumble, str]:
    """A rotation at a rate, rad/s, about any axis, or within 6° of a principal one, and its name."""
    spin = str(rng.choice(list(SPINS), p=list(SPINS.values())))
    axis = direction(rng)
    if spin != "tumble":
        off = 0.0 if spin == "pure spin" else np.radians(rng.uniform(0.3, 6))
        axis = normalised(mass.axes[:, rng.integers(3)] + off * axis)
    quaternion = rng.standard_normal(4)
    return Tumble(mass.inertia, rate * axis, quaternion / np.linalg.norm(quaternion), begin), spin


def turned(
    inertia: FloatArray, rate: FloatArray, quaternion: FloatArray, begin: float, time: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """R_C_B (k, n, 3, 3) and rates (k, n, 3) in B, rad/s, of k bodies at ascending times (n,) from `begin` on, s.

    inertia (k, 3, 3) and rate (k, 3) in B, rad/s; quaternion (w, x, y, z) of R_C_B, the same for all, at `begin`.
    """
    inverse = np.linalg.inv(inertia)

    def slope(_: float, flat: FloatArray) -> FloatArray:
        w, x, y, z, p, q, r = flat.reshape(-1, 7).T
        a, b, c = np.einsum("kij,jk->ik", inertia, np.stack([p, q, r]))
        torque = np.stack([b * r - c * q, c * p - a * r, a * q - b * p])  # −ω × h
        turning = [-x * p - y * q - z * r, w * p + y * r - z * q, w * q + z * p - x * r, w * r + x * q - y * p]
        return np.concatenate([np.stack(turning) / 2, np.einsum("kij,jk->ik", inverse, torque)]).T.ravel()

    k = len(rate)
    first = np.concatenate([np.broadcast_to(quaternion, (k, 4)), rate], axis=1).ravel()
    span = (begin, float(time[-1]))
    found = solve_ivp(slope, span, first, "DOP853", time, rtol=TOLERANCE, atol=np.tile(ABSOLUTE, k))
    if not found.success:
        raise RuntimeError(found.message)
    states = found.y.reshape(k, 7, -1)
    q = states[:, :4] / np.linalg.norm(states[:, :4], axis=1, keepdims=True)
    return _matrices(q), np.swapaxes(states[:, 4:], 1, 2)


def _matrices(q: FloatArray) -> FloatArray:
    """R (k, n, 3, 3) of unit quaternions (k, 4, n), (w, x, y, z)."""
    w, x, y, z = np.moveaxis(q, 1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (2, 3))

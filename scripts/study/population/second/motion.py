"""The true motion: a chaser near a target on a Kepler orbit, and a free tumble, by DOP853 at a tolerance of 1e-12."""

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from baryscope.study.population.second.chance import TURN
from baryscope.study.population.second.orbits import MU, Elements

FloatArray = NDArray[np.float64]


def relative_motion(orbit: Elements, start: float, state: FloatArray, times: FloatArray) -> FloatArray:
    """Chaser less target in I (n, 6), m and m/s, at ascending `times` (n,) in s, from its state (6,) at `start`.

    Encke's difference of the two accelerations, which is exact.
    """
    position, velocity = state[:3], state[3:]

    def slope(t: float, y: FloatArray) -> FloatArray:
        rho, r = y[:3], orbit.position(t)
        rr = r @ r
        q = (rho @ (rho + 2 * r)) / rr
        shrink = np.expm1(-1.5 * np.log1p(q))
        acceleration = -(MU / (rr * np.sqrt(rr))) * ((1 + shrink) * rho + shrink * r)
        return np.concatenate([y[3:], acceleration])

    scale = np.linalg.norm(position)
    speed = max(np.linalg.norm(velocity), 1e-6 * scale)
    found = solve_ivp(
        slope,
        (start, times[-1]),
        state,
        method="DOP853",
        t_eval=times,
        rtol=1e-12,
        atol=np.repeat([1e-12 * scale, 1e-12 * speed], 3),
        max_step=0.02 * TURN / orbit.n * max(1 - orbit.e, 0.05),
    )
    return np.asarray(found.y.T)


def tumble(
    inertia: FloatArray, rate: FloatArray, quaternion: FloatArray, start: float, times: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Attitudes R_I_B (n, 3, 3) and rates (n, 3) in B, rad/s, of a free rigid body at ascending `times` (n,) in s.

    inertia (3, 3) in B, in any unit; rate (3,) in B and quaternion (w, x, y, z) of R_I_B, both at `start`. Of so few
    numbers Python's are faster than arrays.
    """
    rows, inverse = inertia.tolist(), np.linalg.inv(inertia).tolist()

    def slope(_: float, state: FloatArray) -> FloatArray:
        w, x, y, z, p, q, r = state.tolist()
        h = [a * p + b * q + c * r for a, b, c in rows]
        k, m, n = h[1] * r - h[2] * q, h[2] * p - h[0] * r, h[0] * q - h[1] * p  # −ω × h
        change = -x * p - y * q - z * r, w * p + y * r - z * q, w * q - x * r + z * p, w * r + x * q - y * p
        return np.array([*(one / 2 for one in change), *(a * k + b * m + c * n for a, b, c in inverse)])

    size = np.linalg.norm(rate)
    found = solve_ivp(
        slope,
        (start, times[-1]),
        np.concatenate([quaternion, rate]),
        method="DOP853",
        t_eval=times,
        rtol=1e-12,
        atol=np.repeat([1e-13, 1e-13 * size], [4, 3]),
        max_step=0.25 / size,
    )
    q = found.y[:4].T
    return rotation(q / np.linalg.norm(q, axis=1, keepdims=True)), np.asarray(found.y[4:].T)


def rotation(q: FloatArray) -> FloatArray:
    """The matrices (n, 3, 3) of unit quaternions (n, 4), (w, x, y, z)."""
    w, x, y, z = np.moveaxis(q, -1, 0)
    return np.stack(
        [
            np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], -1),
            np.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], -1),
            np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], -1),
        ],
        -2,
    )

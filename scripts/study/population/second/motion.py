"""The true motion: a chaser near a target on a Kepler orbit, and a free tumble, by DOP853 at a tolerance of 1e-12."""

from collections.abc import Sequence
from typing import Any

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
    found = _turning(inertia.tolist(), np.linalg.inv(inertia).tolist(), rate, quaternion, (start, times))
    return rotation(found[:4].T), np.asarray(found[4:].T)


def tumbles(
    inertia: FloatArray, rate: FloatArray, quaternion: FloatArray, start: float, times: FloatArray
) -> FloatArray:
    """The attitudes (k, n, 3, 3) of bodies (k, 3, 3) that hardly differ, of rates (k, 3): in the same steps."""
    rows, inverse = (list(np.moveaxis(one, 0, 2)) for one in (inertia, np.linalg.inv(inertia)))
    found = _turning(rows, inverse, rate.T, np.repeat(quaternion[:, None], len(rate), axis=1), (start, times))
    return rotation(np.moveaxis(found[:4], 0, 2))


def _turning(
    rows: Sequence[Any],
    inverse: Sequence[Any],
    rate: FloatArray,
    quaternion: FloatArray,
    when: tuple[float, FloatArray],
) -> FloatArray:
    """Unit quaternions and rates (7, ..., n), of a body by numbers, or of k bodies by arrays of them.

    rows, inverse: nine numbers or nine arrays (k,), of the inertia and its inverse; rate (3, ...), quaternion (4, ...).
    """
    single, (start, times) = rate.ndim == 1, when

    def slope(_: float, state: FloatArray) -> FloatArray:
        w, x, y, z, p, q, r = state.tolist() if single else state.reshape(7, -1)
        h = [a * p + b * q + c * r for a, b, c in rows]
        k, m, n = h[1] * r - h[2] * q, h[2] * p - h[0] * r, h[0] * q - h[1] * p  # −ω × h
        change = -x * p - y * q - z * r, w * p + y * r - z * q, w * q - x * r + z * p, w * r + x * q - y * p
        return np.array([*(one / 2 for one in change), *(a * k + b * m + c * n for a, b, c in inverse)]).ravel()

    size = np.linalg.norm(rate, axis=0)
    tolerance = np.concatenate([np.full(quaternion.shape, 1e-13), np.broadcast_to(1e-13 * size, rate.shape)])
    found = solve_ivp(
        slope,
        (start, times[-1]),
        np.concatenate([quaternion, rate]).ravel(),
        method="DOP853",
        t_eval=times,
        rtol=1e-12,
        atol=tolerance.ravel(),
        max_step=0.25 / np.max(size),
    ).y.reshape(*tolerance.shape, -1)
    return np.concatenate([found[:4] / np.linalg.norm(found[:4], axis=0), found[4:]])


def rotation(q: FloatArray) -> FloatArray:
    """The matrices (..., 3, 3) of unit quaternions (..., 4), (w, x, y, z)."""
    w, x, y, z = np.moveaxis(q, -1, 0)
    return np.stack(
        [
            np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], -1),
            np.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], -1),
            np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], -1),
        ],
        -2,
    )

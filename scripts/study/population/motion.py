"""The true motion, integrated by scipy's DOP853: a free tumble, and a chaser near a target on a Kepler orbit.

Nothing here is shared with `baryscope.models`: this is the truth that the estimators are judged by. Both functions
integrate several neighbours at once, whose differences are the Jacobians of the bound.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from baryscope.models.orbit import Orbit

FloatArray = NDArray[np.float64]
Force = Callable[[float, FloatArray, FloatArray], FloatArray]
Torque = Callable[[float, FloatArray, FloatArray], FloatArray]

TOLERANCE = 1e-11
_AFTER, _BEFORE = np.array([1, 2, 0]), np.array([2, 0, 1])  # of the axes x, y and z, in turn


def tumble(
    inertia: FloatArray, attitude: FloatArray, rate: FloatArray, time: FloatArray, torque: Torque | None = None
) -> tuple[FloatArray, FloatArray]:
    """Attitudes R_I_B (k, n, 3, 3) and rates (k, n, 3) in B, rad/s, of k rigid bodies at ascending times (n,) in s.

    inertia (k, 3, 3); attitude (k, 4) at the first time, (x, y, z, w); rate (k, 3) there. torque: of (t, R_I_B, rates),
    N m in B (k, 3) in the inertia's units.
    """
    k, inverse = len(inertia), np.linalg.inv(inertia)

    def slope(t: float, flat: FloatArray) -> FloatArray:
        state = flat.reshape(k, 7)
        q, v, s, w = state[:, :4], state[:, :3], state[:, 3:4], state[:, 4:]
        moment = cross(np.einsum("kij,kj->ki", inertia, w), w)
        turning = np.concatenate([s * w + cross(v, w), -np.sum(v * w, axis=1, keepdims=True)], axis=1) / 2
        if torque is not None:
            moment = moment + torque(t, Rotation.from_quat(q).as_matrix(), w)
        return np.concatenate([turning, np.einsum("kij,kj->ki", inverse, moment)], axis=1).ravel()

    start = np.concatenate([attitude, rate], axis=1).ravel()
    states = _integrated(slope, start, time).reshape(len(time), k, 7).transpose(1, 0, 2)
    matrices = Rotation.from_quat(states[..., :4].reshape(-1, 4)).as_matrix()
    return matrices.reshape(k, len(time), 3, 3), states[..., 4:]


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """a × b of few vectors (k, 3): the same numbers as NumPy's, whose time goes to what does not depend on them."""
    return a.take(_AFTER, 1) * b.take(_BEFORE, 1) - a.take(_BEFORE, 1) * b.take(_AFTER, 1)


def relative_motion(
    orbit: Orbit, state: FloatArray, time: FloatArray, force: Force | None = None, breaks: Sequence[float] = ()
) -> tuple[FloatArray, FloatArray]:
    """The chaser's states (k, n, 6) from the target's centre of mass in inertial axes, m and m/s, and R_I_L (n, 3, 3).

    state (k, 6): (ρ, ρ̇) in LVLH, m and m/s, at time 0, for which the orbit holds; time (n,) ascends from 0.
    force: of (t, target's position and velocity (6,), chasers' relative to it (k, 6)), accelerations (k + 1, 3) in m/s²
    besides the point mass: the target's, and those of the chasers relative to it. breaks: times at which it jumps.
    Encke's form of the difference keeps the last digits.
    """
    mu = orbit.gravitational_parameter
    target = orbit_state(orbit)
    R_I_L, turn = lvlh_axes(target[None])
    rho, rate = state[:, :3], state[:, 3:]
    k = len(state)
    relative = np.concatenate([rho @ R_I_L[0].T, (rate + np.cross(turn[0] * np.eye(3)[2], rho)) @ R_I_L[0].T], axis=1)

    def slope(t: float, flat: FloatArray) -> FloatArray:
        here, others = flat[:6], flat[6:].reshape(k, 6)
        r, d = here[:3], others[:, :3]
        cube = np.sum(r * r) ** 1.5
        excess = np.expm1(-1.5 * np.log1p(np.sum(d * (d + 2 * r), axis=1) / np.sum(r * r)))[:, None]
        own, pull = -mu / cube * r, -mu / cube * (d + excess * (r + d))
        if force is not None:
            more = force(t, here, others)
            own, pull = own + more[0], pull + more[1:]
        return np.concatenate([here[3:], own, np.concatenate([others[:, 3:], pull], axis=1).ravel()])

    states = _integrated(slope, np.concatenate([target, relative.ravel()]), time, breaks)
    axes, _ = lvlh_axes(states[:, :6])
    return states[:, 6:].reshape(len(time), k, 6).transpose(1, 0, 2), axes


def orbit_state(orbit: Orbit) -> FloatArray:
    """The target's position and velocity (6,) in inertial axes at time 0, m and m/s."""
    e, theta = orbit.eccentricity, orbit.true_anomaly
    p = orbit.semi_major_axis * (1 - e * e)
    place = p / (1 + e * np.cos(theta)) * np.array([np.cos(theta), np.sin(theta), 0.0])
    speed = np.sqrt(orbit.gravitational_parameter / p) * np.array([-np.sin(theta), e + np.cos(theta), 0.0])
    angles = [orbit.raan, orbit.inclination, orbit.argument_of_periapsis]
    turn = Rotation.from_euler("ZXZ", angles)
    return np.concatenate([turn.apply(place), turn.apply(speed)])


def lvlh_axes(state: FloatArray) -> tuple[FloatArray, FloatArray]:
    """R_I_L (n, 3, 3) and the axes' rate (n,) about their z, rad/s, for states (n, 6) of the target."""
    r, v = state[:, :3], state[:, 3:]
    h = np.cross(r, v)
    up = r / np.linalg.norm(r, axis=1, keepdims=True)
    normal = h / np.linalg.norm(h, axis=1, keepdims=True)
    axes = np.stack([up, np.cross(normal, up), normal], axis=2)
    return axes, np.linalg.norm(h, axis=1) / np.sum(r * r, axis=1)


def _integrated(
    slope: Callable[[float, FloatArray], FloatArray],
    start: FloatArray,
    time: FloatArray,
    breaks: Sequence[float] = (),
) -> FloatArray:
    """The states (n, size) at ascending times (n,), the first of which is that of `start`."""
    edges = [time[0], *sorted(t for t in breaks if time[0] < t < time[-1]), time[-1]]
    found, state = [start[None]], start
    for begin, end in pairwise(edges):
        inside = time[(time > begin) & (time <= end)]
        at = inside if inside.size and inside[-1] == end else np.append(inside, end)
        inner = (begin + 1e-9 * (end - begin), end - 1e-9 * (end - begin))  # a jump belongs to neither side

        def within(t: float, y: FloatArray, inner: tuple[float, float] = inner) -> FloatArray:
            return slope(min(max(t, inner[0]), inner[1]), y)

        done = solve_ivp(within, (begin, end), state, "DOP853", at, rtol=TOLERANCE, atol=TOLERANCE)
        state = done.y[:, -1]
        found.append(done.y.T[: len(inside)])
    return np.concatenate(found)

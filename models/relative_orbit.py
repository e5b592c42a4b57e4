"""Unforced relative motion in closed form: the state transition matrix and the exact path.

The state is [ρ; ρ̇], position (m) and velocity (m/s) of the chaser from the target's CoM in LVLH; ρ̇ is the rate of
change of the coordinates, as in `relative_motion`.
"""

from functools import cache

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from baryscope.models import differences as dif
from baryscope.models.columns import ColumnFunction
from baryscope.models.differences import Pair
from baryscope.models.errors import ComputationError, Reason
from baryscope.models.frames import Symbol, cross_matrix, rotation_I_L
from baryscope.models.keplerian import (
    Elements,
    Ellipse,
    conic,
    eccentric_anomaly,
    eccentric_anomaly_after,
    true_anomaly_after,
    whole_turns,
)
from baryscope.models.orbit import Orbit
from baryscope.models.relative_motion import target_from_chaser

FloatArray = NDArray[np.float64]

POLISHING_STEPS = 2  # of Newton; nearly parabolic orbits need the second


def relative_transition(orbit: Orbit, time: ArrayLike, epoch: float = 0.0) -> FloatArray:
    """State transition matrices of the linearised relative motion, by Yamanaka and Ankersen (2002).

    They hold for every eccentricity below 1 and at every true anomaly, and leave out terms of the order ρ²/r.

    Args:
        orbit: the target's Keplerian elements at time 0.
        time: (n,), s, in any order, before or after the epoch.
        epoch: time of the state that the matrices start from, s.

    Returns:
        Φ, (n, 6, 6), such that `state(time) = Φ @ state(epoch)`; SI, in LVLH.
    """
    return _transition_function()(_row(time), [epoch], orbit.elements)


def relative_path(orbit: Orbit, state0: ArrayLike, time: ArrayLike, epoch: float = 0.0) -> FloatArray:
    """The exact relative motion: the difference of two Kepler orbits, in full precision.

    Both are propagated by Lagrange's f and g in the change of the eccentric anomaly (Battin 1999, §4.3), with the
    arithmetic of `differences`: ρ is accurate to its last bits, over any number of turns.

    Args:
        orbit: the target's Keplerian elements at time 0.
        state0: (6,), [ρ; ρ̇] at the epoch, in LVLH.
        time: (n,), s, in any order, before or after the epoch.
        epoch: time of `state0`, s.

    Returns:
        [ρ; ρ̇] in LVLH, (n, 6).

    Raises:
        ComputationError: the chaser's orbit is not an ellipse.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        path = _path_function()(_row(time), [epoch], orbit.elements, state0)
    if not np.isfinite(path).all():
        raise ComputationError(
            f"relative state {np.asarray(state0).tolist()} in m and m/s: the chaser's orbit is open", Reason.OPEN_ORBIT
        )
    return path


def paths_from_chaser(elements: ArrayLike, begin: float, states: ArrayLike, end: ArrayLike) -> FloatArray:
    """The target's CoM seen from the chaser, in C, of m pairs on orbits of their own: exact, as in `relative_path`.

    Args:
        elements: (m, 7), of the target of each pair at time 0, as of `Orbit.elements`.
        begin: time of the states, s.
        states: (m, 6), position and velocity in C, m and m/s.
        end: (n,), times in s.

    Returns:
        Position and velocity, (m, n, 6); NaN where the chaser's orbit is not an ellipse.
    """
    time, many = np.asarray(end, dtype=np.float64), np.asarray(states, dtype=np.float64)
    pairs = (np.repeat(np.asarray(each, dtype=np.float64).T, len(time), axis=1) for each in (elements, many))
    with np.errstate(all="ignore"):
        found = _chaser_path_function()([begin], np.tile(time, len(many))[None], *pairs)
    return found.reshape(len(many), len(time), 6)


def step_in_chaser_axes() -> ca.Function:
    """The function (begin, end, elements, state) → (state, Φ) of the target's CoM seen from the chaser, in C.

    The state is position and velocity (6,) in m and m/s, exact as in `relative_path` and NaN on an open orbit; Φ (6, 6)
    is that of `relative_transition` in these axes.
    """
    symbols, moved, transition = _in_chaser_axes()
    return ca.Function("relative", symbols, [moved, ca.densify(transition)], {"cse": True})


@cache
def _chaser_path_function() -> ColumnFunction:
    """(begin, end, elements, state) → state then, in C."""
    symbols, moved, _ = _in_chaser_axes()
    return ColumnFunction("paths_from_chaser", symbols, moved)


def _in_chaser_axes() -> tuple[list[Symbol], Symbol, Symbol]:
    """Symbols of begin, end, elements and the state at the beginning, and of these the state then and Φ, in C."""
    begin, end, (column, elements) = ca.SX.sym("begin"), ca.SX.sym("end"), Elements.symbols()
    state, to_C, to_L = ca.SX.sym("state", 6), _chaser_axes(end, elements)[0], _chaser_axes(begin, elements)[1]
    moved = to_C @ _path(end, begin, elements, to_L @ state)
    return [begin, end, column, state], moved, to_C @ _transition(end, begin, elements) @ to_L


def _chaser_axes(time: Symbol, elements: Elements) -> tuple[Symbol, Symbol]:
    """The matrix (6, 6) from [ρ; ρ̇] in LVLH to the target's position and velocity in C, and its inverse."""
    anomaly = true_anomaly_after(time, elements)
    R_I_L = rotation_I_L(elements.R_I_P, anomaly)
    turning = cross_matrix(ca.vertcat(0, 0, conic(elements.ellipse, anomaly).anomaly_rate))
    zero = ca.SX(3, 3)
    to_C = ca.vertcat(ca.horzcat(-R_I_L, zero), ca.horzcat(-R_I_L @ turning, -R_I_L))
    to_L = ca.vertcat(ca.horzcat(-R_I_L.T, zero), ca.horzcat(turning @ R_I_L.T, -R_I_L.T))
    return to_C, to_L


def _row(time: ArrayLike) -> FloatArray:
    return np.asarray(time, dtype=np.float64)[None, :]


@cache
def _transition_function() -> ColumnFunction:
    """(time, epoch, elements) → Φ."""
    time, epoch, (column, elements) = ca.SX.sym("time"), ca.SX.sym("epoch"), Elements.symbols()
    return ColumnFunction("relative_transition", [time, epoch, column], _transition(time, epoch, elements))


def _transition(time: Symbol, epoch: Symbol, elements: Elements) -> Symbol:
    """Φ from the epoch to the time."""
    e, orbit = elements.eccentricity, elements.ellipse
    start, end = (true_anomaly_after(t, elements) for t in (epoch, time))
    return (
        _unscaling(orbit, end)
        @ _modes(e, end, orbit.rate * (time - epoch))
        @ _mode_amplitudes(e, start)
        @ _scaling(orbit, start)
    )


def _scaling(orbit: Ellipse, true_anomaly: Symbol) -> Symbol:
    """[ρ; ρ̇] → [ρ̃; ρ̃'], with ρ̃ = (1 + e cos θ) ρ and ' for d/dθ: Yamanaka–Ankersen (86)."""
    ratio, sine = 1 + orbit.eccentricity * ca.cos(true_anomaly), orbit.eccentricity * ca.sin(true_anomaly)
    return _blocks(ratio, 0, -sine, 1 / (orbit.rate * ratio))


def _unscaling(orbit: Ellipse, true_anomaly: Symbol) -> Symbol:
    """[ρ̃; ρ̃'] → [ρ; ρ̇], the inverse of `_scaling`."""
    ratio, sine = 1 + orbit.eccentricity * ca.cos(true_anomaly), orbit.eccentricity * ca.sin(true_anomaly)
    return _blocks(1 / ratio, 0, orbit.rate * sine, orbit.rate * ratio)


def _blocks(*factors: Symbol | float) -> Symbol:
    """The 6 × 6 matrix of four multiples of the 3 × 3 unit matrix, row by row."""
    return ca.kron(ca.reshape(ca.vertcat(*factors), 2, 2).T, ca.SX.eye(3))


def _modes(e: Symbol, true_anomaly: Symbol, J: Symbol) -> Symbol:
    """Amplitudes of the six modes at the epoch → [ρ̃; ρ̃'] at θ, J = k² (t − epoch): Yamanaka–Ankersen (83).

    Their x is our y, their y our −z and their z our −x; the signs of the modes are chosen so that ours are plain. The
    modes are an offset along the track, two ellipses in the plane, the drift, and two oscillations out of the plane.
    """
    cosine, sine = ca.cos(true_anomaly), ca.sin(true_anomaly)
    ratio = 1 + e * cosine
    s, c = ratio * sine, ratio * cosine
    s_rate, c_rate = cosine + e * ca.cos(2 * true_anomaly), -sine - e * ca.sin(2 * true_anomaly)
    lever = 1 + 1 / ratio
    return _matrix(
        [0, s, c, 2 - 3 * e * s * J, 0, 0],
        [1, c * lever, -s * lever, -3 * ratio**2 * J, 0, 0],
        [0, 0, 0, 0, cosine, sine],
        [0, s_rate, c_rate, -3 * e * (s_rate * J + s / ratio**2), 0, 0],
        [0, -2 * s, e - 2 * c, -3 * (1 - 2 * e * s * J), 0, 0],
        [0, 0, 0, 0, -sine, cosine],
    )


def _mode_amplitudes(e: Symbol, true_anomaly: Symbol) -> Symbol:
    """[ρ̃; ρ̃'] at the epoch → amplitudes of the modes, the inverse of `_modes` at J = 0: Yamanaka–Ankersen (82)."""
    cosine, sine = ca.cos(true_anomaly), ca.sin(true_anomaly)
    ratio = 1 + e * cosine
    s, c = ratio * sine, ratio * cosine
    lever, squeeze = 1 + 1 / ratio, 1 - e**2
    return (
        _matrix(
            [-3 * e * s * (1 / ratio + 1 / ratio**2), squeeze, 0, e * c - 2, -e * s * lever, 0],
            [-3 * s * (1 / ratio + (e / ratio) ** 2), 0, 0, c - 2 * e, -s * lever, 0],
            [-3 * (c / ratio + e), 0, 0, -s, -c * lever - e, 0],
            [3 * ratio - squeeze, 0, 0, e * s, ratio**2, 0],
            [0, 0, squeeze * cosine, 0, 0, -squeeze * sine],
            [0, 0, squeeze * sine, 0, 0, squeeze * cosine],
        )
        / squeeze
    )


def _matrix(*rows: list[Symbol | float]) -> Symbol:
    return ca.vertcat(*(ca.horzcat(*row) for row in rows))


@cache
def _path_function() -> ColumnFunction:
    """(time, epoch, elements, state at the epoch) → state at the time."""
    time, epoch = ca.SX.sym("time"), ca.SX.sym("epoch")
    (column, elements), state = Elements.symbols(), ca.SX.sym("state", 6)
    return ColumnFunction("relative_path", [time, epoch, column, state], _path(time, epoch, elements, state))


def _path(time: Symbol, epoch: Symbol, elements: Elements, state: Symbol) -> Symbol:
    """The state at the time, of that at the epoch.

    Everything is computed in the inertial axes that L has at the epoch; base is the target, other the chaser.
    """
    here = conic(elements.ellipse, true_anomaly_after(epoch, elements))
    offset, drift = target_from_chaser(state[:3], state[3:], here, ca.SX.eye(3))
    position = Pair(ca.vertcat(here.radius, 0, 0), -offset)
    velocity = Pair(ca.vertcat(here.radial_rate, here.radius * here.anomaly_rate, 0), -drift)

    E0, E = (eccentric_anomaly_after(t, elements)[0] for t in (epoch, time))
    position, velocity = _propagate(position, velocity, elements.gravitational_parameter, E - E0, time - epoch)

    up = position.base / ca.norm_2(position.base)
    R_L_K = ca.horzcat(up, ca.vertcat(-up[1], up[0], 0), ca.vertcat(0, 0, 1)).T
    anomaly_rate = here.anomaly_rate * here.radius**2 / ca.dot(position.base, position.base)
    rho = R_L_K @ position.excess
    rho_rate = R_L_K @ velocity.excess - ca.cross(ca.vertcat(0, 0, anomaly_rate), rho)
    return ca.vertcat(rho, rho_rate)


def _propagate(position: Pair, velocity: Pair, mu: Symbol, turn: Symbol, elapsed: Symbol) -> tuple[Pair, Pair]:
    """Two Kepler orbits after `elapsed` s, in which the eccentric anomaly of the first has grown by `turn`."""
    radius = dif.sqrt(dif.dot(position, position))
    curvature = 2 / radius - dif.dot(velocity, velocity) / mu  # 1/a
    e_cos = 1 - radius * curvature
    e_sin = dif.dot(position, velocity) * dif.sqrt(curvature / mu)
    n = dif.sqrt(curvature * curvature * curvature * mu)

    angle = Pair(turn, whole_turns(_second_turn(e_cos, e_sin, n, elapsed) - turn)[0])
    for _ in range(POLISHING_STEPS):
        sine, cosine = dif.sin(angle), dif.cos(angle)
        mean = angle - e_cos * sine + e_sin * (1 - cosine)
        residual, _ = whole_turns(mean.excess - n.excess * elapsed)
        slope = 1 - (e_cos * cosine - e_sin * sine).other
        angle = Pair(turn, angle.excess - residual / slope)

    sine, versine = dif.sin(angle), 1 - dif.cos(angle)
    distance = (e_sin * sine + (1 - e_cos) + e_cos * versine) / curvature
    f = 1 - versine / (radius * curvature)
    g = ((1 - e_cos) * sine + e_sin * versine) / n
    f_rate = -1 * dif.sqrt(mu / curvature) * sine / (distance * radius)
    g_rate = 1 - versine / (distance * curvature)
    return f * position + g * velocity, f_rate * position + g_rate * velocity


def _second_turn(e_cos: Pair, e_sin: Pair, n: Pair, elapsed: Symbol) -> Symbol:
    """Change of the second orbit's eccentric anomaly in ordinary precision, up to whole turns."""
    E0 = ca.atan2(e_sin.other, e_cos.other)
    M, _ = whole_turns(E0 - e_sin.other + n.other * elapsed)
    return eccentric_anomaly(M, ca.hypot(e_sin.other, e_cos.other)) - E0

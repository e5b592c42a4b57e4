"""Rigid-body rotation by Euler's equation, and its sensitivity to the rate and the inertia at an epoch.

The motion is integrated from the epoch to evenly spaced nodes by steps of order 8 (Dormand and Prince; the tableau is
scipy's). Only the state is integrated sequentially; the sensitivities of the steps are evaluated for all steps at once
and multiplied. Between nodes the attitude is a quintic and its sensitivity a cubic Hermite polynomial, so that the
cost of the integration does not depend on the sampling.

Only the ratios of the inertia's elements are observable, so J has trace 1. Its five degrees of freedom are the
coefficients of INERTIA_BASIS, a basis of the traceless symmetric matrices.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.integrate import DOP853

from baryscope.estimator.geometry.alignment import matrix_from_quaternion, quaternion_from_matrix
from baryscope.estimator.geometry.so3 import exp_rotation
from baryscope.models.attitude import angular_acceleration, gravity_gradient_torque, symmetric_inverse
from baryscope.models.columns import ColumnFunction
from baryscope.models.errors import ComputationError, Reason
from baryscope.models.frames import quaternion_rate, rotation_from_quaternion, rotation_I_L
from baryscope.models.keplerian import Elements, conic, true_anomaly_after
from baryscope.models.orbit import Orbit

FloatArray = NDArray[np.float64]

NODE_ANGLE = 0.5  # rad from node to node: the interpolation's error is 1e-8 to 1e-7 rad, that of the steps is less
MAX_NODES = 200_000  # of an integration: 600 MB, and 10 s
CHUNK = 32  # steps in one call of the compiled function
MIN_PRINCIPAL_MOMENT = 1e-3  # over the trace: bound on the inertia of an estimate
RATE_AND_INERTIA = 8  # unknowns of a rotation: three of the rate at the epoch, five of the inertia

_HALF, _SIXTH = np.sqrt(0.5), np.sqrt(1 / 6)
INERTIA_BASIS = np.array(
    [
        np.diag([_HALF, -_HALF, 0.0]),
        np.diag([_SIXTH, _SIXTH, -2 * _SIXTH]),
        [[0, _HALF, 0], [_HALF, 0, 0], [0, 0, 0]],
        [[0, 0, _HALF], [0, 0, 0], [_HALF, 0, 0]],
        [[0, 0, 0], [0, 0, _HALF], [0, _HALF, 0]],
    ]
)


@dataclass(frozen=True, eq=False)
class Rotation:
    """The rotational state at an epoch: attitude R_C_B (3, 3), rate (3,) in rad/s in B, inertia (3, 3) of trace 1.

    epoch in s; orbit: the target's, if a gravity-gradient torque acts on it; None for torque-free motion.
    """

    epoch: float
    attitude: FloatArray
    rate: FloatArray
    inertia: FloatArray
    orbit: Orbit | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "inertia", self.inertia / np.trace(self.inertia))

    def changed(self, turn: FloatArray, change: FloatArray) -> "Rotation":
        """The rotation with a changed state.

        turn (3,): rotation vector in B, rad, applied to the attitude; change (8,): of the rate in rad/s, and of the
        coefficients of INERTIA_BASIS.
        """
        inertia = self.inertia + np.tensordot(change[3:], INERTIA_BASIS, 1)
        return Rotation(self.epoch, self.attitude @ exp_rotation(turn), self.rate + change[:3], inertia, self.orbit)

    @property
    def possible(self) -> bool:
        """Whether the inertia is positive definite, with least moment not below a rod's 27 times as long as thick."""
        return bool(np.linalg.eigvalsh(self.inertia)[0] > MIN_PRINCIPAL_MOMENT)

    def reaches(self, time: FloatArray, nodes: float = MAX_NODES) -> bool:
        """Whether the integration from the epoch over times (n,) in s needs at most `nodes` nodes."""
        return _highest_rate(self) * _span(self.epoch, time) <= NODE_ANGLE * nodes

    def at(self, time: FloatArray) -> "Attitudes":
        """Attitude, rate and sensitivities at times (n,) in s, in any order.

        Raises:
            ComputationError: the integration needs more than MAX_NODES nodes, or diverges.
        """
        if not self.reaches(time):
            raise too_long(float(np.linalg.norm(self.rate)), _span(self.epoch, time))
        found = self.try_at(time)
        if found is None:
            raise ComputationError(
                "the integration of the rotation diverges: over so long a time the gravity gradient makes it chaotic",
                Reason.DIVERGED,
            )
        return found

    def try_at(self, time: FloatArray) -> "Attitudes | None":
        """The same as `at`; None instead of an error."""
        nodes = self._nodes_around(time) if self.reaches(time) else None
        return nodes.between(time) if nodes is not None and nodes.finite else None

    def rate_sensitivity_at(self, time: FloatArray) -> FloatArray:
        """Jacobian (n, 3, 8) of the angular rate in B at times (n,) in s by rate and inertia at the epoch."""
        return self._nodes_around(time).rate_sensitivity(time)

    def _nodes_around(self, time: FloatArray) -> "_Nodes":
        return _nodes(self, float(min(time.min(initial=np.inf), self.epoch)), float(max(time.max(), self.epoch)))


def too_long(rate: float, span: float) -> ComputationError:
    """The error to raise if the integration of a rate in rad/s over a span in s needs too many nodes."""
    turns = rate * span / (2 * np.pi)
    return ComputationError(
        f"the target turns at {rate:.3g} rad/s, {turns:.2g} times in the {span:.3g} s of the tracks: too often for its "
        "motion to be followed in so few frames; use a shorter part of the tracks, or the method pivot",
        Reason.TOO_LONG,
    )


def _span(epoch: float, time: FloatArray) -> float:
    """The span in s of times (n,) and an epoch."""
    return float(max(time.max(initial=epoch), epoch) - min(time.min(initial=epoch), epoch))


@dataclass(frozen=True, eq=False)
class Attitudes:
    """The rotation at n times: attitude (n, 3, 3) R_C_B, rate (n, 3) rad/s in B.

    turn (n, 3, 8): Jacobian of the attitude, as a rotation vector in B, by rate and inertia at the epoch. The attitude
    at the epoch is not among the unknowns; a rotation by φ there rotates the attitude at t by R(t)ᵀ R(epoch) φ.
    """

    attitude: FloatArray
    rate: FloatArray
    turn: FloatArray


@dataclass(frozen=True, eq=False)
class _Nodes:
    time: FloatArray  # (k,) in s, evenly spaced, ascending
    quaternion: FloatArray  # (k, 4) R_C_B, scalar first, without jumps of sign
    rate: FloatArray  # (k, 3)
    acceleration: FloatArray  # (k, 3)
    turn: FloatArray  # (k, 3, 8) in C
    turn_rate: FloatArray  # (k, 3, 8) in C

    @property
    def finite(self) -> bool:
        """Whether the integration has not diverged."""
        return bool(np.isfinite(self.quaternion).all() and np.isfinite(self.turn_rate).all())

    def between(self, time: FloatArray) -> Attitudes:
        h = self.time[1] - self.time[0]
        left, s = self._locate(time)
        q, q1, q2 = _quaternion_derivatives(self.quaternion, self.rate, self.acceleration)
        quaternion = _quintic(s, left, q, h * q1, h * h * q2)
        quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
        attitude = matrix_from_quaternion(quaternion)
        rate = _cubic(s, left, self.rate, h * self.acceleration)
        k = len(self.time)
        turn_C = _cubic(s, left, self.turn.reshape(k, -1), h * self.turn_rate.reshape(k, -1))
        turn = np.swapaxes(attitude, 1, 2) @ turn_C.reshape(len(time), 3, RATE_AND_INERTIA)
        return Attitudes(attitude, rate, turn)

    def rate_sensitivity(self, time: FloatArray) -> FloatArray:
        """Jacobian (n, 3, 8) of the rate in B: φ changes ω by φ̇ + ω × φ = Rᵀ d(R φ)/dt, here of the cubic R φ."""
        h, k = self.time[1] - self.time[0], len(self.time)
        left, s = self._locate(time)
        slope = _cubic_slope(s, left, self.turn.reshape(k, -1), h * self.turn_rate.reshape(k, -1)) / h
        R_B_C = np.swapaxes(self.between(time).attitude, 1, 2)
        return np.asarray(R_B_C @ slope.reshape(len(time), 3, RATE_AND_INERTIA))

    def _locate(self, time: FloatArray) -> tuple[NDArray[np.intp], FloatArray]:
        """The index of the node before each time, and the fraction of the interval from there, 0 to 1."""
        h = self.time[1] - self.time[0]
        left = np.clip(((time - self.time[0]) / h).astype(np.intp), 0, len(self.time) - 2)
        return left, (time - self.time[left]) / h


def _quaternion_derivatives(
    q: FloatArray, rate: FloatArray, acceleration: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """q, q̇ = ½ q ⊗ ω and q̈ = ½ q ⊗ ω̇ − ¼ |ω|² q."""
    first = 0.5 * quaternion_times_vector(q, rate)
    second = 0.5 * quaternion_times_vector(q, acceleration) - 0.25 * np.sum(rate**2, axis=1)[:, None] * q
    return q, first, second


def quaternion_times_vector(q: FloatArray, v: FloatArray) -> FloatArray:
    """q ⊗ (0, v), quaternions (n, 4) scalar first, vectors (n, 3)."""
    scalar = -np.einsum("ni,ni->n", q[:, 1:], v)
    return np.column_stack([scalar, q[:, :1] * v + np.cross(q[:, 1:], v)])


def _cubic(s: FloatArray, left: NDArray[np.intp], f: FloatArray, df: FloatArray) -> FloatArray:
    """Cubic Hermite polynomial from values and derivatives (per interval) at nodes left and left + 1; s is 0 to 1."""
    s = s[:, None]
    s2, s3 = s * s, s * s * s
    h01 = 3 * s2 - 2 * s3
    value: FloatArray = (1 - h01) * f[left] + h01 * f[left + 1]
    value += (s - 2 * s2 + s3) * df[left] + (s3 - s2) * df[left + 1]
    return value


def _cubic_slope(s: FloatArray, left: NDArray[np.intp], f: FloatArray, df: FloatArray) -> FloatArray:
    """The derivative of `_cubic` by s."""
    s = s[:, None]
    value: FloatArray = (6 * s - 6 * s * s) * (f[left + 1] - f[left])
    value += (1 - 4 * s + 3 * s * s) * df[left] + (3 * s * s - 2 * s) * df[left + 1]
    return value


def _quintic(s: FloatArray, left: NDArray[np.intp], f: FloatArray, df: FloatArray, ddf: FloatArray) -> FloatArray:
    """Quintic Hermite polynomial from values, first and second derivatives, arguments as in `_cubic`."""
    s = s[:, None]
    s2, s3 = s * s, s * s * s
    s4, s5 = s2 * s2, s2 * s3
    h0 = 10 * s3 - 15 * s4 + 6 * s5
    value: FloatArray = (1 - h0) * f[left] + h0 * f[left + 1]
    value += (s - 6 * s3 + 8 * s4 - 3 * s5) * df[left] + (-4 * s3 + 7 * s4 - 3 * s5) * df[left + 1]
    value += 0.5 * (s2 - 3 * s3 + 3 * s4 - s5) * ddf[left] + 0.5 * (s3 - 2 * s4 + s5) * ddf[left + 1]
    return value


@np.errstate(over="ignore", invalid="ignore")  # sensitivities of a chaotic motion grow without bound: see `finite`
def _nodes(start: Rotation, begin: float, end: float) -> _Nodes:
    """The motion and its sensitivities at nodes that span begin … end in s, integrated from the epoch."""
    highest_rate = _highest_rate(start)
    h = NODE_ANGLE / highest_rate if highest_rate > 0 else np.inf
    before = max(int(np.ceil((start.epoch - begin) / h)), 0)
    after = max(int(np.ceil((end - start.epoch) / h)), 1)
    h = float(np.max([(start.epoch - begin) / max(before, 1), (end - start.epoch) / after, 1e-9]))
    constants, gravity_gradient = _constants(start), start.orbit is not None
    back, forth = _integrate(start, constants, -h, before), _integrate(start, constants, h, after)
    sizes = np.repeat([-h, h], [before, after])[None]
    steps = _sensitivity_step(gravity_gradient)(np.hstack([back[:, :-1], forth[:, :-1]]), sizes, constants)
    states = np.hstack([back[:, :0:-1], forth])
    sensitivity = np.concatenate([_chained(steps[:before])[:0:-1], _chained(steps[before:])])
    R = matrix_from_quaternion(states[:4].T / np.linalg.norm(states[:4], axis=0)[:, None])
    return _Nodes(
        start.epoch + h * np.arange(-before, after + 1, dtype=np.float64),
        states[:4].T,
        states[4:7].T,
        _rate_columns(gravity_gradient)(states, constants)[:, 4:7],
        sensitivity[:, :3],
        R @ sensitivity[:, 3:],
    )


def _highest_rate(start: Rotation) -> float:
    """An upper bound in rad/s of ‖ω‖ from the kinetic energy, plus that of the orbit if there is a torque.

    The gravity gradient swings a slender body at up to √(3 (λ₃ − λ₁)/λ₁) times the orbit's rate. A quarter of that
    keeps the integration stable.
    """
    J, w = start.inertia, start.rate
    moments = np.linalg.eigvalsh(J)
    lowest = max(float(moments[0]), 1e-6)
    rate = float(np.sqrt(max(float(w @ J @ w), 0.0) / lowest))
    if start.orbit is None:
        return rate
    swing = float(np.sqrt(3 * (moments[-1] - moments[0]) / lowest)) * start.orbit.periapsis_rate
    return max(rate + 2 * start.orbit.periapsis_rate, float(np.hypot(rate, swing)) / 4)


def _integrate(start: Rotation, constants: FloatArray, h: float, steps: int) -> FloatArray:
    """The states (8, steps + 1) at the epoch and after each step of h in s."""
    advance = _advance(start.orbit is not None)
    states = np.empty((8, steps + 1))
    states[:, 0] = [*quaternion_from_matrix(start.attitude[None])[0], *start.rate, _true_anomaly(start)]
    for first in range(0, steps, CHUNK):
        length = min(CHUNK, steps - first)
        sizes = np.zeros(CHUNK)
        sizes[:length] = h
        found = np.asarray(advance(states[:, first], sizes[None, :], constants))
        states[:, first + 1 : first + 1 + length] = found[:, :length]
    return states


def _chained(steps: FloatArray) -> FloatArray:
    """The sensitivities (k + 1, 6, 8) to rate and inertia at the epoch, from those of k steps, (k, 6, 11)."""
    chain = np.zeros((len(steps) + 1, 11, RATE_AND_INERTIA))
    chain[0, 3:6, :3] = np.eye(3)
    chain[:, 6:, 3:] = np.eye(5)
    for before, step, after in zip(chain, steps, chain[1:, :6], strict=False):
        np.matmul(step, before, out=after)
    return chain[:, :6]


def _constants(start: Rotation) -> FloatArray:
    """The parameters of the equations: the inertia by columns (9,), and the orbit's elements if there is a torque."""
    if start.orbit is None:
        return start.inertia.T.ravel()
    return np.concatenate([start.inertia.T.ravel(), start.orbit.elements])


def _true_anomaly(start: Rotation) -> float:
    return 0.0 if start.orbit is None else float(_anomaly_function()(start.epoch, start.orbit.elements))


@cache
def _anomaly_function() -> ca.Function:
    time, (column, elements) = ca.SX.sym("time"), Elements.symbols()
    return ca.Function("anomaly", [time, column], [true_anomaly_after(time, elements)])


@cache
def _rate_columns(gravity_gradient: bool) -> ColumnFunction:
    """The function (x, constants) → ẋ."""
    x, _, c = _symbols(gravity_gradient)
    return ColumnFunction("rates", [x, c], _rates(x, c, gravity_gradient))


@cache
def _advance(gravity_gradient: bool) -> ca.Function:
    """The function (x, sizes, constants) → states (8, CHUNK) after each of CHUNK steps."""
    x, h, c = _symbols(gravity_gradient)
    after = _step(lambda state: _rates(state, c, gravity_gradient), x, h)
    return ca.Function("advance", [x, h, c], [after], {"cse": True}).mapaccum(CHUNK)


@cache
def _sensitivity_step(gravity_gradient: bool) -> ColumnFunction:
    """The function (x, size, constants) → Jacobian (6, 11) of a step.

    It maps changes of attitude (a rotation vector in C), rate and inertia before the step to those of attitude and
    rate after it.
    """
    x, h, c = _symbols(gravity_gradient)
    linear = ca.Function("linearised_rates", [x, c], [_linearised_rates(x, c, gravity_gradient)])
    inertia = ca.horzcat(ca.SX(5, 6), ca.SX.eye(5))

    def rates(state: ca.SX) -> ca.SX:
        sensitivity = ca.vertcat(ca.reshape(state[8:], 6, 11), inertia)
        return ca.vertcat(_rates(state[:8], c, gravity_gradient), ca.vec(linear(state[:8], c) @ sensitivity))

    after = _step(rates, ca.vertcat(x, ca.vec(ca.SX.eye(11)[:6, :])), h)
    return ColumnFunction("sensitivity", [x, h, c], ca.reshape(after[8:], 6, 11))


def _symbols(gravity_gradient: bool) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Symbols of the state (q, ω, true anomaly), the step's size in s, and the constants."""
    return ca.SX.sym("x", 8), ca.SX.sym("h"), ca.SX.sym("c", 16 if gravity_gradient else 9)


def _linearised_rates(x: ca.SX, c: ca.SX, gravity_gradient: bool) -> ca.SX:
    """Jacobian (6, 11) of the rates of rotation vector and angular rate by rotation vector, angular rate, inertia."""
    q, w = x[:4], x[4:7]
    turn, change = ca.SX.sym("turn", 3), ca.SX.sym("change", 5)
    turned = ca.vertcat(_product(ca.vertcat(1, turn / 2), q), x[4:])
    inertia = c[:9] + ca.DM(INERTIA_BASIS.reshape(5, 9).T) @ change
    acceleration = _rates(turned, ca.vertcat(inertia, c[9:]), gravity_gradient)[4:7]
    rates = ca.vertcat(rotation_from_quaternion(q) @ w, acceleration)
    linear = ca.jacobian(rates, ca.vertcat(turn, w, change))
    return ca.substitute(linear, ca.vertcat(turn, change), ca.SX.zeros(8))


def _rates(x: ca.SX, c: ca.SX, gravity_gradient: bool) -> ca.SX:
    q, w, anomaly = x[:4], x[4:7], x[7]
    J = ca.reshape(c[:9], 3, 3)
    torque, anomaly_rate = ca.SX(3, 1), ca.SX(0)
    if gravity_gradient:
        elements = Elements.of(c[9:])
        place = conic(elements.ellipse, anomaly)
        R_I_L = rotation_I_L(elements.R_I_P, anomaly)
        torque = gravity_gradient_torque(J, rotation_from_quaternion(q).T @ R_I_L[:, 0], place.stiffness)
        anomaly_rate = place.anomaly_rate
    return ca.vertcat(quaternion_rate(q, w), angular_acceleration(J, symmetric_inverse(J), w, torque), anomaly_rate)


def _step(rates: Callable[[ca.SX], ca.SX], x: ca.SX, h: ca.SX) -> ca.SX:
    """One step of the eighth-order formula of Dormand and Prince (Hairer, Nørsett, Wanner 1993, DOP853)."""
    slopes: list[ca.SX] = []
    for row in DOP853.A:
        slopes.append(rates(_moved(x, h, row, slopes)))
    return _moved(x, h, DOP853.B, slopes)


def _moved(x: ca.SX, h: ca.SX, weights: FloatArray, slopes: list[ca.SX]) -> ca.SX:
    """x + h Σ weight · slope; h times a weight is a common subexpression of all points."""
    return sum((h * weight * slope for weight, slope in zip(weights, slopes, strict=False) if weight), x)


def _product(p: ca.SX, q: ca.SX) -> ca.SX:
    """The quaternion product p ⊗ q, scalar first."""
    return ca.vertcat(p[0] * q[0] - ca.dot(p[1:], q[1:]), p[0] * q[1:] + q[0] * p[1:] + ca.cross(p[1:], q[1:]))

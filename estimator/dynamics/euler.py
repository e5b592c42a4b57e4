"""Euler's equation, its steps of order 8 and their sensitivities, as functions for many points.

The steps are those of Dormand and Prince. A torque that is not the gravity gradient enters as the angular acceleration
at POINTS times of the step, with a cubic between them. Without gravity gradient the rate depends on nothing but itself:
it alone goes step by step, and by what quaternion each step turns the body is evaluated for all steps at once.
"""

from collections.abc import Callable, Iterable
from functools import cache, partial
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.dynamics.torque import POINTS, stage_weights
from baryscope.models.attitude import (
    INERTIA_BASIS,
    angular_acceleration,
    gravity_gradient_torque,
    symmetric_inverse,
)
from baryscope.models.columns import ColumnFunction
from baryscope.models.ephemeris.runge_kutta import step_of_order_8
from baryscope.models.frames import quaternion_product, quaternion_rate, rotation_from_quaternion, rotation_I_L
from baryscope.models.keplerian import Elements, conic, true_anomaly_after

FloatArray = NDArray[np.float64]

CHUNK = 64  # steps in one call of a function of CasADi, at most
MULTIPLE = 8  # such a call has a multiple of so many, which cost as much as the call itself
MANY = 320  # steps whose Jacobians by columns pay for an expression that takes up to half a second to put together
FORCED = 3 * POINTS  # values of the angular acceleration in a step


@cache
def anomaly_function() -> ca.Function:
    """The function (time in s, elements) → true anomaly."""
    time, (column, elements) = ca.SX.sym("time"), Elements.symbols()
    return ca.Function("anomaly", [time, column], [true_anomaly_after(time, elements)])


@cache
def rate_columns(gravity_gradient: bool) -> ColumnFunction:
    """The function (x, constants) → ẋ without a further torque; x is (q, ω, true anomaly)."""
    x, _, c = _symbols(gravity_gradient)
    return ColumnFunction("rates", [x, c], _rates(x, c, gravity_gradient))


@cache
def step_columns(gravity_gradient: bool) -> ColumnFunction:
    """The function (x, size, constants) → x after a step without a further torque; x is (q, ω, true anomaly)."""
    x, h, c = _symbols(gravity_gradient)
    return ColumnFunction("step", [x, h, c], step_of_order_8(lambda here, _: _rates(here, c, gravity_gradient), x, h))


@cache
def advance(gravity_gradient: bool, forced: bool, count: int) -> ca.Function:
    """The function (x, sizes, constants) → states (size, count) after each of `count` steps.

    x is (q, ω, true anomaly) with gravity gradient, else ω alone. If `forced`, (x, sizes, accelerations (FORCED,
    count), constants).
    """
    return _advance(gravity_gradient, forced).mapaccum(count)


@cache
def _advance(gravity_gradient: bool, forced: bool) -> ca.Function:
    """One step of `advance`."""
    x, h, c = _symbols(gravity_gradient)
    f = ca.SX.sym("f", FORCED)
    state = x if gravity_gradient else x[4:7]

    def rates(here: ca.SX, fraction: float) -> ca.SX:
        if gravity_gradient:
            found = _rates(here, c, gravity_gradient)
            return found + ca.vertcat(ca.SX(4, 1), _interpolated(f, fraction), 0) if forced else found
        found = _rate_alone(here, c)
        return found + _interpolated(f, fraction) if forced else found

    inputs = [state, h, f, c] if forced else [state, h, c]
    return ca.Function("advance", inputs, [step_of_order_8(rates, state, h)], {"cse": True})


@cache
def turn_of_step(forced: bool) -> ColumnFunction:
    """The function (ω, size, constants) → quaternion q by which a step without gravity gradient turns the body.

    The attitude after it is that before it times q. If `forced`, (ω, size, accelerations (FORCED,), constants).
    """
    w, h, f, c = ca.SX.sym("w", 3), ca.SX.sym("h"), ca.SX.sym("f", FORCED), ca.SX.sym("c", 9)

    def rates(here: ca.SX, fraction: float) -> ca.SX:
        q, rate = here[:4], here[4:]
        own = _rate_alone(rate, c)
        return ca.vertcat(quaternion_rate(q, rate), own + _interpolated(f, fraction) if forced else own)

    after = step_of_order_8(rates, ca.vertcat(1, 0, 0, 0, w), h)
    return ColumnFunction("turn", [w, h, f, c] if forced else [w, h, c], after[:4])


@cache
def sensitivity_step(gravity_gradient: bool, forced: bool) -> Callable[..., FloatArray]:
    """The function (x (8, n), sizes (1, n), constants) → Jacobians (n, 6, 11) of n steps.

    They map changes of attitude (a rotation vector in C), rate and inertia before the step to those of attitude and
    rate after it. If `forced`, (x, sizes, accelerations (FORCED, n), constants) → (n, 6, 11 + FORCED), with the
    accelerations among the changes. Many steps take one expression of all stages, others arrays.
    """

    def jacobians(x: FloatArray, h: FloatArray, *others: FloatArray) -> FloatArray:
        n, start = x.shape[1], _start(forced)
        if n >= MANY:
            return _sensitivity(gravity_gradient, forced)(x, h, *others)
        stages, linear = _at_stages(gravity_gradient, forced)
        states = np.moveaxis(stages(x, h, *others), 0, 2)  # (8, stages, n)
        rates = linear(states.reshape(8, -1), others[-1]).reshape(-1, n, 6, 11)
        own = np.zeros((len(rates), n, *start.shape))
        own[:, :, :, 6:11] = rates[:, :, :, 6:]
        forcing = partial(_forcing, forced)
        return np.asarray(_jacobian(rates[:, :, :, :6], own, forcing, start[None], h[0, :, None, None]))

    return jacobians


@cache
def _at_stages(gravity_gradient: bool, forced: bool) -> tuple[ColumnFunction, ColumnFunction]:
    """The states at the stages of a step, and the linear equations at a state."""
    stages = ColumnFunction("stages", *_stages(gravity_gradient, forced))
    return stages, ColumnFunction("linear", *_linearised_rates(gravity_gradient))


def _jacobian(linear: Iterable[Any], own: Iterable[Any], forcing: Callable[[float], Any], start: Any, h: Any) -> Any:
    """The Jacobian after a step of size h from that before it, whose rate is linear @ Jacobian + own + forcing.

    linear, own: at each stage; forcing: at a fraction of the step; all of them arrays, or all expressions.
    """
    stages = zip(linear, own, strict=True)

    def rate(jacobian: Any, fraction: float) -> Any:
        at_stage, more = next(stages)
        return at_stage @ jacobian + more + forcing(fraction)

    return step_of_order_8(rate, start, h)


def _start(forced: bool) -> FloatArray:
    """The Jacobian (6, 11), or (6, 11 + FORCED) if forced, of no step."""
    return np.eye(6, 11 + FORCED if forced else 11)


@cache
def _forcing(forced: bool, fraction: float) -> FloatArray:
    """The derivative of its rate, of the same shape, by the accelerations, at a fraction of the step."""
    found = np.zeros_like(_start(forced))
    if forced:
        found[3:, 11:] = np.kron(stage_weights(fraction), np.eye(3))
    return found


@cache
def _sensitivity(gravity_gradient: bool, forced: bool) -> ColumnFunction:
    """`sensitivity_step` as one expression."""
    inputs, states = _stages(gravity_gradient, forced)
    arguments, rates = _linearised_rates(gravity_gradient)
    linear = ca.Function("linear", arguments, [rates])
    at = [linear(state, inputs[-1]) for state in ca.horzsplit(states)]
    more = ca.SX(6, FORCED if forced else 0)
    own = [ca.horzcat(ca.SX(6, 6), one[:, 6:], more) for one in at]

    def forcing(fraction: float) -> ca.DM:
        return ca.sparsify(ca.DM(_forcing(forced, fraction)))

    start = ca.SX(ca.sparsify(ca.DM(_start(forced))))
    after = _jacobian([one[:, :6] for one in at], own, forcing, start, inputs[1])
    return ColumnFunction("sensitivity", inputs, after)


def _stages(gravity_gradient: bool, forced: bool) -> tuple[list[ca.SX], ca.SX]:
    """The arguments of `sensitivity_step` for one step, and the states (8, stages) at its stages."""
    x, h, c = _symbols(gravity_gradient)
    f = ca.SX.sym("f", FORCED)
    found: list[ca.SX] = []

    def rates(state: ca.SX, fraction: float) -> ca.SX:
        found.append(state)
        own = _rates(state, c, gravity_gradient)
        return own + ca.vertcat(ca.SX(4, 1), _interpolated(f, fraction), 0) if forced else own

    step_of_order_8(rates, x, h)
    return [x, h, f, c] if forced else [x, h, c], ca.horzcat(*found)


def _interpolated(f: ca.SX, fraction: float) -> ca.SX:
    """The angular acceleration (3,) at a fraction of the step."""
    return ca.reshape(f, 3, POINTS) @ ca.DM(stage_weights(fraction))


def _symbols(gravity_gradient: bool) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Symbols of the state (q, ω, true anomaly), the step's size in s, and the constants."""
    return ca.SX.sym("x", 8), ca.SX.sym("h"), ca.SX.sym("c", 16 if gravity_gradient else 9)


def _linearised_rates(gravity_gradient: bool) -> tuple[list[ca.SX], ca.SX]:
    """State and constants, and the Jacobian (6, 11) there of the rates of rotation vector and angular rate by rotation
    vector, angular rate and inertia."""
    x, _, c = _symbols(gravity_gradient)
    q, w = x[:4], x[4:7]
    turn, change = ca.SX.sym("turn", 3), ca.SX.sym("change", 5)
    turned = ca.vertcat(quaternion_product(ca.vertcat(1, turn / 2), q), x[4:])
    inertia = c[:9] + ca.DM(INERTIA_BASIS.reshape(5, 9).T) @ change
    acceleration = _rates(turned, ca.vertcat(inertia, c[9:]), gravity_gradient)[4:7]
    rates = ca.vertcat(rotation_from_quaternion(q) @ w, acceleration)
    linear = ca.jacobian(rates, ca.vertcat(turn, w, change))
    return [x, c], ca.substitute(linear, ca.vertcat(turn, change), ca.SX.zeros(8))


def _rate_alone(w: ca.SX, c: ca.SX) -> ca.SX:
    """ω̇ without a torque."""
    J = ca.reshape(c[:9], 3, 3)
    return angular_acceleration(J, symmetric_inverse(J), w, ca.SX(3, 1))


def _rates(x: ca.SX, c: ca.SX, gravity_gradient: bool) -> ca.SX:
    """Rates (8,) of x = (q_I_B, ω_B, θ), for c = (J by columns, elements of the orbit); without a gradient θ rests."""
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

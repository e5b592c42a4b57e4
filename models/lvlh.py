"""Attitude of the LVLH frame on a known orbit, and the gravity gradient along its vertical, in closed form."""

from functools import cache

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from baryscope.models.columns import ColumnFunction
from baryscope.models.frames import Symbol, rotation_I_L
from baryscope.models.keplerian import Elements, conic, true_anomaly_after
from baryscope.models.orbit import Orbit


def lvlh_attitude(orbit: Orbit, time: NDArray[np.float64]) -> NDArray[np.float64]:
    """R_I_L of the target's LVLH frame.

    Args:
        orbit: Keplerian elements at time 0.
        time: (n,), s.

    Returns:
        R_I_L, (n, 3, 3), such that `p_I = R_I_L @ p_L`.
    """
    return _lvlh_function()(time[None, :], orbit.elements)


def lvlh_rate(orbit: Orbit, time: NDArray[np.float64]) -> NDArray[np.float64]:
    """The angular rate of the target's LVLH frame about its z axis, θ̇ (n,) in rad/s, at times (n,) in s."""
    return _rate_function()(time[None, :], orbit.elements)[:, 0]


def gravity_gradient_axis(orbit: Orbit, time: NDArray[np.float64]) -> NDArray[np.float64]:
    """The axis g = √(3 μ/r³) û of the gravity gradient in I, (n, 3), 1/s, at times (n,) in s; û the upward vertical.

    The torque on a body of inertia J is g × J g.
    """
    return _axis_function()(time[None, :], orbit.elements)


def gravity_gradient_function() -> ca.Function:
    """The function (time, elements) → g of `gravity_gradient_axis`, to be written as C code."""
    time, (column, elements) = ca.SX.sym("time"), Elements.symbols()
    return ca.Function("gradient_axis", [time, column], [_gradient_axis(time, elements)], {"cse": True})


def _gradient_axis(time: Symbol, elements: Elements) -> Symbol:
    anomaly = true_anomaly_after(time, elements)
    vertical = rotation_I_L(elements.R_I_P, anomaly)[:, 0]
    return vertical * ca.sqrt(3 * conic(elements.ellipse, anomaly).stiffness)


@cache
def _axis_function() -> ColumnFunction:
    """(time, elements) → g."""
    time, (column, elements) = ca.SX.sym("time"), Elements.symbols()
    return ColumnFunction("gravity_gradient_axis", [time, column], _gradient_axis(time, elements))


@cache
def _rate_function() -> ColumnFunction:
    """(time, elements) → θ̇."""
    time, (column, elements) = ca.SX.sym("time"), Elements.symbols()
    rate = conic(elements.ellipse, true_anomaly_after(time, elements)).anomaly_rate
    return ColumnFunction("lvlh_rate", [time, column], rate)


@cache
def _lvlh_function() -> ColumnFunction:
    """(time, elements) → R_I_L."""
    time, (column, elements) = ca.SX.sym("time"), Elements.symbols()
    R_I_L = rotation_I_L(elements.R_I_P, true_anomaly_after(time, elements))
    return ColumnFunction("lvlh", [time, column], R_I_L)

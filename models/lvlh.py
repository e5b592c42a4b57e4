"""Attitude of the LVLH frame on a known orbit, in closed form."""

from functools import cache

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from baryscope.models.columns import ColumnFunction
from baryscope.models.frames import rotation_I_L
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

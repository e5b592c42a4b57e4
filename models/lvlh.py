"""Where LVLH points at given times on a known orbit, for those who have an orbit and tracks but no unit."""

from functools import cache

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from baryscope.models.columns import ColumnFunction
from baryscope.models.frames import rotation_I_L, rotation_I_P
from baryscope.models.keplerian import true_anomaly_after
from baryscope.models.scenario import Orbit, orbit_parameters


def lvlh_attitude(orbit: Orbit, time: NDArray[np.float64]) -> NDArray[np.float64]:
    """R_I_L of the target's LVLH frame.

    Args:
        orbit: Keplerian elements at time 0.
        time: (n,), s.

    Returns:
        R_I_L, (n, 3, 3), such that `p_I = R_I_L @ p_L`.
    """
    return _lvlh_function()(time[None, :], list(orbit_parameters(orbit).values()))


@cache
def _lvlh_function() -> ColumnFunction:
    """(time, elements) → R_I_L."""
    time, elements = ca.SX.sym("time"), ca.SX.sym("elements", 7)
    a, e, inclination, raan, periapsis, anomaly0, mu = ca.vertsplit(elements)
    anomaly = true_anomaly_after(time, a, e, mu, anomaly0)
    R_I_L = rotation_I_L(rotation_I_P(raan, inclination, periapsis), anomaly)
    return ColumnFunction("lvlh", [time, elements], R_I_L)

"""The direction of the Sun from the Earth, and what the Earth's shadow leaves of its light."""

from functools import cache

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from baryscope.models.columns import ColumnFunction
from baryscope.models.ephemeris.utc import DAY, Moment, seconds_between, utc_of
from baryscope.models.forces import Sunlight, sunlit_share

FloatArray = NDArray[np.float64]

J2000 = "2000-01-01T12:00:00"


def sun_direction(begin: Moment, time: FloatArray) -> FloatArray:
    """Unit vectors (n, 3) from the Earth to the Sun, `time` (n,) s after `begin`, good to 0.01° from 1950 to 2050.

    In axes of the mean equator and equinox of date (Astronomical Almanac, section C, low-precision formulas).
    """
    days = (seconds_between(utc_of(J2000, "J2000"), begin) + time) / DAY
    anomaly = np.deg2rad(357.528 + 0.9856003 * days)
    longitude = np.deg2rad(280.460 + 0.9856474 * days + 1.915 * np.sin(anomaly) + 0.020 * np.sin(2 * anomaly))
    obliquity = np.deg2rad(23.439 - 4e-7 * days)
    return np.stack(
        [np.cos(longitude), np.cos(obliquity) * np.sin(longitude), np.sin(obliquity) * np.sin(longitude)], axis=1
    )


def sunlit(position: FloatArray, direction: FloatArray, radius: float) -> FloatArray:
    """The share (n,) of the Sun's disc, 0 to 1, seen from positions (n, 3) in m, past a sphere of a radius in m.

    direction: unit vectors (n, 3) to the Sun, in the same axes.
    """
    return _share_function()(position.T, direction.T, [radius])[:, 0]


@cache
def _share_function() -> ColumnFunction:
    position, direction, radius = ca.SX.sym("position", 3), ca.SX.sym("direction", 3), ca.SX.sym("radius")
    share = sunlit_share(position, Sunlight(direction, ca.SX(1), radius))
    return ColumnFunction("sunlit", [position, direction, radius], share)

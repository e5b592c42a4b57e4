"""Gravity of an oblate central body, and its difference between two bodies that are close to each other.

The field is that of a point mass and of the second zonal harmonic (Montenbruck, Gill, Satellite Orbits, 2000, §3.2).
With r the distance from the centre, z = k·r the height above the equator, k the pole:

    a = −μ/r³ r − (3/2) J₂ μ R²/r⁵ ((1 − 5 z²/r²) r + 2 z k)

It is written once, for pairs of nearly equal positions (`differences`), so that its difference loses no digits.
"""

from dataclasses import dataclass
from functools import cache

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from baryscope.models import differences as dif
from baryscope.models.columns import ColumnFunction
from baryscope.models.differences import Pair
from baryscope.models.errors import InputError
from baryscope.models.frames import Symbol
from baryscope.models.orbit import Orbit

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Zonal:
    """The second zonal harmonic of a central body.

    Attributes:
        strength: (3/2) J₂ μ R², m⁵/s².
        pole: (3,), the unit vector k along the body's axis, in the axes of the positions.
    """

    strength: Symbol
    pole: Symbol

    @classmethod
    def of(cls, mu: Symbol, j2: Symbol, equatorial_radius: Symbol, pole: Symbol | None = None) -> "Zonal":
        """From μ in m³/s², J₂ and R in m; the pole is the z axis unless given."""
        return cls(1.5 * j2 * mu * equatorial_radius**2, ca.SX([0, 0, 1]) if pole is None else pole)


def point_mass_gravity(position: Pair, mu: Symbol) -> Pair:
    """−μ r/r³ at two positions from the centre (m; base and excess), m/s²."""
    square = dif.dot(position, position)
    return -1 * mu / (square * dif.sqrt(square)) * position


def zonal_gravity(position: Pair, zonal: Zonal) -> Pair:
    """The acceleration by J₂ at two positions from the centre (m; base and excess), m/s², in their axes."""
    square, height = dif.dot(position, position), dif.dot(position, Pair(zonal.pole, ca.SX.zeros(3)))
    factor = -1 * zonal.strength / (square * square * dif.sqrt(square))
    return factor * ((1 - 5 * height * height / square) * position + 2 * height * zonal.pole)


def j2_acceleration(orbit: Orbit, position: ArrayLike, pole: ArrayLike = (0.0, 0.0, 1.0)) -> FloatArray:
    """The acceleration by J₂ of an orbit's central body.

    Args:
        orbit: gives μ, J₂ and the equatorial radius.
        position: (n, 3), m from the centre, in any axes.
        pole: (3,), or (n, 3) in axes that turn: unit vector along the body's axis, in the same axes.

    Returns:
        (n, 3), m/s², in these axes; without the point mass's part.

    Raises:
        InputError: the orbit has no J₂.
    """
    positions = np.asarray(position, dtype=np.float64)
    return _at(orbit, positions, np.zeros_like(positions), pole)[:, :3]


def j2_difference(
    orbit: Orbit, position: ArrayLike, offset: ArrayLike, pole: ArrayLike = (0.0, 0.0, 1.0)
) -> FloatArray:
    """How much more J₂ accelerates a body at `position + offset` than one at `position`, to the last digits.

    Args:
        orbit: as for `j2_acceleration`.
        position: as there.
        pole: as there.
        offset: (n, 3), m, in the same axes.

    Returns:
        (n, 3), m/s², in these axes.

    Raises:
        InputError: the orbit has no J₂.
    """
    return _at(orbit, np.asarray(position, dtype=np.float64), np.asarray(offset, dtype=np.float64), pole)[:, 3:]


def _at(orbit: Orbit, position: FloatArray, offset: FloatArray, pole: ArrayLike) -> FloatArray:
    if orbit.j2 is None or orbit.equatorial_radius is None:
        raise InputError("orbit.j2: missing, expected j2 and equatorial_radius")
    body = [orbit.gravitational_parameter, orbit.j2, orbit.equatorial_radius]
    return _function()(position.T, offset.T, np.asarray(pole, dtype=np.float64).T, body)


@cache
def _function() -> ColumnFunction:
    """(position, offset, pole, (μ, J₂, R)) → the acceleration at the position, and its change over the offset."""
    position, offset, pole, body = (ca.SX.sym(name, 3) for name in ("position", "offset", "pole", "body"))
    mu, j2, equatorial_radius = ca.vertsplit(body)
    pair = zonal_gravity(Pair(position, offset), Zonal.of(mu, j2, equatorial_radius, pole))
    return ColumnFunction("j2", [position, offset, pole, body], ca.vertcat(pair.base, pair.excess))

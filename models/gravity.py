"""Gravity of an oblate central body, and its difference between two bodies that are close to each other.

The field is that of a point mass and of the second zonal harmonic (Montenbruck, Gill, Satellite Orbits, 2000, §3.2).
With r the distance from the centre, z = k·r the height above the equator, k the pole, the z axis:

    a = −μ/r³ r − (3/2) J₂ μ R²/r⁵ ((1 − 5 z²/r²) r + 2 z k)

It is written once, for pairs of nearly equal positions (`differences`), so that its difference loses no digits.
"""

import casadi as ca

from baryscope.models import differences as dif
from baryscope.models.differences import Pair
from baryscope.models.frames import Symbol


def zonal_strength(mu: Symbol, j2: Symbol, equatorial_radius: Symbol) -> Symbol:
    """(3/2) J₂ μ R², m⁵/s², from μ in m³/s², J₂ and R in m."""
    return 1.5 * j2 * mu * equatorial_radius**2


def point_mass_gravity(position: Pair, mu: Symbol) -> Pair:
    """−μ r/r³ at two positions from the centre (m; base and excess), m/s²."""
    square = dif.dot(position, position)
    return -1 * mu / (square * dif.sqrt(square)) * position


def zonal_gravity(position: Pair, strength: Symbol) -> Pair:
    """The acceleration by J₂ at two positions from the centre (m; base and excess), m/s²; strength: (3/2) J₂ μ R²."""
    pole = ca.SX([0, 0, 1])
    square, height = dif.dot(position, position), dif.dot(position, Pair(pole, ca.SX.zeros(3)))
    factor = -1 * strength / (square * square * dif.sqrt(square))
    return factor * ((1 - 5 * height * height / square) * position + 2 * height * pole)

"""Forces and torques: gravity with J2, drag, light pressure with the central body's shadow, eddy currents.

All are expressions of positions from the centre of the central body and of velocities, in the inertial axes; the
central body turns about z. Its field is that of a point mass and of the second zonal harmonic (Montenbruck, Gill,
Satellite Orbits, 2000, §3.2). With r the distance from the centre, z = k·r the height above the equator, k the pole,

    a = −μ/r³ r − (3/2) J₂ μ R²/r⁵ ((1 − 5 z²/r²) r + 2 z k)

It is written for pairs of nearly equal positions (`differences`), so that its difference loses no digits.
"""

from dataclasses import dataclass

import casadi as ca

from baryscope.models import differences as dif
from baryscope.models.differences import Pair
from baryscope.models.frames import Symbol

SUN_HALF_ANGLE = 4.6505e-3  # rad, of the Sun's disc: 695,700 km at one astronomical unit
TINY = 1e-30  # keeps roots and their derivatives from zero


@dataclass(frozen=True)
class Atmosphere:
    """An atmosphere whose density falls exponentially with the distance from the centre, and that turns about z.

    Attributes:
        density: at the reference radius, kg/m³.
        reference_radius: m.
        scale_height: m.
        rotation_rate: rad/s.
    """

    density: Symbol
    reference_radius: Symbol
    scale_height: Symbol
    rotation_rate: Symbol


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


def drag(position_I: Symbol, velocity_I: Symbol, atmosphere: Atmosphere, coefficient: Symbol) -> Symbol:
    """−½ ρ b ‖w‖ w, m/s²: w the velocity through the air, b = c_D A/m in m²/kg (Montenbruck, Gill 2000, (3.97))."""
    height = ca.norm_2(position_I) - atmosphere.reference_radius
    density = atmosphere.density * ca.exp(-height / atmosphere.scale_height)
    turning = ca.vertcat(0, 0, atmosphere.rotation_rate)
    wind = velocity_I - ca.cross(turning, position_I)
    return -0.5 * density * coefficient * ca.norm_2(wind) * wind


@dataclass(frozen=True)
class Sunlight:
    """Parallel light from one direction, and the sphere that shades it.

    Attributes:
        direction: unit vector towards the Sun, in I.
        pressure: on a surface that absorbs it, N/m².
        shadow_radius: of the sphere around the centre, m.
    """

    direction: Symbol
    pressure: Symbol
    shadow_radius: Symbol


def light_pressure(position_I: Symbol, light: Sunlight, coefficient: Symbol) -> Symbol:
    """−ν P b ŝ, m/s²: ν the share of the Sun's disc that is seen, b = c_R A/m in m²/kg (Montenbruck, Gill, (3.75))."""
    return -sunlit_share(position_I, light) * light.pressure * coefficient * light.direction


def sunlit_share(position_I: Symbol, light: Sunlight) -> Symbol:
    """The share ν of the Sun's disc that the central body leaves, from 0 in the umbra to 1.

    The body's limb is taken as straight over the Sun's disc (its curvature changes ν by less than 1 % in penumbra where
    the body is seen larger than 30°): a chord at the distance x radii from the disc's centre leaves
    ½ + (x √(1 − x²) + arcsin x)/π of it. Contacts of the limbs are smooth, so that integrators cope.
    """
    towards = ca.dot(position_I, light.direction)
    across = ca.sqrt(ca.fmax(ca.dot(position_I, position_I) - towards**2, TINY))
    separation = ca.atan2(across, -towards)
    radius = light.shadow_radius
    limb = ca.atan2(radius, ca.sqrt(ca.fmax(ca.dot(position_I, position_I) - radius**2, TINY)))
    x = ca.fmax(-1, ca.fmin(1, (separation - limb) / SUN_HALF_ANGLE))
    half_chord = ca.sqrt(ca.fmax(1 - x**2, TINY))
    return 0.5 + (x * half_chord + ca.atan2(x, half_chord)) / ca.pi


def dipole_field(position_I: Symbol, dipole_I: Symbol) -> Symbol:
    """B = (3 (m·r̂) r̂ − m)/r³ in T, of a dipole m in T m³ (μ₀/4π times its moment) at the centre."""
    r = ca.norm_2(position_I)
    up = position_I / r
    return (3 * ca.dot(dipole_I, up) * up - dipole_I) / r**3


def eddy_current_torque(
    magnetic_tensor: Symbol, angular_rate_B: Symbol, field_B: Symbol, field_rate_B: Symbol
) -> Symbol:
    """(M (ω × B − Ḃ)) × B, N m in B: the torque on a conducting body that turns in a magnetic field.

    Ortiz Gómez, Walker, Eddy currents applied to de-tumbling of space debris, Acta Astronautica 114 (2015), where the
    body turns much faster than the field; the change of the field in inertial axes is added here.

    Args:
        magnetic_tensor: M in S m⁴, symmetric, body axes.
        angular_rate_B: ω, rad/s.
        field_B: B, T.
        field_rate_B: the change of the field in inertial axes as the body moves, T/s, turned to body axes.
    """
    moment = magnetic_tensor @ (ca.cross(angular_rate_B, field_B) - field_rate_B)
    return ca.cross(moment, field_B)

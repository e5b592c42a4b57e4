"""What acts besides the point mass and is not in the estimators' models: the truth's own formulas, in numpy."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from baryscope.models.ephemeris.sun import sun_direction
from baryscope.models.ephemeris.utc import utc_of
from baryscope.models.orbit import EARTH_J2, EARTH_RADIUS, Orbit
from baryscope.study.population.motion import Force, Torque, lvlh_axes
from baryscope.study.world.worlds import World

FloatArray = NDArray[np.float64]

TILT = np.deg2rad(10.0)  # of the Earth's magnetic dipole
AIR_RATE = 2 * np.pi / 86_164.0905  # rad/s, of the atmosphere: once in a sidereal day
STEPS = 600  # of piecewise constant accelerations that stand for white noise


@dataclass(frozen=True)
class Burn:
    """A constant acceleration (3,) of the chaser in LVLH from `begin` to `end` s, m/s²."""

    begin: float
    end: float
    acceleration: FloatArray


def burns_of(world: World, rng: np.random.Generator) -> tuple[Burn, ...]:
    """The burns of a draw: 1–3 mm/s² for 5–30 s in any direction, at any time."""
    found = []
    for _ in range(world.burns):
        duration, begin = rng.uniform(5, 30), rng.uniform(0, world.span - 30)
        direction = rng.standard_normal(3)
        found.append(Burn(begin, begin + duration, rng.uniform(1e-3, 3e-3) * direction / np.linalg.norm(direction)))
    return tuple(sorted(found, key=lambda burn: burn.begin))


def force_of(
    world: World, rng: np.random.Generator, orbit: Orbit, burns: tuple[Burn, ...]
) -> tuple[Force, list[float]]:
    """The acceleration besides the point mass's, see `relative_motion`, and the times at which it jumps."""
    sun = towards_sun(orbit) if world.light else np.zeros(3)
    step = world.span / STEPS
    white = rng.standard_normal((STEPS, 3)) * np.sqrt(world.white / step)
    mu = orbit.gravitational_parameter

    def force(t: float, here: FloatArray, others: FloatArray) -> FloatArray:
        found = np.zeros((len(others) + 1, 3))
        if world.j2:
            places = here[:3] + np.concatenate([np.zeros((1, 3)), others[:, :3]])
            pull = j2_acceleration(mu, places)
            found[0], found[1:] = pull[0], pull[1:] - pull[0]
        found[1:] += world.light * sun - world.drag * through_air(here)
        if world.white:
            found[1:] += white[min(int(t / step), STEPS - 1)]
        for burn in burns:
            if burn.begin <= t < burn.end:
                found[1:] += lvlh_axes(here[None])[0][0] @ burn.acceleration
        return found

    breaks = [edge for burn in burns for edge in (burn.begin, burn.end)]
    return force, breaks + ([step * k for k in range(1, STEPS)] if world.white else [])


def towards_sun(orbit: Orbit) -> FloatArray:
    """The unit vector (3,) from the Earth to the Sun at the orbit's epoch, in I."""
    return np.asarray(sun_direction(utc_of(orbit.epoch, "epoch"), np.zeros(1))[0])


def through_air(state: FloatArray) -> FloatArray:
    """The unit vector (3,) along the velocity through air that turns with the Earth, for a state (6,) in I."""
    found = state[3:] + AIR_RATE * np.array([state[1], -state[0], 0.0])
    return np.asarray(found / np.linalg.norm(found))


def j2_acceleration(mu: float, place: FloatArray) -> FloatArray:
    """−(3/2) J2 μ R²/r⁵ (x (1 − 5z²/r²), y (1 − 5z²/r²), z (3 − 5z²/r²)) at places (k, 3) in I."""
    r = np.linalg.norm(place, axis=1, keepdims=True)
    polar = 5 * (place[:, 2:] / r) ** 2
    return np.asarray(-1.5 * EARTH_J2 * mu * EARTH_RADIUS**2 / r**5 * place * (np.array([1.0, 1.0, 3.0]) - polar))


def eddy_torque(world: World, inertia: FloatArray, path: Callable[[float], FloatArray]) -> Torque | None:
    """The torque (k, 3) in B on a sphere of conductor in the field of a tilted dipole: −c (ω − b (b · ω)).

    b is the unit vector of the field in I at the target's place path(t), the size of the field is taken as constant; c
    is `eddy` times the mean moment of inertia.
    """
    if not world.eddy:
        return None
    dipole = Rotation.from_euler("x", TILT).apply([0.0, 0.0, -1.0])
    drag = world.eddy * np.trace(inertia) / 3

    def torque(t: float, R_I_B: FloatArray, rate: FloatArray) -> FloatArray:
        up = path(t)
        up = up / np.linalg.norm(up)
        field = 3 * up * (up @ dipole) - dipole
        field_B = np.swapaxes(R_I_B, 1, 2) @ (field / np.linalg.norm(field))
        return np.asarray(-drag * (rate - field_B * np.sum(field_B * rate, axis=1, keepdims=True)))

    return torque

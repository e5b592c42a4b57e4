"""Accelerations of target and chaser that two-body motion does not know."""

from dataclasses import dataclass

import numpy as np

from baryscope.study.population.interface import FloatArray
from baryscope.study.population.third.dice import direction, log_uniform

MU = 3.986004418e14  # m³/s²
J2 = 1.08262668e-3
EARTH_RADIUS = 6378137.0  # m
EARTH_RATE = np.array([0.0, 0.0, 7.2921159e-5])  # rad/s
SOLAR_PRESSURE = 4.56e-6  # N/m²
PENUMBRA = 2e4  # m, over which light fades
DENSITY, SCALE_HEIGHT = 1.5e-12, 6.5e4  # kg/m³ at 450 km, m
REFERENCE_HEIGHT = 4.5e5  # m
LONGEST_SHIFT = 0.4  # of the range, that burns or pulses may move the chaser


@dataclass(frozen=True)
class Drag:
    """density: kg/m³ at the reference height; bulge: by how much of it day and night depart from the mean; towards:
    the bulge (3,); ballistic: drag coefficient times area over mass of target and chaser, m²/kg.
    """

    density: float
    bulge: float
    towards: tuple[float, ...]
    ballistic: tuple[float, float]


@dataclass(frozen=True)
class Light:
    """sun: unit vector to it (3,); ratio: reflectivity times area over mass of target and chaser, m²/kg."""

    sun: tuple[float, ...]
    ratio: tuple[float, float]


@dataclass(frozen=True)
class Burn:
    """The chaser's engine from a time on, s, for a length, s, with an acceleration (3,) in C, m/s²."""

    start: float
    length: float
    acceleration: tuple[float, ...]


@dataclass(frozen=True)
class Forces:
    """bit: velocity of a pulse of the chaser, m/s, none if 0; pulse_times: of them, s; white: deviation of the white
    acceleration between the two, m/s^1.5; j2: of both.
    """

    j2: bool = False
    drag: Drag | None = None
    light: Light | None = None
    burns: tuple[Burn, ...] = ()
    bit: float = 0.0
    pulse_times: tuple[float, ...] = ()
    white: float = 0.0

    def words(self) -> list[str]:
        """Each force with its size."""
        found = ["J2"] * self.j2
        if self.drag:
            target, chaser = self.drag.ballistic
            found.append(f"drag {self.drag.density:.1e} kg/m³ at 450 km, {target:.3f} and {chaser:.3f} m²/kg")
        if self.light:
            found.append("light pressure on {:.3f} and {:.3f} m²/kg".format(*self.light.ratio))
        if self.burns:
            sizes = ", ".join(f"{1e3 * np.linalg.norm(b.acceleration):.2g}·{b.length:.0f} s" for b in self.burns)
            found.append(f"burns {len(self.burns)} x {sizes} mm/s² untold")
        if self.bit:
            found.append(f"pulses {len(self.pulse_times)} x {1e3 * self.bit:.2g} mm/s untold")
        if self.white:
            found.append(f"white acceleration {1e6 * self.white:.2g} µm/s²/√Hz")
        return found


def drawn(rng: np.random.Generator, names: tuple[str, ...], begin: float, span: float, size: FloatArray) -> Forces:
    """The forces that are named, between begin and begin + span, s; size (2,): range and noise, m."""
    distance, noise = size
    drag = light = None
    if "drag" in names:
        ballistic = (log_uniform(rng, 0.002, 0.05), log_uniform(rng, 0.002, 0.05))
        bulge = float(rng.choice([0.0, rng.uniform(0.2, 0.7)]))
        drag = Drag(DENSITY * log_uniform(rng, 0.1, 5), bulge, tuple(direction(rng)), ballistic)
    if "light pressure" in names:
        light = Light(tuple(direction(rng)), (log_uniform(rng, 0.003, 0.1), log_uniform(rng, 0.003, 0.1)))
    burns = _burns(rng, begin, span, distance) if "burns" in names else ()
    bit, times = _pulses(rng, begin, span, distance) if "pulses" in names else (0.0, ())
    white = 0.0
    if "white acceleration" in names:
        white = min(log_uniform(rng, 0.1, 100) * noise, 0.3 * distance) * np.sqrt(3 / span**3)
    return Forces("J2" in names, drag, light, burns, bit, times, float(white))


def _burns(rng: np.random.Generator, begin: float, span: float, distance: float) -> tuple[Burn, ...]:
    found = []
    for _ in range(int(rng.integers(1, 5))):
        start = begin + span * rng.uniform(0.0, 0.9)
        length = min(log_uniform(rng, 1, 60), 0.5 * span)
        most = LONGEST_SHIFT / 2 * distance / (length * max(begin + span - start, length))
        size = min(log_uniform(rng, 1e-4, 5e-3), most)
        found.append(Burn(float(start), float(length), tuple(size * direction(rng))))
    return tuple(found)


def _pulses(rng: np.random.Generator, begin: float, span: float, distance: float) -> tuple[float, tuple[float, ...]]:
    count = int(np.clip(span / log_uniform(rng, 5, 200), 4, 400))
    bit = min(log_uniform(rng, 2e-5, 2e-3), LONGEST_SHIFT * distance / (span * np.sqrt(count)))
    return float(bit), tuple(np.sort(begin + span * rng.random(count)).tolist())


def natural(forces: Forces, r: FloatArray, v: FloatArray, body: int) -> FloatArray:
    """The acceleration (3,) of target (body 0) or chaser (1) by J2, drag and light; r, v (3,) geocentric, m, m/s."""
    total = np.zeros(3)
    distance = np.sqrt(r @ r)
    if forces.j2:
        z = (r[2] / distance) ** 2
        factor = -1.5 * J2 * MU * EARTH_RADIUS**2 / distance**5
        total += factor * r * np.array([1 - 5 * z, 1 - 5 * z, 3 - 5 * z])
    if forces.drag:
        wind = v - np.cross(EARTH_RATE, r)
        height = distance - EARTH_RADIUS - REFERENCE_HEIGHT
        day = 1 + forces.drag.bulge * (r @ np.array(forces.drag.towards)) / distance
        density = forces.drag.density * day * np.exp(-height / SCALE_HEIGHT)
        total -= 0.5 * density * forces.drag.ballistic[body] * np.sqrt(wind @ wind) * wind
    if forces.light:
        sun = np.array(forces.light.sun)
        total -= SOLAR_PRESSURE * forces.light.ratio[body] * lit(r, sun) * sun
    return total


def lit(r: FloatArray, sun: FloatArray) -> float:
    """The share of sunlight at r (3,): 0 deep in the Earth's cylindrical shadow, 1 far from it, smooth between."""
    along = r @ sun
    if along > 0:
        return 1.0
    depth = (np.linalg.norm(r - along * sun) - EARTH_RADIUS) / PENUMBRA
    return float(0.5 * (1 + np.tanh(depth)))

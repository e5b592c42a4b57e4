"""The worlds as a table: orbit, span, forces, what is told of them, torque and camera."""

from dataclasses import dataclass
from typing import Literal

from baryscope.models.orbit import EARTH_RADIUS, Orbit


@dataclass(frozen=True)
class World:
    """A world, in SI units; zero means that there is no such effect.

    orbit: at the first time, but for a random true anomaly unless `periapsis`, then the target passes it in mid-span;
    span and frames; j2: of the Earth on both bodies; drag: difference of the accelerations against the target's
    velocity through air that turns with the Earth; light: difference away from the Sun, whose place is that of the
    orbit's epoch; white: density of white acceleration, m²/s³; burns: how many,
    of 1–3 mm/s² for 5–30 s in LVLH; logged: exactly, but for 1 % of each component, or not; eddy: rate at which the
    conducting target's angular velocity normal to the magnetic field decays, 1/s; wrong_orbit: the orbit told is off by
    1 km and 1°; attitude_noise of the camera and its boresight, rad; slip: deviation of a fixed pivot, m, of
    correlation time `slip_time` s (0: white). noise: of a coordinate, m; error_time: correlation time of each
    feature's errors, s (0: white), which are those of a first-order Markov process along axes of error_axes.
    """

    name: str
    orbit: Orbit
    span: float = 600.0
    frames: int = 600
    periapsis: bool = False
    j2: bool = False
    drag: float = 0.0
    light: float = 0.0
    white: float = 0.0
    burns: int = 0
    logged: Literal["exactly", "to 1 %", "no"] = "no"
    eddy: float = 0.0
    wrong_orbit: bool = False
    attitude_noise: float = 0.0
    boresight: float = 0.0
    slip: float = 0.0
    slip_time: float = 0.0
    noise: float = 0.02
    error_time: float = 0.0
    error_axes: Literal["camera", "body"] = "camera"


LOW = Orbit(7150e3, 0.001, 1.72, 2.09, 1.57)  # Envisat's
VERY_LOW = Orbit(EARTH_RADIUS + 400e3, 0.001, 0.9, 1.0, 2.0)
GEOSTATIONARY = Orbit(42_164e3, 0.0002, 0.001, epoch="2026-06-21T12:00:00Z")  # a solstice, so without a shadow
ECCENTRIC = Orbit(7000e3 / 0.3, 0.7, 1.1, 0.5, 0.8)

WORLDS = {
    world.name: world
    for world in (
        World("as modelled", LOW),
        World("white 1e-12", LOW, white=1e-12),
        World("white 1e-10", LOW, white=1e-10),
        World("white 1e-8", LOW, white=1e-8),
        World("J2", LOW, j2=True),
        World("J2, one orbit", LOW, span=5980.0, j2=True),
        World("400 km, drag", VERY_LOW, j2=True, drag=2e-6),
        World("geostationary, light", GEOSTATIONARY, span=1200.0, light=6e-8),
        World("thrust logged", LOW, burns=3, logged="exactly"),
        World("thrust logged to 1 %", LOW, burns=3, logged="to 1 %"),
        World("thrust not logged", LOW, burns=3),
        World("eddy currents", LOW, span=2400.0, eddy=1 / 86_400),
        World("orbit file wrong", LOW, j2=True, wrong_orbit=True),
        World("camera's attitude", LOW, attitude_noise=1e-4, boresight=1e-3),
        World("e = 0.7", ECCENTRIC, j2=True, periapsis=True),
        World("pivot slips", LOW, frames=300, slip=5e-4, noise=2e-4),
        World("pivot slips slowly", LOW, frames=300, slip=5e-4, slip_time=10.0, noise=2e-4),
        World("errors last 5 s", LOW, error_time=5.0),
        World("errors last 60 s", LOW, error_time=60.0),
        World("errors last 20 s, body", LOW, error_time=20.0, error_axes="body"),
    )
}
"""All worlds by their names, in the order of the table."""

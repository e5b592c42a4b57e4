"""Where the chaser is: at rest in LVLH or in I, round the target, or flying by; near, and never touching."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.study.population.second.chance import TURN, log_uniform, unit
from baryscope.study.population.second.motion import relative_motion
from baryscope.study.population.second.orbits import MU, Elements, lvlh

FloatArray = NDArray[np.float64]

FARTHEST = 150.0  # m
STYLES = {
    "V-bar": 0.24,
    "R-bar": 0.1,
    "H-bar": 0.06,
    "hold": 0.15,
    "football": 0.2,
    "fly-by": 0.18,
    "inertial hold": 0.07,
}
TRIES = 40
PATIENCE = 20  # tries after which the time is cut short where the chaser comes too near


@dataclass(frozen=True, eq=False)
class _Place:
    """Where a chaser is drawn. orbit: the target's; start: the first time, s; nearest, farthest: its distance, m."""

    orbit: Elements
    start: float
    nearest: float
    farthest: float


def draw_chaser(
    rng: np.random.Generator, orbit: Elements, start: float, span: float, reach: float
) -> tuple[FloatArray, float, str]:
    """The chaser's state less the target's (6,) in I at `start`, m and m/s; the span of time, s; and their words.

    The span is the given one, or less if the chaser would come nearer than `reach` m or get too far.
    """
    place = _Place(orbit, start, max(3.0, reach + 1.0), max(60.0, 1.5 * (reach + 1.0)))
    for attempt in range(TRIES):
        state, words = _drawn(rng, place, span)
        probe = np.linspace(start, start + span, 80)
        far = np.linalg.norm(relative_motion(orbit, start, state, probe)[:, :3], axis=1)
        bad = np.flatnonzero((far < reach) | (far > FARTHEST))
        if not bad.size:
            return state, span, words
        if attempt >= PATIENCE and bad[0] > 20:
            return state, float(probe[bad[0] - 1] - start), words
    if bad[0] >= 2:
        return state, float(probe[bad[0] - 1] - start), words
    axes, turn = lvlh(orbit.position(start), orbit.velocity(start))  # it touches at once: V-bar hardly moves
    stand = np.array([0.0, 3 * reach, 0.0])
    state = np.concatenate([axes @ stand, axes @ (turn * np.cross([0, 0, 1], stand))])
    return state, min(span, 600.0), "V-bar last resort"


def _drawn(rng: np.random.Generator, place: _Place, span: float) -> tuple[FloatArray, str]:
    """A state (6,) in I, and its words."""
    style = str(rng.choice(list(STYLES), p=list(STYLES.values())))
    r, v = place.orbit.position(place.start), place.orbit.velocity(place.start)
    axes, turn = lvlh(r, v)
    distance, sign = log_uniform(rng, place.nearest, place.farthest), rng.choice([-1.0, 1.0])
    if style in ("V-bar", "R-bar", "H-bar"):
        position = np.zeros(3)
        position[["R-bar", "V-bar", "H-bar"].index(style)] = sign * distance
        position += 0.01 * distance * rng.standard_normal(3)
        velocity = log_uniform(rng, 1e-5, 1e-2) * unit(rng)
    elif style == "hold":
        position, velocity = unit(rng) * distance, log_uniform(rng, 1e-5, 1e-2) * unit(rng)
    elif style == "inertial hold":
        position = unit(rng) * distance
        velocity = -turn * np.cross([0, 0, 1], position) + log_uniform(rng, 1e-5, 5e-3) * unit(rng)
    elif style == "football":
        position, velocity = _football(rng, sign * distance, turn)
        shrink = min(1.0, place.farthest / float(np.linalg.norm(position)))
        position, velocity = position * shrink, velocity * shrink
    else:
        position, velocity = _fly_by(rng, distance, span)
    rho = axes @ position
    rate = axes @ (velocity + turn * np.cross([0, 0, 1], position))
    if style == "football" and place.orbit.e > 1e-3:
        rate = _without_drift(r, v, rho, rate)
    return np.concatenate([rho, rate]), f"{style} from {np.linalg.norm(rho):.0f}m"


def _football(rng: np.random.Generator, away: float, n: float) -> tuple[FloatArray, FloatArray]:
    """Place and velocity (3,) in LVLH on a 2:1 ellipse about the target, or about a place beside it on V-bar."""
    amplitude, phase = abs(away) * rng.uniform(0.35, 1.0), rng.uniform(0, TURN)
    tilt = rng.uniform(-1, 1)
    along = 2 * amplitude * np.sin(phase) + rng.choice([0, 0, 1.5 * away])
    normal = tilt * amplitude * np.sin(phase + rng.uniform(0, TURN))
    position = np.array([-amplitude * np.cos(phase), along, normal])
    out = tilt * amplitude * n * rng.uniform(-1, 1)
    return position, np.array([n * amplitude * np.sin(phase), 2 * n * amplitude * np.cos(phase), out])


def _fly_by(rng: np.random.Generator, distance: float, span: float) -> tuple[FloatArray, FloatArray]:
    """Place and velocity (3,) in LVLH on a line that passes the target at that distance, m."""
    length, course = rng.uniform(0.5, 3) * distance, unit(rng)
    miss = np.cross(course, unit(rng))
    miss *= distance / np.linalg.norm(miss)
    return miss - course * length * rng.uniform(0.2, 1.0), course * min(length / span, 0.5)


def _without_drift(r: FloatArray, v: FloatArray, rho: FloatArray, rate: FloatArray) -> FloatArray:
    """The rate (3,) in I at which the chaser has the energy of the target."""
    along = v / np.linalg.norm(v)
    for _ in range(5):
        there, speed = r + rho, v + rate
        vis = 2 * (1 / np.linalg.norm(there) - 1 / np.linalg.norm(r)) * MU - (speed @ speed - v @ v)
        rate = rate + along * vis / (2 * (speed @ along))
    return rate

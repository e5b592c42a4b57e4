"""A target in orbit, and a chaser that stays near it."""

from dataclasses import dataclass, replace

import numpy as np

from baryscope.models.orbit import Orbit
from baryscope.study.population.interface import FloatArray
from baryscope.study.population.third import forces as all_forces
from baryscope.study.population.third.dice import direction, log_uniform
from baryscope.study.population.third.forces import EARTH_RADIUS, MU, Forces
from baryscope.study.population.third.kepler import at_epoch, propagated
from baryscope.study.population.third.mismatches import HIGH, LOW, Plan
from baryscope.study.population.third.relative import Flown, carried, flown
from baryscope.study.population.third.timing import Timing

NEAREST, FARTHEST = 3.0, 80.0  # m
LIMIT = 120.0  # m, beyond which no case goes in two-body motion
TRIES = 60


@dataclass(frozen=True, eq=False)
class Flight:
    """told: the orbit as an estimator is told it, in `words` if that is wrong; flown: the truth, under `forces`."""

    told: Orbit
    truth: Orbit
    forces: Forces
    flown: Flown
    words: tuple[str, ...]


def drawn(rng: np.random.Generator, plan: Plan, timing: Timing, distance: float, noise: float) -> Flight:
    """The flight of a plan from about a distance, m; noise: of the sensor, m, to which small forces are sized."""
    truth = _orbit(rng, plan.place)
    begin = float(timing.time[0])
    start = _start(rng, truth, timing, distance)
    size = np.array([distance, noise])
    forces = all_forces.drawn(rng, plan.mismatches, begin, timing.span, size)
    target = carried(at_epoch(truth), 0.0, begin, forces)
    told, words = _told(rng, truth) if "orbit told wrong" in plan.mismatches else (truth, ())
    return Flight(told, truth, forces, flown(target, start, timing.time, forces, rng), words)


def _orbit(rng: np.random.Generator, place: str) -> Orbit:
    if place == LOW:
        a, e = EARTH_RADIUS + rng.uniform(4e5, 6e5), log_uniform(rng, 1e-5, 3e-3)
    elif place == HIGH:
        a, e = 42164e3 + rng.uniform(-3e5, 3e5), log_uniform(rng, 1e-5, 1e-2)
    else:
        e = float(rng.choice([log_uniform(rng, 1e-4, 0.02), rng.uniform(0.05, 0.74)]))
        a = (EARTH_RADIUS + log_uniform(rng, 6e5, 8e6)) / (1 - e)
    inclination = rng.uniform(0, 0.2) if place == HIGH else np.arccos(rng.uniform(-0.3, 1.0))
    raan, periapsis, anomaly = rng.uniform(0, 2 * np.pi, 3)
    return Orbit(float(a), e, float(inclination), raan, periapsis, anomaly, MU)


def _start(rng: np.random.Generator, orbit: Orbit, timing: Timing, distance: float) -> FloatArray:
    """The path's state (6,) at the first time: one whose two-body motion stays between half and three times the
    distance, and below LIMIT, or comes nearest to that.
    """
    begin, span = timing.time[0], timing.span
    target = propagated(at_epoch(orbit), MU, np.array([begin]))[0]
    elapsed = np.linspace(0, span, 200)
    ahead = propagated(target, MU, elapsed)
    r, v = target[:3], target[3:]
    swing = np.cross(r, v) / (r @ r)
    mean_motion = np.sqrt(MU / orbit.semi_major_axis**3)
    best, least = np.concatenate([distance * v / np.linalg.norm(v), np.zeros(3)]), np.inf
    for attempt in range(TRIES):
        calm = 1 - attempt / TRIES  # the later the closer to rest on the orbit itself
        p = distance * direction(rng)
        p -= (1 - calm) * (p @ r) / (r @ r) * r
        w = np.cross(swing, p) * rng.choice([0.0, 1.0])
        w = w + calm * log_uniform(rng, 0.01, 0.5) * distance * min(1 / span, mean_motion) * direction(rng)
        drift = calm * rng.uniform(-0.3, 0.3) * distance / (1.5 * mean_motion * span)
        w = v - _with_axis(r - p, v - w, orbit.semi_major_axis + drift)
        ranges = np.linalg.norm((ahead - propagated(np.concatenate([r - p, v - w]), MU, elapsed))[:, :3], axis=1)
        beyond = max(0.5 * distance / ranges.min(), ranges.max() / min(LIMIT, 3 * distance))
        if beyond < least:
            best, least = np.concatenate([p, w]), beyond
        if beyond <= 1:
            break
    return best


def _with_axis(r: FloatArray, v: FloatArray, a: float) -> FloatArray:
    """A velocity (3,) along v with which an orbit at r has the semi-major axis a."""
    return np.asarray(v * np.sqrt(MU * (2 / np.linalg.norm(r) - 1 / a) / (v @ v)))


def _told(rng: np.random.Generator, truth: Orbit) -> tuple[Orbit, tuple[str, ...]]:
    """An orbit that is off along the track, in its size or in its angles, and words for it."""
    along, larger = log_uniform(rng, 10, 3000) * rng.choice([-1, 1]), log_uniform(rng, 10, 3000) * rng.choice([-1, 1])
    angles = np.radians(log_uniform(rng, 0.01, 2)) * direction(rng)
    which = rng.choice([(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, 1, 1)])
    along, larger, angles = which[0] * along, which[1] * larger, which[2] * angles
    told = replace(
        truth,
        semi_major_axis=truth.semi_major_axis + larger,
        inclination=abs(truth.inclination + float(angles[0])),
        raan=truth.raan + float(angles[1]),
        true_anomaly=truth.true_anomaly + float(along / truth.semi_major_axis + angles[2]),
    )
    said = {
        f"{along:.0f} m along": which[0],
        f"{larger:.0f} m in a": which[1],
        f"{np.degrees(np.linalg.norm(angles)):.2g}° in angles": which[2],
    }
    return told, (f"orbit told wrong by {', '.join(words for words, true in said.items() if true)}",)

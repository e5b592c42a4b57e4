"""Where the chaser is: at rest or drifting in LVLH, round the target, or on its orbit ahead or behind."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from baryscope.study.population.fourth.chance import direction, log_uniform
from baryscope.study.population.fourth.orbits import MU, lvlh
from baryscope.study.population.fourth.relative import carried, flown
from baryscope.study.population.interface import FloatArray

NEAREST, FARTHEST = 5.0, 60.0  # m; no nearer than REACHES of the body's either
REACHES = 1.2
WIDEST = 25.0  # m, of the nearest distance: larger bodies are drawn again
EVENLY = 12  # tries with distances that are uniform; the logarithm's is later
CIRCULAR = 1e-9  # eccentricity below which a chaser ahead or behind can rest
HARDEST = 5.0  # m/s, by which a velocity is changed for a period


@dataclass(frozen=True, eq=False)
class Place:
    """target (6,): its state in I at the first time, m and m/s; eccentricity, semi_major_axis in m; span: s."""

    target: FloatArray
    eccentricity: float
    semi_major_axis: float
    span: float
    oblate: bool

    @property
    def swing(self) -> FloatArray:
        """The rate (3,) of LVLH in I, rad/s."""
        r, v = self.target[:3], self.target[3:]
        return np.asarray(np.cross(r, v) / (r @ r))


def drawn(rng: np.random.Generator, place: Place, reach: float) -> tuple[FloatArray, str] | None:
    """The chaser's state less the target's (6,) in I, m and m/s, and what it does; reach: of the body, m.

    In the span it comes no nearer than the limits and gets no farther; None if no try does so.
    """
    nearest = max(NEAREST, REACHES * reach)
    if nearest > WIDEST:
        return None
    probe = np.linspace(0, place.span, 40)
    kinds = ["rest", "drift", "football"]
    for attempt, kind in enumerate(rng.permutation(kinds).tolist() * 3 + ["football"] * 12 + ["leader"] * 8):
        if attempt < EVENLY:
            distance = rng.uniform(1.05 * nearest, 0.9 * FARTHEST)
        else:
            distance = log_uniform(rng, 1.2 * nearest, 0.6 * FARTHEST)
        state = _KINDS[kind](rng, place, distance)
        if state is None:
            continue
        _, states = flown(place.target, state[None], 0.0, probe, place.oblate)
        away = np.linalg.norm(states[:, 0, :3], axis=1)
        if away.min() > nearest and away.max() < FARTHEST:
            return state, f"{kind} from {distance:.0f} m"
    return None


def _rest(rng: np.random.Generator, place: Place, distance: float) -> FloatArray:
    """At rest in LVLH, anywhere or, half of them, ahead or behind, then on the same circle if the orbit is one."""
    if rng.random() < 0.5:
        d = distance * direction(rng)
    else:
        ahead = distance * rng.choice([-1.0, 1.0])
        if place.eccentricity < CIRCULAR:
            return _along(place.target, ahead / place.semi_major_axis)
        d = np.array([0, ahead, 0])
    d = lvlh(place.target) @ d
    return np.concatenate([d, np.cross(place.swing, d)])


def _along(target: FloatArray, angle: float) -> FloatArray:
    """The state (6,) of one that is ahead on a circle by an angle, rad, less the target's."""
    axes = lvlh(target)
    c, s = np.cos(angle), np.sin(angle)
    R = axes @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ axes.T
    return np.concatenate([R @ target[:3], R @ target[3:]]) - target


def _drift(rng: np.random.Generator, place: Place, distance: float) -> FloatArray:
    d = lvlh(place.target) @ direction(rng) * distance
    velocity = direction(rng) * rng.uniform(0, 1.2) * distance / place.span
    return np.concatenate([d, np.cross(place.swing, d) + velocity])


def _football(rng: np.random.Generator, place: Place, distance: float) -> FloatArray | None:
    """At any velocity of the size of relative motion that has the target's period; None where there is none."""
    axes, r, v = lvlh(place.target), place.target[:3], place.target[3:]
    mean_motion = np.sqrt(MU / place.semi_major_axis**3)
    d = axes @ direction(rng) * distance
    w = np.cross(place.swing, d) + axes @ rng.standard_normal(3) * mean_motion * distance * rng.uniform(0.1, 1.2)
    along = v / np.linalg.norm(v)

    def excess(change: float) -> float:
        speed = v + w + change * along
        energy = 0.5 * speed @ speed - MU / np.linalg.norm(r + d)
        return float(energy + 0.5 * MU / place.semi_major_axis)

    if excess(-HARDEST) * excess(HARDEST) > 0:
        return None
    return np.concatenate([d, w + brentq(excess, -HARDEST, HARDEST, xtol=1e-16) * along])


def _leader(rng: np.random.Generator, place: Place, distance: float) -> FloatArray:
    """On the target's orbit, ahead or behind."""
    earlier = rng.choice([-1.0, 1.0]) * distance / np.linalg.norm(place.target[3:])
    return carried(place.target, float(earlier), False) - place.target


_KINDS = {"rest": _rest, "drift": _drift, "football": _football, "leader": _leader}

"""When a case is watched."""

from dataclasses import dataclass

import numpy as np

from baryscope.study.population.fourth.chance import log_uniform
from baryscope.study.population.interface import FloatArray

LONGEST = 20_000.0  # s
REVOLUTIONS = 3  # at most
FEWEST, MOST = 30, 2000  # frames
COARSE = 6  # frames per rotation, below which cases are rare
KINDS = {"regular": 0.45, "jittered": 0.2, "random": 0.2, "bursts": 0.15}


@dataclass(frozen=True)
class Timing:
    """rate: of the tumble, rad/s; span: from the first frame to about the last, s; frames: how many."""

    rate: float
    span: float
    frames: int


def drawn(rng: np.random.Generator, period: float) -> Timing | None:
    """0.2 to 20 rotations at 0.1 to 20 °/s; None where that is too long for an orbit of a period, s, or too coarse."""
    rate = float(np.radians(log_uniform(rng, 0.1, 20)))
    rotations = log_uniform(rng, 0.2, 20)
    span = rotations * 2 * np.pi / rate
    frames = round(log_uniform(rng, FEWEST, MOST))
    if span > min(REVOLUTIONS * period, LONGEST) or (rotations * COARSE > frames and rng.random() < 0.8):
        return None
    return Timing(rate, span, frames)


def begun(rng: np.random.Generator, oblate: bool) -> float:
    """The first time, s after that of the orbit's elements; oblate: from 0 to 5000 s."""
    begin = float(rng.choice([0.0, rng.uniform(-2000, 5000), 1e5 + rng.uniform(0, 1e3)], p=[0.5, 0.25, 0.25]))
    return min(max(begin, 0.0), 5000.0) if oblate else begin


def elapsed(rng: np.random.Generator, timing: Timing) -> tuple[FloatArray, str]:
    """Ascending times (n,) after the first, which is 0, s, and what kind they are of."""
    kind = str(rng.choice(list(KINDS), p=list(KINDS.values())))
    span, n = timing.span, timing.frames
    if kind == "regular":
        time = np.linspace(0, span, n)
    elif kind == "jittered":
        time = (np.arange(n) + rng.uniform(-0.35, 0.35, n)) * span / (n - 1)
    elif kind == "random":
        time = np.sort(rng.uniform(0, span, n))
    else:
        bursts, share = int(rng.integers(2, 8)), rng.uniform(0.3, 0.9)
        place = np.sort(rng.uniform(0, bursts, n))
        time = (np.floor(place) + (place - np.floor(place)) * share) * span / bursts
    steps = np.maximum(np.diff(time), 1e-3 * span / n)
    return np.concatenate([[0.0], np.cumsum(steps)]), kind

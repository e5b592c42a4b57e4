"""When a case is watched."""

from dataclasses import dataclass

import numpy as np

from baryscope.study.population.interface import FloatArray
from baryscope.study.population.third.dice import log_uniform

LONGEST = 2e4  # s
SHORTEST_STEP = 0.02  # s
PER_ROTATION = 8  # frames at least


@dataclass(frozen=True, eq=False)
class Timing:
    """time (n,) s; rate: the tumble's, rad/s; span: s; blind: first and last time of a gap in what is seen, or ()."""

    time: FloatArray
    rate: float
    blind: tuple[float, ...]

    @property
    def span(self) -> float:
        """From the first time to the last, s."""
        return float(self.time[-1] - self.time[0])


def drawn(rng: np.random.Generator, orbital: bool) -> Timing:
    """20 to 3000 frames in 0.15 to 20 rotations at 0.1 to 30 °/s, faster than that in a laboratory."""
    rate = np.radians(log_uniform(rng, 0.1, 30) if orbital else log_uniform(rng, 5, 120))
    rotations = log_uniform(rng, 0.15, 20)
    span = float(np.clip(2 * np.pi * rotations / rate, 1.0, LONGEST if orbital else 120.0))
    least = max(20.0, PER_ROTATION * span * rate / (2 * np.pi))
    most = min(3000.0, span / SHORTEST_STEP)
    count = round(log_uniform(rng, least, most)) if most > least else int(least)
    begin = float(rng.uniform(-600, 1200)) if orbital and rng.random() < 0.3 else 0.0
    grid = np.linspace(0.0, 1.0, count)
    if rng.random() < 0.3:  # frames are lost or late
        grid[1:-1] += rng.uniform(-0.4, 0.4, count - 2) / (count - 1)
        kept = rng.random(count) < rng.uniform(0.7, 1.0)
        kept[[0, -1]] = True
        grid = grid[kept] if kept.sum() >= 20 else grid
    blind: tuple[float, ...] = ()
    if orbital and rng.random() < 0.2:
        dark = rng.uniform(0.1, 0.4)
        first = rng.uniform(0.1, 0.9 - dark)
        outside = (grid < first) | (grid > first + dark)
        if rng.random() < 0.5 and outside.sum() >= 20:
            grid = grid[outside]  # the camera is off
        else:
            blind = (begin + span * first, begin + span * (first + dark))
    return Timing(begin + span * grid, float(rate), blind)

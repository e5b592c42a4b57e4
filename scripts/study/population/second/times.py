"""When frames are taken, and during which of them something is hidden."""

import numpy as np
from numpy.typing import NDArray

from baryscope.study.population.second.chance import log_uniform

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

FEWEST, MOST = 20, 2000
COUNTS = [(20, 60), (60, 300), (300, 2000)]
STYLES = {"uniform": 0.55, "jitter": 0.15, "random": 0.1, "missing": 0.12, "bursts": 0.08}


def draw_times(rng: np.random.Generator, start: float, span: float, rotations: float) -> tuple[FloatArray, str]:
    """Ascending times (n,) in s from `start` over `span` s, at least six a rotation if there can be; their words."""
    low, high = COUNTS[rng.choice(3, p=[0.2, 0.48, 0.32])]
    frames = int(min(MOST, max(log_uniform(rng, low, high), FEWEST, 6 * rotations)))
    style = str(rng.choice(list(STYLES), p=list(STYLES.values())))
    if style == "uniform":
        t = np.linspace(0, 1, frames)
    elif style == "jitter":
        t = (np.arange(frames) + rng.uniform(-0.35, 0.35, frames)) / frames
    elif style == "random":
        t = np.cumsum(rng.exponential(1, frames) + 0.02)
    elif style == "missing":
        t = np.sort(rng.choice(np.linspace(0, 1, int(frames * 1.3) + 3), frames, replace=False))
    else:
        gap = np.ones(frames)
        gap[:: max(5, frames // int(rng.integers(2, 7)))] = rng.uniform(0.05, 0.2) * frames
        t = np.cumsum(gap)
    t = (t - t[0]) / (t[-1] - t[0]) * span
    return start + np.round(t, 6), f"{frames} {style} frames"


def stretches(rng: np.random.Generator, n: int, count: int, low: float, high: float) -> BoolArray:
    """Frames (n,) within one of `count` stretches, each of a share between low and high of all."""
    hidden = np.zeros(n, bool)
    for _ in range(count):
        length = int(rng.uniform(low, high) * n)
        begin = int(rng.integers(-length // 2, max(n - length // 2, 1)))
        hidden[max(begin, 0) : max(begin + length, 0)] = True
    return hidden

"""Which features are seen when, and under which labels."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.study.population.interface import BoolArray, FloatArray

IDENTIFIED, PASSES, ALL = "labels kept", "a label for each pass", "all seen"
MOST_LABELS = 60
FEWEST_SIGHTINGS = 3
FEWEST_FRAMES, LEAST_SHARE = 8, 0.2  # in which three features are seen


@dataclass(frozen=True, eq=False)
class View:
    """seen (n, m): labels in frames; feature (m,): behind each label; how: labels are given."""

    seen: BoolArray
    feature: NDArray[np.intp]
    how: str


def drawn(rng: np.random.Generator, facing: FloatArray, dark: BoolArray, orbital: bool) -> View:
    """Labels of M features.

    facing (n, M): cosines between a feature's normal and the way to the chaser; dark (n,): frames that show nothing.
    """
    how = str(rng.choice([IDENTIFIED, PASSES, ALL], p=[0.45, 0.3, 0.25] if orbital else [0.3, 0.0, 0.7]))
    frames, features = facing.shape
    limit = np.cos(np.radians(rng.uniform(65, 85)))
    chance = rng.random((frames, features)) >= rng.choice([0.0, rng.uniform(0.0, 0.3)])
    lives = _lives(rng, frames, features) if rng.random() < 0.3 else np.ones((frames, features), dtype=bool)
    common = lives & ~dark[:, None]
    for way in (how, ALL):
        turned = common & (facing > limit) if way != ALL else common
        passes = _passes(turned) if way == PASSES else [(feature, turned[:, feature]) for feature in range(features)]
        found = [(feature, mask & chance[:, feature]) for feature, mask in passes]
        found = [(feature, mask) for feature, mask in found if mask.sum() >= FEWEST_SIGHTINGS]
        found = sorted(found, key=lambda pair: -int(pair[1].sum()))[:MOST_LABELS]
        if found:
            seen = np.stack([mask for _, mask in found], axis=1)
            if (seen.sum(axis=1) >= 3).sum() >= max(FEWEST_FRAMES, LEAST_SHARE * frames):
                return View(seen, np.array([feature for feature, _ in found]), way)
    everything = np.ones((frames, features), dtype=bool) & ~dark[:, None]
    return View(everything, np.arange(features), ALL)


def _lives(rng: np.random.Generator, frames: int, features: int) -> BoolArray:
    """Births and deaths: each feature can be seen from a time to another (frames, features)."""
    first, last = np.sort(rng.uniform(-0.5, 1.5, (2, features)), axis=0)
    share = np.linspace(0, 1, frames)[:, None]
    return np.asarray((share >= first) & (share <= last))


def _passes(seen: BoolArray) -> list[tuple[int, BoolArray]]:
    """Each stretch of frames in which a feature is seen, as the feature and a mask (n,)."""
    found = []
    for feature in range(seen.shape[1]):
        column = seen[:, feature]
        number = np.cumsum(np.diff(column.astype(int), prepend=0) == 1)
        found += [(feature, column & (number == k)) for k in range(1, int(number.max(initial=0)) + 1)]
    return found

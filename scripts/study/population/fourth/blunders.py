"""Observations of something else than the label says."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.study.population.fourth.chance import directions, normalised
from baryscope.study.population.interface import BoolArray, FloatArray

LENGTHS = (1, 12)  # sightings in a burst, the last excluded


@dataclass(frozen=True, eq=False)
class Scene:
    """What is to be seen: ideal (n, m, 3) and noisy (n, m, 3) positions in C, m; seen (n, m); feature (m,) behind each
    label; size: of the body, m; noise: m.
    """

    ideal: FloatArray
    noisy: FloatArray
    seen: BoolArray
    feature: NDArray[np.intp]
    size: float
    noise: float


def blundered(rng: np.random.Generator, scene: Scene, kind: str, share: float) -> tuple[FloatArray, BoolArray]:
    """Positions (n, m, 3) in C, m, of which a share of what is seen is something else, and which are right (n, m)."""
    position, wrong = scene.noisy.copy(), np.zeros_like(scene.seen)
    if share:
        wrong = _bursts(rng, scene.seen, share) if kind == BURSTS else scene.seen & (rng.random(wrong.shape) < share)
        if kind == SWAPPED:
            _swap(rng, scene, position, wrong)
        else:
            position[wrong] += _SHIFTS[kind](rng, scene, wrong)
    return position, scene.seen & ~wrong


def _bursts(rng: np.random.Generator, seen: BoolArray, share: float) -> BoolArray:
    """Some sightings of a label in a row, again and again, until they are a share of all."""
    found, wanted = np.zeros_like(seen), share * seen.sum()
    while found.sum() < wanted:
        label = rng.integers(seen.shape[1])
        when = np.flatnonzero(seen[:, label])
        begin = rng.integers(len(when))
        found[when[begin : begin + int(rng.integers(*LENGTHS))], label] = True
    return found


def _swap(rng: np.random.Generator, scene: Scene, position: FloatArray, wrong: BoolArray) -> None:
    """Each becomes any that is seen in the same frame; where that is the same feature, it is right."""
    for frame, label in np.argwhere(wrong):
        other = rng.choice(np.flatnonzero(scene.seen[frame]))
        if scene.feature[other] == scene.feature[label]:
            wrong[frame, label] = False
        else:
            position[frame, label] += scene.ideal[frame, other] - scene.ideal[frame, label]


def _gross(rng: np.random.Generator, scene: Scene, wrong: BoolArray) -> FloatArray:
    """0.3 to 2 sizes of the body in any direction, (k, 3)."""
    k = int(wrong.sum())
    return directions(rng, k) * scene.size * rng.uniform(0.3, 2, (k, 1))


def _deep(rng: np.random.Generator, scene: Scene, wrong: BoolArray) -> FloatArray:
    """0.3 to 3 sizes of the body along the ray, (k, 3)."""
    length = scene.size * rng.choice([-1, 1], (int(wrong.sum()), 1)) * rng.uniform(0.3, 3, (int(wrong.sum()), 1))
    return normalised(scene.ideal[wrong]) * length


def _near(rng: np.random.Generator, scene: Scene, wrong: BoolArray) -> FloatArray:
    """4 to 15 deviations in any direction, (k, 3)."""
    k = int(wrong.sum())
    return directions(rng, k) * scene.noise * rng.uniform(4, 15, (k, 1))


def _steady(rng: np.random.Generator, scene: Scene, wrong: BoolArray) -> FloatArray:
    """0.2 to 1 sizes of the body, (k, 3), for each label the same in C."""
    labels = wrong.shape[1]
    shift = directions(rng, labels) * scene.size * rng.uniform(0.2, 1, (labels, 1))
    return np.asarray(shift[np.nonzero(wrong)[1]])


BURSTS, SWAPPED = "bursts of", "swapped"
_SHIFTS: dict[str, Callable[[np.random.Generator, Scene, BoolArray], FloatArray]] = {
    "gross": _gross,
    "deep": _deep,
    "near": _near,
    BURSTS: _steady,
}
KINDS = (*_SHIFTS, SWAPPED)

"""Observations of something else than the label says."""

from dataclasses import dataclass

import numpy as np

from baryscope.study.population.interface import BoolArray, FloatArray
from baryscope.study.population.third.dice import direction, log_uniform
from baryscope.study.population.third.sensor import Watch

SWAP_LENGTHS = (1, 12)  # frames


@dataclass(frozen=True)
class Blunders:
    """gross, near, swapped: shares of the observations that are far off, 2 to 6 deviations off, or another's; sliding:
    how many deviations a label's point creeps over the body while it is watched; glint: share of the sightings of one
    label that are a highlight on a sphere of `radius`, m.
    """

    gross: float = 0.0
    near: float = 0.0
    swapped: float = 0.0
    sliding: float = 0.0
    glint: float = 0.0
    radius: float = 0.0

    def words(self) -> list[str]:
        """Each kind with its size."""
        said = {
            f"gross outliers {100 * self.gross:.1f} %": self.gross,
            f"near outliers {100 * self.near:.1f} %": self.near,
            f"swapped labels {100 * self.swapped:.1f} %": self.swapped,
            f"sliding feature by {self.sliding:.1f} sigma": self.sliding,
            f"glint for {100 * self.glint:.0f} % of a label on {self.radius:.1f} m": self.glint,
        }
        return [words for words, true in said.items() if true]


def drawn(rng: np.random.Generator, names: tuple[str, ...], radius: float) -> Blunders:
    """The blunders that are named; radius: of a body's round part, m."""
    return Blunders(
        log_uniform(rng, 0.003, 0.15) if "gross outliers" in names else 0.0,
        log_uniform(rng, 0.003, 0.15) if "near outliers" in names else 0.0,
        log_uniform(rng, 0.003, 0.15) if "swapped labels" in names else 0.0,
        log_uniform(rng, 1, 100) if "sliding feature" in names else 0.0,
        float(rng.uniform(0.1, 1.0)) if "glint" in names else 0.0,
        float(radius * rng.uniform(0.3, 1.0)) if "glint" in names else 0.0,
    )


def blundered(
    rng: np.random.Generator, blunders: Blunders, noisy: FloatArray, root: FloatArray, watch: Watch
) -> tuple[FloatArray, BoolArray]:
    """Positions (n, m, 3) in C with blunders, m, and which are right (n, m).

    noisy (n, m, 3): positions without; root (n, m, 3, 3): square roots of the covariances of their noise.
    """
    position, right = noisy.copy(), np.ones(watch.seen.shape, dtype=bool)
    if blunders.sliding:
        label = rng.integers(watch.seen.shape[1])
        position[:, label] += _creep(rng, blunders.sliding, root[:, label], watch.attitude)
        right[:, label] = False
    if blunders.glint:
        label = rng.integers(watch.seen.shape[1])
        shines = _stretch(rng, blunders.glint, watch.seen[:, label])
        offset = noisy[:, label] - watch.ideal[:, label]
        position[shines, label] = (_highlight(rng, blunders.radius, watch) + offset)[shines]
        right[shines, label] = False
    if blunders.swapped:
        _swap(rng, blunders.swapped, (position, right), watch.seen)
    if blunders.gross:
        bad = rng.random(right.shape) < blunders.gross
        reach = watch.spread * np.exp(rng.uniform(np.log(0.3), np.log(5), bad.sum()))[:, None]
        position[bad] += reach * _directions(rng, int(bad.sum()))
        right &= ~bad
    if blunders.near:
        bad = rng.random(right.shape) < blunders.near
        reach = rng.uniform(2, 6, bad.sum())[:, None]
        position[bad] += np.einsum("kij,kj->ki", root[bad], reach * _directions(rng, int(bad.sum())))
        right &= ~bad
    return position, right


def _creep(rng: np.random.Generator, size: float, root: FloatArray, attitude: FloatArray) -> FloatArray:
    """A steady shift (n, 3) in C along a line of the body, by `size` mean deviations from first to last."""
    deviation = np.sqrt(np.mean(np.sum(root**2, axis=(1, 2))) / 3)
    way = np.linspace(-0.5, 0.5, len(attitude))[:, None] * size * deviation * direction(rng)
    return np.asarray(np.einsum("nij,nj->ni", attitude, way))


def _highlight(rng: np.random.Generator, radius: float, watch: Watch) -> FloatArray:
    """The highlight (n, 3) in C of the sun on a sphere about a point of the body."""
    to_chaser = -watch.path / np.linalg.norm(watch.path, axis=1, keepdims=True)
    sun = direction(rng)
    sun = sun * np.sign(sun @ to_chaser[0])  # behind the chaser, so that there is one
    half = to_chaser + sun
    centre = watch.attitude @ (0.3 * radius * direction(rng))
    return np.asarray(watch.path + centre + radius * half / np.linalg.norm(half, axis=1, keepdims=True))


def _stretch(rng: np.random.Generator, share: float, seen: BoolArray) -> BoolArray:
    """The frames (n,) of a stretch of what is seen, by its share of the sightings."""
    when = np.flatnonzero(seen)
    length = max(1, round(share * len(when)))
    first = int(rng.integers(len(when) - length + 1))
    found = np.zeros(len(seen), dtype=bool)
    found[when[first : first + length]] = True
    return found


def _swap(rng: np.random.Generator, share: float, tracks: tuple[FloatArray, BoolArray], seen: BoolArray) -> None:
    """Exchange two labels for some frames in a row, where both are seen, until a share of all is another's."""
    position, right = tracks
    changed, wanted = 0, share * seen.sum()
    for _ in range(20 * seen.shape[0]):
        if changed >= wanted or seen.shape[1] < 2:
            break
        one, other = rng.choice(seen.shape[1], 2, replace=False)
        first = int(rng.integers(len(seen)))
        frames = np.arange(first, min(first + int(rng.integers(*SWAP_LENGTHS)), len(seen)))
        frames = frames[seen[frames, one] & seen[frames, other] & right[frames, one] & right[frames, other]]
        position[frames, one], position[frames, other] = position[frames, other], position[frames, one].copy()
        right[frames, one] = right[frames, other] = False
        changed += 2 * len(frames)


def _directions(rng: np.random.Generator, count: int) -> FloatArray:
    v = rng.standard_normal((count, 3))
    return np.asarray(v / np.linalg.norm(v, axis=1, keepdims=True))

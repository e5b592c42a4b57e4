"""Which features are seen when, and under which labels."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.study.population.fourth.bodies import Body
from baryscope.study.population.interface import BoolArray, FloatArray

FEWEST_FRAMES, LEAST_SHARE = 12, 0.15  # in which three features are seen
RELABELLED = 0.4  # of the cases


@dataclass(frozen=True, eq=False)
class View:
    """seen (n, m): labels in frames; feature (m,): behind each label; new_labels: when a cluster comes back."""

    seen: BoolArray
    feature: NDArray[np.intp]
    labels: list[str]
    new_labels: bool


def drawn(rng: np.random.Generator, body: Body, elapsed: FloatArray, span: float, look: FloatArray) -> View | None:
    """What is seen at times (n,) of a span, s; None where that is too little.

    look (n, 3): unit vectors to the chaser in B.
    """
    clusters = _clusters(rng, body, elapsed, span, look)
    in_view = clusters[:, body.cluster]
    seen = in_view & (rng.random(in_view.shape) >= rng.choice([0.0, rng.uniform(0, 0.1), rng.uniform(0.1, 0.45)]))
    if rng.random() < 0.3:
        _shorten(rng, seen)
    if (seen.sum(axis=1) >= 3).sum() < max(FEWEST_FRAMES, LEAST_SHARE * len(elapsed)):
        return None
    features = range(len(body.points))
    new_labels = bool(rng.random() < RELABELLED)
    if new_labels:
        masks = [(f, f"P{f}-{k}", seen[:, f] & run) for f in features for k, run in _runs(in_view[:, f])]
    else:
        masks = [(f, f"P{f}", seen[:, f]) for f in features]
    masks = [(feature, label, mask) for feature, label, mask in masks if mask.any()]
    feature = np.array([feature for feature, _, _ in masks], dtype=np.intp)
    labels = [label for _, label, _ in masks]
    return View(np.stack([mask for _, _, mask in masks], axis=1), feature, labels, new_labels)


def _clusters(rng: np.random.Generator, body: Body, time: FloatArray, span: float, look: FloatArray) -> BoolArray:
    """Clusters in view (n, k): those that face the chaser, to 55–110°, but for stretches of time."""
    limit = np.cos(np.radians(rng.uniform(55, 110)))
    if body.normals is None:
        found = np.ones((len(time), int(body.cluster.max()) + 1), dtype=bool)
    else:
        found = np.asarray(look @ body.normals.T > limit)
    for _ in range(int(rng.choice([0, 1, 2, 4]))):  # nothing is seen
        begin = rng.uniform(0, span)
        found[(time > begin) & (time < begin + span * rng.uniform(0.01, 0.15))] = False
    for cluster in range(found.shape[1]):
        if rng.random() < 0.25:  # lost for another reason
            begin = rng.uniform(0, span)
            found[(time > begin) & (time < begin + span * rng.uniform(0.05, 0.4)), cluster] = False
    return found


def _shorten(rng: np.random.Generator, seen: BoolArray) -> None:
    """Leave two to six sightings in a row of a fifth of the features."""
    count = seen.shape[1]
    for feature in rng.permutation(count)[: max(1, count // 5)]:
        when = np.flatnonzero(seen[:, feature])
        if len(when) > 8:
            begin = rng.integers(0, len(when) - 6)
            seen[:, feature] = False
            seen[when[begin : begin + int(rng.integers(2, 7))], feature] = True


def _runs(mask: BoolArray) -> list[tuple[int, BoolArray]]:
    """Each stretch of frames in which a mask (n,) holds: its number from 1 on, and a mask of its own."""
    number = np.cumsum(np.diff(mask.astype(int), prepend=0) == 1)
    return [(k, mask & (number == k)) for k in range(1, int(number.max(initial=0)) + 1)]

"""Which features move with the rest of a rigid body: the pose of most of them, by random triples and Procrustes."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.geometry.alignment import align
from baryscope.estimator.geometry.so3 import cross_matrices, exp_rotation

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

TRIPLES = 100  # tried: of half wrong points all have one with a probability of (1 − 1/2³)^100
LEAST = 5  # features that are compared: four of them agree by chance sooner
ROUNDS = 4  # of the pose
GATE = 5.0  # standard deviations
FINEST = 0.5  # of the claimed standard deviations: those that agree by chance are no measure
TO_DEVIATION = 1.538  # median length of three unit normal numbers: √χ²₃(½)


@dataclass(frozen=True, eq=False)
class _Points:
    """Positions (k, 3), m, and their covariances (k, 3, 3), m²."""

    position: FloatArray
    covariance: FloatArray

    def __getitem__(self, which: BoolArray | NDArray[np.intp]) -> "_Points":
        return _Points(self.position[which], self.covariance[which])


@dataclass(eq=False)
class BodyMap:
    """Where features are on the body, in axes of its own: the information of all their sightings, and that times the
    place.
    """

    information: dict[int, FloatArray] = field(default_factory=dict)
    weighted: dict[int, FloatArray] = field(default_factory=dict)

    def strays(self, numbers: list[int], position: FloatArray, covariance: FloatArray) -> BoolArray:
        """Which features (k,) don't move with the body; the map learns from the others.

        position (k, 3) m; covariance (k, 3, 3) m². A frame with fewer than LEAST known features begins a map anew.
        """
        known = np.array([number in self.information for number in numbers], dtype=bool)
        stray, rotation, translation = np.zeros(len(numbers), dtype=bool), np.eye(3), np.zeros(3)
        if known.sum() < LEAST:
            self.information, self.weighted = {}, {}
        else:
            there = [number for number, is_known in zip(numbers, known, strict=True) if is_known]
            spread: FloatArray = np.asarray(np.linalg.inv([self.information[number] for number in there]), np.float64)
            places = (spread @ np.array([self.weighted[number] for number in there])[..., None])[..., 0]
            seen = _Points(position[known], covariance[known])
            rotation, translation, stray[known] = _agreeing(_Points(places, spread), seen)
        precision = rotation.T @ np.linalg.inv(covariance) @ rotation
        body = (precision @ ((position - translation) @ rotation)[..., None])[..., 0]
        for k in np.flatnonzero(~stray).tolist():
            self.information[numbers[k]] = self.information.get(numbers[k], 0.0) + precision[k]
            self.weighted[numbers[k]] = self.weighted.get(numbers[k], 0.0) + body[k]
        return stray


def _agreeing(body: _Points, seen: _Points) -> tuple[FloatArray, FloatArray, BoolArray]:
    """The pose R (3, 3), t (3,) of most points (k), and which of them don't fit it."""
    count = len(body.position)
    triples = np.argsort(np.random.default_rng(count).random((TRIPLES, count)), axis=1)[:, :3]
    tried = align(seen.position[triples], body.position[triples], np.ones((TRIPLES, 3)))
    misfits = [_misfits(*pose, body, seen) for pose in zip(tried.rotation, tried.translation, strict=True)]
    best = int(np.argmin(np.median(misfits, axis=1)))
    rotation, translation, kept = tried.rotation[best], tried.translation[best], misfits[best] <= _gate(misfits[best])
    for _ in range(ROUNDS):
        rotation, translation = _refined(rotation, translation, body[kept], seen[kept])
        misfit = _misfits(rotation, translation, body, seen)
        kept = misfit <= _gate(misfit)
    return rotation, translation, ~kept


def _refined(
    rotation: FloatArray, translation: FloatArray, body: _Points, seen: _Points
) -> tuple[FloatArray, FloatArray]:
    """A step of weighted least squares: depth is known far less well than direction."""
    turned = body.position @ rotation.T
    J = np.concatenate([np.broadcast_to(np.eye(3), (len(turned), 3, 3)), -cross_matrices(turned)], axis=2)
    weighted = np.swapaxes(J, 1, 2) @ np.linalg.inv(_spread(rotation, body, seen))
    off = (seen.position - turned - translation)[..., None]
    step = np.linalg.solve((weighted @ J).sum(axis=0), (weighted @ off).sum(axis=0)[:, 0])
    return exp_rotation(step[None, 3:])[0] @ rotation, translation + step[:3]


def _gate(misfit: FloatArray) -> float:
    return float(GATE * max(np.median(misfit) / TO_DEVIATION, FINEST))


def _misfits(rotation: FloatArray, translation: FloatArray, body: _Points, seen: _Points) -> FloatArray:
    """Residuals (k,) in standard deviations."""
    off = (seen.position - body.position @ rotation.T - translation)[..., None]
    squares = np.swapaxes(off, 1, 2) @ np.linalg.solve(_spread(rotation, body, seen), off)
    return np.asarray(np.sqrt(squares[:, 0, 0]))


def _spread(rotation: FloatArray, body: _Points, seen: _Points) -> FloatArray:
    return np.asarray(seen.covariance + rotation @ body.covariance @ rotation.T)

"""Fewer frames of each body, for what does not need all of them."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.registration.body import Body

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

SUBSAMPLE_FRAMES = 3000  # frames, approximately, for the initial solution, burns and ridges
MIN_BODY_FRAMES = 20  # frames of each body that a subsample keeps


@dataclass(frozen=True, eq=False)
class Subsample:
    """A subsample of bodies and observations: rows (k,) are the frames kept, every steps-th of each body."""

    bodies: tuple[Body, ...]
    observations: Observations
    rows: IntArray
    steps: tuple[int, ...]

    def standing_for_all(self) -> tuple[Observations, FloatArray]:
        """The observations, each with the weight of those that it stands for, and for how many frames each one does,
        (k,).
        """
        weight, count = self.observations.weight.copy(), np.ones(len(self.rows))
        for body, step in zip(self.bodies, self.steps, strict=True):
            weight[body.block] *= step
            count[body.frames] = np.maximum(count[body.frames], step)
        return self.observations.weighted(weight), count


def subsampled(bodies: tuple[Body, ...], observations: Observations, most: int) -> Subsample:
    """A subsample of about `most` of the bodies' frames, with at least MIN_BODY_FRAMES of each body."""
    every = max(1, sum(len(body.frames) for body in bodies) // most)
    steps = tuple(max(1, min(every, len(body.frames) // MIN_BODY_FRAMES)) for body in bodies)
    rows = np.sort(np.concatenate([body.frames[::step] for body, step in zip(bodies, steps, strict=True)]))
    few = tuple(
        replace(body, frames=np.searchsorted(rows, body.frames[::step]), attitude=body.attitude[::step])
        for body, step in zip(bodies, steps, strict=True)
    )
    return Subsample(few, observations.frames(rows), rows, steps)

"""Bodies that a path has lost: all that they show is rejected, and nothing draws them back."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.registration.body import Body

FloatArray = NDArray[np.float64]

LOST = 0.1  # share of a body's weight that is left where a path has lost it


def brought_back_bodies(
    bodies: tuple[Body, ...],
    weight: FloatArray,
    registered: tuple[Sequence[Body], Sequence[FloatArray]],
    first: Observations,
    origin: FloatArray,
) -> tuple[tuple[Body, ...], FloatArray] | None:
    """The bodies and weights (n, m) with those bodies at the path again of which all is rejected; None if none is.

    A body whose offset was badly known at first is far from a path that others tell. The median of its observations
    tells its offset from the path.

    Args:
        bodies: with points from the centre of mass.
        weight: (n, m), their robust weights.
        registered: with the attitudes of registration, and their shapes, points (m, 3) in m from their centroid.
        first: the observations with the weights from which the iteration began.
        origin: (n, 3) in C, m: the path.
    """
    moved, weight, lost = list(bodies), weight.copy(), False
    for index, (body, start, shape) in enumerate(zip(bodies, *registered, strict=True)):
        block = np.ix_(body.frames, body.features)
        before = first.weight[block]
        if weight[block].sum() > LOST * before.sum():
            continue
        seen = first.position[block] - origin[body.frames][:, None]
        apart = (seen @ start.attitude - shape)[before >= LOST]
        if len(apart):
            moved[index] = replace(start, points=shape + np.median(apart, axis=0))
            weight[block], lost = before, True
    return (tuple(moved), weight) if lost else None

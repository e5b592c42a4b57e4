"""Bodies and features of which all that they show is rejected: a path has lost them, or their labels are wrong."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.reweighting import NEGLIGIBLE, REJECTED
from baryscope.estimator.geometry.gauge import are_in_line
from baryscope.estimator.registration.body import Body

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

LOST = 0.1  # share of a body's weight that is left where a path has lost it
LEAST = 3  # features of a body
FEWEST = 2  # of them in a frame


def brought_back_bodies(
    bodies: tuple[Body, ...],
    weight: FloatArray,
    start: Sequence[Body],
    registered: Sequence[Body],
    first: Observations,
    origin: FloatArray,
) -> tuple[tuple[Body, ...], FloatArray] | None:
    """The bodies and weights (n, m) with those bodies at the path again of which all is rejected; None if none is.

    A body whose offset was badly known at first is far from a path that others tell. The median of its observations
    tells its offset from the path. Frames that have joined it since then by a wrong one leave it.

    Args:
        bodies: with points from the centre of mass.
        weight: (n, m), their robust weights.
        start: the bodies with which the iteration began, in their frames, whose attitudes are those of registration.
        registered: their shapes, with points from their centroid; start and these may have more features.
        first: the observations with the weights from which the iteration began.
        origin: (n, 3) in C, m: the path.
    """
    moved, weight, lost = list(bodies), weight.copy(), False
    for index, (body, whole, shape) in enumerate(zip(bodies, start, registered, strict=True)):
        own, points = whole.like(body), shape.like(body).points
        now, block = np.ix_(body.frames, body.features), np.ix_(own.frames, body.features)
        before = first.weight[block]
        if weight[now].sum() > LOST * before.sum():
            continue
        seen = first.position[block] - origin[own.frames][:, None]
        apart = (seen @ own.attitude - points)[before >= LOST]
        if len(apart):
            moved[index] = replace(own, points=points + np.median(apart, axis=0))
            weight[now] = 0.0
            weight[block], lost = before, True
    return (tuple(moved), weight) if lost else None


def without_scraps(bodies: Sequence[Body], weight: FloatArray) -> FloatArray:
    """Weights (n, m) that leave nothing of bodies of which hardly anything is right.

    What is right of such a body by chance does not tell its points, and with these the path would be led off. With
    weights that are negligible, but alike, the body follows the path until that agrees with it.
    """
    rejected = np.count_nonzero((weight > 0) & (weight < REJECTED))
    if rejected < (1 - LOST) * FEWEST * min(len(body.frames) for body in bodies):
        return weight  # no body can be lost
    weight = weight.copy()
    for body in bodies:
        block = np.ix_(body.frames, body.features)
        own = weight[block]
        if (own >= REJECTED).sum() < LOST * (own > 0).sum():
            weight[block] = np.where(own > 0, NEGLIGIBLE, 0.0)
    return weight


def without_untold_features(bodies: tuple[Body, ...], weight: FloatArray) -> tuple[tuple[Body, ...], FloatArray] | None:
    """The bodies without features of which all observations are rejected, and the weights (n, m), 0 there; None if none
    is.

    The place of such a feature is not told, and with it not where the centre of mass is from the centroid of all. A
    body that without them had too few, or they a line, keeps all.
    """
    fewer, weight = [], weight.copy()
    for body in bodies:
        told = told_features(body, weight)
        weight[np.ix_(body.frames, body.features)] *= told
        fewer.append(body if told.all() else body.of_features(told))
    return (tuple(fewer), weight) if fewer != list(bodies) else None


def told_features(body: Body, weight: FloatArray) -> BoolArray:
    """The features (m,) of a body of which weights (n, m) do not reject all observations; all where these are too few,
    or in a line.
    """
    told = np.asarray((weight[np.ix_(body.frames, body.features)] >= REJECTED).any(axis=0))
    few = told.sum() < LEAST or (are_in_line(body.points[told]) and not are_in_line(body.points))
    return np.ones_like(told) if few else told

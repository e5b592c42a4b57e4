"""Bodies and features of which all is rejected: a path has lost them, or their labels are wrong."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.degrees_of_freedom import values_for_path
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.reweighting import NEGLIGIBLE, REJECTED, WEIGHT_CHANGE_TOLERANCE, reweighted
from baryscope.estimator.paths.sampled_path import SampledPath
from baryscope.estimator.pivot.free_attitudes import linearised, told_features
from baryscope.estimator.registration.body import Body

FloatArray = NDArray[np.float64]

LOST = 0.1  # share of a body's weight that is left where a path has lost it
FEWEST = 2  # features in a frame
MOST_STEPS = 30  # of a body that is brought back, at the path


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
        now, block = body.block, np.ix_(own.frames, body.features)
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


def regained(
    near: tuple[tuple[Body, ...], FloatArray],
    bodies: tuple[Body, ...],
    observations: Observations,
    sampled: SampledPath,
    x: FloatArray,
    least: float,
) -> tuple[tuple[Body, ...], FloatArray]:
    """The bodies and weights (n, m) of `brought_back_bodies`, with shapes and outliers as the path has them.

    Where outliers have spoilt the attitudes of registration, all of a body is far from the path to the noise of others,
    and is rejected at once. Here each settles by itself, with weights by its own residuals, which may be many outliers.

    Args:
        near: what has been brought back.
        bodies: those before; the others of `near` are the same.
        observations: of all.
        sampled: the path, which is held at x (p,).
        least: lower bound of the variance of an observation of weight 1.
    """
    found, weight = list(near[0]), near[1].copy()
    for index, (body, before) in enumerate(zip(near[0], bodies, strict=True)):
        if body is before:
            continue
        block = body.block
        alone = np.zeros_like(weight)
        alone[block] = weight[block]
        own, cost = observations.weighted(alone), np.inf
        dof = max(values_for_path((body,), own), 1.0)
        for _ in range(MOST_STEPS):
            problem = linearised((found[index],), own, sampled, x)
            last, cost = cost, float(problem.squares.sum())
            if abs(cost - last) <= WEIGHT_CHANGE_TOLERANCE * cost:
                break
            (turned,), (inverse,), (rhs,), (told,) = problem.bodies, problem.inverse, problem.points_rhs, problem.told
            found[index] = turned.moved(inverse @ rhs, told)
            own = own.weighted(reweighted(problem.squares, own.weight, dof, least, many=True))
        weight[block] = own.weight[block]
    return tuple(found), weight


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
        block = body.block
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
        weight[body.block] *= told
        fewer.append(body if told.all() else body.of_features(told))
    return (tuple(fewer), weight) if fewer != list(bodies) else None

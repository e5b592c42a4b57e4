"""Bodies whose shape and poses are those of the observations' covariances: Procrustes with weights along all axes.

A stereo rig knows the depth ten to a hundred times worse than the place in the image. Registration weighs all axes
alike, so that its attitudes and shapes have the noise of the depth, and what fits them are not the right observations.
From there on steps of Gauss and Newton improve poses and points together: the poses, six unknowns a frame, are
eliminated frame by frame. The body's own pose is no unknown: points change without a common turn or shift.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.normal_equations import CHUNK_SIZE, normal_blocks
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.reweighting import REJECTED, Mixture, reweighted
from baryscope.estimator.geometry.so3 import cross_matrices, exp_rotation
from baryscope.estimator.geometry.symmetric import inverse_across
from baryscope.estimator.registration.body import Body
from baryscope.estimator.registration.clusters import Registered

FloatArray = NDArray[np.float64]
_Fitted = tuple[Body, FloatArray, FloatArray]

SHAPE_FRAMES = 1000  # of a body, from which its points are improved, approximately
ROUNDS = 8  # of steps at most: with all observations, and with robust weights
POSE_STEPS = 3  # for the poses before each step of the points
ENOUGH = 1e-3  # relative decrease of the cost by a round, below which the next would change little
MOST_HALVINGS = 4  # of a step of the points that leads uphill
MOST_TURN = 0.5  # rad, of a step
CLEARLY = 9.0  # 2 ln of the likelihood ratio from which a reversed pose counts as better
POSE = 6  # unknowns of a frame
SOFT_ROUNDS = 5  # with the weights of least absolute residuals, where there are outliers
MOST_ROUNDS = 15  # with robust weights
ENOUGH_VALUES = 30  # degrees of freedom, from which residuals tell the variance of a body
FAR = 10.0  # a body's variance over that of another, from which it is taken for wrong
STEADY = 0.1  # change of a weight that needs no further round


def with_covariances(registered: Registered, observations: Observations) -> tuple[Registered, Observations]:
    """The bodies registered by observations (n, m) with precisions, and these with robust weights; else as they are.

    Where a body has far greater residuals than another, as where labels are exchanged, its weights are as much smaller.
    """
    if observations.precision is None:
        return registered, observations
    found = [
        _improved(body, origin, observations.frames(body.frames).features(body.features))
        for body, origin in zip(registered.bodies, registered.origins, strict=True)
    ]
    weight = observations.weight.copy()
    least = min((one.variance for one in found if one.variance > 0), default=0.0)
    for one in found:
        fitting = least / one.variance if one.variance > FAR * least else 1.0
        weight[one.body.block] = fitting * one.weight
    improved = replace(registered, bodies=tuple(one.body for one in found), origins=tuple(one.origin for one in found))
    return improved, observations.weighted(weight)


@dataclass(frozen=True, eq=False)
class _Fit:
    """A body with its origins (n, 3), its observations' robust weights (n, m), and the variance of one of weight 1, 0
    where there are too few to tell.
    """

    body: Body
    origin: FloatArray
    weight: FloatArray
    variance: float


def _improved(body: Body, origin: FloatArray, own: Observations) -> _Fit:
    """The body with points about their centroid that fits its own observations best."""
    every = max(1, len(body.frames) // SHAPE_FRAMES)
    few = body.in_frames(slice(None, None, every))
    some = own.frames(slice(None, None, every))
    shaped, there, _ = _adjusted(few, origin[::every], some)
    shaped, there = _likelier_poses(shaped, there, some)
    fit = _robust(_adjusted, shaped, there, some, POSE * len(few.frames) + 3 * len(few.points) - POSE)
    if every > 1:
        body, origin = _likelier_poses(replace(body, points=fit.body.points), origin, own)
        fit = _robust(_all_posed, body, origin, own, POSE * len(body.frames))
    centre = fit.body.points.mean(axis=0)
    return replace(
        fit,
        body=replace(fit.body, points=fit.body.points - centre),
        origin=fit.origin + fit.body.attitude @ centre,
    )


def _robust(fitted: Callable[..., _Fitted], body: Body, origin: FloatArray, own: Observations, unknowns: int) -> _Fit:
    """The body fitted to its observations (n, m) with robust weights, of so many unknowns.

    Many outliers are spread over all residuals by least squares. So as long as any is found, the weights are first
    those of the least absolute residuals, which need no scale to be right.
    """
    body, origin, squares = fitted(body, origin, own)
    seen, weight, soft = own.weight > 0, own.weight, SOFT_ROUNDS
    for _ in range(MOST_ROUNDS):
        dof = 3 * float(weight.sum()) - unknowns
        if not dof > 0:
            break
        plain = squares[seen] / weight[seen]
        new = reweighted(squares, weight, dof, many=True)
        if soft and np.any(new[seen] < REJECTED):
            new = np.zeros_like(weight)
            new[seen] = 1 / np.sqrt(1 + plain / max(float(np.median(plain)), 1e-300))
            soft -= 1
        change = float(np.abs(new - weight).max())
        body, origin, squares = fitted(body, origin, own.weighted(new))
        weight = new
        if change < STEADY:
            break
    values = 3 * float(weight.sum())
    if values - unknowns <= ENOUGH_VALUES:
        return _Fit(body, origin, weight, 0.0)
    noise = Mixture.few(squares[seen] / weight[seen], (values - unknowns) / values, least=0.0)
    return _Fit(body, origin, weight, noise.variance)


def _adjusted(body: Body, origin: FloatArray, own: Observations) -> _Fitted:
    """Body and origins (n, 3) after rounds of poses and points, and the weighted squares (n, m) there.

    A step that leads uphill, as from points that few observations tell, is halved.
    """
    best = _all_posed(body, origin, own)
    for _ in range(ROUNDS):
        body, origin, squares = best
        change, cost = _change_of_points(body, origin, own), float(squares.sum())
        for halved in range(MOST_HALVINGS + 1):
            moved = replace(body, points=body.points + change / 2**halved)
            found = _all_posed(moved, origin, own)
            if found[2].sum() <= cost:
                best = found
                break
        if not float(best[2].sum()) < (1 - ENOUGH) * cost:
            break
    return best


def _all_posed(body: Body, origin: FloatArray, own: Observations) -> _Fitted:
    """Body and origins (n, 3) after steps of the poses for the same points, and the weighted squares (n, m) there."""
    for _ in range(POSE_STEPS):
        body, origin = _posed(body, origin, own)
    return body, origin, normal_blocks(own, body.attitude, origin, body.points).squares


def _likelier_poses(body: Body, origin: FloatArray, own: Observations) -> tuple[Body, FloatArray]:
    """The body with attitudes and origins (n, 3) from where they are, or reversed in depth where that fits better.

    In an image a plane of points looks nearly the same if it is tilted as much the other way (Necker's cube): R then is
    M R N, with M the reflection in depth and N that in the plane of the points that are seen.
    """
    weight = own.weight
    mean = (weight @ body.points) / np.maximum(weight.sum(axis=1), 1e-300)[:, None]
    centred = np.sqrt(weight)[:, :, None] * (body.points - mean[:, None])
    normal = np.linalg.eigh(np.swapaxes(centred, 1, 2) @ centred)[1][:, :, 0]
    centre = origin + np.einsum("kij,kj->ki", body.attitude, mean)
    sight = centre / np.maximum(np.linalg.norm(centre, axis=1), 1e-300)[:, None]
    M, N = (np.eye(3) - 2 * v[:, :, None] * v[:, None] for v in (sight, normal))
    other = replace(body, attitude=M @ body.attitude @ N)
    there = centre - np.einsum("kij,kj->ki", other.attitude, mean)
    costs = []
    for _ in range(2 * POSE_STEPS):
        body, origin = _posed(body, origin, own)
        other, there = _posed(other, there, own)
    for one, place in ((body, origin), (other, there)):
        costs.append(normal_blocks(own, one.attitude, place, one.points).squares.sum(axis=1))
    better = costs[1] < costs[0] - CLEARLY
    attitude = np.where(better[:, None, None], other.attitude, body.attitude)
    return replace(body, attitude=attitude), np.where(better[:, None], there, origin)


def _posed(body: Body, origin: FloatArray, own: Observations) -> tuple[Body, FloatArray]:
    """The body with its attitudes and origins (n, 3) after a step for the same points."""
    turn, shift = normal_blocks(own, body.attitude, origin, body.points).best_pose()
    turn *= np.minimum(1.0, MOST_TURN / np.maximum(np.linalg.norm(turn, axis=1), 1e-300))[:, None]
    origin = origin + np.einsum("kij,kj->ki", body.attitude, shift)
    return replace(body, attitude=body.attitude @ exp_rotation(turn)), origin


def _change_of_points(body: Body, origin: FloatArray, own: Observations) -> FloatArray:
    """The step (m, 3) of the points in B, m, with the poses eliminated."""
    m = len(body.points)
    matrix, rhs, sizes = np.zeros((3 * m, 3 * m)), np.zeros(3 * m), np.zeros(3 * m)
    size = max(64, CHUNK_SIZE // (18 * m))
    for first in range(0, len(body.frames), size):
        part = slice(first, first + size)
        found = normal_blocks(own.frames(part), body.attitude[part], origin[part], body.points)
        (block, own_rhs), coupling = found.of_poses(), found.poses_points()
        solved = np.linalg.pinv(block, hermitian=True) @ coupling
        for index, of_point in enumerate(found.point):
            at = slice(3 * index, 3 * index + 3)
            matrix[at, at] += of_point
        sizes += np.diagonal(found.point, axis1=1, axis2=2).ravel()
        matrix -= coupling.reshape(-1, 3 * m).T @ solved.reshape(-1, 3 * m)
        rhs += found.point_rhs.ravel() - np.einsum("kip,ki->p", solved, own_rhs)
    turns = np.swapaxes(cross_matrices(body.points), 1, 2).reshape(-1, 3)
    own_pose = np.concatenate([turns, np.tile(np.eye(3), (m, 1))], axis=1)
    return np.asarray(inverse_across(matrix, own_pose, sizes) @ rhs).reshape(-1, 3)

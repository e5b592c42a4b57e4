"""A path from features in a line, which have no attitude of their own.

The centre of mass is at one place along such a line, and at one distance from it. The first is linear in the path:
u · (c − g(t; x)) = d, for the direction u and the centroid c of the features in a frame. The second follows, and with
it the attitude: the line and the centre of mass are in one plane of the body.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.spurious import (
    SpuriousInformation,
    effective_count,
    spurious_information_columns,
)
from baryscope.estimator.geometry.alignment import matrix_from_quaternion, rotation_from_moments
from baryscope.estimator.paths.prior import Prior
from baryscope.estimator.paths.sampled_path import SampledPath
from baryscope.estimator.pivot.drift import drift_equations
from baryscope.estimator.pivot.offset_prior import RADII, radius_of_many
from baryscope.estimator.pivot.pivot_solution import PivotSolution
from baryscope.estimator.registration.body import Body
from baryscope.estimator.registration.clusters import Registered, typical_steps
from baryscope.estimator.registration.collinear import FEWEST_ON_LINE
from baryscope.estimator.registration.flips import same_sense
from baryscope.models.errors import ComputationError, Reason

FloatArray = NDArray[np.float64]

MOST_SPURIOUS = 0.2  # of the information on a path from lines: its square, 4 % of that, is not subtracted
HALFWAY = 6.0  # deviations from the middle of two features, up to which exchanged labels may hold the centre of mass
NEAREST = 0.01  # of the length of the line: the distance of the centre of mass from its line, at least


def collinear_start(
    registered: Registered, observations: Observations, sampled: SampledPath, prior: Prior
) -> tuple[tuple[Body, ...], FloatArray]:
    """Bodies with points from the centre of mass and attitudes, and the path's x (p,), by linear least squares."""
    frames = sum(len(body.frames) for body in registered.bodies)
    roots = [_roots(body, registered.noise, frames) for body in registered.bodies]
    equations = drift_equations(registered, roots, sampled, registered.noise)
    drift = replace(equations, values=sum(map(len, roots))).solved(prior)
    origin, bodies = sampled.position(drift.x), []
    for body, centroid, offset in zip(registered.bodies, registered.origins, drift.offsets, strict=True):
        apart = centroid - origin[body.frames]
        along = body.attitude[:, :, 2]
        across = apart - np.einsum("ki,ki->k", apart, along)[:, None] * along
        away = max(float(np.median(np.linalg.norm(across, axis=1))), NEAREST * float(np.ptp(body.points[:, 2])))
        bodies.append(replace(body, points=body.points + np.array([away, 0.0, offset[2]])))
    return attitudes_about(bodies, observations, origin), drift.x


def _roots(body: Body, noise: float, frames: int) -> FloatArray:
    """The roots of the information that a line tells in each frame, (n, 3, 3), for `drift_equations`.

    Along the line, the place of the centre of mass; across it, that it is near, which all frames together tell as well
    as the prior of an offset does. noise: of a coordinate along the line, m; frames: of all lines.
    """
    root = np.swapaxes(body.attitude, 1, 2).copy()
    root[:, :2] *= noise / (RADII * radius_of_many(body.points) * np.sqrt(frames))
    return root


def attitudes_about(bodies: Sequence[Body], observations: Observations, origin: FloatArray) -> tuple[Body, ...]:
    """The bodies with the attitudes that fit best for their points, the centre of mass at origin (n, 3) in C, m."""
    return tuple(
        replace(body, attitude=best_attitudes(_own(body, observations), body.points, origin[body.frames]))
        for body in bodies
    )


def _own(body: Body, observations: Observations) -> Observations:
    return observations.features(body.features).frames(body.frames)


def best_attitudes(own: Observations, points: FloatArray, origin: FloatArray) -> FloatArray:
    """The attitudes (n, 3, 3) R_C_S that fit best for points (m, 3) about origins (n, 3) in C, m, by the weights."""
    apart = own.position - origin[:, None]
    moments = np.einsum("km,kmi,mj->kij", own.weight, apart, points, optimize=True)
    return np.asarray(matrix_from_quaternion(rotation_from_moments(moments)[0]))


def spurious_share(found: PivotSolution) -> float:
    """The spurious information on the path over that on it, in the direction where it is greatest."""
    return float(np.linalg.eigvals(found.solution.covariance @ spurious_information(found).mean).real.max())


def refuse_untold(found: PivotSolution, registered: Registered) -> None:
    """Check that features in a line tell the path by more than noise, and by more than exchanged labels may.

    Raises:
        ComputationError: they do not.
    """
    if not registered.in_line:
        return
    if spurious_share(found) > MOST_SPURIOUS:
        raise ComputationError(
            "the features seen together lie in a line, or no farther from one than their noise, and turn too little, "
            "or too evenly, to tell a path",
            Reason.COLLINEAR_FEATURES,
        )
    if any(_may_be_exchanged(found, index) for index in range(len(found.bodies))):
        raise ComputationError(
            "the features seen together are two, and the centre of mass that fits best is as far from one as from the "
            "other, as it is where their labels are exchanged in some frames, which does not show: the line through "
            "them turns by more than 30° from frame to frame",
            Reason.COLLINEAR_FEATURES,
        )


def _may_be_exchanged(found: PivotSolution, index: int) -> bool:
    """Whether two features may have each other's label in some frames of a body: only halfway along the line, where
    labels make no difference, such frames fit as well as others.
    """
    body = found.bodies[index]
    if len(body.features) != FEWEST_ON_LINE:
        return False
    apart, own = body.points[1] - body.points[0], slice(3 * index, 3 * index + 3)
    length = float(np.linalg.norm(apart))
    along, middle = apart / length, body.points.mean(axis=0)
    deviation = np.sqrt(found.variance * float(along @ found.solution.offset_covariance[own, own] @ along))
    if not abs(middle @ along) < HALFWAY * deviation < length / 2:
        return False
    _, sure = same_sense(typical_steps(len(found.time), found.time)[body.frames], body.attitude @ along)
    return bool(sure.mean() < 0.5)


def spurious_information(found: PivotSolution) -> SpuriousInformation:
    """The spurious information on the path's x (p, p), in the weights' units; it scatters as the frames that give most.

    A frame does not see what moves the centre of mass across the plane in which it is with the line: the attitude
    follows. But with the noise φ of that attitude, the distance from the line seems to change by φ times as much. For
    the information Q on the distance, the direction t across the plane and the path's Jacobian J, the information is
    Σ Q φ² Jᵀ t tᵀ J. Along the axis of a spin, and across a plane in which the line stays, there is no other.
    """
    total, sizes = np.zeros_like(found.solution.covariance), []
    for body, noisy in zip(found.bodies, found.noisy_attitudes, strict=True):
        centroid = body.points.mean(axis=0)
        along = np.linalg.svd(body.points - centroid)[2][0]
        away = centroid - (centroid @ along) * along
        away /= max(float(np.linalg.norm(away)), 1e-300)
        turned = np.einsum("i,kij,j->k", along, noisy.covariance, along)
        seen = np.einsum("i,kij,j->k", away, noisy.known, away)
        across = noisy.attitude @ np.cross(along, away)
        matrices = (seen * turned)[:, None, None] * across[:, :, None] * across[:, None]
        total += noisy.every * found.sampled.gram(noisy.frames, matrices)
        sizes.append(np.repeat(seen * turned, noisy.every))
    return SpuriousInformation.of(total, max(effective_count(np.concatenate(sizes)), 1.0))


def without_spurious_path(found: PivotSolution, least: float) -> FloatArray:
    """Columns A (3 k + p, d) by which the joint covariance of offsets and x grows, as A Aᵀ, without that information.

    least: the least information on the place of the centre of mass in a direction, in the weights' units.
    """
    solution = found.solution
    of_x, of_offsets = spurious_information_columns(
        solution.covariance,
        solution.offset_path.T,
        spurious_information(found),
        least,
        lengths=found.sampled.lengths,
    )
    return np.asarray(np.sqrt(found.variance) * np.concatenate([of_offsets, of_x]))

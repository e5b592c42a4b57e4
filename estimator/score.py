"""score: the symmetrical centre of rotation estimation of Ehrig, Taylor, Duda and Heller (J. Biomech. 39, 2006).

The centre of a joint between two moving bodies is at rest in both: R_k u + c_k = S_k v + e_k in all frames. Here one of
the two is the ground: the poses of the target's bodies come from registration, and v is the same point for all of them,
    c_k + R_k u = v,
by unweighted least squares. The model is right for a centre of mass at rest only: a baseline, which says so where the
residuals show that the centre moves. The ground is the target's LVLH frame if an orbit is given, in which a chaser on
V-bar is at rest, else frame C.
"""

import time as clock
from dataclasses import replace

import numpy as np
from numpy.polynomial import chebyshev
from scipy.special import chdtri, fdtrc

from baryscope.estimator.adjustment.diagnostics import (
    cluster_of,
    covered_by,
    observability_of,
    rejected_by,
    residuals_of,
)
from baryscope.estimator.adjustment.lasting_errors import frames_per_error
from baryscope.estimator.adjustment.normal_equations import attitude_covariances, turn_information
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.reweighting import NEGLIGIBLE
from baryscope.estimator.adjustment.spurious import spurious_information_columns, three_sigma_factor
from baryscope.estimator.details import ScoreDetails
from baryscope.estimator.findings import ExcessResiduals, LackOfFit
from baryscope.estimator.geometry.so3 import cross_matrices
from baryscope.estimator.geometry.symmetric import null_space_of, symmetric_pseudo_inverse
from baryscope.estimator.options import PathOptions, refuse_forces
from baryscope.estimator.registration.body import Body
from baryscope.estimator.registration.clusters import Registered, find_bodies
from baryscope.estimator.registration.screening import screen
from baryscope.estimator.result import Estimate, Motion, Noise
from baryscope.estimator.tracks import BoolArray, FeatureTracks, FloatArray
from baryscope.models.errors import InputError
from baryscope.models.lvlh import lvlh_attitude, lvlh_rate
from baryscope.models.orbit import Orbit

DEGREE = 4  # of the polynomial that is looked for in the residuals
SIGNIFICANCE = 1e-4  # probability of finding one by chance
MAX_VARIANCE_RATIO = 1.5  # of the residuals over what the registration tells, above which the centre moves
ROUNDING = 1e-7  # of the distance: residuals that are rounding


def estimate_by_score(tracks: FeatureTracks, orbit: Orbit | None, options: PathOptions) -> Estimate:
    """The centre of mass as the fixed centre of rotation: in LVLH if an orbit is given and no trajectory, else in C.

    The covariance is that of the least squares, with the noise from its residuals c_k + R_k u − v per coordinate,
    `ScoreDetails.centre_residual`, without the spurious information of noisy attitudes; frames that have the same
    errors of the features count as one. It is wrong if the centre moves, which the findings tell. A sigma in the
    options is not used.

    Raises:
        InputError: a trajectory other than `fixed`, or a singular covariance.
        ComputationError: the tracks determine no attitude.
    """
    begin = clock.perf_counter()
    refuse_forces(options, "score")
    if options.trajectory not in (None, "fixed"):
        raise InputError(f"trajectory is {options.trajectory!r}, expected fixed: score finds a centre that is at rest")
    tracks.refuse_singular()
    in_orbit = orbit is not None and options.trajectory is None
    R_C_W = lvlh_attitude(orbit, tracks.time) if orbit is not None and in_orbit else np.eye(3)[None]
    position = tracks.position @ R_C_W
    given = tracks.covariance
    if given is not None:
        given = np.swapaxes(R_C_W, 1, 2)[:, None] @ given @ R_C_W[:, None]
    inliers = screen(position, tracks.seen, given)
    registered = find_bodies(position, inliers, tracks.time)
    centre, offsets, inverse, variance, unseen = solve_score(registered)
    bodies = [
        replace(body, points=body.points + offset) for body, offset in zip(registered.bodies, offsets, strict=True)
    ]
    origin, n = np.tile(centre, (len(position), 1)), len(position)
    observations = Observations(np.where(inliers[:, :, None], position, 0.0), inliers.astype(np.float64))
    lasting = frames_per_error(bodies, observations, origin)
    path = "fixed in LVLH" if in_orbit else "fixed"
    lack = _lack_of_fit(registered, tracks.time, centre, offsets, path, lasting)
    noisy = variance > (ROUNDING * float(np.abs(centre).max())) ** 2
    finding = lack or (_excess_residuals(registered, inliers, offsets, variance, path) if noisy else None)
    distance = float(np.linalg.norm(centre))
    together = lasting * variance
    inverse = _without_spurious_information(registered, inliers, inverse, together / max(distance, 1e-300) ** 2)
    unseen = unseen * distance / np.linalg.norm(unseen[-3:], axis=0)
    joint = together * inverse + unseen @ unseen.T
    weight, covariances = np.zeros(tracks.seen.shape), []
    for index, body in enumerate(bodies):
        own, block = slice(3 * index, 3 * index + 3), np.ix_(body.frames, body.features)
        weight[block] = np.where(tracks.seen[block], np.where(inliers[block], 1.0, NEGLIGIBLE), 0.0)
        covariances.append(joint[own, own])
    clusters = tuple(
        cluster_of(body, body.points, own, tracks.labels) for body, own in zip(bodies, covariances, strict=True)
    )
    of_centre = R_C_W @ joint[-3:, -3:] @ np.swapaxes(R_C_W, 1, 2)
    covariance = np.broadcast_to(of_centre, (n, 3, 3)).copy()
    turn = lvlh_rate(orbit, tracks.time)[:, None] if orbit is not None and in_orbit else np.zeros((n, 1))
    residuals = residuals_of(position, bodies, origin)
    residuals = residuals @ np.swapaxes(R_C_W, 1, 2)
    used, rejected = weight > 0, rejected_by(weight)
    kept = residuals[used & ~rejected]
    return Estimate(
        time=tracks.time,
        labels=tracks.labels,
        position=np.broadcast_to(R_C_W @ centre, (n, 3)).copy(),
        covariance=covariance,
        motion=Motion(velocity=np.broadcast_to(R_C_W @ np.cross([0.0, 0.0, 1.0], centre), (n, 3)) * turn),
        observability=observability_of(clusters, covariance),
        clusters=clusters,
        noise=Noise(None, float(np.sqrt(np.mean(kept**2))) if kept.size else np.nan, lasting=lasting),
        residuals=residuals,
        used=used,
        rejected=rejected,
        covered=covered_by(clusters, n),
        converged=True,
        rounds=1,
        findings=() if finding is None else (finding,),
        method="score",
        path=path,
        options=options,
        details=ScoreDetails(float(np.sqrt(variance))),
        wall_time=clock.perf_counter() - begin,
    )


def solve_score(registered: Registered) -> tuple[FloatArray, FloatArray, FloatArray, float, FloatArray]:
    """The least-squares solution of c_k = v + R_k d, d = −u, jointly for all bodies.

    Returns:
        v (3,) and d (j, 3), each body's in its axes, m; the pseudo-inverse (3 j + 3, 3 j + 3) of the normal equations
        of (d, v); the residuals' variance per coordinate, m²; and the directions (3 j + 3, k) of (d, v) that nothing
        tells, as where the target does not turn.
    """
    bodies, origins = registered.bodies, registered.origins
    j = len(bodies)
    matrix, rhs = np.zeros((3 * j + 3, 3 * j + 3)), np.zeros(3 * j + 3)
    for index, (body, origin) in enumerate(zip(bodies, origins, strict=True)):
        own, R = slice(3 * index, 3 * index + 3), body.attitude
        turned = R.sum(axis=0)
        matrix[own, own] = len(R) * np.eye(3)
        matrix[own, -3:], matrix[-3:, own] = turned.T, turned
        matrix[-3:, -3:] += len(R) * np.eye(3)
        rhs[own] = np.einsum("kij,ki->j", R, origin)
        rhs[-3:] += origin.sum(axis=0)
    inverse = symmetric_pseudo_inverse(matrix)
    found = inverse @ rhs
    centre, offsets = found[-3:], found[:-3].reshape(-1, 3)
    squares = sum(
        float(np.sum((origin - centre - body.attitude @ offset) ** 2))
        for body, origin, offset in zip(bodies, origins, offsets, strict=True)
    )
    values = 3 * sum(len(body.frames) for body in bodies)
    variance = squares / max(values - len(found), 1)
    return centre, offsets, inverse, variance, null_space_of(matrix, np.diag(matrix))


def _without_spurious_information(
    registered: Registered, inliers: BoolArray, inverse: FloatArray, least: float
) -> FloatArray:
    """The pseudo-inverse of the normal equations, (3 j + 3, 3 j + 3), without spurious information of noisy attitudes.

    An error φ of an attitude with the covariance C adds φ × d to the frame, in the mean the information tr C − C on d,
    see `adjustment.spurious`. least: information that remains in a direction.
    """
    k = len(inverse) - 3
    spurious = np.zeros((k, k))
    for index, body in enumerate(registered.bodies):
        own = slice(3 * index, 3 * index + 3)
        of_turn = _turn_covariances(body, inliers, registered.noise).sum(axis=0)
        information = np.trace(of_turn) * np.eye(3) - of_turn
        spurious[own, own] = three_sigma_factor(len(body.frames)) * information
    of_offsets, of_centre = spurious_information_columns(inverse[:k, :k], inverse[:k, k:], spurious, least)
    columns = np.concatenate([of_offsets, of_centre])
    return np.asarray(inverse + columns @ columns.T)


def _lack_of_fit(
    registered: Registered, time: FloatArray, centre: FloatArray, offsets: FloatArray, path: str, lasting: float
) -> LackOfFit | None:
    """A finding if a polynomial of time explains more of the residuals c_k + R_k u − v than noise does.

    lasting: how many frames have the same errors of the features.
    """
    frames = np.concatenate([body.frames for body in registered.bodies])
    residual = np.concatenate(
        [
            origin - centre - body.attitude @ offset
            for body, origin, offset in zip(registered.bodies, registered.origins, offsets, strict=True)
        ]
    )
    half = max((time[-1] - time[0]) / 2, 1e-300)
    powers = chebyshev.chebvander((time[frames] - time[0]) / half - 1, DEGREE)
    basis = np.linalg.qr(powers - powers.mean(axis=0))[0][:, 1:]
    explained = basis @ (basis.T @ residual)
    values = residual.size - 3 * (DEGREE + 1) - 3 * len(offsets)
    if values < 1:
        return None
    variance = max(float(np.sum((residual - explained) ** 2)) / values, (ROUNDING * float(np.abs(centre).max())) ** 2)
    gain, dof = float(np.sum(explained**2)) / (lasting * variance), 3 * DEGREE
    if fdtrc(dof, values / lasting, gain / dof) > SIGNIFICANCE:
        return None
    return LackOfFit(path, float(np.sqrt(np.mean(np.sum(explained**2, axis=1)))), gain, dof)


def _turn_covariances(body: Body, inliers: BoolArray, noise: float) -> FloatArray:
    """The covariances (n, 3, 3) of the body's attitudes in its axes, rad², for a standard deviation of a coordinate."""
    weight = inliers[np.ix_(body.frames, body.features)].astype(np.float64)
    return attitude_covariances(turn_information(weight, cross_matrices(body.points)), noise**2)


def _excess_residuals(
    registered: Registered, inliers: BoolArray, offsets: FloatArray, variance: float, path: str
) -> ExcessResiduals | None:
    """A finding if the residuals' variance is greater than that of centroids and attitudes from the registration."""
    expected, values = 0.0, -3 * len(offsets) - 3
    for body, offset in zip(registered.bodies, offsets, strict=True):
        arm = cross_matrices(offset[None])[0]
        of_turn = np.einsum("ij,kjl,il->k", arm, _turn_covariances(body, inliers, registered.noise), arm)
        of_centroid = 3 * registered.noise**2 / inliers[np.ix_(body.frames, body.features)].sum(axis=1)
        expected += float(np.sum(of_turn + of_centroid))
        values += 3 * len(body.frames)
    if values < 1:
        return None
    ratio = variance * values / max(expected, 1e-300)
    if ratio <= max(MAX_VARIANCE_RATIO, float(chdtri(values, SIGNIFICANCE)) / values) or registered.noise == 0:
        return None
    return ExcessResiduals(path, float(np.sqrt(ratio)))

"""score: the symmetrical centre of rotation estimation of Ehrig, Taylor, Duda and Heller (J. Biomech. 39, 2006).

The centre of a joint between two moving bodies is at rest in both: R_k u + c_k = S_k v + e_k in all frames. Here one of
the two is the ground: the poses of the target's bodies come from registration, and v is the same point for all of them,
    c_k + R_k u = v,
by unweighted least squares. The model is right for a centre of mass at rest only: a baseline, which says so where the
residuals show that the centre moves. The ground is the target's LVLH frame if an orbit is given, in which a chaser on
V-bar is at rest, else frame C.
"""

import time as clock
from dataclasses import dataclass, replace

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
from baryscope.estimator.adjustment.spurious import (
    SpuriousInformation,
    attenuated_columns,
    spurious_information_columns,
)
from baryscope.estimator.details import ScoreDetails
from baryscope.estimator.findings import ExcessResiduals, FewFrames, Finding, LackOfFit
from baryscope.estimator.geometry.so3 import cross_matrices
from baryscope.estimator.geometry.symmetric import inverse_and_null_space
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


@dataclass(frozen=True, eq=False)
class _RestFrame:
    """The axes W in which the centre is at rest: LVLH, or those of C.

    path: their name as that of the path's model; R_C_W (n, 3, 3), or (1, 3, 3) where W is C; rate (n, 1): how fast W
    turns about its z in C, rad/s.
    """

    path: str
    R_C_W: FloatArray
    rate: FloatArray

    @classmethod
    def of(cls, orbit: Orbit | None, time: FloatArray) -> "_RestFrame":
        """LVLH of the orbit at n times, s; without one, C."""
        if orbit is None:
            return cls("fixed", np.eye(3)[None], np.zeros((len(time), 1)))
        return cls("fixed in LVLH", lvlh_attitude(orbit, time), lvlh_rate(orbit, time)[:, None])

    def vectors(self, vectors_C: FloatArray) -> FloatArray:
        """Vectors (n, m, 3) in W, from those in C."""
        return vectors_C @ self.R_C_W

    def vectors_in_C(self, vectors_W: FloatArray) -> FloatArray:
        """Vectors (n, m, 3) in C, from those in W."""
        return vectors_W @ np.swapaxes(self.R_C_W, 1, 2)

    def covariances(self, covariances_C: FloatArray) -> FloatArray:
        """Covariances (n, m, 3, 3) in W, from those in C."""
        return np.asarray(np.swapaxes(self.R_C_W, 1, 2)[:, None] @ covariances_C @ self.R_C_W[:, None])

    def at_rest(self, point_W: FloatArray) -> FloatArray:
        """The positions (n, 3) in C of a point (3,) that is at rest in W."""
        return np.broadcast_to(self.R_C_W @ point_W, (len(self.rate), 3)).copy()

    def velocity(self, point_W: FloatArray) -> FloatArray:
        """The velocities (n, 3) in C, m/s, of a point (3,) that is at rest in W."""
        return np.broadcast_to(self.R_C_W @ np.cross([0.0, 0.0, 1.0], point_W), (len(self.rate), 3)) * self.rate

    def covariance(self, covariance_W: FloatArray) -> FloatArray:
        """The covariances (n, 3, 3) in C of a point's positions, from those (n, 3, 3) in W."""
        return np.asarray(self.R_C_W @ covariance_W @ np.swapaxes(self.R_C_W, 1, 2))


@dataclass(frozen=True, eq=False)
class Fit:
    """The least-squares solution of c_k = v + R_k d, d = −u, jointly for j bodies; v = Σ b_l(t_k) v_l for q functions
    of time, of which the first is 1.

    Attributes:
        centres: v_l (q, 3), m.
        offsets: d (j, 3), each body's in its axes, m.
        inverse: the pseudo-inverse (3 j + 3 q, 3 j + 3 q) of the normal equations of (d, v_l).
        variance: of the residuals per coordinate, m².
        unseen: the directions (3 j + 3 q, k) of (d, v_l) that nothing tells, as where the target does not turn.
    """

    centres: FloatArray
    offsets: FloatArray
    inverse: FloatArray
    variance: float
    unseen: FloatArray

    @property
    def centre(self) -> FloatArray:
        """v (3,), m, or what of it is constant."""
        return np.asarray(self.centres[0])


def estimate_by_score(tracks: FeatureTracks, orbit: Orbit | None, options: PathOptions) -> Estimate:
    """The centre of mass as the fixed centre of rotation: in LVLH if an orbit is given and no trajectory, else in C.

    The covariance is that of the least squares, with the noise from its residuals c_k + R_k u − v per coordinate,
    `ScoreDetails.centre_residual`, without the spurious information of noisy attitudes, and with what these leave the
    centre too near the features; frames that have the same errors of the features count as one. It is wrong if the
    centre moves, which the findings tell; unless a trajectory is told, it has the motion that the residuals show, or do
    not exclude: polynomials of time, of which the noise of a frame is the prior. A sigma in the options is not used.

    Raises:
        InputError: a trajectory other than `fixed`, or a singular covariance.
        ComputationError: the tracks determine no attitude.
    """
    begin = clock.perf_counter()
    refuse_forces(options, "score")
    if options.trajectory not in (None, "fixed"):
        raise InputError(f"trajectory is {options.trajectory!r}, expected fixed: score finds a centre that is at rest")
    tracks.refuse_singular()
    ground = _RestFrame.of(orbit if options.trajectory is None else None, tracks.time)
    position = ground.vectors(tracks.position)
    inliers = screen(
        position, tracks.seen, None if tracks.covariance is None else ground.covariances(tracks.covariance)
    )
    registered = find_bodies(position, inliers, tracks.time)
    fit = solve_score(registered)
    bodies = [
        replace(body, points=body.points + offset) for body, offset in zip(registered.bodies, fit.offsets, strict=True)
    ]
    origin = np.tile(fit.centre, (len(position), 1))
    observations = Observations(np.where(inliers[:, :, None], position, 0.0), inliers.astype(np.float64))
    lasting = frames_per_error(bodies, observations, origin)
    drift = _drift(registered, tracks.time) if options.trajectory is None else None
    of_offsets, of_centre = _covariances(registered, inliers, fit, len(position), lasting, drift)
    clusters = tuple(
        cluster_of(body, body.points, own, tracks.labels) for body, own in zip(bodies, of_offsets, strict=True)
    )
    covariance = ground.covariance(of_centre)
    weight = _weights(tracks.seen, inliers, bodies)
    residuals = ground.vectors_in_C(residuals_of(position, bodies, origin))
    used, rejected = weight > 0, rejected_by(weight)
    kept = residuals[used & ~rejected]
    return Estimate(
        time=tracks.time,
        labels=tracks.labels,
        position=ground.at_rest(fit.centre),
        covariance=covariance,
        motion=Motion(velocity=ground.velocity(fit.centre)),
        observability=observability_of(clusters, covariance),
        clusters=clusters,
        noise=Noise(None, float(np.sqrt(np.mean(kept**2))) if kept.size else np.nan, lasting=lasting),
        residuals=residuals,
        used=used,
        rejected=rejected,
        covered=covered_by(clusters, len(tracks.time)),
        converged=True,
        rounds=1,
        findings=_findings(registered, inliers, tracks.time, fit, ground.path, lasting),
        method="score",
        path=ground.path,
        options=options,
        details=ScoreDetails(float(np.sqrt(fit.variance))),
        wall_time=clock.perf_counter() - begin,
    )


def solve_score(registered: Registered, functions: FloatArray | None = None) -> Fit:
    """The least-squares solution for the registered bodies, by the normal equations of (d, v_l).

    functions: of time, (n, q), at all times of the tracks, of which the first is 1; that one alone by default. The
    others' coefficients have a prior about zero, of the deviation of one frame's residual.
    """
    bodies, origins = registered.bodies, registered.origins
    j, q = len(bodies), 1 if functions is None else functions.shape[1]
    matrix, rhs = np.zeros((3 * j + 3 * q, 3 * j + 3 * q)), np.zeros(3 * j + 3 * q)
    centre = slice(3 * j, None)
    basis = [np.ones((len(body.frames), 1)) if functions is None else functions[body.frames] for body in bodies]
    for index, (body, origin, b) in enumerate(zip(bodies, origins, basis, strict=True)):
        own, R = slice(3 * index, 3 * index + 3), body.attitude
        turned = np.einsum("kl,kij->lij", b, R, optimize=True).reshape(-1, 3)
        matrix[own, own] = len(R) * np.eye(3)
        matrix[own, centre], matrix[centre, own] = turned.T, turned
        matrix[centre, centre] += np.kron(b.T @ b, np.eye(3))
        rhs[own] = np.einsum("kij,ki->j", R, origin)
        rhs[centre] += (b.T @ origin).ravel()
    matrix[3 * j + 3 :, 3 * j + 3 :] += np.eye(3 * q - 3)
    inverse, null_space = inverse_and_null_space(matrix)
    found = inverse @ rhs
    centres, offsets = found[centre].reshape(-1, 3), found[: 3 * j].reshape(-1, 3)
    squares = sum(
        float(np.sum((origin - b @ centres - body.attitude @ offset) ** 2))
        for body, origin, b, offset in zip(bodies, origins, basis, offsets, strict=True)
    )
    values = 3 * sum(len(body.frames) for body in bodies)
    variance = squares / max(values - len(found), 1)
    return Fit(centres, offsets, inverse, variance, null_space)


def _covariances(
    registered: Registered, inliers: BoolArray, fit: Fit, frames: int, lasting: float, drift: FloatArray | None
) -> tuple[FloatArray, FloatArray]:
    """The covariances (j, 3, 3) of d and (n, 3, 3) of v in n frames, m².

    With the motion by functions of time, drift (n, q), that the residuals show, or do not exclude; None: v is at rest.
    lasting: how many frames have the same errors of the features.
    """
    count, joint = len(registered.bodies), _joint_covariance(registered, inliers, fit, lasting)
    of_offsets, of_centre = _of_offsets(joint, count), _of_centre(joint, np.ones((frames, 1)))
    if drift is None:
        return of_offsets, of_centre
    free = solve_score(registered, drift)
    joint = _joint_covariance(registered, inliers, free, lasting)
    away, apart = drift @ free.centres - fit.centre, free.offsets - fit.offsets
    return (
        _greater(of_offsets, _of_offsets(joint, count) + apart[:, :, None] * apart[:, None, :]),
        _greater(of_centre, _of_centre(joint, drift) + away[:, :, None] * away[:, None, :]),
    )


def _joint_covariance(registered: Registered, inliers: BoolArray, fit: Fit, lasting: float) -> FloatArray:
    """The covariance (3 j + 3 q, 3 j + 3 q) of (d, v_l), m²; along what nothing tells, the deviation is the distance.

    lasting: how many frames have the same errors of the features, and count as one.
    """
    distance, variance = float(np.linalg.norm(fit.centre)), lasting * fit.variance
    least = variance / max(distance, 1e-300) ** 2
    first, spurious = 3 * len(registered.bodies), _spurious_information(registered, inliers)
    parts = fit.inverse[:first, :first], fit.inverse[:first, first:]
    more = np.sqrt(variance) * np.concatenate(spurious_information_columns(*parts, spurious, least))
    lacking = np.concatenate(attenuated_columns(fit.offsets.ravel(), *parts, spurious, least))
    unseen = fit.unseen * distance / np.linalg.norm(fit.unseen[first : first + 3], axis=0)
    columns = np.concatenate([more, lacking, unseen], axis=1)
    return np.asarray(variance * fit.inverse + columns @ columns.T)


def _of_offsets(joint: FloatArray, bodies: int) -> FloatArray:
    """The covariances (j, 3, 3) of d, from that of (d, v_l)."""
    return np.array([joint[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] for k in range(bodies)])


def _of_centre(joint: FloatArray, functions: FloatArray) -> FloatArray:
    """The covariances (n, 3, 3) of v, from that of (d, v_l), for the functions of time (n, q)."""
    size = 3 * functions.shape[1]
    own = joint[-size:, -size:].reshape(-1, 3, size // 3, 3)
    return np.asarray(np.einsum("nl,limj,nm->nij", functions, own, functions, optimize=True))


def _greater(one: FloatArray, other: FloatArray) -> FloatArray:
    """Covariances (n, 3, 3) that are no less than either along the axes of the one."""
    values, axes = np.linalg.eigh(one)
    along = np.einsum("nia,nij,nja->na", axes, other, axes)
    added = np.maximum(along - values, 0.0)
    return np.asarray(one + (axes * added[:, None]) @ np.swapaxes(axes, 1, 2))


def _drift(registered: Registered, time: FloatArray) -> FloatArray:
    """1 and polynomials of time (n, DEGREE + 1), which before the first frame of a body and after the last stay."""
    frames = np.concatenate([body.frames for body in registered.bodies])
    own = np.clip(time, time[frames.min()], time[frames.max()])
    return np.asarray(chebyshev.chebvander(2 * (own - own[0]) / max(own[-1] - own[0], 1e-300) - 1, DEGREE))


def _weights(seen: BoolArray, inliers: BoolArray, bodies: list[Body]) -> FloatArray:
    """The weights (n, m) of the observations of bodies in their frames: negligible where they are no inliers."""
    weight = np.zeros(seen.shape)
    for body in bodies:
        block = body.block
        weight[block] = np.where(seen[block], np.where(inliers[block], 1.0, NEGLIGIBLE), 0.0)
    return weight


def _spurious_information(registered: Registered, inliers: BoolArray) -> SpuriousInformation:
    """The spurious information of noisy attitudes on d of all bodies.

    An error φ of an attitude with the covariance C adds φ × d to the frame, in the mean the information tr C − C on d,
    see `adjustment.spurious`.
    """
    parts = []
    for body in registered.bodies:
        of_turn = _turn_covariances(body, inliers, registered.noise).sum(axis=0)
        parts.append(SpuriousInformation.of(np.trace(of_turn) * np.eye(3) - of_turn, len(body.frames)))
    return SpuriousInformation.of_each(parts)


def _findings(
    registered: Registered, inliers: BoolArray, time: FloatArray, fit: Fit, path: str, lasting: float
) -> tuple[Finding, ...]:
    """What tells that the centre moves: residuals with a trend, or else too large ones, unless they are rounding; or
    that there are too few frames to tell.
    """
    frames, unknowns = sum(len(body.frames) for body in registered.bodies), 3.0 * (DEGREE + 1 + len(fit.offsets))
    if 2 * frames / lasting < unknowns:
        return (FewFrames(frames, unknowns, lasting),)
    trend = _lack_of_fit(registered, time, fit, path, lasting)
    if trend is not None:
        return (trend,)
    excess = _excess_residuals(registered, inliers, fit, path) if fit.variance > _rounding(fit) else None
    return () if excess is None else (excess,)


def _rounding(fit: Fit) -> float:
    """The variance of residuals that are rounding, m²."""
    return (ROUNDING * float(np.abs(fit.centre).max())) ** 2


def _lack_of_fit(registered: Registered, time: FloatArray, fit: Fit, path: str, lasting: float) -> LackOfFit | None:
    """A finding if a polynomial of time explains more of the residuals c_k + R_k u − v than noise does.

    lasting: how many frames have the same errors of the features.
    """
    frames = np.concatenate([body.frames for body in registered.bodies])
    residual = np.concatenate(
        [
            origin - fit.centre - body.attitude @ offset
            for body, origin, offset in zip(registered.bodies, registered.origins, fit.offsets, strict=True)
        ]
    )
    powers = _drift(registered, time)[frames]
    basis = np.linalg.qr(powers - powers.mean(axis=0))[0][:, 1:]
    explained = basis @ (basis.T @ residual)
    values = residual.size - 3 * (DEGREE + 1) - 3 * len(fit.offsets)
    variance = max(float(np.sum((residual - explained) ** 2)) / values, _rounding(fit))
    gain, dof = float(np.sum(explained**2)) / (lasting * variance), 3 * DEGREE
    if fdtrc(dof, values / lasting, gain / dof) > SIGNIFICANCE:
        return None
    return LackOfFit(path, float(np.sqrt(np.mean(np.sum(explained**2, axis=1)))), gain, dof)


def _turn_covariances(body: Body, inliers: BoolArray, noise: float) -> FloatArray:
    """The covariances (n, 3, 3) of the body's attitudes in its axes, rad², for a standard deviation of a coordinate."""
    weight = inliers[body.block].astype(np.float64)
    return attitude_covariances(turn_information(weight, cross_matrices(body.points)), noise**2)


def _excess_residuals(registered: Registered, inliers: BoolArray, fit: Fit, path: str) -> ExcessResiduals | None:
    """A finding if the residuals' variance is greater than that of centroids and attitudes from the registration."""
    expected, values = 0.0, -3 * len(fit.offsets) - 3
    for body, offset in zip(registered.bodies, fit.offsets, strict=True):
        arm = cross_matrices(offset[None])[0]
        of_turn = np.einsum("ij,kjl,il->k", arm, _turn_covariances(body, inliers, registered.noise), arm)
        of_centroid = 3 * registered.noise**2 / inliers[body.block].sum(axis=1)
        expected += float(np.sum(of_turn + of_centroid))
        values += 3 * len(body.frames)
    ratio = fit.variance * values / max(expected, 1e-300)
    if ratio <= max(MAX_VARIANCE_RATIO, float(chdtri(values, SIGNIFICANCE)) / values) or registered.noise == 0:
        return None
    return ExcessResiduals(path, float(np.sqrt(ratio)))

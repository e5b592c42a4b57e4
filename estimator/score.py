"""score: the symmetrical centre of rotation estimation of Ehrig, Taylor, Duda and Heller (J. Biomech. 39, 2006).

Between two moving bodies, the joint's centre is at rest in both: R_k u + c_k = S_k v + e_k in all frames. Here one of
the two is the ground: the target's bodies are posed by registration, and v is one point for all of them,
    c_k + R_k u = v,
by unweighted least squares. It holds for a centre of mass at rest, and for nothing else: a baseline. With an orbit the
ground is the target's LVLH frame, in which a chaser on V-bar is at rest, and without one frame C.
"""

import time as clock

import numpy as np

from baryscope.estimator.adjustment.diagnostics import Cluster, assessed
from baryscope.estimator.adjustment.reweighting import NEGLIGIBLE
from baryscope.estimator.geometry.symmetric import symmetric_pseudo_inverse
from baryscope.estimator.options import PathOptions
from baryscope.estimator.registration.clusters import PosedBody, find_bodies
from baryscope.estimator.registration.screening import screen
from baryscope.estimator.result import Estimate
from baryscope.estimator.tracks import FeatureTracks, FloatArray
from baryscope.models.errors import InputError
from baryscope.models.lvlh import lvlh_attitude
from baryscope.models.orbit import Orbit


def estimate_by_score(tracks: FeatureTracks, orbit: Orbit | None, options: PathOptions) -> Estimate:
    """The centre of mass as the fixed centre of rotation, in LVLH where an orbit is given and `fixed` is not asked for.

    The covariance is that of the least squares, whose noise is what is left over: of c_k + R_k u − v, per coordinate,
    which is also the diagnostics' `residual_rms`, and not the noise of an observation. Where the centre moves it is
    wrong.

    Raises:
        InputError: a trajectory other than `fixed`.
        ComputationError: the tracks show no attitude.
    """
    begin = clock.perf_counter()
    if options.trajectory not in (None, "fixed"):
        raise InputError(f"trajectory is {options.trajectory!r}, expected fixed: score finds a centre that is at rest")
    in_orbit = orbit is not None and options.trajectory is None
    R_C_W = lvlh_attitude(orbit, tracks.time) if orbit is not None and in_orbit else np.eye(3)[None]
    position = tracks.position @ R_C_W
    inliers = screen(position, tracks.seen)
    posed, _ = find_bodies(position, inliers)
    centre, offsets, covariance, variance = solve_score(posed)
    each = np.ones((len(tracks.time), 1))
    weights = np.zeros(tracks.seen.shape)
    clusters = []
    for index, (one, offset) in enumerate(zip(posed, offsets, strict=True)):
        own, body = slice(3 * index, 3 * index + 3), one.body
        block = np.ix_(body.frames, body.features)
        weights[block] = np.where(tracks.seen[block], np.where(inliers[block], 1.0, NEGLIGIBLE), 0.0)
        clusters.append(
            Cluster(body.features, body.frames, one.intervals, body.points + offset, variance * covariance[own, own])
        )
    return assessed(
        "score",
        tracks,
        "fixed in LVLH" if in_orbit else "fixed",
        each * (R_C_W @ centre),
        each[:, :, None] * (variance * R_C_W @ covariance[-3:, -3:] @ np.swapaxes(R_C_W, 1, 2)),
        clusters,
        weights=weights,
        variance=variance,
        options=options,
        begin=begin,
        extra={},
    )


def solve_score(posed: tuple[PosedBody, ...]) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """The least squares of c_k = v + R_k d, d = −u, over all bodies at once.

    Returns:
        v (3,) and d (j, 3), each body's in its axes, m; the inverse (3 j + 3, 3 j + 3) of the normal equations of
        (d, v), zero where undetermined; and the variance of a coordinate that is left over, m².
    """
    j = len(posed)
    matrix, rhs = np.zeros((3 * j + 3, 3 * j + 3)), np.zeros(3 * j + 3)
    for index, one in enumerate(posed):
        own, R = slice(3 * index, 3 * index + 3), one.body.attitude
        turned = R.sum(axis=0)
        matrix[own, own] = len(R) * np.eye(3)
        matrix[own, -3:], matrix[-3:, own] = turned.T, turned
        matrix[-3:, -3:] += len(R) * np.eye(3)
        rhs[own] = np.einsum("kij,ki->j", R, one.translation)
        rhs[-3:] += one.translation.sum(axis=0)
    inverse = symmetric_pseudo_inverse(matrix)
    found = inverse @ rhs
    centre, offsets = found[-3:], found[:-3].reshape(-1, 3)
    squares = sum(
        float(np.sum((one.translation - centre - one.body.attitude @ offset) ** 2))
        for one, offset in zip(posed, offsets, strict=True)
    )
    values = 3 * sum(len(one.body.frames) for one in posed)
    return centre, offsets, inverse, squares / max(values - len(found), 1)

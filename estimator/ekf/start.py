"""The reference motion that the first pass of `ekf` is linearised about, from a registration of all frames.

If there is a solution of `pivot`, the registered attitudes are refined by it first.

A free tumble is fitted to the registered attitudes, as in `ml`. Where it does not follow them, it is turned to them:
by the mean rotation between nearby frames' registered and fitted attitudes.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.reweighting import NEGLIGIBLE
from baryscope.estimator.adjustment.weighted_registration import with_covariances
from baryscope.estimator.dynamics.rotation import Rotation, too_long
from baryscope.estimator.ekf.linearised import Nodes
from baryscope.estimator.geometry.extent import rms_radius
from baryscope.estimator.geometry.so3 import exp_rotation, log_rotation
from baryscope.estimator.ml.initial_tumble import EXPLAINED, Tumble, fit_tumbles
from baryscope.estimator.ml.maximum import MaximumAPosteriori
from baryscope.estimator.ml.search import UNDECIDED, are_alike
from baryscope.estimator.pivot.pivot_solution import PivotSolution
from baryscope.estimator.registration.body import Body
from baryscope.estimator.registration.clusters import Registered, find_bodies
from baryscope.estimator.registration.screening import screen
from baryscope.estimator.tracks import FeatureTracks, FloatArray
from baryscope.models.errors import ComputationError, Reason
from baryscope.models.orbit import Orbit
from baryscope.models.words import counted

MIN_FRAMES = 4  # with an attitude
NODE_ANGLE = 0.3  # rad that the target turns between nodes
MAX_NODES, NODES_PER_FRAME = 10_000, 4  # more would take minutes


@dataclass(frozen=True, eq=False)
class Start:
    """The initial motion.

    nodes; rotation: the fitted tumble, and whether it explains the attitudes; attitude (n, 3, 3) R_C_B and rate (n, 3),
    rad/s in B, at the nodes; points (m, 3) in B, m; centroid (3,): the mean of the features' centroids in C, m; radius
    of the features, m; noise: standard deviation of a coordinate from the registration, m; weight (frames, m) of the
    observations; rival: see there.
    """

    nodes: Nodes
    rotation: Rotation
    explained: bool
    attitude: FloatArray
    rate: FloatArray
    points: FloatArray
    centroid: FloatArray
    radius: float
    noise: float
    weight: FloatArray
    rival: "Rival | None" = None


@dataclass(frozen=True, eq=False)
class Rival:
    """The start with the other one of two gravity gradients, where attitudes do not tell which acts.

    excess: −2 ln of its odds by these; alike: whether its rate and inertia are the same, so that it explains the tracks
    as well.
    """

    start: Start
    excess: float
    alike: bool


def starts(
    tracks: FeatureTracks,
    measured: Observations,
    solved: PivotSolution | None,
    torques: tuple[Orbit | None, ...],
) -> Iterator[Start]:
    """Initial motions, each for when the one before leads nowhere.

    The gravity gradient is that of the one of `torques` that fits best. measured: all observations; solved: the
    solution of `pivot` to start from, unless it leads nowhere.

    Raises:
        ComputationError: the tracks determine no attitude or no rate, or the target turns too often.
    """
    inliers = screen(tracks.position, tracks.seen, tracks.covariance)
    right = measured.weighted(np.where(inliers, 1.0, 0.0))
    registered, right = with_covariances(find_bodies(tracks.position, inliers, tracks.time), right)
    frames = sum(len(body.frames) for body in registered.bodies)
    if frames < MIN_FRAMES:
        raise ComputationError(
            f"attitudes are seen in {counted(frames, 'frame')}, {MIN_FRAMES} are needed for a rate",
            Reason.TOO_FEW_FRAMES,
        )
    refined = None if solved is None else _refined(tracks, registered, solved, torques)
    if refined is not None:
        yield _start(tracks, *refined)
    variance = _noise(registered) ** 2 / unit_of(tracks)
    tumbles = fit_tumbles(registered.bodies, right, variance, tracks.time, torques)
    yield _start(tracks, tumbles, registered, right)


def _start(
    tracks: FeatureTracks, tumbles: tuple[Tumble, ...], registered: Registered, observations: Observations
) -> Start:
    """The start at the likeliest of tumbles, and at the other one, if attitudes do not tell them apart."""
    found = _start_at(tracks, tumbles[0], registered, observations)
    if len(tumbles) < 2 or not found.explained or (excess := tumbles[1].excess - tumbles[0].excess) > UNDECIDED:
        return found
    if are_alike(*tumbles):
        other = replace(found, rotation=replace(found.rotation, orbit=tumbles[1].rotation.orbit))
        return replace(found, rival=Rival(other, excess, alike=True))
    other = _start_at(tracks, tumbles[1], registered, observations)
    return replace(found, rival=Rival(other, excess, alike=False))


def _start_at(tracks: FeatureTracks, tumble: Tumble, registered: Registered, observations: Observations) -> Start:
    """The start at the nodes of a tumble, with the registered points about the mean of the bodies' centroids in C."""
    nodes = _nodes(tumble.rotation, tracks.time)
    attitude, rate = _followed(tumble, registered.bodies, nodes)
    origins = np.concatenate(registered.origins)
    centroid = origins.mean(axis=0)
    return Start(
        nodes=nodes,
        rotation=tumble.rotation,
        explained=tumble.median_ratio < EXPLAINED,
        attitude=attitude,
        rate=rate,
        points=_points(tumble, registered, attitude[nodes.frames], centroid, tracks.seen.shape[1]),
        centroid=centroid,
        radius=_radius(registered),
        noise=_noise(registered),
        weight=np.where(tracks.seen, np.maximum(observations.weight, NEGLIGIBLE), 0.0),
    )


def start_of(tracks: FeatureTracks, best: MaximumAPosteriori) -> Start:
    """The start at the likeliest tumble, with its points and weights."""
    nodes, points = _nodes(best.rotation, tracks.time), best.seen_points
    found = best.rotation.at(nodes.time)
    attitude, origin = found.attitude[nodes.frames], best.sampled.position(best.x)
    seen = (best.observations.weight > NEGLIGIBLE).any(axis=0)
    middle = points[seen].mean(axis=0)
    centroid = (origin + attitude @ middle).mean(axis=0)
    return Start(
        nodes=nodes,
        rotation=best.rotation,
        explained=True,
        attitude=found.attitude,
        rate=found.rate,
        points=points + np.einsum("kij,ki->j", attitude, origin - centroid) / len(attitude),
        centroid=centroid,
        radius=rms_radius(points[seen]),
        noise=float(np.sqrt(best.residual_variance * unit_of(tracks))),
        weight=best.observations.weight,
    )


def _radius(registered: Registered) -> float:
    """The greatest rms distance of a body's points from their centroid, m."""
    return max(float(np.sqrt(np.mean(np.sum(body.points**2, axis=1)))) for body in registered.bodies)


def _noise(registered: Registered) -> float:
    return max(registered.noise, 1e-5 * _radius(registered))


def _refined(
    tracks: FeatureTracks,
    registered: Registered,
    found: PivotSolution,
    torques: tuple[Orbit | None, ...],
) -> tuple[tuple[Tumble, ...], Registered, Observations] | None:
    """The tumbles of attitudes of weighted least squares, by `pivot`, the likeliest first, the bodies, and observations
    with its weights.

    None if the likeliest does not explain them.
    """
    noise = found.frame_variance
    try:
        tumbles = fit_tumbles(found.bodies, found.observations, noise, tracks.time, torques, found.shifts)
    except ComputationError:
        return None
    if tumbles[0].median_ratio >= EXPLAINED:
        return None
    origin, centroids = found.sampled.position(found.solution.x), [body.points.mean(axis=0) for body in found.bodies]
    pairs = list(zip(found.bodies, centroids, strict=True))
    bodies = tuple(replace(body, points=body.points - centroid) for body, centroid in pairs)
    origins = tuple(origin[body.frames] + body.attitude @ centroid for body, centroid in pairs)
    return tumbles, replace(registered, bodies=bodies, origins=origins), found.observations


def unit_of(tracks: FeatureTracks) -> float:
    """The variance of a coordinate, m², of a typical observation of weight 1."""
    covariance = tracks.covariance
    return 1.0 if covariance is None else float(np.median(np.trace(covariance[tracks.seen].T)) / 3)


def _nodes(rotation: Rotation, time: FloatArray) -> Nodes:
    """Nodes between which the target turns by at most NODE_ANGLE."""
    speed = float(np.linalg.norm(rotation.rate))
    if speed * float(time[-1] - time[0]) > NODE_ANGLE * (MAX_NODES + NODES_PER_FRAME * len(time)):
        raise too_long(speed, float(time[-1] - time[0]))
    return Nodes.between(time, NODE_ANGLE / max(speed, 1e-9))


def _followed(tumble: Tumble, bodies: tuple[Body, ...], nodes: Nodes) -> tuple[FloatArray, FloatArray]:
    """Attitude (n, 3, 3) and rate (n, 3) at the nodes: the fitted ones, turned to the registered if needed."""
    found = tumble.rotation.at(nodes.time)
    if tumble.median_ratio < EXPLAINED:
        return found.attitude, found.rate
    frames = np.concatenate([body.frames for body in bodies])
    registered = np.concatenate([body.attitude @ R.T for body, R in zip(bodies, tumble.bodies, strict=True)])
    order = np.argsort(frames, kind="stable")
    at = nodes.frames[frames[order]]
    turn = log_rotation(np.swapaxes(found.attitude[at], 1, 2) @ registered[order])
    spread = np.stack([np.interp(nodes.time, nodes.time[at], values) for values in turn.T], axis=1)
    attitude = found.attitude @ exp_rotation(spread)
    return attitude, _rates(attitude, nodes.time)


def _rates(attitude: FloatArray, time: FloatArray) -> FloatArray:
    """The rate (n, 3) in B, rad/s, between neighbours of each node."""
    step = log_rotation(np.swapaxes(attitude[:-1], 1, 2) @ attitude[1:])
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(step, axis=0)])
    before, after = np.maximum(np.arange(len(time)) - 1, 0), np.minimum(np.arange(len(time)) + 1, len(time) - 1)
    return np.asarray((total[after] - total[before]) / (time[after] - time[before])[:, None])


def _points(
    tumble: Tumble, registered: Registered, attitude: FloatArray, centroid: FloatArray, count: int
) -> FloatArray:
    """The points (count, 3) in B, m, for a path at rest in the mean centroid; those of the body seen most often."""
    points = np.zeros((count, 3))
    parts = sorted(
        zip(registered.bodies, registered.origins, tumble.bodies, strict=True), key=lambda part: len(part[1])
    )
    for body, origin, R_B_S in parts:
        offset = np.einsum("kij,ki->j", attitude[body.frames], origin - centroid) / len(body.frames)
        points[body.features] = body.points @ R_B_S.T + offset
    return points

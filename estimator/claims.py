"""What a result may claim: a path that departs from its model is named, and what does not fit is widened.

Where a model does not fit, the residuals are not those of noise, and the covariance, which takes them for it, is too
small. It is widened by what the misfit shows: by the variance of the residuals over the given one, and by the misfit
itself, as a shift of every coordinate that lasts. Its speed is that of a wave as long as the tracks.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.diagnostics import observability_of, with_attitude
from baryscope.estimator.distances import contradict
from baryscope.estimator.findings import (
    ContradictedPath,
    Departure,
    DisagreeingClusters,
    ExcessResiduals,
    Extrapolated,
    FramesLeftOut,
    LackOfFit,
    UnknownBurn,
    WrongSigma,
)
from baryscope.estimator.geometry.alignment import FEWEST_POINTS
from baryscope.estimator.geometry.symmetric import factor_of
from baryscope.estimator.prediction import PredictedBody, PredictedPath
from baryscope.estimator.registration.intervals import runs_of
from baryscope.estimator.result import Cluster, Estimate, Motion, Status
from baryscope.estimator.tracks import FeatureTracks, errors_of
from baryscope.estimator.widening import BurnsBeyond, UncheckedLaw, Widening

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

SMOOTH = "polynomial"  # the path that has no model to depart from
FAR = 3.0  # standard deviation beyond the frames with an attitude over the greatest among them
LEAST_SHARE = 0.01  # of all frames, successive ones without a used observation
SIGNIFICANCE = 1e-7  # probability by chance, below which a departure is named
BY_CHANCE = 1e-3  # probability of so many successive frames that are left out


def claimed(result: Estimate, tracks: FeatureTracks) -> Estimate:
    """The result with its departure, extrapolation and frames left out named, and as wide as its misfits show."""
    named = replace(result, findings=result.findings + _departure(result) + _left_out(result))
    named = _with_unchecked_law(_with_burns_beyond(named), tracks)
    return widened(named, _widening(named)) if named.status is Status.MODEL_DOES_NOT_FIT else named


def _departure(result: Estimate) -> tuple[Departure, ...]:
    """A remark if the process noise on a path with a model is no chance."""
    noise = result.process_noise
    if noise is None or noise.displacement is None or noise.significance is None or result.path == SMOOTH:
        return ()
    if noise.by_chance >= SIGNIFICANCE:
        return ()
    return (Departure(result.path, noise.displacement, noise.density, noise.significance),)


def _left_out(result: Estimate) -> tuple[FramesLeftOut, ...]:
    """The longest run of frames of which all observations are rejected, if it is no chance.

    Frames that are left out one by one, as often as those outside the run, make one as long somewhere among n frames
    with a probability of n times the share to its power, at most.
    """
    known = result.used & np.isfinite(result.residuals[..., 0])
    shown = np.flatnonzero(known.sum(axis=1) >= FEWEST_POINTS)
    out = np.asarray((result.rejected | ~known)[shown].all(axis=1))
    first, stop = max(runs_of(out).tolist(), key=lambda run: run[1] - run[0], default=(0, 0))
    run = stop - first
    others = (out.sum() - run + 1) / (len(out) - run + 1)  # share of the other frames left out, as if of one more
    if run < LEAST_SHARE * len(out) or run < 2 or len(out) * others**run > BY_CHANCE:
        return ()
    frames = shown[first:stop]
    shift = np.linalg.norm(np.nanmean(result.residuals[frames], axis=1), axis=1)
    begin, end = result.time[frames[[0, -1]]]
    return (FramesLeftOut(float(begin), float(end), int(run), float(np.median(shift))),)


def _with_unchecked_law(result: Estimate, tracks: FeatureTracks) -> Estimate:
    """The result with a finding if a path is extrapolated where features contradict it, or so far that its law claims
    more than the tracks, and wider there.

    The law of a smooth path is what this shows where it is seen. Whether it holds beyond, as on an ellipse that nears
    its periapsis, nothing tells but an orbit; and not even that where forces are at work that it does not have.
    """
    seen = with_attitude(result.used & ~result.rejected)
    if result.covariance is None or not len(seen):
        return result
    begin, end = result.time[seen[[0, -1]]].tolist()
    if any(_contradicted(result, tracks, side) for side in (result.time < begin, result.time > end)):
        return replace(result, findings=(*result.findings, ContradictedPath(begin, end)))
    lawful = result.path != SMOOTH and not any(isinstance(one, Departure | UnknownBurn) for one in result.findings)
    if lawful or result.observability is None:
        return result
    told = int(result.observability.observable.sum())
    variance = np.linalg.eigvalsh(result.covariance)[:, :told].sum(axis=1)
    within = float(variance[seen[0] : seen[-1] + 1].max())
    if variance.max() <= FAR**2 * within:
        return result
    law, motion = UncheckedLaw(begin, end, told, within), result.motion
    factor = law.factor(result.time, result.covariance)[:, None, None]
    if motion.velocity_covariance is not None:
        motion = replace(motion, velocity_covariance=factor * motion.velocity_covariance)
    return replace(
        result,
        findings=(*result.findings, Extrapolated(begin, end)),
        covariance=factor * result.covariance,
        motion=motion,
        widening=result.widening.then(Widening(law=law)),
    )


def _contradicted(result: Estimate, tracks: FeatureTracks, beyond: BoolArray) -> bool:
    """Whether features contradict the path in some frames (n,) without an attitude."""
    path = result.predictor.path if isinstance(result.predictor, PredictedBody) else result.predictor
    frames = np.flatnonzero(beyond & tracks.seen.any(axis=1))
    if not isinstance(path, PredictedPath) or not len(frames):
        return False
    origin, camera = result.position, errors_of(tracks)
    arm = tracks.position[frames] - origin[frames, None]
    variance = np.full(arm.shape[:2], result.noise.a_posteriori**2)
    if tracks.covariance is not None:
        along = arm / np.linalg.norm(arm, axis=2, keepdims=True)
        variance *= np.einsum("kmi,kmij,kmj->km", along, tracks.covariance[frames], along)
    errors = path.sampled(result.time[frames])[1][:, :3] @ factor_of(path.covariance)
    if camera is not None:
        errors = np.concatenate([errors, (camera.shifts(origin) * camera.deviations)[frames]], axis=2)
        variance += np.trace(camera.shift_covariance(origin), axis1=1, axis2=2)[frames, None]
    outliers = (result.rejected.sum() + 1) / (result.used.sum() + 2)
    return contradict(arm, result.noise.lasting * variance, errors, float(outliers))


def _with_burns_beyond(result: Estimate) -> Estimate:
    """The result with burns in its covariance before and after the frames with an attitude, if it has found any.

    A chaser that burns where it is seen may burn where it is not.
    """
    changes = [finding.change for finding in result.findings if isinstance(finding, UnknownBurn)]
    seen = with_attitude(result.used & ~result.rejected)
    if not changes or result.covariance is None or len(seen) < 2:
        return result
    begin, end = result.time[seen[[0, -1]]].tolist()
    burns = BurnsBeyond(begin, end, len(changes) / (end - begin), float(np.sum(np.square(changes))) / len(changes))
    added, motion = burns.covariance(result.time), result.motion
    velocity = motion.velocity_covariance
    if velocity is not None:
        motion = replace(motion, velocity_covariance=velocity + added[:, 3:, 3:])
    by = result.widening.then(Widening(burns=burns))
    return replace(result, covariance=result.covariance + added[:, :3, :3], motion=motion, widening=by)


def _widening(result: Estimate) -> Widening:
    """What the misfits of an estimate show that its covariance leaves out.

    The factor is the residuals' variance over the given one, unless that is named as wrong, or by how much clusters
    disagree, if that is more. Residuals that a model makes greater by a ratio have 1 − ratio⁻² of their mean square
    from its misfit; of a displacement the variance along each axis is a third of the square. The speed is that of a
    wave of one period over the tracks.
    """
    noise, variance = result.noise, 0.0
    told = None if any(isinstance(one, WrongSigma) for one in result.findings) else noise.a_priori
    factor = 1.0 if told is None else max((noise.a_posteriori / told) ** 2, 1.0)
    seen = np.isfinite(result.residuals[..., 0]) & ~result.rejected
    mean_square = float(np.mean(result.residuals[seen] ** 2)) if seen.any() else 0.0
    for finding in result.findings:
        match finding:
            case ExcessResiduals():
                variance += mean_square * max(1 - finding.ratio**-2, 0.0)
            case DisagreeingClusters():
                factor = max(factor, finding.ratio**2)
            case LackOfFit() | FramesLeftOut():
                variance += finding.magnitude**2 / 3
    span = float(result.time[-1] - result.time[0])
    return Widening(factor, variance, variance * (2 * np.pi / span) ** 2 if span > 0 else 0.0)


def widened(result: Estimate, by: Widening) -> Estimate:
    """The result with covariances that are wider by so much, if it has any."""
    if result.covariance is None or result.observability is None:
        return result
    clusters = tuple(_widened_cluster(cluster, by) for cluster in result.clusters)
    return with_wider(result, by.of_position(result.covariance), clusters, _widened_motion(result.motion, by), by)


def with_wider(
    result: Estimate, covariance: FloatArray, clusters: tuple[Cluster, ...], motion: Motion, by: Widening
) -> Estimate:
    """The result with wider covariances: of the path (n, 3, 3), of clusters and of the motion, and of predictions."""
    return replace(
        result,
        covariance=covariance,
        clusters=clusters,
        observability=observability_of(clusters, covariance),
        motion=motion,
        widening=result.widening.then(by),
    )


def _widened_cluster(cluster: Cluster, by: Widening) -> Cluster:
    known = cluster.covariance
    return cluster if known is None else replace(cluster, covariance=by.of_position(known))


def _widened_motion(motion: Motion, by: Widening) -> Motion:
    """Attitude and rate by the factor only: what the misfit does to them, its size does not tell."""
    velocity, attitude, rate = motion.velocity_covariance, motion.attitude_covariance, motion.angular_rate_covariance
    return replace(
        motion,
        velocity_covariance=None if velocity is None else by.of_velocity(velocity),
        attitude_covariance=None if attitude is None else by.factor * attitude,
        angular_rate_covariance=None if rate is None else by.factor * rate,
    )

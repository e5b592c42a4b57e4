"""The report of an estimate from own tracks: nobody knows the truth."""

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.details import TumbleDetails
from baryscope.estimator.options import PathOptions
from baryscope.estimator.result import Estimate
from baryscope.estimator.thrust import KnownAcceleration
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.orbit import Orbit
from baryscope.models.words import counted
from baryscope.report.document import Part, Report
from baryscope.report.estimates import coverage, deviation_chart, parts_of, path_chart, verdict_of
from baryscope.report.gaps import blackouts
from baryscope.report.online import course_chart, online_course
from baryscope.report.orbits import UP_TO_A_TURN, found_orbit
from baryscope.report.scene import Body, Shown, scene_of

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

COLOUR = 5


def report_of_estimate(
    result: Estimate, tracks: FeatureTracks, orbit: Orbit | None, name: str, predicted: Part | None = None
) -> Report:
    """The report of an estimate of tracks.

    Args:
        result: the estimate, of these tracks.
        tracks: what it was made from, in C.
        orbit: of the target, if it is known; the scene then has LVLH axes, as where the tracks tell the orbit.
        name: of the tracks, for the title.
        predicted: what is shown of a prediction, as by `prediction_chart`.
    """
    shades = blackouts(tracks.time, tracks.seen)
    shaded = {"shades": shades, "shade": "nothing seen"}
    parts: list[Part] = [scene_of_estimate(result, tracks, orbit), path_chart(result, **shaded)]
    deviations = deviation_chart(result, **shaded)
    if deviations is not None:
        parts.append(deviations)
    if predicted is not None:
        parts.append(predicted)
    course = online_course(tracks, orbit, _sigma(result), _thrust(result))
    if not isinstance(course, str):
        about = (
            f"How far what the online estimator knows after each frame, of the frames so far, is from the path by "
            f"{result.method}, which sees all; the band is where 95 % of its errors should be by its covariance."
        )
        parts.append(course_chart(course, result.position, f"the path by {result.method}", about=about, **shaded))
    rejected = in_tracks(result.rejected, result.labels, tracks)
    parts.append(coverage(tracks.time, tracks.labels, tracks.seen, rejected))
    return Report(
        f"Centre of mass from {name}",
        f"{counted(len(tracks.time), 'frame')} over {tracks.time[-1] - tracks.time[0]:.6g} s, "
        f"{counted(len(tracks.labels), 'feature')}, by {result.method}"
        + ("" if tracks.epoch is None else f"; time 0 is {tracks.epoch}"),
        result.version,
        (*parts, *parts_of(result, shades)),
        verdict_of(result),
        notes=(f"There is no online estimate: {course}.",) if isinstance(course, str) else (),
    )


def _sigma(result: Estimate) -> float:
    """The deviation of a coordinate in m that the online estimator is told; of no account beside covariances."""
    noise = result.noise
    return noise.a_posteriori if noise.a_priori is None else noise.a_priori


def _thrust(result: Estimate) -> KnownAcceleration | None:
    return result.options.acceleration if isinstance(result.options, PathOptions) else None


def scene_of_estimate(result: Estimate, tracks: FeatureTracks, orbit: Orbit | None) -> Part:
    """Features where they were measured; where they are not seen, where the estimate has them, if it does."""
    rejected = in_tracks(result.rejected, result.labels, tracks)
    body = Body(
        time=tracks.time,
        path=result.position,
        path_label=f"centre of mass by {result.method}",
        attitude=result.attitude,
        labels=tracks.labels,
        features=_filled(result, tracks),
        seen=tracks.seen,
        rejected=rejected,
        solids=_solids(result, tracks),
    )
    shown = (Shown(result.method, COLOUR, result.position, result.covariance),)
    about = "Features where they were measured, and hollow where the estimate has those that are not seen."
    told = found_orbit(result) if orbit is None else None
    return scene_of(body, shown, told or orbit, f"{about} {UP_TO_A_TURN}" if told else about)


def in_tracks(flags: BoolArray, labels: tuple[str, ...], tracks: FeatureTracks) -> BoolArray:
    """Flags (n, k) of an estimate's features for those of the tracks, (n, m); an estimate may have added features."""
    place = {label: index for index, label in enumerate(labels)}
    columns = [place.get(label, -1) for label in tracks.labels]
    padded = np.concatenate([flags, np.zeros((len(flags), 1), dtype=bool)], axis=1)
    return np.asarray(padded[:, columns])


def _solids(result: Estimate, tracks: FeatureTracks) -> tuple[FloatArray, ...] | None:
    """The features of each cluster as a solid of its own, (m, 3), where the clusters have no axes in common.

    The hull of all of them would have few faces whose corners are all known at a time.
    """
    if not result.clusters or isinstance(result.details, TumbleDetails):
        return None
    place = {label: index for index, label in enumerate(tracks.labels)}
    solids = np.full((len(result.clusters), len(tracks.labels), 3), np.nan)
    for solid, cluster in zip(solids, result.clusters, strict=True):
        for label, point in zip(cluster.labels, cluster.points, strict=True):
            if label in place:
                solid[place[label]] = point
    return tuple(solids)


def _filled(result: Estimate, tracks: FeatureTracks) -> FloatArray:
    """Measured features (n, m, 3), and estimated ones where an attitude is known and they are not seen.

    With `ml` all clusters have the same axes; else only those of the main one are those of the attitude.
    """
    found = tracks.position.copy()
    if result.attitude is None or not result.clusters:
        return found
    main = max(result.clusters, key=lambda cluster: len(cluster.frames))
    clusters = result.clusters if isinstance(result.details, TumbleDetails) else (main,)  # those with the same axes
    place = {label: index for index, label in enumerate(tracks.labels)}
    known = np.isfinite(result.attitude).all(axis=(1, 2))
    for cluster in clusters:
        for label, point in zip(cluster.labels, cluster.points - cluster.centre_of_mass, strict=True):
            column = place.get(label)
            if column is not None and np.isfinite(point).all():
                hidden = known & ~tracks.seen[:, column]
                found[hidden, column] = result.position[hidden] + result.attitude[hidden] @ point
    return found

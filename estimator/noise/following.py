"""Estimates whose noise follows time and the line of sight, of tracks without covariances.

Markers on skin are quiet while a subject stands still: with one noise for the whole recording, the motion is rejected,
but for what happens to fit. Here every frame is weighed by the noise of its part. How long errors last may change with
their size, too: what the whole recording tells of it is too little for a part in which they last.

A stereo rig knows depths worse than places across the line of sight: with one noise for all axes an estimate is less
good than it could be, and its claim too small along the line of sight. Here every observation gets a covariance.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.autocorrelation import growth_by_lasting
from baryscope.estimator.adjustment.lasting_errors import OF_A_POSE
from baryscope.estimator.claims import widened
from baryscope.estimator.findings import ChangingNoise, DepthNoise, Finding
from baryscope.estimator.geometry.alignment import FEWEST_POINTS
from baryscope.estimator.limits import FINEST
from baryscope.estimator.noise.a_priori import with_credible_sigma
from baryscope.estimator.noise.changes import Misfit, Part, noise_parts
from baryscope.estimator.noise.depth import DepthRatio, depth_ratio, deviations, with_noisier_depths
from baryscope.estimator.options import PathOptions
from baryscope.estimator.result import Estimate
from baryscope.estimator.tracks import FeatureTracks
from baryscope.estimator.widening import Widening
from baryscope.models.errors import ComputationError

FloatArray = NDArray[np.float64]
Fit = Callable[[FeatureTracks, PathOptions], Estimate]

FEW = 0.003  # share of all observations that are rejected, up to which no part is looked for
MANY = 0.03  # share of a part's observations that are rejected, from which its noise is to blame
MORE = 3.0  # times the share in the quietest part
FAR_TOO_WIDE = 0.3  # deviations that the residuals tell, over those of the tracks' covariances
LEAST = 1e3 * FINEST  # m: deviations of tracks without noise are not made smaller


def with_noise_as_shown(fit: Fit, tracks: FeatureTracks, options: PathOptions) -> tuple[Estimate, FeatureTracks]:
    """The estimate by a fit, with the noise that the tracks show, and the tracks as it weighs them.

    Covariances that are far too wide, as in mm² for m², are made as small as the residuals tell, and the estimate is
    made anew: features that seem to be less well known than they are far apart tell no centre of mass.

    Raises:
        ComputationError: the tracks do not determine the unknowns.
    """
    found, weighed = _with_shape_as_shown(fit, tracks, options)
    factor = found.noise.a_posteriori
    if tracks.covariance is None or options.sigma is not None or not found.noise.relative or factor > FAR_TOO_WIDE:
        return found, weighed
    least = float(np.sqrt(np.linalg.eigvalsh(tracks.covariance[tracks.seen]).min()))
    factor = max(factor, LEAST / least)
    try:
        anew, weighed_anew = _with_shape_as_shown(
            fit, replace(tracks, covariance=factor**2 * tracks.covariance), options
        )
    except ComputationError:
        return found, weighed
    noise = replace(anew.noise, a_posteriori=factor * anew.noise.a_posteriori)
    told = replace(weighed_anew, covariance=np.asarray(weighed_anew.covariance) / factor**2)
    return replace(anew, noise=noise, wall_time=found.wall_time + anew.wall_time), told


def _with_shape_as_shown(fit: Fit, tracks: FeatureTracks, options: PathOptions) -> tuple[Estimate, FeatureTracks]:
    """The estimate by a fit, with the noise of each part of the tracks where one noise rejects what a part shows, and
    with that of depths where it is another than across the line of sight; and the tracks as these weigh them.

    Tracks with covariances tell their noise by themselves, but how much noisier depths are may be told wrongly. A sigma
    is not used where the noise changes or has axes.

    Raises:
        ComputationError: the tracks do not determine the unknowns.
    """
    plain = with_credible_sigma(lambda told: fit(tracks, told), options)
    own = _in_columns_of(plain, tracks)
    without_pose = own.seen & ~np.any(plain.used, axis=1, keepdims=True)
    ratio = depth_ratio(own, (plain.used | without_pose) & ~plain.rejected)
    if tracks.covariance is not None:
        return (plain, tracks) if ratio is None else _with_depths_as_shown(fit, tracks, options, plain, ratio.ratio)
    parts = _rejecting_parts(plain, tracks)
    if not parts and ratio is None:
        return plain, tracks
    deviation = np.full(len(tracks.time), plain.noise.a_posteriori)
    for part in parts:
        deviation[part.begin : part.end] = part.deviation
    covariance = np.broadcast_to(np.eye(3), (*tracks.position.shape, 3))
    if ratio is not None:
        place = tracks.position.copy()
        for column, residual in zip(plain.sources(tracks.labels), np.moveaxis(plain.residuals, 1, 0), strict=True):
            place[:, column] -= np.nan_to_num(residual)
        covariance = ratio.covariance(place)
    weighed = replace(tracks, covariance=deviation[:, None, None, None] ** 2 * covariance)
    try:
        found = fit(weighed, replace(options, sigma=None))
    except ComputationError:
        return plain, tracks
    return _claimed(found, plain, weighed, parts, ratio), weighed


def _with_depths_as_shown(
    fit: Fit, tracks: FeatureTracks, options: PathOptions, plain: Estimate, factor: float
) -> tuple[Estimate, FeatureTracks]:
    """The estimate with deviations along the line of sight times a factor on what the tracks' covariances tell."""
    told = np.asarray(tracks.covariance)
    weighed = replace(tracks, covariance=with_noisier_depths(told, tracks.position, factor))
    try:
        found = fit(weighed, options)
    except ComputationError:
        return plain, tracks
    across, along = deviations(told[tracks.seen], tracks.position[tracks.seen])
    size = found.noise.a_posteriori
    finding = DepthNoise(size * across, size * factor * along, along / across)
    wall_time = plain.wall_time + found.wall_time
    told_so = replace(found, findings=(*found.findings, finding), options=plain.options, wall_time=wall_time)
    return told_so, weighed


def _in_columns_of(found: Estimate, tracks: FeatureTracks) -> FeatureTracks:
    """The tracks of an estimate's features."""
    if found.labels == tracks.labels:
        return tracks
    source, covariance = found.sources(tracks.labels), tracks.covariance
    own = None if covariance is None else covariance[:, source]
    return replace(tracks, position=tracks.position[:, source], labels=found.labels, covariance=own)


def _rejecting_parts(plain: Estimate, tracks: FeatureTracks) -> tuple[Part, ...]:
    """The parts with noise of their own, where one noise rejects what one of them shows; else none."""
    shown = tracks.seen.sum(axis=1)
    rejected = shown - (plain.used & ~plain.rejected).sum(axis=1)
    if rejected.sum() <= FEW * shown.sum():
        return ()
    parts = noise_parts(tracks.position, tracks.seen, _misfit(plain))
    shares = [_sum(rejected, part) / max(_sum(shown, part), 1.0) for part in parts]
    quietest = min(range(len(parts)), key=lambda index: parts[index].deviation, default=0)
    return parts if parts and max(shares) >= max(MANY, MORE * shares[quietest]) else ()


def _misfit(plain: Estimate) -> Misfit:
    """What an estimate leaves of the frames that have an attitude by more than as many features as this takes."""
    kept = plain.used & ~plain.rejected & np.isfinite(plain.residuals[..., 0])
    squares = np.where(kept, np.sum(plain.residuals**2, axis=2), 0.0)
    count = kept.sum(axis=1)
    return Misfit(squares.sum(axis=1), np.where(count >= FEWEST_POINTS, 3.0 * count - OF_A_POSE, 0.0))


def _claimed(
    found: Estimate, plain: Estimate, weighed: FeatureTracks, parts: tuple[Part, ...], ratio: DepthRatio | None
) -> Estimate:
    """The estimate of weighed tracks, as one of the tracks of the plain one, with what it may claim."""
    kept = found.used & ~found.rejected & np.isfinite(found.residuals[..., 0])
    size, scale = (found.noise.a_posteriori if found.noise.relative else 1.0), 1.0
    if found.noise.relative and kept.any():
        assert weighed.covariance is not None  # noqa: S101  as its caller has made it
        covariance = weighed.covariance[:, found.sources(weighed.labels)][kept]
        scale = float(np.sqrt(np.mean(np.trace(covariance, axis1=1, axis2=2)) / 3))
    deviation = scale * found.noise.a_posteriori
    lasting = max(found.noise.lasting, *(_lasting(found, kept, part) for part in parts), 0.0)
    findings: list[Finding] = []
    if parts:
        begins = tuple(float(found.time[part.begin]) for part in parts)
        findings.append(ChangingNoise(begins, tuple(size * part.deviation for part in parts)))
    if ratio is not None:
        findings.append(DepthNoise(*ratio.deviations(deviation)))
    wider = widened(found, Widening(lasting / found.noise.lasting))
    return replace(
        wider,
        options=plain.options,
        noise=replace(
            found.noise, a_priori=plain.noise.a_priori, a_posteriori=deviation, relative=False, lasting=lasting
        ),
        findings=(*found.findings, *findings),
        wall_time=plain.wall_time + found.wall_time,
    )


def _lasting(found: Estimate, kept: NDArray[np.bool_], part: Part) -> float:
    """How many frames of a part have the same errors of the features, in the axes in which these are more.

    kept (n, m): the residuals that count.
    """
    rows = slice(part.begin, part.end)
    own, attitude = kept[rows], found.attitude
    count, frames = float(own.sum()), float(own.any(axis=1).sum())
    values = max(3 * count - OF_A_POSE * frames, 0.0)
    if not values:
        return 1.0
    residual = np.where(own[..., None], found.residuals[rows], 0.0)
    axes = [residual]
    if attitude is not None:
        axes.append(residual @ np.nan_to_num(attitude[rows]))
    of_feature = count / max(int(own.any(axis=0).sum()), 1)
    return max(growth_by_lasting(list(np.swapaxes(one, 0, 1)), values, of_feature) for one in axes)


def _sum(values: NDArray[np.intp], part: Part) -> float:
    return float(values[part.begin : part.end].sum())

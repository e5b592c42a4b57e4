"""Estimates whose noise follows time, where that of the tracks changes so much that it passes for outliers.

Markers on skin are quiet while a subject stands still: with one noise for the whole recording, the motion is rejected,
but for what happens to fit. Here every frame is weighed by the noise of its part. How long errors last may change with
their size, too: what the whole recording tells of it is too little for a part in which they last.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.autocorrelation import growth_by_lasting
from baryscope.estimator.adjustment.lasting_errors import OF_A_POSE
from baryscope.estimator.claims import widened
from baryscope.estimator.findings import ChangingNoise
from baryscope.estimator.noise.a_priori import with_credible_sigma
from baryscope.estimator.noise.changes import Part, noise_parts
from baryscope.estimator.options import PathOptions
from baryscope.estimator.prediction import Widening
from baryscope.estimator.result import Estimate
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import ComputationError

FloatArray = NDArray[np.float64]
Fit = Callable[[FeatureTracks, PathOptions], Estimate]

FEW = 0.003  # share of all observations that are rejected, up to which no part is looked for
MANY = 0.03  # share of a part's observations that are rejected, from which its noise is to blame
MORE = 3.0  # times the share in the quietest part


def with_noise_of_time(fit: Fit, tracks: FeatureTracks, options: PathOptions) -> Estimate:
    """The estimate by a fit, with the noise of each part of the tracks where one noise rejects what a part shows.

    Tracks with covariances tell their noise by themselves. A sigma is not used where the noise changes.

    Raises:
        ComputationError: the tracks do not determine the unknowns.
    """
    plain = with_credible_sigma(lambda told: fit(tracks, told), options)
    shown = tracks.seen.sum(axis=1)
    rejected = shown - (plain.used & ~plain.rejected).sum(axis=1)
    if tracks.covariance is not None or rejected.sum() <= FEW * shown.sum():
        return plain
    parts = noise_parts(tracks.position, tracks.seen)
    shares = [_sum(rejected, part) / max(_sum(shown, part), 1.0) for part in parts]
    quietest = min(range(len(parts)), key=lambda index: parts[index].deviation, default=0)
    if not parts or max(shares) < max(MANY, MORE * shares[quietest]):
        return plain
    deviation = np.concatenate([np.full(part.end - part.begin, part.deviation) for part in parts])
    covariance = deviation[:, None, None, None] ** 2 * np.eye(3)
    weighed = replace(tracks, covariance=np.broadcast_to(covariance, (*tracks.position.shape, 3)).copy())
    try:
        found = fit(weighed, replace(options, sigma=None))
    except ComputationError:
        return plain
    return _claimed(found, plain, parts, deviation)


def _claimed(found: Estimate, plain: Estimate, parts: tuple[Part, ...], deviation: FloatArray) -> Estimate:
    """The estimate with the noise of each part, as one of the tracks of the plain one, with what it may claim.

    deviation (n,): of a coordinate in each frame, m.
    """
    kept = found.used & ~found.rejected & np.isfinite(found.residuals[..., 0])
    scale = 1.0
    if found.noise.relative:
        scale = float(np.sqrt(np.mean(np.repeat(deviation, kept.sum(axis=1)) ** 2))) if kept.any() else 1.0
    lasting = max(found.noise.lasting, *(_lasting(found, kept, part) for part in parts))
    size = found.noise.a_posteriori if found.noise.relative else 1.0
    begins = tuple(float(found.time[part.begin]) for part in parts)
    finding = ChangingNoise(begins, tuple(size * part.deviation for part in parts))
    wider = widened(found, Widening(lasting / found.noise.lasting))
    return replace(
        wider,
        options=plain.options,
        noise=replace(
            found.noise,
            a_priori=plain.noise.a_priori,
            a_posteriori=scale * found.noise.a_posteriori,
            relative=False,
            lasting=lasting,
        ),
        findings=(*found.findings, finding),
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

"""Observations from tracks, and the noise of a stereo rig: its covariance at the estimated point, its range bias.

A stereo rig reports the covariance evaluated at the measured point. A point measured too near has too small a
covariance, and a lateral error rotates the covariance's long axis; both bias a weighted fit towards the rig. The
variance along the line of sight is proportional to range⁴, across it to range², and the axes rotate with the line of
sight. The mean of the measured range is too long by the factor 1 + σ_r²/r². This module transfers the covariance from
the measured to the estimated point and corrects the range. If the true covariance does not depend on the range, the
change is of the order of σ/r.
"""

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.geometry.so3 import cross_matrices
from baryscope.estimator.limits import COARSEST, FINEST, STRETCHED
from baryscope.estimator.options import Noise
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import InputError

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

NEAREST = 1e-6  # m, of a point from the rig
STEREO = 4.0  # power of the range that the variance along the line of sight of a stereo rig goes with
SAMPLE = 2000  # frames that are looked at to tell whether it does, at most
MAX_CORRECTION = 0.5  # of a range: where noise is as large as the range, the second order says nothing


def observations_of(tracks: FeatureTracks, used: BoolArray) -> Observations:
    """The observations used (n, m) of the tracks, with weight 1, and precisions if the tracks have covariances.

    Raises:
        InputError: a covariance is singular, or its standard deviations are not within the ranges of `limits`.
    """
    position = np.where(used[..., None], tracks.position, 0.0)
    if tracks.covariance is None:
        return Observations(position, used.astype(np.float64))
    _refuse_singular(tracks, tracks.covariance[used], used)
    covariance = np.where(used[..., None, None], tracks.covariance, np.eye(3))
    return Observations(position, used.astype(np.float64), np.linalg.inv(covariance))


def _refuse_singular(tracks: FeatureTracks, covariance: FloatArray, used: BoolArray) -> None:
    """Check the covariances (k, 3, 3) of the observations used (n, m)."""
    values = np.linalg.eigvalsh(covariance)
    least, greatest = values[:, 0], values[:, 2]
    wrong = (least < FINEST**2) | (greatest > COARSEST**2) | (greatest > STRETCHED**2 * least)
    if wrong.any():
        first = int(np.argmax(wrong))
        frame, feature = np.argwhere(used)[first]
        smallest, largest = np.sqrt(np.maximum([least[first], greatest[first]], 0.0))
        raise InputError(
            f"covariance of feature {tracks.labels[feature]!r} at {tracks.time[frame]} s has standard deviations of "
            f"{smallest:.2g} to {largest:.2g} m, expected {FINEST:g} to {COARSEST:g} m and a ratio of at most "
            f"{STRETCHED:g}"
        )


def varies_with_range(measured: Observations, noise: Noise) -> bool:
    """Whether the precisions are those of a stereo rig at the measured points; none are not.

    Where noise is auto, they tell: of each feature, the variance along the line of sight goes with the range to the
    power of 4, or by itself with none.
    """
    if measured.precision is None or noise != "auto":
        return measured.precision is not None and noise == "stereo"
    every = max(1, len(measured.position) // SAMPLE)
    few = measured.frames(slice(None, None, every))
    r = np.linalg.norm(few.position, axis=2)
    seen = (few.weight > 0) & (r > NEAREST)
    a = np.where(seen[..., None], few.position, 1.0) / np.where(seen, r, 1.0)[..., None]
    assert few.precision is not None  # noqa: S101  as above
    along = np.einsum("kmi,kmi->km", a, np.linalg.solve(few.precision, a[..., None])[..., 0])
    x, y = np.log(np.where(seen, r, 1.0)), np.log(np.where(seen, along, 1.0))
    count = np.maximum(seen.sum(axis=0), 1)
    x, y = (np.where(seen, one - np.where(seen, one, 0.0).sum(axis=0) / count, 0.0) for one in (x, y))
    return float(np.vdot(x, y)) > STEREO / 2 * float(np.vdot(x, x))


def moved_to(observations: Observations, measured: Observations, estimated: FloatArray) -> Observations:
    """`measured` with precisions transferred to the estimated points (n, m, 3) in C, m, and the range bias removed.

    The weights are those of `observations`, which is returned unchanged if there are no precisions.
    """
    if measured.precision is None:
        return observations
    # A point measured at the rig itself has no line of sight: it stays as it is.
    sighted = (measured.weight > 0) & (np.linalg.norm(measured.position, axis=2) > NEAREST)
    near, far = np.where(sighted[..., None], measured.position, 1.0), np.where(sighted[..., None], estimated, 1.0)
    r, r_new = np.linalg.norm(near, axis=2), np.linalg.norm(far, axis=2)
    a, a_new = near / r[..., None], far / np.maximum(r_new, 1e-300)[..., None]
    ratio = np.clip(r_new / r, 0.5, 2.0)
    turn = _rotation_between(a, a_new)
    # With D = s (1 + (s − 1) a aᵀ), s the ratio of ranges, the covariance at the new range is D Σ D; then rotate it.
    D = np.eye(3) + (1 / ratio - 1)[..., None, None] * a[..., :, None] * a[..., None, :]
    D = turn @ D / ratio[..., None, None]
    precision = D @ measured.precision @ np.swapaxes(D, 2, 3)
    covariance_along = np.linalg.solve(precision, a_new[..., None])[..., 0]
    variance = np.einsum("kmi,kmi->km", a_new, covariance_along)
    range_correction = np.where(sighted, 1 - np.minimum(variance / (r * ratio) ** 2, MAX_CORRECTION), 1.0)
    return Observations(measured.position * range_correction[..., None], observations.weight, precision)


def _rotation_between(a: FloatArray, b: FloatArray) -> FloatArray:
    """The smallest rotations (n, m, 3, 3) from unit vectors a (n, m, 3) to b; the identity for angles from 90° on."""
    cosine = np.einsum("kmi,kmi->km", a, b)
    cross = cross_matrices(np.cross(a, b).reshape(-1, 3)).reshape(*a.shape, 3)
    turn = np.eye(3) + cross + cross @ cross / np.maximum(1 + cosine, 1e-12)[..., None, None]
    return np.asarray(np.where((cosine > 0)[..., None, None], turn, np.eye(3)))

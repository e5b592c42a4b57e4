"""Observations from tracks, and the noise of a stereo rig: its covariance at the estimated point, its range bias.

A stereo rig reports the covariance evaluated at the measured point. A point measured too near has too small a
covariance, and a lateral error rotates the covariance's long axis; both bias a weighted fit towards the rig. The
variance along the line of sight is proportional to range⁴, across it to range², and the axes rotate with the line of
sight. The mean of the measured range is too long by the factor 1 + σ_r²/r². This module transfers the covariance from
the measured to the estimated point and corrects the range. Covariances may be right but for a factor: the correction is
that of the noise which the residuals show. If the true covariance does not depend on the range, the change is of the
order of σ/r.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.options import Noise
from baryscope.estimator.tracks import FeatureTracks

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

NEAREST = 1e-6  # m, of a point from the rig
STEREO = 4.0  # power of the range that the variance along the line of sight of a stereo rig goes with
SAMPLE = 2000  # frames that are looked at to tell whether it does, at most
OUTLYING = 20.0  # square of an error over the median, above which it is left out there
MEANS = 3  # times that means of features and frames are subtracted in turn
MATTERS = 0.01  # squared change of a range common to all observations, in units of its covariance
MAX_CORRECTION = 0.5  # of a range: where noise is as large as the range, the second order says nothing


def observations_of(tracks: FeatureTracks, used: BoolArray) -> Observations:
    """The observations used (n, m) of the tracks, with weight 1, and precisions if the tracks have covariances.

    Raises:
        InputError: a covariance is singular, or its standard deviations are not within the ranges of `limits`.
    """
    position = np.asfortranarray(np.where(used[..., None], tracks.position, 0.0))
    if tracks.covariance is None:
        return Observations(position, used.astype(np.float64))
    tracks.refuse_singular()
    covariance = np.where(used[..., None, None], tracks.covariance, np.eye(3))
    return Observations(position, used.astype(np.float64), np.linalg.inv(covariance))


def varies_with_range(measured: Observations, estimated: FloatArray, noise: Noise) -> bool:
    """Whether the precisions are those of a stereo rig at the measured points; none are not.

    estimated (n, m, 3): the points in C, m. Where noise is auto, the precisions tell. What of the logarithm of the
    variance along the line of sight goes with the estimated point is no matter; with the measured range less the
    estimated one it goes by a factor of 4 if it belongs to the measured point, of 0 if to the true one, or to none.
    """
    if measured.precision is None or noise != "auto":
        return measured.precision is not None and noise == "stereo"
    every = max(1, len(measured.position) // SAMPLE)
    few, place = measured.frames(slice(None, None, every)), estimated[::every]
    assert few.precision is not None  # noqa: S101  as above
    r, far = np.linalg.norm(few.position, axis=2), np.linalg.norm(place, axis=2)
    seen = (few.weight > 0) & (r > NEAREST) & (far > NEAREST)
    sight = np.where(seen[..., None], place, 1.0) / np.where(seen, far, np.sqrt(3.0))[..., None]
    along = np.einsum("kmi,kmi->km", sight, np.linalg.solve(few.precision, sight[..., None])[..., 0])
    r, far, along = (np.where(seen, one, 1.0) for one in (r, far, along))
    longer = np.log(r / far)
    seen &= longer != 0  # what is not estimated
    if not seen.any():
        return False
    square = longer**2 * far**2 / along
    seen &= square <= OUTLYING * np.median(square[seen])
    logarithms = np.stack([np.log(along), longer, np.log(far)], axis=2)
    values = _without_means(np.concatenate([logarithms, sight], axis=2), seen)
    scale = np.linalg.norm(values[:, 1:], axis=0) + np.finfo(float).tiny
    slope = np.linalg.lstsq(values[:, 1:] / scale, values[:, 0], rcond=None)[0][0] / scale[0]
    return bool(slope > STEREO / 2)


def _without_means(values: FloatArray, seen: BoolArray) -> FloatArray:
    """The seen (n, m) of values (n, m, d), as rows (k, d), without means of features, whose variance is their own, and
    of frames, whose place may be wrong.
    """
    values = np.where(seen[..., None], values, 0.0)
    for _ in range(MEANS):
        for axis in (0, 1):
            mean = values.sum(axis, keepdims=True) / np.maximum(seen.sum(axis, keepdims=True), 1)[..., None]
            values = np.where(seen[..., None], values - mean, 0.0)
    return np.asarray(values[seen])


@dataclass(frozen=True, eq=False)
class StereoNoise:
    """The noise of a stereo rig: what does not depend on where the points are estimated to be.

    position (n, m, 3) in C, m, and precision (n, m, 3, 3), 1/m², of the measured points; sighted (n, m): which are
    used, and not at the rig itself; distance (n, m), m, and sight (n, m, 3): of a measured point from the rig, and its
    direction in C, the diagonal of C for the others; spread (n, m): the told variance along it over distance²;
    variance: of an observation of weight 1 in a frame by itself, over what its covariance tells. The frames are last in
    memory.
    """

    position: FloatArray
    precision: FloatArray
    sighted: BoolArray
    distance: FloatArray
    sight: FloatArray
    spread: FloatArray
    variance: float

    @classmethod
    def of(cls, measured: Observations, variance: float) -> "StereoNoise":
        """The noise of observations with precisions, of such a variance over what these tell."""
        assert measured.precision is not None  # noqa: S101  as its caller has seen
        position = np.asfortranarray(measured.position)
        sighted = (np.asfortranarray(measured.weight) > 0) & (np.linalg.norm(position, axis=2) > NEAREST)
        near = np.where(sighted[..., None], position, 1.0)
        distance = np.linalg.norm(near, axis=2)
        sight = near / distance[..., None]
        along = np.linalg.solve(measured.precision, sight[..., None])[..., 0]
        spread = np.einsum("kmi,kmi->km", sight, along) / distance**2
        return cls(position, np.asfortranarray(measured.precision), sighted, distance, sight, spread, variance)

    def of_variance(self, variance: float) -> "StereoNoise":
        """The noise of another variance over what covariances tell; the same where its biases would move no estimate.

        The sum of the squared biases over the variances is that of a range common to all observations.
        """
        biases = np.median(self.spread[self.sighted]) * self.sighted.sum() if self.sighted.any() else 0.0
        change = (variance - self.variance) ** 2 / variance * biases
        return replace(self, variance=variance) if change > MATTERS else self

    def moved_to(self, estimated: FloatArray, weight: FloatArray) -> Observations:
        """The observations with the precisions of estimated points (n, m, 3) in C, m, without the range's bias.

        weight (n, m): their weights.
        """
        far = np.where(self.sighted[..., None], np.asfortranarray(estimated), 1.0)
        distance = np.linalg.norm(far, axis=2)
        ratio = np.clip(distance / self.distance, 0.5, 2.0)
        # With D = s (1 + (s − 1) a aᵀ), s the ratio of ranges, the covariance at the new range is D Σ D; then turned.
        across = _rotation_between(self.sight, far / np.maximum(distance, 1e-300)[..., None]) / ratio[..., None, None]
        turned = np.einsum("kmij,kmj->kmi", across, self.sight)
        inverse = across + turned[..., :, None] * ((1 / ratio - 1)[..., None] * self.sight)[..., None, :]
        precision = np.einsum("kmij,kmjl->kmil", inverse, self.precision)
        precision = np.einsum("kmij,kmlj->kmil", precision, inverse)
        # Along the line of sight the variance is s⁴ times as large.
        shortened = np.where(self.sighted, 1 - np.minimum(self.variance * ratio**2 * self.spread, MAX_CORRECTION), 1.0)
        return Observations(self.position * shortened[..., None], weight, precision)


def stereo_noise(measured: Observations, estimated: FloatArray, noise: Noise, variance: float) -> StereoNoise | None:
    """The noise of a stereo rig, if the precisions are those at the measured points, see `varies_with_range`."""
    return StereoNoise.of(measured, variance) if varies_with_range(measured, estimated, noise) else None


def _rotation_between(a: FloatArray, b: FloatArray) -> FloatArray:
    """The smallest rotations (n, m, 3, 3) from unit vectors a (n, m, 3) to b; the identity for angles from 90° on.

    c 1 + [v]× + v vᵀ/(1 + c) for v = a × b and the angle's cosine c.
    """
    cosine = np.einsum("kmi,kmi->km", a, b)
    v: FloatArray = np.asfortranarray(np.cross(a, b))
    turn: FloatArray = v[..., :, None] * (v / np.maximum(1 + cosine, 1e-12)[..., None])[..., None, :]
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        turn[..., i, i] += cosine
        turn[..., i, j] -= v[..., k]
        turn[..., j, i] += v[..., k]
    turn[cosine <= 0] = np.eye(3)
    return turn

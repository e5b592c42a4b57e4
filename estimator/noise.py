"""The noise of sightings: what a given covariance says at the estimated point, and the range's second-order bias.

A rig triangulates: its covariance is evaluated at the noisy point, so a point measured too near claims to be better
than it is, and a weighted fit believes it. Along the line of sight a variance grows with range⁴, across it with
range²; and the mean of the measured range is too long by the factor 1 + σ_r²/r². Both are put right here, from the
measured to the estimated point. For covariances that do not grow with range the change is of the order of σ/r.
"""

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.sightings import Sightings
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import InputError

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


def sightings_of(tracks: FeatureTracks, used: BoolArray) -> Sightings:
    """The tracks as they are, with their covariances if they have some.

    Raises:
        InputError: a covariance is singular.
    """
    position = np.where(used[..., None], tracks.position, 0.0)
    if tracks.covariance is None:
        return Sightings(position, used.astype(np.float64))
    covariance = np.where(used[..., None, None], tracks.covariance, np.eye(3))
    try:
        precision = np.linalg.inv(covariance)
    except np.linalg.LinAlgError as error:
        raise InputError("a covariance of the tracks is singular, expected positive definite ones") from error
    return Sightings(position, used.astype(np.float64), precision)


def moved_to(sightings: Sightings, measured: Sightings, estimated: FloatArray) -> Sightings:
    """`measured` with precisions and positions as a stereo rig has them at the estimated points (n, m, 3) in C.

    The weights are those of `sightings`.
    """
    if measured.precision is None:
        return sightings
    distance = np.linalg.norm(measured.position, axis=2)
    used = distance > 0
    along = measured.position / np.where(used, distance, 1.0)[..., None]
    ratio = np.einsum("kmi,kmi->km", along, estimated) / np.where(used, distance, 1.0)
    ratio = np.where(used, np.clip(ratio, 0.5, 2.0), 1.0)
    # With D = s (1 + (s − 1) a aᵀ), the covariance at the estimated point is D Σ D.
    P = measured.precision
    across = (P @ along[..., None])[..., 0]
    aPa = np.einsum("kmi,kmi->km", along, across)
    grow = 1 / ratio - 1
    mixed = along[..., :, None] * across[..., None, :]
    precision = P + grow[..., None, None] * (mixed + np.swapaxes(mixed, 2, 3))
    precision += (grow**2 * aPa)[..., None, None] * along[..., :, None] * along[..., None, :]
    precision /= (ratio**2)[..., None, None]
    # aᵀ Σ a from the precision: for a rig whose depth is its worst direction this is 1 / (aᵀ P a) but for its skewness.
    variance = np.einsum("kmi,kmij,kmj->km", along, np.linalg.inv(precision), along)
    shrink = 1 - variance / np.where(used, distance * ratio, 1.0) ** 2
    return Sightings(measured.position * np.where(used, shrink, 1.0)[..., None], sightings.weight, precision)

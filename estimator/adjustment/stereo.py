"""The noise of observations: what a given covariance says at the estimated point, and the range's second-order bias.

A rig triangulates: its covariance is evaluated at the noisy point, so a point measured too near claims to be better
than it is, and one measured aside has its long axis turned aside; a weighted fit believes both and comes out too near.
Along the line of sight a variance grows with range⁴, across it with range², and its axes turn with the line of sight.
And the mean of the measured range is too long by the factor 1 + σ_r²/r². All this is put right here, from the measured
to the estimated point. For covariances that do not grow with range the change is of the order of σ/r.
"""

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.geometry.so3 import cross_matrices
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import InputError

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


def observations_of(tracks: FeatureTracks, used: BoolArray) -> Observations:
    """The tracks as they are, with their covariances if they have some.

    Raises:
        InputError: a covariance is singular.
    """
    position = np.where(used[..., None], tracks.position, 0.0)
    if tracks.covariance is None:
        return Observations(position, used.astype(np.float64))
    covariance = np.where(used[..., None, None], tracks.covariance, np.eye(3))
    try:
        precision = np.linalg.inv(covariance)
    except np.linalg.LinAlgError as error:
        raise InputError("a covariance of the tracks is singular, expected positive definite ones") from error
    return Observations(position, used.astype(np.float64), precision)


def moved_to(observations: Observations, measured: Observations, estimated: FloatArray) -> Observations:
    """`measured` with precisions and positions as a stereo rig has them at the estimated points (n, m, 3) in C.

    The weights are those of `observations`.
    """
    if measured.precision is None:
        return observations
    used = measured.weight > 0
    near, far = np.where(used[..., None], measured.position, 1.0), np.where(used[..., None], estimated, 1.0)
    r, r_new = np.linalg.norm(near, axis=2), np.linalg.norm(far, axis=2)
    a, a_new = near / r[..., None], far / np.maximum(r_new, 1e-300)[..., None]
    ratio = np.clip(r_new / r, 0.5, 2.0)
    turn = _turning(a, a_new)
    # With D = s (1 + (s − 1) a aᵀ) the covariance at the new range is D Σ D; then it is turned.
    D = np.eye(3) + (1 / ratio - 1)[..., None, None] * a[..., :, None] * a[..., None, :]
    D = turn @ D / ratio[..., None, None]
    precision = D @ measured.precision @ np.swapaxes(D, 2, 3)
    covariance_along = np.linalg.solve(precision, a_new[..., None])[..., 0]
    variance = np.einsum("kmi,kmi->km", a_new, covariance_along)
    shrink = np.where(used, 1 - variance / (r * ratio) ** 2, 1.0)
    return Observations(measured.position * shrink[..., None], observations.weight, precision)


def _turning(a: FloatArray, b: FloatArray) -> FloatArray:
    """Rotations (n, m, 3, 3) that turn unit vectors a (n, m, 3) into b by the shortest way; none for opposite ones."""
    cosine = np.einsum("kmi,kmi->km", a, b)
    cross = cross_matrices(np.cross(a, b).reshape(-1, 3)).reshape(*a.shape, 3)
    turn = np.eye(3) + cross + cross @ cross / np.maximum(1 + cosine, 1e-12)[..., None, None]
    return np.asarray(np.where((cosine > 0)[..., None, None], turn, np.eye(3)))

"""Errors of features that last: how many frames have the same one, as the residuals of rigid bodies tell.

What a tracker takes for a feature moves on it with the light and the angle of view, so that its error is alike in
frames that follow one another. Frames then tell less: with ρ the errors' autocorrelations, as little of what is
constant or slow as frames of white noise of 1 + 2 Σ ρ times the variance would. Errors may be slow in the camera's axes
or in the body's; those of the camera's tell of its path, those of the body's of its points.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.autocorrelation import growth_by_lasting
from baryscope.estimator.adjustment.normal_equations import normal_blocks
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.registration.body import Body

FloatArray = NDArray[np.float64]

MOST_FRAMES = 10_000  # of a body, that are looked at
OF_A_POSE = 6  # values of a frame, that its pose takes


def frames_per_error(bodies: Sequence[Body], observations: Observations, origin: FloatArray) -> float:
    """1 + 2 Σ ρ of the features' errors, at least 1, in the axes in which it is greater.

    Each frame's own pose is taken out, so that noise which moves all features together has no part in it.
    origin (n, 3) in C, m: the path.
    """
    in_C: list[FloatArray] = []
    in_B: list[FloatArray] = []
    values, frames, features = 0.0, 0.0, 0
    for body in (_in_the_middle(one) for one in bodies if len(one.frames)):
        own = observations.frames(body.frames).features(body.features)
        left = _whitened(body, own, origin[body.frames])
        weight = own.weight.sum()
        values += max(3 * float(weight) - OF_A_POSE * len(body.frames), 0.0)
        frames += float(weight)
        features += len(body.features)
        rows = body.frames - body.frames[0]
        turned = np.einsum("kmj,kji->kmi", left, np.asfortranarray(body.attitude))
        for axes, of_all in ((left, in_C), (turned, in_B)):
            series = np.zeros((len(body.features), 3, int(rows[-1]) + 1))
            series[:, :, rows] = axes.transpose(1, 2, 0)
            of_all.extend(np.swapaxes(series, 1, 2))
    if values <= 0:
        return 1.0
    return max(growth_by_lasting(series, values, frames / features) for series in (in_C, in_B))


def _in_the_middle(body: Body) -> Body:
    """The body in its middle frames, if it has more than MOST_FRAMES: these tell as well how long errors last."""
    more = len(body.frames) - MOST_FRAMES
    if more <= 0:
        return body
    return body.in_frames(slice(more // 2, more // 2 + MOST_FRAMES))


def _whitened(body: Body, own: Observations, origin: FloatArray) -> FloatArray:
    """The residuals (n, m, 3) of the best pose of each frame, along axes of C, in standard deviations.

    Without their means in axes of the body, as which points that are not yet at their best would seem to last.
    """
    found, R = normal_blocks(own, body.attitude, origin, body.points), np.asfortranarray(body.attitude)
    turn, shift = found.best_pose()
    # With the frames last in memory, as the blocks have them.
    offset = np.asfortranarray(own.position) - np.asfortranarray(origin)[:, None]
    residual = np.einsum("kmj,kji->kmi", offset, R)
    residual += (found.arms @ turn.T).transpose(2, 0, 1)
    residual -= body.points + shift[:, None]
    residual -= found.mean(residual)
    residual = np.einsum("kmj,kij->kmi", residual, R)
    residual *= np.sqrt(own.weight)[:, :, None]
    if own.precision is None:
        return np.asarray(residual)
    return np.asarray(np.einsum("kmji,kmj->kmi", np.linalg.cholesky(own.precision), residual))

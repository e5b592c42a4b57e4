"""Forms of motion capture, which hold places of markers and nothing else: what goes into them, and what cannot."""

import numpy as np

from baryscope.estimator.tracks import FeatureTracks, FloatArray
from baryscope.models.errors import InputError

MARKER_FORMS = (".trc", ".c3d")


def with_marker(tracks: FeatureTracks, label: str, time: FloatArray, position: FloatArray, name: str) -> FeatureTracks:
    """A recording without covariances, with one more marker: position (k, 3), m, at k of its times, not seen elsewhere.

    Raises:
        InputError: the recording, for a file of that name, has a marker of that label.
    """
    if label in tracks.labels:
        raise InputError(f"{name}: the recording has a marker {label}, as the centre would be named")
    marker = np.full((len(tracks.time), 1, 3), np.nan)
    marker[np.isin(tracks.time, time), 0] = position
    both = np.concatenate([tracks.position, marker], axis=1)
    return FeatureTracks(tracks.time, both, (*tracks.labels, label), epoch=tracks.epoch)


def refuse_untold(tracks: FeatureTracks, name: str, form: str) -> None:
    """Check that tracks have nothing that a form of motion capture cannot tell.

    Raises:
        InputError: they have covariances or an epoch; `name` is that of the file.
    """
    for what, there in (("covariances", tracks.covariance is not None), ("an epoch", tracks.epoch is not None)):
        if there:
            raise InputError(f"{name}: found tracks with {what}, for which {form} has no place")

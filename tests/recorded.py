"""Tracks that tests of files write and read again."""

import numpy as np

from baryscope.estimator import FeatureTracks
from baryscope.estimator.formats import METRES
from synthetic import ENVISAT, attitude, box_features, make_case

TIME = np.arange(0.0, 20.0, 0.5)
LABELS = ("left", "right", "ÿ top", "back")


def box_tracks():
    """Four features in 40 frames, some not seen, one frame without any."""
    points = box_features(4, (2, 2, 2), seed=3)
    case = make_case(TIME, attitude(ENVISAT, np.deg2rad((9.0, 3.0, 6.0)), TIME), np.zeros((40, 3)), points, noise=0.001)
    position = case.tracks.position + np.array([1.0, -2.0, 5.0])
    position[5:9, 2] = position[20] = np.nan
    return FeatureTracks(TIME, position, LABELS)


def same(found, tracks, rtol=1e-12):
    assert found.labels == tracks.labels
    np.testing.assert_allclose(found.time, tracks.time, atol=1e-9)
    np.testing.assert_allclose(found.position, tracks.position, rtol=rtol)
    if tracks.covariance is not None:
        np.testing.assert_allclose(found.covariance, tracks.covariance, rtol=rtol)


def trc(tracks, unit="mm"):
    """The text of a TRC file with them."""

    def row(k):
        cells = (
            ["", "", ""] if np.isnan(p[0]) else [repr(float(c / METRES[unit])) for c in p] for p in tracks.position[k]
        )
        return "\t".join([str(k + 1), repr(float(tracks.time[k])), *(cell for three in cells for cell in three)])

    heads = "\t\t\t".join(tracks.labels)
    numbers = "\t".join(f"{axis}{k + 1}" for k in range(len(tracks.labels)) for axis in "XYZ")
    lines = [
        "PathFileType\t4\t(X/Y/Z)\tt.trc",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"2.0\t2.0\t{len(tracks.time)}\t{len(tracks.labels)}\t{unit}\t2.0\t1\t{len(tracks.time)}",
        f"Frame#\tTime\t{heads}\t\t",
        f"\t\t{numbers}",
        "",
        *map(row, range(len(tracks.time))),
    ]
    return "\n".join(lines) + "\n"

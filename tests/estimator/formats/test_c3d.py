"""Tracks from C3D files, as ezc3d writes them."""

import ezc3d
import numpy as np
import pytest

from baryscope.estimator import FeatureTracks, read_tracks
from baryscope.estimator.formats import METRES
from baryscope.models.errors import InputError
from recorded import TIME, box_tracks, same


@pytest.fixture(scope="module")
def tracks():
    return box_tracks()


def c3d(tracks, path, unit="mm", labels=True):
    """As ezc3d writes it, in single precision."""
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [2.0]
    file["parameters"]["POINT"]["UNITS"]["value"] = [unit] if unit else []
    file["parameters"]["POINT"]["LABELS"]["value"] = tuple(tracks.labels) if labels else ()
    points = np.ones((4, len(tracks.labels), len(tracks.time)))
    points[:3] = np.moveaxis(tracks.position, -1, 0).swapaxes(1, 2) / METRES[unit or "m"]
    file["data"]["points"] = points
    file.write(str(path))


def test_c3d_has_its_own_unit(tracks, tmp_path):
    c3d(tracks, tmp_path / "t.c3d")
    same(read_tracks(tmp_path / "t.c3d"), tracks, rtol=1e-6)
    np.testing.assert_allclose(read_tracks(tmp_path / "t.c3d", "m").position, 1e3 * tracks.position, rtol=1e-6)


def test_more_markers_than_a_list_of_labels_holds(tmp_path):
    many = FeatureTracks(TIME[:3], np.random.default_rng(1).normal(size=(3, 300, 3)), [f"M{k}" for k in range(300)])
    c3d(many, tmp_path / "t.c3d")
    same(read_tracks(tmp_path / "t.c3d"), many, rtol=1e-6)


def told_by_trial(file, frames):
    file.add_parameter("TRIAL", "ACTUAL_START_FIELD", [1, 0])
    file.add_parameter("TRIAL", "ACTUAL_END_FIELD", [frames & 0xFFFF, frames >> 16])


@pytest.mark.parametrize("tell", [
    lambda file, frames: None, told_by_trial, lambda file, frames: file.add_parameter("POINT", "LONG_FRAMES", [frames])
])  # fmt: skip
def test_more_frames_than_the_header_of_a_c3d_file_counts(tmp_path, tell):
    """Ten minutes at 120 Hz: ezc3d writes them all, and reads 65,535. The last is zero, and there where it is told."""
    frames, file = 72_001, ezc3d.c3d()
    points = np.ones((4, 3, frames))
    points[:3] = np.random.default_rng(1).normal(size=(3, 3, frames)).astype(np.float32)
    points[0, 1, 70_000] = np.nan
    points[:3, :, -1] = 0.0
    file["parameters"]["POINT"]["RATE"]["value"] = [120.0]
    file["parameters"]["POINT"]["UNITS"]["value"] = ["m"]
    file["parameters"]["POINT"]["LABELS"]["value"] = ("a", "b", "c")
    file["data"]["points"] = points
    tell(file, frames)
    file.write(str(tmp_path / "t.c3d"))
    found = read_tracks(tmp_path / "t.c3d")
    told = frames if file["parameters"].get("TRIAL") or "LONG_FRAMES" in file["parameters"]["POINT"] else frames - 1
    assert len(found.time) == told
    assert found.time[-1] == (told - 1) / 120.0
    assert np.argwhere(~found.seen).tolist() == [[70_000, 1]]
    expected = np.where(found.seen[..., None], np.moveaxis(points[:3, :, :told], 0, -1).swapaxes(0, 1), np.nan)
    np.testing.assert_array_equal(found.position, expected)


@pytest.mark.parametrize("kept", [0, 100, 511, 512, 700, 1024, 1600])
def test_a_c3d_file_that_is_cut_short_is_refused(tracks, tmp_path, kept):
    c3d(tracks, tmp_path / "t.c3d")
    content = (tmp_path / "t.c3d").read_bytes()
    assert len(content) > 1600
    (tmp_path / "t.c3d").write_bytes(content[:kept])
    with pytest.raises(InputError, match=r"t\.c3d: "):
        read_tracks(tmp_path / "t.c3d")

"""Tracks to C3D files, as ezc3d reads them and as our own reader does."""

import ezc3d
import numpy as np
import pytest

from baryscope.estimator import FeatureTracks, read_tracks, write_tracks
from baryscope.models.errors import InputError
from recorded import box_tracks, same

SINGLE = 6e-8  # relative: half a unit in the last place of single precision


def test_what_is_written_is_read_by_ezc3d(tmp_path):
    tracks = box_tracks()
    write_tracks(tracks, tmp_path / "t.c3d")
    found = ezc3d.c3d(str(tmp_path / "t.c3d"))
    about = found["parameters"]["POINT"]
    assert about["LABELS"]["value"] == list(tracks.labels)
    assert [about["UNITS"]["value"], about["RATE"]["value"].tolist()] == [["mm"], [2.0]]
    assert found["parameters"]["TRIAL"]["ACTUAL_END_FIELD"]["value"].tolist() == [40, 0]
    points = found["data"]["points"]
    np.testing.assert_allclose(points[:3].transpose(2, 1, 0), 1e3 * tracks.position, rtol=SINGLE)
    same(read_tracks(tmp_path / "t.c3d"), tracks, rtol=SINGLE)


@pytest.mark.parametrize(("first", "frames", "rate"), [
    (0, 2, 100.0), (150, 300, 50.0), (0, 400, 120.0), (12_345, 500, 59.94), (60_000, 10_000, 200.0), (0, 72_001, 120.0)
])  # fmt: skip
def test_times_are_counted_from_the_begin_of_the_recording(tmp_path, first, frames, rate):
    """Also beyond what the header counts, to 65,535; the last markers are at 0, as what fills up a block."""
    time = (first + np.arange(frames)) / rate
    position = np.random.default_rng(1).normal(size=(frames, 2, 3))
    position[-3:] = 0.0
    write_tracks(FeatureTracks(time, position, ["a", "b"]), tmp_path / "t.c3d")
    found = read_tracks(tmp_path / "t.c3d")
    np.testing.assert_allclose(found.time, time, rtol=2 * SINGLE, atol=1e-9)  # the rate's, too
    np.testing.assert_allclose(found.position, position, rtol=SINGLE, atol=1e-12)


def test_times_that_are_rounded_to_milliseconds(tmp_path):
    time = np.round(np.arange(90) / 120, 3)
    write_tracks(FeatureTracks(time, np.ones((90, 1, 3)), ["a"]), tmp_path / "t.c3d")
    np.testing.assert_allclose(read_tracks(tmp_path / "t.c3d").time, time, atol=1e-3)


def test_more_markers_than_a_list_of_labels_holds(tmp_path):
    labels = [f"M{k}" for k in range(600)]
    many = FeatureTracks([0.0, 0.5], np.random.default_rng(1).normal(size=(2, 600, 3)), labels)
    write_tracks(many, tmp_path / "t.c3d")
    same(read_tracks(tmp_path / "t.c3d"), many, rtol=SINGLE)
    parameters = ezc3d.c3d(str(tmp_path / "t.c3d"))["parameters"]["POINT"]
    assert [name for part in ("", "2", "3") for name in parameters[f"LABELS{part}"]["value"]] == labels


EVEN = np.arange(3.0)


@pytest.mark.parametrize(("tracks", "expected"), [
    (FeatureTracks([0.0, 1.0, 3.0], np.ones((3, 1, 3)), ["a"]),
     "found the time 1 s, expected times that C3D can tell, k / 0.666667 s with whole numbers k from 0 on"),
    (FeatureTracks(EVEN - 1, np.ones((3, 1, 3)), ["a"]), "found the time -1 s, expected times"),
    (FeatureTracks(EVEN + 0.5, np.ones((3, 1, 3)), ["a"]), "found the time 0.5 s, expected times"),
    (FeatureTracks([0.0], np.ones((1, 1, 3)), ["a"]), "found 1 frame, expected two or more, which tell a rate"),
    (FeatureTracks(EVEN, np.ones((3, 1, 3)), ["a"], np.broadcast_to(np.eye(3), (3, 1, 3, 3))),
     "found tracks with covariances, for which C3D has no place"),
    (FeatureTracks(EVEN, np.ones((3, 1, 3)), ["a"], epoch="2026-03-01T12:00:00Z"),
     "found tracks with an epoch, for which C3D has no place"),
    (FeatureTracks(EVEN, np.ones((3, 1, 3)), ["ÿ" * 128]), "found the label ÿÿÿ"),
    (FeatureTracks(EVEN, np.ones((3, 700, 3)), [f"{k:0200d}" for k in range(700)]), "found 700 markers, whose labels"),
])  # fmt: skip
def test_what_c3d_has_no_place_for_is_refused(tmp_path, tracks, expected):
    with pytest.raises(InputError) as raised:
        write_tracks(tracks, tmp_path / "t.c3d")
    assert str(raised.value).startswith(f"{tmp_path / 't.c3d'}: {expected}")
    assert not list(tmp_path.iterdir())

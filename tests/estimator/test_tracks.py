from datetime import datetime

import numpy as np
import pandas
import pytest
from hypothesis import given
from hypothesis import strategies as st

from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import InputError
from malformed import TRACKS


@pytest.mark.parametrize("case", TRACKS)
def test_malformed_file_gives_one_clear_line(case, tmp_path):
    content, expected = TRACKS[case]
    path = tmp_path / "tracks.csv"
    if content is not None:
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(InputError) as caught:
        FeatureTracks.read_csv(path)
    message = str(caught.value)
    assert "\n" not in message
    for part in ["tracks.csv", *expected]:
        assert part in message


def test_rows_in_any_order_columns_in_any_order_and_unseen_features(tmp_path):
    path = tmp_path / "tracks.csv"
    path.write_text("feature,z,y,x,time\nb,6,5,4,2\n\na,3,2,1,1\nb,,,,1\n,,,,3\n", encoding="utf-8")
    tracks = FeatureTracks.read_csv(path)
    assert tracks.labels == ("b", "a")
    np.testing.assert_array_equal(tracks.time, [1, 2, 3])
    np.testing.assert_array_equal(tracks.seen, [[False, True], [True, False], [False, False]])
    np.testing.assert_array_equal(tracks.position[0, 1], [1, 2, 3])
    np.testing.assert_array_equal(tracks.position[1, 0], [4, 5, 6])


@pytest.mark.parametrize("na_rep", ["", "NaN", "NA"])
@pytest.mark.parametrize("frames", [3, 30_000])  # of 30,000 the file is long enough for the fast reader
def test_markers_that_pandas_writes_as_lost_are_those_of_arrays(tmp_path, na_rep, frames):
    """NaN in a file was an error, where NaN in an array is a feature that is not seen."""
    position = np.random.default_rng(4).normal(size=(frames, 2, 3))
    position[1, 0] = np.nan
    tracks = FeatureTracks(np.arange(float(frames)), position, ["a", "b"])
    rows = {"time": np.repeat(tracks.time, 2), "feature": ["a", "b"] * frames}
    rows |= {axis: position[..., index].ravel() for index, axis in enumerate("xyz")}
    pandas.DataFrame(rows).to_csv(tmp_path / "tracks.csv", index=False, na_rep=na_rep)
    found = FeatureTracks.read_csv(tmp_path / "tracks.csv")
    np.testing.assert_array_equal(found.position, position)
    assert found.labels == tracks.labels


def test_what_becomes_of_the_arrays_that_made_them_changes_no_tracks():
    """A program that fills one buffer anew for each recording changed the tracks that it had made before."""
    time, position, covariance = np.arange(2.0), np.ones((2, 3, 3)), np.tile(np.eye(3), (2, 3, 1, 1))
    tracks = FeatureTracks(time, position, ["a", "b", "c"], covariance)
    for buffer in (time, position, covariance):
        buffer[...] = -1.0
    np.testing.assert_array_equal(tracks.time, [0, 1])
    np.testing.assert_array_equal(tracks.position, np.ones((2, 3, 3)))
    np.testing.assert_array_equal(tracks.covariance[1, 2], np.eye(3))


def test_masked_positions_are_not_seen():
    """As netCDF4 and numpy.ma bring them; their numbers, such as -9999 for what is missing, were taken for seen."""
    position = np.full((2, 3, 3), 7.0)
    position[1, 2] = -9999.0
    tracks = FeatureTracks([0.0, 1.0], np.ma.masked_equal(position, -9999.0), ["a", "b", "c"])
    np.testing.assert_array_equal(tracks.seen, [[True] * 3, [True, True, False]])
    with pytest.raises(InputError, match=r"feature 'c' at 1\.0 s is partly NaN"):
        FeatureTracks([0.0, 1.0], np.ma.masked_array(position, np.arange(18).reshape(2, 3, 3) == 15), ["a", "b", "c"])
    with pytest.raises(InputError, match=r"^time of frame 1 is nan, expected a finite number"):
        FeatureTracks(np.ma.masked_array([0.0, 1.0], [False, True]), position, ["a", "b", "c"])


def test_tracks_are_shown_in_a_line():
    """Whoever looked at them in a notebook was shown all of their numbers."""
    position = np.zeros((2000, 3, 3))
    position[:500] = np.nan
    covariance = np.broadcast_to(np.eye(3), (2000, 3, 3, 3))
    tracks = FeatureTracks(np.arange(2000.0), position, ["a", "b", "c"], covariance, "2026-03-01T12:00:00Z")
    shown = "2000 frames from 0 to 1999 s, 3 features, 75 % seen, with covariances, time 0 is 2026-03-01T12:00:00Z"
    assert repr(tracks) == f"<FeatureTracks: {shown}>"
    assert "1 frame from 0 to 0 s, 1 feature, 0 % seen" in repr(FeatureTracks([0], [[[np.nan] * 3]], ["a"]))


characters = st.characters(exclude_categories=["Cs"], exclude_characters="\r\n")
labels = st.text(characters, min_size=1, max_size=5).map(str.strip).filter(bool)


@st.composite
def some_tracks(draw):
    names = draw(st.lists(labels, min_size=1, max_size=4, unique=True))
    steps = draw(st.lists(st.floats(1e-5, 1e6), min_size=1, max_size=5))
    time = draw(st.floats(-1e6, 1e6)) + np.cumsum(steps)
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    position = rng.normal(size=(len(time), len(names), 3)) * 10 ** rng.uniform(-8, 8)
    unseen = rng.random(position.shape[:2]) < draw(st.floats(0, 1))
    position[unseen] = np.nan
    covariance = None
    if draw(st.booleans()):
        factor = rng.normal(size=(*position.shape, 2))  # of rank two: as near to indefinite as can be
        covariance = factor @ np.swapaxes(factor, -1, -2)
        covariance[unseen] = np.nan
    return FeatureTracks(time, position, tuple(names), covariance)


@given(some_tracks())
def test_written_tracks_are_read_back_exactly(tmp_path_factory, tracks):
    path = tmp_path_factory.mktemp("round") / "tracks.csv"
    tracks.write_csv(path)
    back = FeatureTracks.read_csv(path)
    assert back.labels == tracks.labels
    np.testing.assert_array_equal(back.time, tracks.time)
    np.testing.assert_array_equal(back.position, tracks.position)
    assert (back.covariance is None) == (tracks.covariance is None)
    if tracks.covariance is not None:
        upper = np.triu_indices(3)
        np.testing.assert_array_equal(back.covariance[..., *upper], tracks.covariance[..., *upper])


def test_blanks_around_labels_are_ignored(tmp_path):
    path = tmp_path / "tracks.csv"
    path.write_text('time,feature,x,y,z\n0, left,1,2,3\n1,left,4,5,6\n1," right ",7,8,9\n', encoding="utf-8")
    assert FeatureTracks.read_csv(path).labels == ("left", "right")
    assert FeatureTracks([0.0], np.zeros((1, 2, 3)), [" left", "right\t"]).labels == ("left", "right")


def test_times_of_a_blackout_survive(tmp_path):
    position = np.arange(12.0).reshape(4, 1, 3)
    position[1:3] = np.nan
    FeatureTracks(np.arange(4.0), position, ("a",)).write_csv(tmp_path / "t.csv")
    assert (tmp_path / "t.csv").read_text().splitlines()[2:4] == ["1.0,,,,", "2.0,,,,"]
    np.testing.assert_array_equal(FeatureTracks.read_csv(tmp_path / "t.csv").time, np.arange(4.0))


WRONG = {
    "times that go back": ({"time": [0, 0]}, "strictly increasing"),
    "time of two dimensions": ({"time": [[0, 1]]}, "shape"),
    "no time at all": ({"time": [], "position": np.zeros((0, 2, 3))}, "shape"),
    "NaN time": ({"time": [0, np.nan]}, "finite"),
    "position of the wrong shape": ({"position": np.zeros((2, 3, 3))}, "expected (2, 2, 3)"),
    "text for a position": ({"position": "far"}, "numbers"),
    "times in nanoseconds": ({"time": [1.7e18, 1.8e18]}, "1.7e+18 s, expected within ±1e+10 s"),
    "a step too short": ({"time": [0, 1e-300]}, "time goes from 0.0 to 1e-300, expected steps of at least 1e-06 s"),
    "position far off": ({"position": np.full((2, 2, 3), 1e160)}, "'a' at 0.0 s is far off, expected coordinates"),
    "huge covariance": ({"covariance": np.full((2, 2, 3, 3), 1e300)}, "'a' at 0.0 s: expected numbers within ±1e+18"),
    "infinite position": ({"position": np.full((2, 2, 3), np.inf)}, "infinite"),
    "half a position": ({"position": np.broadcast_to([1, np.nan, 1], (2, 2, 3))}, "partly NaN"),
    "label twice": ({"labels": ("a", "a")}, "twice"),
    "empty label": ({"labels": ("a", "")}, "empty"),
    "label of blanks": ({"labels": ("a", " \t")}, "empty"),
    "label twice but for blanks": ({"labels": ("a", " a")}, "'a' stands twice"),
    "label that is no text": ({"labels": ("a", 2)}, "label 2: expected a text"),
    "no labels": ({"labels": None}, "labels: found None, expected a text for each feature"),
    "a number of labels": ({"labels": 2}, "labels: found 2, expected a text for each feature"),
    "a camera's file": ({"camera": "attitude.csv"}, "camera: found str, expected Camera, as of Camera.load"),
    "label that is no Unicode": ({"labels": ("a", "\ud800")}, "UTF-8"),
    "covariance of the wrong shape": ({"covariance": np.zeros((2, 2, 3))}, "shape"),
    "covariance not symmetric": ({"covariance": np.eye(3) + np.eye(3, k=1) + np.zeros((2, 2, 3, 3))}, "symmetric"),
    "covariance missing": ({"covariance": np.full((2, 2, 3, 3), np.nan)}, "symmetric"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_arrays_are_refused(case):
    arguments, expected = WRONG[case]
    sound = {"time": [0.0, 1.0], "position": np.zeros((2, 2, 3)), "labels": ("a", "b")}
    with pytest.raises(InputError) as caught:
        FeatureTracks(**(sound | arguments))
    assert expected in str(caught.value)


def test_some_features_in_another_order():
    """With what belongs to them, and what belongs to all."""
    rng = np.random.default_rng(0)
    variances = rng.uniform(1, 2, (4, 3))
    tracks = FeatureTracks(
        np.arange(4.0), rng.normal(size=(4, 3, 3)), ("a", "b", "c"), variances[..., None, None] * np.eye(3),
        epoch="2026-03-01T12:00:00Z",
    )  # fmt: skip
    found = tracks.of_features(["c", "a"])
    assert (found.labels, found.epoch) == (("c", "a"), tracks.epoch)
    np.testing.assert_array_equal(found.position, tracks.position[:, [2, 0]])
    np.testing.assert_array_equal(found.covariance[..., 0, 0], variances[:, [2, 0]])
    with pytest.raises(InputError, match="label 'd': expected some of a, b, c"):
        tracks.of_features(["a", "d"])
    with pytest.raises(InputError, match="'a'"):
        tracks.of_features(["a", "a"])


def test_failed_write_leaves_no_file(tmp_path):
    tracks = FeatureTracks(np.zeros(1), np.zeros((1, 1, 3)), ("a",))
    with pytest.raises(InputError):
        tracks.write_csv(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_utc_times_are_seconds_from_the_earliest(tmp_path):
    """Rows in any order; written, they are UTC times again."""
    path, again = tmp_path / "tracks.csv", tmp_path / "again.csv"
    rows = ["2026-03-01T12:00:01.25Z,b,1,2,3", "2026-03-01T12:00:00.000002Z,a,4,5,6", "2026-060T12:00:00,,,,"]
    path.write_text("\n".join(["time,feature,x,y,z", *rows, ""]), encoding="utf-8")
    tracks = FeatureTracks.read_csv(path)
    assert tracks.epoch == "2026-03-01T12:00:00Z"
    np.testing.assert_array_equal(tracks.time, [0, 2e-6, 1.25])
    tracks.write_csv(again)
    read = FeatureTracks.read_csv(again)
    np.testing.assert_array_equal(read.time, tracks.time)
    np.testing.assert_array_equal(read.position, tracks.position)
    assert (read.epoch, read.labels) == (tracks.epoch, tracks.labels)


def test_an_epoch_is_a_utc_time():
    with pytest.raises(InputError, match="epoch: found 'now', expected a UTC time"):
        FeatureTracks([0.0], np.zeros((1, 1, 3)), ["a"], epoch="now")
    assert FeatureTracks([0.0], np.zeros((1, 1, 3)), ["a"]).epoch is None
    dated = FeatureTracks([0.0], np.zeros((1, 1, 3)), ["a"], epoch=datetime(2026, 3, 1, 12))
    assert dated.epoch == "2026-03-01T12:00:00Z"


def test_times_with_offsets_are_those_in_utc(tmp_path):
    """Of an hour that summer time repeats: 02:30 is twice, and the offsets tell which."""
    times = ["2026-10-25T02:30:00+02:00", "2026-10-25T02:30:00+01:00", "2026-10-25T01:31:00Z"]
    rows = "".join(f"{time},a,1,2,3\n" for time in times)
    (tmp_path / "tracks.csv").write_text("time,feature,x,y,z\n" + rows, encoding="utf-8")
    tracks = FeatureTracks.read_csv(tmp_path / "tracks.csv")
    assert tracks.epoch == "2026-10-25T00:30:00Z"
    np.testing.assert_array_equal(tracks.time, [0.0, 3600.0, 3660.0])

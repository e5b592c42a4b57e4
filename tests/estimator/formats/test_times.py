"""Times of frames and datasets in other forms than numbers of seconds."""

from datetime import UTC, datetime, timedelta, timezone

import numpy as np
import pandas
import polars
import pytest
import xarray
from scipy.spatial.transform import Rotation

from baryscope.estimator import (
    FeatureTracks,
    dataset_of_tracks,
    estimate,
    read_tracks,
    tracks_of,
    tracks_of_dataset,
    write_tracks,
)
from baryscope.models.errors import InputError
from baryscope.models.orbit import Orbit
from synthetic import box_features

BEGIN = datetime(2026, 3, 1, 12, tzinfo=UTC)
MILLISECONDS = [timedelta(milliseconds=250 * k) for k in range(3)]
ROWS = {"feature": ["a", "a", "b"], **{axis: [1.0, 2.0, 3.0] for axis in "xyz"}}
ABROAD = timezone(timedelta(hours=5, minutes=30))


@pytest.mark.parametrize("kind", [dict, polars.DataFrame, pandas.DataFrame])
@pytest.mark.parametrize(
    "moments",
    [
        pytest.param([BEGIN + span for span in MILLISECONDS], id="in UTC"),
        pytest.param([(BEGIN + span).astimezone(ABROAD) for span in MILLISECONDS], id="in another zone"),
        pytest.param([(BEGIN + span).replace(tzinfo=None) for span in MILLISECONDS], id="naive"),
    ],
)
def test_datetimes_of_any_kind_and_zone_are_the_same_times(kind, moments):
    """pandas reads texts that end in Z as datetimes with a zone; these, and Python's own, were refused."""
    if kind is polars.DataFrame and moments[0].tzinfo is ABROAD:
        moments = polars.Series([BEGIN + span for span in MILLISECONDS]).dt.convert_time_zone("Asia/Kolkata")
    found = tracks_of(kind({"time": moments} | ROWS))
    assert found.epoch == "2026-03-01T12:00:00Z"
    assert found.time.tolist() == [0.0, 0.25, 0.5]


@pytest.mark.parametrize("kind", [dict, polars.DataFrame, pandas.DataFrame])
def test_durations_are_seconds(kind):
    """They were counted in units of their own: microseconds of polars, nanoseconds of pandas."""
    found = tracks_of(kind({"time": MILLISECONDS} | ROWS))
    assert found.epoch is None
    assert found.time.tolist() == [0.0, 0.25, 0.5]


def test_a_datetime_that_is_missing_is_named():
    for missing in (None, pandas.NaT, pandas.NA):
        rows = pandas.DataFrame({"time": [BEGIN, missing, BEGIN]} | ROWS)
        with pytest.raises(InputError, match="frame, row 1, column time: missing, expected a datetime"):
            tracks_of(rows)


@pytest.mark.parametrize(
    "change, expected",
    [
        ({"time": [BEGIN, "x", BEGIN]}, "row 1, column time: found 'x', expected a datetime"),
        ({"time": [BEGIN, pandas.NA, BEGIN]}, "row 1, column time: missing, expected a datetime"),
        ({"time": [*MILLISECONDS[:2], 0.5]}, "row 2, column time: found '0.5', expected a duration"),
        (
            {"time": [0.0, 1.0, 2.0], "x": np.array(MILLISECONDS, dtype="m8[ms]")},
            "column x: found timedelta64.ms.,",
        ),
    ],
)
def test_times_among_others_are_named(change, expected):
    with pytest.raises(InputError, match=f"frame, {expected}"):
        tracks_of(ROWS | change)


def test_masked_cells_are_missing():
    """Their numbers were taken for seen, of tables from netCDF4 and numpy.ma."""
    hidden = np.array([False, False, True])
    masked = {axis: np.ma.masked_array([1.0, 2.0, -9999.0], hidden) for axis in "xyz"}
    found = tracks_of({"time": [0.0, 1.0, 2.0], "feature": ["a", "a", "a"]} | masked)
    assert found.seen[:, 0].tolist() == [True, True, False]
    assert tracks_of(ROWS | {"time": [0.0, 1.0, 2.0], "feature": np.ma.masked_array(["a"] * 3, False)}).labels == ("a",)
    for moments in (np.array(MILLISECONDS, dtype="m8[ms]"), np.arange(3).astype("M8[s]")):
        with pytest.raises(InputError, match=r"frame, row 2, column time: missing, expected a (datetime|number)"):
            tracks_of(ROWS | {"time": np.ma.masked_array(moments, hidden)})


def test_a_lazy_frame_is_refused_in_a_line():
    with pytest.raises(InputError, match=r"^frame: a lazy frame, expected its rows: frame\.collect\(\)$"):
        tracks_of(polars.DataFrame({"time": [0.0, 1.0, 2.0]} | ROWS).lazy())


def test_a_missing_label_of_pandas_is_an_empty_cell():
    rows = pandas.DataFrame({"time": [0.0, 1.0, 2.0]} | ROWS)
    rows["feature"] = rows["feature"].astype("string")
    rows.loc[1, ["feature", "x", "y", "z"]] = pandas.NA
    found = tracks_of(rows)
    assert found.labels == ("a", "b")
    assert found.seen.tolist() == [[True, False], [False, False], [False, True]]


def test_a_dataset_whose_times_xarray_has_decoded(tmp_path):
    """As it does unless told not to; nanoseconds since 1970 were taken for seconds, and refused."""
    position = np.random.default_rng(1).normal(size=(3, 2, 3))
    dated = FeatureTracks([0.0, 0.25, 0.5], position, ["a", "b"], epoch="2026-03-01T12:00:00Z")
    write_tracks(dated, tmp_path / "t.nc")
    with xarray.open_dataset(tmp_path / "t.nc", engine="h5netcdf") as found:
        assert found["time"].dtype.kind == "M"
        back = tracks_of_dataset(found)
    assert back.epoch == dated.epoch
    assert back.time.tolist() == dated.time.tolist()
    np.testing.assert_array_equal(back.position, position)
    lasting = dataset_of_tracks(FeatureTracks(dated.time, position, dated.labels))
    lasting["time"] = (1e3 * lasting["time"].values).astype("timedelta64[ms]")
    assert tracks_of_dataset(lasting).time.tolist() == dated.time.tolist()


@pytest.mark.parametrize("ending", [".nc", ".zarr"])
def test_times_as_xarray_writes_datetimes_and_durations(tmp_path, ending):
    """It takes the longest unit that has no fractions, as milliseconds: a file of datetimes was refused."""
    position = np.random.default_rng(1).normal(size=(3, 2, 3))
    found = dataset_of_tracks(FeatureTracks([0.0, 0.25, 0.5], position, ["a", "b"]))
    del found["time"].attrs["units"]
    spans = pandas.to_timedelta([0, 250, 500], unit="ms")
    for times, epoch in ((pandas.Timestamp("2026-03-01 12:00") + spans, "2026-03-01T12:00:00Z"), (spans, None)):
        path = tmp_path / f"{epoch is None}{ending}"
        dated = found.assign_coords(time=times)
        if ending == ".nc":
            dated.to_netcdf(path, engine="h5netcdf")
        else:
            dated.to_zarr(path, zarr_format=2)
        back = read_tracks(path)
        assert (back.time.tolist(), back.epoch) == ([0.0, 0.25, 0.5], epoch)


@pytest.mark.parametrize(
    "units, seconds, epoch",
    [
        ("ms", 1e-3, None),
        ("minutes", 60.0, None),
        ("hours since 2026-03-01 12:00:00", 3600.0, "2026-03-01T12:00:00Z"),
        ("days since 2026-3-1", 86400.0, "2026-03-01T00:00:00Z"),
        ("seconds since 2026-03-01 06:00:00 -05:30", 1.0, "2026-03-01T11:30:00Z"),
        ("milliseconds since 2026-03-01T12:00:00Z", 1e-3, "2026-03-01T12:00:00Z"),
    ],
)
def test_times_of_a_dataset_are_in_any_unit_of_cf(units, seconds, epoch):
    found = dataset_of_tracks(FeatureTracks([1.0, 2.0, 4.0], np.zeros((3, 1, 3)), ["a"]))
    found["time"].attrs["units"] = units
    back = tracks_of_dataset(found)
    assert (back.time / seconds).tolist() == pytest.approx([1.0, 2.0, 4.0])
    assert back.epoch == epoch


@pytest.mark.parametrize("moment, calendar", [("nonsense", "standard"), ("2026-03-01", "noleap")])
def test_moments_that_are_not_of_utc_are_refused(moment, calendar):
    found = dataset_of_tracks(FeatureTracks([1.0, 2.0], np.zeros((2, 1, 3)), ["a"]))
    found["time"].attrs |= {"units": f"seconds since {moment}", "calendar": calendar}
    with pytest.raises(InputError, match=f"^dataset, time: since '{moment}' in the calendar '{calendar}', expected a "):
        tracks_of_dataset(found)


def test_the_axes_of_a_dataset_go_by_their_labels():
    """One labelled z, y, x was read as a mirror image; one without times had its frames' numbers for seconds."""
    rng = np.random.default_rng(2)
    root = rng.normal(size=(3, 2, 3, 3))
    tracks = FeatureTracks([0.0, 1.0, 2.0], rng.normal(size=(3, 2, 3)), ["a", "b"], root @ np.swapaxes(root, 2, 3))
    found = dataset_of_tracks(tracks)
    for other in (found.isel(axis=[2, 0, 1], axis_=[1, 2, 0]), found.drop_vars(["axis", "axis_"])):
        back = tracks_of_dataset(other)
        np.testing.assert_array_equal(back.position, tracks.position)
        np.testing.assert_array_equal(back.covariance, tracks.covariance)
    with pytest.raises(InputError, match="dataset, axis: found e, n, u, expected x, y, z"):
        tracks_of_dataset(found.assign_coords(axis=["e", "n", "u"]))
    with pytest.raises(InputError, match="dataset, time: no variable of that name, expected the times of the frames"):
        tracks_of_dataset(found.drop_vars("time"))


def test_an_estimate_of_dated_tracks_is_dated(tmp_path):
    """Its path was in seconds from a time that neither its files nor its dataset told."""
    time = np.arange(20.0)
    turn = Rotation.from_rotvec(time[:, None] * [0.0, 0.06, 0.08]).as_matrix()
    position = box_features(4, (4, 3, 2), seed=1) @ np.swapaxes(turn, 1, 2)
    dated = FeatureTracks(time, position, list("abcd"), epoch="2026-03-01T12:00:00Z")
    result = estimate(dated, method="score")
    assert result.epoch == dated.epoch
    result.to_dataset().to_netcdf(tmp_path / "e.nc", engine="h5netcdf")
    with xarray.open_dataset(tmp_path / "e.nc", engine="h5netcdf") as found:
        assert str(found["time"].values[2]) == "2026-03-01T12:00:02.000000000"
    orbit = Orbit(7.2e6, 0.0, 1.7, epoch="2026-03-02T00:00:00Z")  # the elements are those of time 0
    undated = FeatureTracks(time, position, dated.labels)
    assert estimate(undated, method="score", orbit=orbit).epoch == orbit.epoch
    assert estimate(undated, method="score").epoch is None


@pytest.mark.parametrize("kind, unit", [("datetime64", "D"), ("datetime64", "ns"), ("timedelta64", "ms")])
def test_tracks_take_numbers_of_seconds_alone(kind, unit):
    """Days, nanoseconds and milliseconds were taken for seconds."""
    with pytest.raises(InputError, match=rf"^time: found {kind}\[{unit}\], expected real numbers$"):
        FeatureTracks(np.arange(3).astype(f"{kind}[{unit}]"), np.zeros((3, 1, 3)), ["a"])

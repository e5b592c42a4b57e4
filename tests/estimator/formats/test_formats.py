"""Tracks in other forms: each holds what the CSV file holds, in any unit; what is none is refused in a line."""

import numpy as np
import pandas
import polars
import pytest
import xarray

from baryscope.estimator import (
    FeatureTracks,
    dataset_of_tracks,
    estimate,
    read_tracks,
    tracks_of,
    tracks_of_dataset,
    write_estimate,
    write_tracks,
)
from baryscope.models.errors import InputError
from recorded import LABELS, TIME, same, trc


def columns(tracks, scale=1.0):
    """One row per observation and one for the frame without any."""
    frame, feature = np.nonzero(tracks.seen)
    blank = np.nonzero(~tracks.seen.any(axis=1))[0]
    rows = {"time": np.concatenate([tracks.time[frame], tracks.time[blank]])}
    rows["feature"] = [*(tracks.labels[k] for k in feature), *[None] * len(blank)]
    for axis, name in enumerate("xyz"):
        rows[name] = np.concatenate([scale * tracks.position[frame, feature, axis], np.full(len(blank), np.nan)])
    if tracks.covariance is not None:
        for name, (i, j) in {
            "cxx": (0, 0),
            "cxy": (0, 1),
            "cxz": (0, 2),
            "cyy": (1, 1),
            "cyz": (1, 2),
            "czz": (2, 2),
        }.items():
            rows[name] = np.append(scale**2 * tracks.covariance[frame, feature, i, j], np.full(len(blank), np.nan))
    return rows


@pytest.mark.parametrize("kind", [dict, polars.DataFrame, pandas.DataFrame])
def test_frames_are_read_as_the_csv_file(tracks, precise, kind, tmp_path):
    for one in (tracks, precise):
        same(tracks_of(kind(columns(one))), one)
        same(tracks_of(kind(columns(one, 1e3)), units="mm"), one)
    precise.write_csv(tmp_path / "t.csv")
    same(FeatureTracks.read_csv(tmp_path / "t.csv"), precise)


@pytest.mark.parametrize("kind", [dict, polars.DataFrame, pandas.DataFrame])
def test_tracks_are_restored_from_their_columns(tracks, precise, kind):
    """In s and in UTC, with covariances and without; a frame without observations keeps its row."""
    for one in (tracks, precise):
        restored = tracks_of(kind(one.columns()))
        same(restored, one)
        assert restored.epoch == one.epoch


@pytest.mark.parametrize("frame, units, line", [
    (None, "m", "frame: found NoneType, expected a frame of polars or pandas, or columns by name"),
    (np.eye(3), "m", "frame: found ndarray, expected a frame of polars or pandas, or columns by name"),
    ({"feature": "a"}, "m", r"frame, column feature: found the shape \(\), expected a label for each row"),
    ({}, 3, "frame: lengths in 3, expected one of m, cm, mm, in, ft, km"),
    ({}, None, "frame: lengths in None, expected one of m, cm, mm, in, ft, km"),
])  # fmt: skip
def test_arguments_of_another_kind_are_refused_in_one_line(tracks, frame, units, line):
    with pytest.raises(InputError, match=f"^{line}$"):
        tracks_of(columns(tracks) | frame if isinstance(frame, dict) else frame, units=units)


def test_datetimes_count_from_the_earliest(tracks):
    rows = columns(tracks)
    rows["time"] = np.datetime64("2026-03-01T12:00:00") + (rows["time"] * 1e9).astype("timedelta64[ns]")
    found = tracks_of(polars.DataFrame(rows))
    same(found, tracks)
    assert found.epoch.startswith("2026-03-01T12:00:00")


def texts(time):
    """UTC texts of times in s."""
    begin = np.datetime64("2026-03-01T12:00:00", "ns")
    return [f"{begin + np.timedelta64(round(1e9 * second), 'ns')}Z" for second in time]


@pytest.mark.parametrize("kind", [dict, polars.DataFrame, pandas.DataFrame])
def test_utc_texts_are_read_as_in_the_csv_file(tracks, kind, tmp_path):
    rows = columns(tracks)
    rows["time"] = texts(rows["time"])
    found = tracks_of(kind(rows))
    same(found, tracks)
    assert found.epoch == "2026-03-01T12:00:00Z"
    polars.DataFrame(rows).write_parquet(tmp_path / "t.parquet")
    same(read_tracks(tmp_path / "t.parquet"), tracks)


def test_numbers_as_texts_are_numbers(tracks):
    rows = columns(tracks)
    same(tracks_of(rows | {"time": [str(second) for second in rows["time"]]}), tracks)


def test_parquet(precise, tmp_path):
    polars.DataFrame(columns(precise)).write_parquet(tmp_path / "t.parquet")
    same(read_tracks(tmp_path / "t.parquet"), precise)


@pytest.mark.parametrize("classic", [False, True])
def test_netcdf_with_labels_of_characters(tracks, tmp_path, classic):
    """As NetCDF 3, MATLAB and Fortran have them: labels were "b'left'", axes refused, and the classic form not read."""
    found = dataset_of_tracks(tracks)
    for name in ("feature", "axis"):
        found[name] = np.char.encode(found[name].values.astype(str), "utf-8")
    found.to_netcdf(tmp_path / "t.nc", engine="scipy" if classic else "h5netcdf")
    assert (tmp_path / "t.nc").read_bytes().startswith(b"CDF") == classic
    same(read_tracks(tmp_path / "t.nc"), tracks)
    same(tracks_of_dataset(found), tracks)


def test_netcdf_and_back(precise, tracks, tmp_path):
    for one in (precise, tracks):
        path = tmp_path / "t.nc"
        found = dataset_of_tracks(one)
        assert found.attrs["Conventions"].startswith("CF-")
        found.to_netcdf(path, engine="h5netcdf")
        back = read_tracks(path)
        same(back, one)
        assert back.epoch == one.epoch
    found["position"].attrs["units"] = "mm"
    found["position"].data *= 1e3
    same(tracks_of_dataset(found), tracks)
    found.to_netcdf(path, engine="h5netcdf")
    same(read_tracks(path), tracks)


@pytest.mark.parametrize("unit", ["millimeter", "millimetres", "MM"])
def test_units_are_spelt_as_udunits_and_files_do(tracks, tmp_path, unit):
    found = dataset_of_tracks(tracks)
    found["position"].attrs["units"] = unit
    found["position"].data *= 1e3
    found.to_netcdf(tmp_path / "t.nc", engine="h5netcdf")
    same(read_tracks(tmp_path / "t.nc"), tracks)
    (tmp_path / "t.trc").write_text(trc(tracks).replace("\tmm\t", f"\t{unit}\t"), encoding="utf-8")
    same(read_tracks(tmp_path / "t.trc"), tracks)


@pytest.mark.parametrize("told", ["m2", "m^2", "metre**2"])
def test_covariances_have_a_unit_of_their_own(precise, tmp_path, told):
    """Positions in millimetres beside covariances in m² made these too small by a million."""
    found = dataset_of_tracks(precise)
    found["position"].attrs["units"] = "mm"
    found["position"].data *= 1e3
    found["covariance"].attrs["units"] = told
    found.to_netcdf(tmp_path / "t.nc", engine="h5netcdf")
    same(read_tracks(tmp_path / "t.nc"), precise)
    found["covariance"].attrs["units"] = "m"
    with pytest.raises(InputError, match="dataset, covariance: in 'm', expected the square of a unit of length"):
        tracks_of_dataset(found)


def test_a_dataset_is_read_in_metres(precise, tmp_path):
    """Its tracks, which are in m by contract, had the numbers of its own unit, and estimates of them m for mm.

    Told to be in mm, with covariances that say mm2, these were taken for m2 and made mm2: too small by a million.
    """
    found = dataset_of_tracks(precise)
    found["position"] = 1e3 * found["position"]  # keeps no attributes
    found["covariance"].data *= 1e6
    found["covariance"].attrs["units"] = "mm2"
    same(tracks_of_dataset(found, units="mm"), precise)
    found.to_netcdf(tmp_path / "t.nc", engine="h5netcdf")
    same(read_tracks(tmp_path / "t.nc", "mm"), precise)
    for said, told in (("m", "m2"), ("m", "mm2"), ("cm", "cm2")):
        found["position"].attrs["units"], found["covariance"].attrs["units"] = said, told
        same(tracks_of_dataset(found, units="mm"), precise)
    found["covariance"].attrs["units"] = "mm2"
    found["position"].attrs["units"] = "mm"
    same(tracks_of_dataset(found), precise)
    found["position"].attrs["units"] = "furlong"
    with pytest.raises(InputError, match=r"^dataset: lengths in 'furlong', expected one of m, cm, mm"):
        tracks_of_dataset(found)
    with pytest.raises(InputError, match=r"^frame: a dataset of xarray, expected rows; tracks_of_dataset takes"):
        tracks_of(found)


def test_zarr_and_back(precise, tracks, tmp_path):
    """A folder of Zarr's format 2, which xarray opens by itself; a new one replaces it whole."""
    path = tmp_path / "t.zarr"
    for one in (precise, tracks):
        write_tracks(one, path)
        back = read_tracks(path)
        same(back, one)
        assert back.epoch == one.epoch
        assert (back.covariance is None) == (one.covariance is None)
        with xarray.open_zarr(path, decode_times=False) as found:
            np.testing.assert_array_equal(found["position"], one.position)
    assert [entry.name for entry in tmp_path.iterdir()] == ["t.zarr"]
    found = dataset_of_tracks(tracks)
    found["position"].attrs["units"] = "mm"
    found.to_zarr(tmp_path / "mm.zarr", zarr_format=2, consolidated=True)
    same(read_tracks(tmp_path / "mm.zarr", "m"), tracks)
    same(read_tracks(tmp_path / "mm.zarr"), FeatureTracks(TIME, 1e-3 * tracks.position, LABELS))


def test_a_folder_that_is_no_zarr_store_is_left_alone(tracks, tmp_path):
    (tmp_path / "t.zarr").mkdir()
    (tmp_path / "t.zarr" / "mine.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(InputError, match=r"t\.zarr: is there, but is not a Zarr store; expected another name"):
        write_tracks(tracks, tmp_path / "t.zarr")
    with pytest.raises(InputError, match=r"t\.zarr: not Zarr \(No group found"):
        read_tracks(tmp_path / "t.zarr")
    with pytest.raises(InputError, match=r"u\.zarr: no such folder, expected feature tracks in Zarr"):
        read_tracks(tmp_path / "u.zarr")
    assert (tmp_path / "t.zarr" / "mine.txt").read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize(
    "change, expected",
    [
        (lambda rows: rows.pop("y"), "has no column 'y', expected time, feature, x, y, z"),
        (lambda rows: rows.update(cxx=rows["x"]), "has cxx only, expected all of cxx, cxy"),
        (lambda rows: rows.update(x=["far"] * len(rows["x"])), "column x: found .*, expected real numbers"),
        (lambda rows: rows["x"].__setitem__(3, np.inf), "column x: an infinite number"),
        (lambda rows: rows["x"].__setitem__(3, np.inf), "frame, row 3, column x: an infinite number, expected finite"),
        (lambda rows: rows["time"].__setitem__(2, -np.inf), "frame, row 2, column time: an infinite number"),
        (lambda rows: rows.update(x=rows["x"] > 0), "frame, column x: true and false, expected finite numbers"),
        (lambda rows: rows.update(y=[None, *[True] * (len(rows["x"]) - 1)]), "column y: true and false, expected"),
        (lambda rows: rows.update(time=np.arange(len(rows["x"])) > 0), "column time: true and false, expected"),
        (
            lambda rows: rows.update(time=[*texts(rows["time"])[:-1], "noon"]),
            "frame, row 152, column time: found 'noon', expected a UTC time as",
        ),
        (
            lambda rows: rows.update(time=[*texts(rows["time"])[:-1], None]),
            "frame, row 152, column time: found 'None', expected a UTC time as",
        ),
        (lambda rows: rows["x"].__setitem__(3, np.nan), "frame, row 3, column x: missing, expected a number"),
        (lambda rows: rows["time"].__setitem__(1, 0.5), "frame, row .*, column feature: 'right' stands twice at 0.5 s"),
        (lambda rows: rows.update(feature=[None] * len(rows["x"])), "column feature: no label in"),
        (lambda rows: rows.update({name: [] for name in rows}), "no rows, expected at least one"),
        (lambda rows: rows.update(z=rows["z"][:-1]), "columns of .* rows, expected as many in all"),
    ],
)
def test_a_frame_that_holds_no_tracks_is_refused_in_a_line(tracks, change, expected):
    rows = columns(tracks)
    change(rows)
    with pytest.raises(InputError, match=expected):
        tracks_of(rows)


@pytest.mark.parametrize("name, content, expected", [
    ("t.parquet", b"PAR1", "not Parquet"),
    ("t.nc", b"CDF", r"not NetCDF \("),
    ("t.nc", b"CDF\1" + bytes(5), r"not NetCDF \("),
    ("t.trk", b"", "ends in '.trk', expected one of .csv, .parquet, .trc, .c3d, .nc, .zarr"),
])  # fmt: skip
def test_other_files_are_refused(tmp_path, name, content, expected):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=expected):
        read_tracks(tmp_path / name)


def test_a_dataset_without_tracks_is_refused(tracks):
    found = dataset_of_tracks(tracks)
    with pytest.raises(InputError, match="position: no variable of that name, expected the dimensions"):
        tracks_of_dataset(found.drop_vars("position"))
    found["time"].attrs["units"] = "frames"
    with pytest.raises(InputError, match="time: units 'frames', expected s"):
        tracks_of_dataset(found)


@pytest.mark.parametrize("method", ["pivot", "screw-raw"])
def test_an_estimate_as_a_dataset(tracks, tmp_path, method):
    result = estimate(tracks, method=method)
    found = result.to_dataset()
    np.testing.assert_array_equal(found["position"].sel(axis="y"), result.position[:, 1])
    np.testing.assert_array_equal(found["residual"].sel(feature="back"), result.residuals[:, 3])
    assert ("covariance" in found) == (result.covariance is not None)
    assert found.attrs["method"] == method
    assert found["position"].attrs["units"] == "m"
    found.to_netcdf(tmp_path / "e.nc", engine="h5netcdf")


@pytest.mark.parametrize("ending", [".csv", ".parquet", ".nc", ".zarr"])
def test_what_is_written_is_read(tracks, precise, tmp_path, ending):
    for one in (tracks, precise):
        write_tracks(one, tmp_path / f"t{ending}")
        back = read_tracks(tmp_path / f"t{ending}")
        same(back, one)
        assert back.epoch == one.epoch
    with pytest.raises(InputError, match=r"ends in '.txt', expected .csv, .parquet, .nc, .zarr, .trc or .c3d"):
        write_tracks(tracks, tmp_path / "t.txt")
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"t{ending}"]


def test_a_frame_without_observations_names_no_feature(tracks, tmp_path):
    position = tracks.position.copy()
    position[7] = np.nan
    write_tracks(FeatureTracks(TIME, position, LABELS), tmp_path / "t.parquet")
    rows = polars.read_parquet(tmp_path / "t.parquet").filter(polars.col("time") == TIME[7])
    assert rows["feature"].to_list() == [None]


def test_a_covariance_without_an_observation_is_not_written(tracks, tmp_path):
    position = tracks.position.copy()
    position[0, 1] = np.nan  # the first frame lists all features
    whole = FeatureTracks(TIME, position, LABELS, np.broadcast_to(1e-6 * np.eye(3), (40, 4, 3, 3)))
    for ending in (".csv", ".parquet"):
        write_tracks(whole, tmp_path / f"t{ending}")
        found = read_tracks(tmp_path / f"t{ending}")
        np.testing.assert_array_equal(found.position, position)
        np.testing.assert_array_equal(np.isnan(found.covariance[..., 0, 0]), np.isnan(position[..., 0]))


def test_estimates_in_other_forms(tracks, tmp_path):
    result = estimate(tracks)
    for ending in (".csv", ".parquet", ".nc", ".zarr"):
        write_estimate(result, tmp_path / f"e{ending}")
    rows, table = polars.read_csv(tmp_path / "e.csv"), polars.read_parquet(tmp_path / "e.parquet")
    assert rows.columns == table.columns
    np.testing.assert_array_equal(rows.to_numpy(), table.to_numpy())
    with xarray.open_dataset(tmp_path / "e.nc", engine="h5netcdf") as found:
        np.testing.assert_array_equal(found["covariance"].values[:, 0, 1], table["cxy"])
    with xarray.open_zarr(tmp_path / "e.zarr", decode_times=False) as found:
        np.testing.assert_array_equal(found["covariance"].values[:, 0, 1], table["cxy"])

"""`baryscope estimate` on small files: what it prints."""

import csv
import json
import pickle
import re

import ezc3d
import numpy as np
import polars
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator import FeatureTracks, PathOptions, estimate, read_tracks, write_tracks
from baryscope.report import prediction_chart
from baryscope.scripts.cli import app
from baryscope.scripts.cli import estimate as cli_estimate
from baryscope.scripts.cli import joint as cli_joint
from synthetic import box_features


@pytest.fixture
def tracks(tmp_path):
    """A file of a body that turns about a point at rest, 60 frames, always in view."""
    time = np.arange(60.0)
    turn = Rotation.from_rotvec(0.1 * time[:, None] * [0.0, 0.6, 0.8]).as_matrix()
    points = box_features(5, (4, 3, 2), seed=1) @ np.swapaxes(turn, 1, 2) + [1.0, -20.0, 2.0]
    noise = 0.01 * np.random.default_rng(4).normal(size=points.shape)
    path = tmp_path / "tracks.csv"
    FeatureTracks(time, points + noise, [f"F{i}" for i in range(5)]).write_csv(path)
    return path


def test_one_of_anything_is_singular(tracks, capsys):
    assert app.main(["estimate", str(tracks), "--trajectory", "fixed"]) == 0
    assert "60 positions from 1 cluster, 100 % of the times covered" in capsys.readouterr().out


def test_features_of_one_body_in_a_file_of_several(tracks, tmp_path, capsys):
    """The same estimate as of a file of these alone, to the digit, with their covariances and in the order given."""
    read = FeatureTracks.read_csv(tracks)
    other = read.position + np.sin(read.time)[:, None, None] * [3.0, 40.0, 1.0]
    labels = (*read.labels, *(f"other {label}" for label in read.labels))
    covariance = np.broadcast_to(np.diag([1e-4, 4e-4, 1e-4]), (60, 10, 3, 3))
    FeatureTracks(
        read.time, np.concatenate([other, read.position], axis=1), labels[5:] + labels[:5], covariance
    ).write_csv(tmp_path / "both.csv")
    FeatureTracks(read.time, read.position, read.labels, covariance[:, :5]).write_csv(tmp_path / "one.csv")
    options = ["--trajectory", "fixed", "--no-report"]
    assert app.main(["estimate", str(tmp_path / "both.csv"), "--features", "F0, F1,F2,F3,F4", *options]) == 0
    assert app.main(["estimate", str(tmp_path / "one.csv"), *options]) == 0
    one, both = ((tmp_path / f"{name}.estimate.csv").read_text(encoding="utf-8") for name in ("one", "both"))
    assert one == both


def test_labels_with_commas_stand_in_quotes(tracks, tmp_path, capsys):
    """As in a CSV file; all else is an error that shows them so."""
    read = FeatureTracks.read_csv(tracks)
    labels = ["F0, upper", 'a "lower", one', *read.labels[2:]]
    FeatureTracks(read.time, read.position, labels).write_csv(tmp_path / "commas.csv")
    FeatureTracks(read.time, read.position[:, :4], read.labels[:4]).write_csv(tmp_path / "plain.csv")
    options = ["--trajectory", "fixed", "--no-report"]
    named = '"F0, upper", "a ""lower"", one",F2,F3'
    assert app.main(["estimate", str(tmp_path / "commas.csv"), "--features", named, *options]) == 0
    assert app.main(["estimate", str(tmp_path / "plain.csv"), *options]) == 0
    one, both = ((tmp_path / f"{name}.estimate.csv").read_text(encoding="utf-8") for name in ("commas", "plain"))
    assert one == both
    capsys.readouterr()
    assert app.main(["estimate", str(tmp_path / "commas.csv"), "--features", "F0, upper,F2,F3", *options]) == 2
    assert """found 'F0', expected some of "F0, upper", "a ""lower"", one", F2""" in capsys.readouterr().err


@pytest.mark.parametrize(("scale", "told"), [(1.0, False), (1e3, True)])
def test_times_in_milliseconds_are_doubted(tracks, tmp_path, capsys, scale, told):
    """A minute is none: of a thousand it is said, in the line of the file; and of UTC and on an orbit it is right."""
    read = FeatureTracks.read_csv(tracks)
    path = tmp_path / "timed.csv"
    FeatureTracks(scale * read.time, read.position, read.labels).write_csv(path)
    app.main(["estimate", str(path), "--trajectory", "fixed", "--no-report"])
    assert ("timed.csv: it lasts" in capsys.readouterr().err) == told
    FeatureTracks(scale * read.time, read.position, read.labels, epoch="2030-01-01T00:00:00Z").write_csv(path)
    app.main(["estimate", str(path), "--trajectory", "fixed", "--no-report"])
    assert "it lasts" not in capsys.readouterr().err


def test_tracks_in_millimetres_and_in_another_form(tracks, tmp_path, capsys):
    """The same estimate to rounding, in metres."""
    rows = polars.read_csv(tracks).with_columns(polars.col("x", "y", "z") * 1e3)
    rows.write_parquet(tmp_path / "tracks.parquet")
    assert app.main(["estimate", str(tmp_path / "tracks.parquet"), "--trajectory", "fixed"]) == 2
    assert "in millimetres? (--units mm)" in capsys.readouterr().err
    for path, units in ((tracks, "m"), (tmp_path / "tracks.parquet", "mm")):
        options = ["--units", units, "--trajectory", "fixed", "-o", str(tmp_path / f"{units}.csv")]
        assert app.main(["estimate", str(path), *options]) == 0
    metres, millimetres = (polars.read_csv(tmp_path / f"{units}.csv").to_numpy() for units in ("m", "mm"))
    np.testing.assert_allclose(millimetres, metres, rtol=1e-6, atol=1e-9)


@pytest.fixture
def probe(tmp_path, monkeypatch):
    """Marks of a probe that turns about its tip, at rest at (120, 40, 900) mm, and of a table, from 2 s on at 50 Hz."""
    monkeypatch.chdir(tmp_path)
    rng, time = np.random.default_rng(1), np.arange(100, 300) / 50
    turn = Rotation.from_rotvec(0.5 * np.sin(2 * np.pi * time[:, None] * [0.3, 0.5, 0.2])).as_matrix()
    marks = np.array([[0.0, 0.0, 0.2], [0.06, 0.0, 0.22], [0.0, 0.06, 0.24], [0.03, 0.03, 0.3]])
    points = [0.12, 0.04, 0.9] + marks @ np.swapaxes(turn, 1, 2)
    still = np.broadcast_to([[0.5, 0.0, 0.8]], (200, 1, 3))
    position = np.concatenate([points, still], axis=1) + 2e-4 * rng.standard_normal((200, 5, 3))
    position[7, 4] = np.nan
    tracks = FeatureTracks(time, position, [*"abcd", "table"])
    for form in ("trc", "c3d"):
        write_tracks(tracks, f"probe.{form}")
    return tracks


def test_the_centre_is_one_more_marker_for_programs_of_motion_capture(probe, capsys):
    """The recording as it was, with the path of the CSV file beside it; C3D as ezc3d reads it."""
    command = ["--features", "a,b,c,d", "--trajectory", "fixed", "--no-report", "-o"]
    assert app.main(["estimate", "probe.c3d", *command, "tip.csv"]) == 0
    path = polars.read_csv("tip.csv").select("x", "y", "z").to_numpy()
    capsys.readouterr()
    for form in ("trc", "c3d"):
        assert app.main(["estimate", f"probe.{form}", *command, f"tip.{form}"]) == 0
        assert f"it is the marker tip of tip.{form}, which has no place for its claim: ±" in capsys.readouterr().out
        found = read_tracks(f"tip.{form}")
        assert found.labels == (*probe.labels, "tip")
        np.testing.assert_allclose(found.time, probe.time, atol=1e-9)
        np.testing.assert_allclose(found.position[:, :5], probe.position, rtol=1e-6)  # C3D is in single precision
        np.testing.assert_allclose(found.position[:, 5], path, rtol=1e-6)
    binary = ezc3d.c3d("tip.c3d")
    assert binary["parameters"]["POINT"]["LABELS"]["value"] == [*probe.labels, "tip"]
    np.testing.assert_allclose(binary["data"]["points"][:3, 5].T, 1e3 * path, rtol=1e-6)


def test_a_centre_that_a_marker_cannot_tell_is_refused(tracks, probe, capsys):
    """A spin about one axis leaves it open along that; a marker of its name is there already."""
    for form in ("trc", "c3d"):
        assert app.main(["estimate", str(tracks), "--trajectory", "fixed", "-q", "-o", f"e.{form}"]) == 1
        expected = f"e.{form}: the estimate's status is not observable, which {form.upper()} cannot tell; -o EST.csv"
        assert expected in capsys.readouterr().err
        assert not list(tracks.parent.glob("e.*"))
    assert app.main(["estimate", "probe.trc", "--features", "a,b,c,d", "-q", "-o", "table.c3d"]) == 2
    assert "table.c3d: the recording has a marker table, as the centre would be named" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "found"),
    [
        ("e.trc", "e.trc: found tracks with an epoch, for which TRC has no place"),
        ("e.c3d", "e.c3d: found tracks with an epoch, for which C3D has no place"),
        ("F1.trc", "F1.trc: the recording has a marker F1, as the centre would be named"),
    ],
)
def test_a_recording_that_cannot_be_written_is_refused_before_the_centre_is_sought(
    tracks, capsys, monkeypatch, name, found
):
    """By `estimate` and by `joint`, with the file's whole path: the line came after the whole computation."""
    for module, function in ((cli_estimate, "estimate"), (cli_joint, "joint")):
        monkeypatch.setattr(module, function, lambda *_, **__: pytest.fail("the centre was sought"))
    read = FeatureTracks.read_csv(tracks)
    dated = FeatureTracks(read.time, read.position, read.labels, epoch="2000-06-28T00:00:00Z")
    dated.write_csv(tracks)
    for command in (["estimate", "--trajectory", "fixed"], ["joint", "--child", "F0,F1,F2"]):
        assert app.main([*command, str(tracks), "-o", str(tracks.parent / name)]) == 2
        assert capsys.readouterr().err.splitlines()[-1] == f"baryscope: {tracks.parent / found}"
    assert [path.name for path in tracks.parent.iterdir()] == ["tracks.csv"]


TLE = """\
1 00005U 58002B   00179.78495062  .00000023  00000-0  28098-4 0  4753
2 00005  34.2682 348.7242 1859667 331.7664  19.3264 10.82419157413667
"""


def test_a_tle_needs_the_utc_of_the_tracks(tracks, tmp_path, capsys):
    orbit, dated = tmp_path / "satellite.tle", tmp_path / "dated.csv"
    orbit.write_text(TLE, encoding="utf-8")
    read = FeatureTracks.read_csv(tracks)
    FeatureTracks(read.time, read.position, read.labels, epoch="2000-06-28T00:00:00Z").write_csv(dated)
    command = ["--orbit", str(orbit), "--trajectory", "fixed"]
    assert app.main(["estimate", str(dated), *command]) == 0
    given = str(tmp_path / "given.csv")
    assert app.main(["estimate", str(tracks), *command, "--epoch", "2000-06-28T00:00:00.0", "-o", given]) == 0
    for name in ("dated.estimate.json", "given.json"):  # so that the times of the path are more than seconds
        assert json.loads((tmp_path / name).read_text(encoding="utf-8"))["epoch"] == "2000-06-28T00:00:00Z"
    capsys.readouterr()
    assert app.main(["estimate", str(tracks), *command]) == 2
    assert "mean elements of 2000-06-27T18:50:19.734Z, but when time 0" in capsys.readouterr().err
    assert app.main(["estimate", str(dated), *command, "--epoch", "2000-06-28"]) == 2
    assert "--epoch: found 2000-06-28 beside tracks with UTC times" in capsys.readouterr().err


def test_a_log_of_accelerations(tmp_path, capsys):
    """A chaser that flies away with 2e-3 m/s²: told, the path is a straight line less half of it times t²."""
    time = np.arange(0.0, 120.0)
    turn = Rotation.from_rotvec(0.1 * time[:, None] * [0.0, 0.6, 0.8]).as_matrix()
    com = [1.0, -20.0, 2.0] - np.outer(time**2 / 2, [2e-3, 0, 0])
    points = box_features(5, (4, 3, 2), seed=1) @ np.swapaxes(turn, 1, 2) + com[:, None]
    noise = 0.01 * np.random.default_rng(4).normal(size=points.shape)
    tracks, log = tmp_path / "tracks.csv", tmp_path / "thrust.csv"
    FeatureTracks(time, points + noise, [f"F{i}" for i in range(5)]).write_csv(tracks)
    log.write_text("time,ax,ay,az\n0,2e-3,0,0\n", encoding="utf-8")
    command = ["estimate", str(tracks), "--trajectory", "polynomial:1", "--process-noise", "none"]
    assert app.main([*command, "--acceleration", str(log), "--acceleration-scale", "0.05"]) == 0
    printed = capsys.readouterr().out
    assert "acceleration scale" in printed
    page = tmp_path / "tracks.estimate.report.html"
    assert f"report, for a browser: {page}" in printed
    assert "acceleration scale" in page.read_text(encoding="utf-8")
    bare = tmp_path / "bare.csv"  # untold, a straight line does not fit, and the files say so
    assert app.main([*command, "--no-report", "-o", str(bare), "-q"]) == 3
    assert {path.name for path in tmp_path.glob("bare*")} == {"bare.csv", "bare.json"}
    found = np.loadtxt(tmp_path / "tracks.estimate.csv", delimiter=",", skiprows=1)[:, 1]
    np.testing.assert_allclose(found, com[:, 0], atol=0.02)  # across the axis: a spin leaves the position along it open
    other = tmp_path / "other.csv"
    for moments, words in (
        (
            (200, 300),
            "other.csv: its first row is at 200 s, after 119 s, the last time in question: it changes nothing",
        ),
        ((-9, -2), "other.csv: its last row is at -2 s, before 0 s, the first time in question: it changes nothing"),
    ):
        rows = (f"{moment},{size},0,0" for moment, size in zip(moments, (2e-3, 0), strict=True))
        other.write_text("\n".join(["time,ax,ay,az", *rows]), encoding="utf-8")
        capsys.readouterr()
        assert app.main([*command, "--acceleration", str(other), "--no-report"]) == 3
        assert words in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (["--acceleration-axes", "lvlh"], "--acceleration-axes: needs --acceleration, expected --acceleration A.csv"),
        (["--acceleration", "missing.csv"], "missing.csv: No such file or directory, expected accelerations in CSV"),
        (["--constant-acceleration", "lvlh"], "which needs the target's orbit"),
        (["--method", "score", "--constant-acceleration", "lvlh"], "found with score, expected pivot or ml"),
        (["--method", "ekf", "--constant-acceleration", "lvlh"], "found with ekf, expected pivot or ml"),
        (["--method", "screw-gpa", "--constant-acceleration", "sun"], "--constant-acceleration: found with --method"),
    ],
)
def test_forces_that_cannot_be(tracks, capsys, options, expected):
    assert app.main(["estimate", str(tracks), *options]) == 2
    error = capsys.readouterr().err
    assert expected in error
    assert len([line for line in error.splitlines() if line.startswith("baryscope: ")]) == 1


def test_a_prediction_is_a_file_of_its_own(tracks, tmp_path, capsys):
    command = ["estimate", str(tracks), "--trajectory", "fixed", "-o", str(tmp_path / "e.csv"), "--predict", "2.5"]
    assert app.main([*command, "--method", "ml", "--point", "F2"]) == 0
    assert re.search(r"F2 in 2.5 s: ±0.0\d+ m, ±0.0\d+ m/s; .*e.prediction.csv", capsys.readouterr().out)
    with (tmp_path / "e.prediction.csv").open(encoding="utf-8", newline="") as stream:
        names, *rows = csv.reader(stream)
    values = np.array(rows, dtype=float)
    assert names[:8] == ["time", "x", "y", "z", "vx", "vy", "vz", "cxx"]
    assert names[-2:] == ["cvyvz", "cvzvz"]
    assert len(names) == 7 + 21
    np.testing.assert_allclose(values[:, 0], [60.0, 61.0, 61.5])
    result = estimate(FeatureTracks.read_csv(tracks), method="ml", options=PathOptions(trajectory="fixed")).predict(
        values[:, 0], "F2"
    )
    np.testing.assert_allclose(values[:, 1:4], result.position, atol=1e-9)
    upper = np.triu_indices(6)
    np.testing.assert_allclose(values[:, 7:], result.covariance[:, *upper], rtol=1e-6, atol=1e-15)
    told = (tmp_path / "e.report.html").read_text(encoding="utf-8")
    assert "covariance. F2 in 2.5 s: ±0.0" in told
    total, worst = prediction_chart(result, "").series
    np.testing.assert_allclose(total.x, values[:, 0])
    variances = values[:, [names.index(name) for name in ("cxx", "cyy", "czz")]]
    np.testing.assert_allclose(total.y, 1e3 * np.sqrt(variances.sum(axis=1)), rtol=1e-6)
    assert (worst.y >= 1e3 * np.sqrt(variances.max(axis=1))).all()
    assert (worst.y < total.y).all()


def test_what_an_older_estimate_left_is_removed(tracks, tmp_path):
    """A prediction and a report of other tracks or options beside a new path would be taken for its own."""
    command = ["estimate", str(tracks), "--trajectory", "fixed", "-o", str(tmp_path / "e.csv"), "--quiet"]
    path, diagnostics = tmp_path / "e.csv", tmp_path / "e.json"
    prediction, report = tmp_path / "e.prediction.csv", tmp_path / "e.report.html"

    def written():
        return {one for one in (path, diagnostics, prediction, report) if one.exists()}

    assert app.main([*command, "--predict", "5"]) == 0
    assert written() == {path, diagnostics, prediction, report}
    assert app.main(command) == 0
    assert written() == {path, diagnostics, report}
    assert "covariance. centre of mass in 5 s" not in report.read_text(encoding="utf-8")
    assert app.main([*command, "--no-report"]) == 0
    assert written() == {path, diagnostics}


def test_nothing_that_is_read_is_removed(tracks, tmp_path, capsys):
    read = tmp_path / "e.prediction.csv"
    read.write_bytes(tracks.read_bytes())
    assert app.main(["estimate", str(read), "-o", str(tmp_path / "e.csv")]) == 2
    assert "e.prediction.csv: would be written over, but is read" in capsys.readouterr().err
    assert read.read_bytes() == tracks.read_bytes()


def test_a_point_by_coordinates_and_the_centre_of_mass(tracks, capsys):
    command = ["estimate", str(tracks), "--trajectory", "fixed", "--predict", "10"]
    assert app.main([*command, "--method", "ml", "--point", "0.5,-1,2"]) == 0
    assert "0.5,-1,2 in 10 s: ±" in capsys.readouterr().out
    assert app.main(command) == 0
    assert "centre of mass in 10 s: ±" in capsys.readouterr().out


def test_a_look_back(tracks, tmp_path, capsys):
    """From the farthest time on to the first frame."""
    command = ["estimate", str(tracks), "--trajectory", "polynomial:1", "-o", str(tmp_path / "e.csv")]
    assert app.main([*command, "--predict", "-2.5"]) == 0
    assert re.search(r"centre of mass 2.5 s before the first frame: ±\S+ m, ±\S+ m/s", capsys.readouterr().out)
    with (tmp_path / "e.prediction.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    first = FeatureTracks.read_csv(tracks).time[0]
    np.testing.assert_allclose([float(row["time"]) for row in rows], first + np.array([-2.5, -2.0, -1.0]))
    assert float(rows[0]["cxvx"]) < 0  # what moves faster was farther behind


@pytest.mark.parametrize(
    "options, message",
    [
        (["--point", "F1"], "--point: found F1 without a time, expected --predict SECONDS or --predict-at"),
        (
            ["--predict", "5", "--point", "F1"],
            "--point: found with --method pivot, which has attitudes in its frames only",
        ),
        (["--predict", "5", "--method", "score"], "--predict: found with --method score, expected pivot, ml or ekf"),
        (
            ["--predict", "5", "--predict-at", "t.csv"],
            "--predict: found 5 beside --predict-at, expected one of the two",
        ),
        (["--predict-at", "t.csv", "--method", "score"], "--predict-at: found with --method score, expected pivot, ml"),
        (["--predict-at", "t.csv"], "t.csv: "),
        (["--predict", "0"], "--predict: found 0, expected seconds ahead, or back below 0"),
        (["--predict", "1e300"], "found 1e+300, expected seconds ahead, or back below 0, at most 1e+10 of them"),
        (["--predict", "1e9"], "--predict: found 1e+09 s at steps of 1 s, expected 100000 at most"),
        (["--predict", "5", "--method", "ml", "--point", "hinge"], "--point: found 'hinge', expected x,y,z in m or a"),
    ],
)
def test_what_cannot_be_predicted(tracks, options, message, capsys):
    assert app.main(["estimate", str(tracks), "--trajectory", "fixed", *options]) == 2
    assert message in capsys.readouterr().err


def test_an_estimate_without_its_prediction(tmp_path, capsys, monkeypatch):
    """A body driven about no axis of a tumble: the path is good, and written, but no point of it can be followed.

    A script that waits for the prediction is told by the exit code, and finds none of an older estimate.
    """
    time = np.arange(60.0)
    turn = Rotation.from_rotvec(np.stack([0.8 * np.sin(0.9 * time), np.sin(0.37 * time), 0.1 * time], 1)).as_matrix()
    points = box_features(5, (4, 3, 2), seed=1) @ np.swapaxes(turn, 1, 2) + [1.0, -20.0, 2.0]
    noise = 0.001 * np.random.default_rng(4).normal(size=points.shape)
    FeatureTracks(time, points + noise, [f"F{i}" for i in range(5)]).write_csv(tmp_path / "t.csv")
    estimates = {}

    def once(tracks, **options):
        """Both commands ask for the same estimate, which takes seconds."""
        content = pickle.dumps((tracks, {name: value for name, value in options.items() if name != "progress"}))
        return estimates.get(content) or estimates.setdefault(content, estimate(tracks, **options))

    monkeypatch.setattr(cli_estimate, "estimate", once)
    command = ["estimate", str(tmp_path / "t.csv"), "--method", "ml", "--trajectory", "fixed", "--quiet"]
    old = tmp_path / "t.estimate.prediction.csv"
    old.touch()
    assert app.main([*command, "--predict", "5", "--point", "F1"]) == 3
    told = capsys.readouterr()
    assert [line for line in told.err.splitlines() if "no prediction: " in line] == told.err.splitlines()
    assert "no point can be predicted without a tumble" in told.err
    assert "60 positions" in told.out
    assert json.loads((tmp_path / "t.estimate.json").read_text(encoding="utf-8"))["status"] == "good"
    assert not old.exists()
    np.testing.assert_allclose(
        polars.read_csv(tmp_path / "t.estimate.csv")["x", "y", "z"].to_numpy(), [[1, -20, 2]] * 60, atol=0.003
    )
    assert app.main([*command, "--predict", "5"]) == 0  # the centre of mass needs no tumble
    assert old.exists()
    assert len(estimates) == 1

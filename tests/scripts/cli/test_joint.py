"""`baryscope joint`: what it prints and writes, and what it refuses."""

import csv
import json
import re

import ezc3d
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator import FeatureTracks, write_tracks
from baryscope.scripts.cli import app
from joints import TIME, both_bodies, recording

PARENT, CHILD = "pa,pb,pc,pd", "ca,cb,cc,cd"


@pytest.fixture
def recorded(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    both_bodies(1).write_csv("ball.csv")
    both_bodies(1, hinge=True).write_csv("hinge.csv")
    return tmp_path


def test_the_centre_is_written_at_every_time(recorded, capsys):
    assert (
        app.main(["joint", "ball.csv", "--parent", PARENT, "--child", CHILD, "-o", "centre.csv", "--json", "-q"]) == 0
    )
    found = json.loads(capsys.readouterr().out)
    assert [found["frames"], found["hinge"], found["method"]] == [600, False, "ml"]
    with (recorded / "centre.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    _, _, centre = recording(np.random.default_rng(1), 0.001, 0.5)
    path = np.array([[float(row[axis]) for axis in "xyz"] for row in rows])
    np.testing.assert_allclose([float(row["time"]) for row in rows], TIME)
    assert np.sqrt(np.mean((path - centre) ** 2)) < 0.002  # that of a pose by four markers at 0.2 m, and of skin
    variances = np.array([[float(row[name]) for name in ("cxx", "cyy", "czz")] for row in rows])
    assert np.sqrt(np.mean((path - centre) ** 2 / variances)) < 2  # of one centre, which three numbers tell


def test_the_centre_is_one_more_marker_for_programs_of_motion_capture(recorded, capsys):
    """As in the CSV file, in mm; a hinge's, which is decimetres off along its axis, has no place there."""
    command = ["--parent", PARENT, "--child", CHILD, "-q", "-o"]
    assert app.main(["joint", "ball.csv", *command, "hip.trc"]) == 0
    assert app.main(["joint", "ball.csv", *command, "hip.csv"]) == 0
    rows = [line.split("\t") for line in (recorded / "hip.trc").read_text(encoding="utf-8").splitlines()]
    column = rows[3].index("hip")
    found = np.array([[float(cell) for cell in row[column : column + 3]] for row in rows[6:]])
    expected = np.loadtxt(recorded / "hip.csv", delimiter=",", skiprows=1)[:, 1:4]
    np.testing.assert_allclose(found, 1e3 * expected, atol=1e-6)
    assert app.main(["joint", "ball.csv", *command, "hip.c3d"]) == 0
    binary = ezc3d.c3d(str(recorded / "hip.c3d"))
    assert binary["parameters"]["POINT"]["LABELS"]["value"][-1] == "hip"
    np.testing.assert_allclose(binary["data"]["points"][:3, -1].T, 1e3 * expected, rtol=1e-6)  # single precision
    capsys.readouterr()
    for form in ("trc", "c3d"):
        assert app.main(["joint", "hinge.csv", *command, f"knee.{form}"]) == 1
        assert f"the centre is hardly known along an axis, which {form.upper()} cannot tell" in capsys.readouterr().err
        assert not (recorded / f"knee.{form}").exists()


def test_a_report_of_an_older_result_is_removed(recorded):
    command = ["joint", "ball.csv", "--parent", PARENT, "--child", CHILD, "-o", "centre.csv", "-q"]
    assert app.main(command) == 0
    assert (recorded / "centre.report.html").exists()
    assert app.main([*command, "--no-report"]) == 0
    assert not (recorded / "centre.report.html").exists()


def test_lengths_in_another_unit_are_told(recorded, capsys):
    """Markers 0.1 m and more from their centre: 100 m and more if millimetres pass for metres, refused from 2 km on."""
    tracks = both_bodies(1)
    command = ["--parent", PARENT, "--child", CHILD, "-q"]
    for scale, code, told in ((1.0, 0, False), (1e3, 0, True), (1e6, 2, True)):
        FeatureTracks(tracks.time, scale * tracks.position, tracks.labels).write_csv("scaled.csv")
        assert app.main(["joint", "scaled.csv", *command]) == code
        captured = capsys.readouterr()
        assert ("m apart" in captured.out + captured.err) == told
        assert ("--units mm" in captured.out + captured.err) == told
    assert captured.err.startswith("baryscope: scaled.csv: features about ")


def test_the_centre_of_a_hinge_is_told_to_be_unknown_along_its_axis(recorded):
    """Its path was nine digits without a covariance, whoever reads it, decimetres off along the axis."""
    assert app.main(["joint", "hinge.csv", "--parent", PARENT, "--child", CHILD, "-o", "hinge.path.csv", "-q"]) == 0
    with (recorded / "hinge.path.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    full = np.array([[[float(row[f"c{min(a, b)}{max(a, b)}"]) for b in "xyz"] for a in "xyz"] for row in rows])
    deviations = np.sqrt(np.linalg.eigvalsh(full))
    assert (deviations[:, 2] > 0.03).all()  # a third of the markers' radius of 0.1 m or more: hardly known
    assert (deviations[:, 1] < 0.02).all()


def test_the_utc_of_time_0_is_told(recorded, capsys):
    tracks = both_bodies(1)
    FeatureTracks(tracks.time, tracks.position, tracks.labels, epoch="2026-03-01T12:00:00Z").write_csv("dated.csv")
    for name, epoch in (("dated.csv", "2026-03-01T12:00:00Z"), ("ball.csv", None)):
        assert app.main(["joint", name, "--child", CHILD, "--parent", PARENT, "--json", "-q"]) == 0
        assert json.loads(capsys.readouterr().out)["epoch"] == epoch


def test_the_centre_can_be_found_from_the_markers(recorded, capsys):
    """In any frame: the mean shape, which stands beside the centre, is turned onto the markers there (Kabsch)."""
    assert app.main(["joint", "ball.csv", "--parent", PARENT, "--child", CHILD, "--json", "-q"]) == 0
    found = json.loads(capsys.readouterr().out)
    whole = both_bodies(1)
    _, _, centre = recording(np.random.default_rng(1), 0.001, 0.5)
    for which, labels in (("parent", PARENT), ("child", CHILD)):
        shape = np.array(found[f"{which}_markers"])
        seen = whole.position[300][[whole.labels.index(label) for label in labels.split(",")]]
        turn, _ = Rotation.align_vectors(seen - seen.mean(axis=0), shape)
        assert np.linalg.norm(seen.mean(axis=0) + turn.apply(found[f"in_{which}"]) - centre[300]) < 0.006


def test_the_axis_of_a_hinge_is_written_at_every_time(recorded, capsys):
    """In the axes of the file; the columns of a centre that has no axis are those of an estimate."""
    assert app.main(["joint", "hinge.csv", "--parent", PARENT, "--child", CHILD, "-o", "axis.csv", "--json", "-q"]) == 0
    claim = json.loads(capsys.readouterr().out)["hinge_axis"]["covariance_in_child"]
    with (recorded / "axis.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    axis = np.array([[float(row[f"axis_{name}"]) for name in "xyz"] for row in rows])
    np.testing.assert_allclose(np.linalg.norm(axis, axis=1), 1.0)
    t = TIME[:, None]  # the bend of `recording` is about the parent's x
    turn = Rotation.from_rotvec(0.7 * np.sin(2 * np.pi * np.array([0.31, 0.47, 0.23]) * t + [0, 1, 2]))
    true = turn.apply([1.0, 0.0, 0.0])
    assert (np.abs(np.einsum("ki,ki->k", axis, true)) > np.cos(0.02)).all()  # 0.25 mm of noise at 0.1 m, four times
    mean = np.mean(axis * np.sign(np.einsum("ki,ki->k", axis, true))[:, None] - true, axis=0)
    assert np.linalg.norm(mean) < 4 * np.sqrt(np.trace(claim)) + 4 * 0.0025 / np.sqrt(len(TIME))
    assert app.main(["joint", "ball.csv", "--parent", PARENT, "--child", CHILD, "-o", "ball.centre.csv", "-q"]) == 0
    assert (recorded / "ball.centre.csv").read_text().startswith("time,x,y,z,cxx,cxy,cxz,cyy,cyz,czz\n")


def test_the_centre_is_told_in_axes_that_are_told(recorded, capsys):
    """Those of the file in a frame that is named; markers stand in them, so that the centre can be found from them."""
    tracks = both_bodies(1)
    position = tracks.position.copy()
    position[:7, tracks.labels.index("cb")] = np.nan  # the first frame with all of them is that of 0.14 s
    position[100:140, [tracks.labels.index(label) for label in ("ca", "cb")]] = np.nan
    FeatureTracks(tracks.time, position, tracks.labels).write_csv("gaps.csv")
    assert app.main(["joint", "gaps.csv", "--parent", PARENT, "--child", CHILD]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "  the child's axes are those of the file at 0.14 s; its markers in them, below" in lines
    assert "  the parent's axes are those of the file at 0 s; its markers in them, below" in lines
    assert any("40 of 600 frames are not used" in line for line in lines)
    rows = {cells[1]: cells[2:] for line in lines if (cells := line.split()) and cells[0] in ("parent", "child")}
    seen = position[7, [tracks.labels.index(label) for label in CHILD.split(",")]]
    told = np.array([[float(cell) for cell in rows[label][:3]] for label in CHILD.split(",")])
    # Half a digit, and two markers' noise of 0.25 mm: that of the frame, and what its attitude is off at the markers.
    np.testing.assert_allclose(told, 1000 * (seen - seen.mean(axis=0)), atol=4 * np.sqrt(2) * 0.25 + 0.005)
    assert [rows[label][3] for label in CHILD.split(",")] == ["560", "553", "560", "560"]


def test_a_probe_s_tip_is_told_in_the_room_and_in_its_own_axes(tmp_path, monkeypatch, capsys):
    """A pivot calibration, from what is printed alone: the tip in the room, and in the probe by the markers that stand
    with it, each with its claim. The true tool is turned onto these (Kabsch), which are to 0.01 mm.
    """
    monkeypatch.chdir(tmp_path)
    tool = np.array([[0.0, 0.0, 0.2], [0.06, 0.0, 0.22], [0.0, 0.06, 0.24], [0.03, 0.03, 0.3]])  # from its tip
    rest, phase = np.array([0.12, 0.04, 0.9]), np.array([0.3, 0.5, 0.2])
    squares = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        turn = Rotation.from_rotvec(0.5 * np.sin(2 * np.pi * phase * TIME[:, None] + rng.uniform(0, 7, 3))).as_matrix()
        marks = rest + tool @ np.swapaxes(turn, 1, 2) + 2e-4 * rng.standard_normal((len(TIME), 4, 3))
        write_tracks(FeatureTracks(TIME, marks, tuple("abcd")), "probe.c3d")
        assert app.main(["joint", "probe.c3d", "--child", "a,b,c,d", "-q"]) == 0
        lines = capsys.readouterr().out.splitlines()
        told = re.compile(
            r"in the (room, in the file's axes|child, .*): \((.*)\) m, ±(.*) mm along \(.*\), ±(.*) mm across"
        )
        (_, room, *claim), (_, own, *own_claim) = (one.groups() for line in lines if (one := told.search(line)))
        markers = [[float(cell) for cell in line.split()[2:5]] for line in lines if line.startswith("child")]
        to_own, _ = Rotation.align_vectors(np.array(markers), tool - tool.mean(axis=0))
        errors = numbers(room) - rest, numbers(own) - to_own.apply(-tool.mean(axis=0))
        for error, (along, across) in zip(errors, (claim, own_claim), strict=True):
            squares.append(1e6 * error @ error / (float(along) ** 2 + 2 * float(across) ** 2))
    # Of an error with that covariance 1 on average, with a deviation below √2; sixteen, of which two go together.
    assert 0.2 < np.mean(squares) < 1 + 4 * np.sqrt(2 / 8)


def numbers(text):
    return np.array([float(cell) for cell in text.split(", ")])


def test_a_hinge_is_named(recorded, capsys):
    assert app.main(["joint", "hinge.csv", "--parent", PARENT, "--child", CHILD]) == 0
    assert "a hinge: along its axis its centre is hardly known" in capsys.readouterr().out
    assert app.main(["joint", "ball.csv", "--parent", PARENT, "--child", CHILD]) == 0
    assert "hinge" not in capsys.readouterr().out


def test_markers_too_near_to_a_line_are_told(recorded, capsys):
    """Of markers nearly in a line, with 0.25 mm of noise each, attitudes are off by more than 5°."""
    tracks = both_bodies(1)
    position = tracks.position.copy()
    middle, along = position[:, 4:].mean(axis=1), position[:, 4] - position[:, 5]
    along /= np.linalg.norm(along, axis=1)[:, None]
    off = position[:, 4:] - middle[:, None]
    on = np.einsum("kmi,ki->km", off, along)[..., None] * along[:, None]
    noise = 0.00025 * np.random.default_rng(1).normal(size=off.shape)
    position[:, 4:] = middle[:, None] + on + 0.02 * (off - on) + noise
    FeatureTracks(tracks.time, position, tracks.labels).write_csv("line.csv")
    assert app.main(["joint", "line.csv", "--parent", PARENT, "--child", CHILD]) == 0
    assert "the markers of a body are too near to a line" in capsys.readouterr().out
    assert app.main(["joint", "ball.csv", "--parent", PARENT, "--child", CHILD]) == 0
    assert "near to a line" not in capsys.readouterr().out


@pytest.mark.parametrize("arguments, words", [
    ([], "--child: missing, expected at least 3 of pa, pb, pc, pd, ca, cb, cc, cd"),
    (["--child", "ca,cb,xx"], "--child: found 'xx', expected some of pa, pb"),
    (["--child", "ca,cb"], "--child: found 2 markers, expected at least 3"),
    (["--child", "ca,cb,cb"], "--child: found 'cb' twice"),
    (["--child", CHILD, "--parent", "ca,pb,pc"], "--parent and --child: found ca in both"),
    (["--child", CHILD, "-o", "out.txt"], "out.txt: ends in '.txt', expected .csv, .trc or .c3d"),
    (["--child", CHILD, "-o", "ca.trc"], "ca.trc: the recording has a marker ca"),
])  # fmt: skip
def test_wrong_markers_are_one_line(recorded, capsys, arguments, words):
    assert app.main(["joint", "ball.csv", *arguments]) == 2
    (line,) = capsys.readouterr().err.splitlines()[-1:]
    assert words in line


@pytest.mark.parametrize("frames, words", [
    (slice(0, 1), "ball.csv: 1 frame shows three markers of each body, expected at least 4"),
    (slice(0, 3), "ball.csv: 3 frames show three markers of each body, expected at least 4"),
])  # fmt: skip
def test_too_few_frames_cannot_be_computed(recorded, capsys, frames, words):
    whole = both_bodies(1)
    FeatureTracks(whole.time[frames], whole.position[frames], whole.labels).write_csv("ball.csv")
    assert app.main(["joint", "ball.csv", "--child", CHILD, "--parent", PARENT]) == 1
    assert f"baryscope: {words}" == capsys.readouterr().err.splitlines()[-1]


def test_no_frame_shows_all_markers(recorded, capsys):
    whole = both_bodies(1)
    position = whole.position.copy()
    for k in range(len(position)):
        position[k, whole.labels.index(CHILD.split(",")[k % 4])] = np.nan
    FeatureTracks(whole.time, position, whole.labels).write_csv("ball.csv")
    assert app.main(["joint", "ball.csv", "--child", CHILD]) == 1
    last = capsys.readouterr().err.splitlines()[-1]
    assert last == "baryscope: ball.csv: no frame shows all of ca, cb, cc, cd, expected one at least"


def test_a_marker_that_is_never_seen_is_named(recorded, capsys):
    """As one that a recording lists but has not: all of the body's were named, as if they were never seen together."""
    whole = both_bodies(1)
    position = whole.position.copy()
    position[:, whole.labels.index("cb")] = np.nan
    write_tracks(FeatureTracks(whole.time, position, whole.labels), "ball.trc")
    assert app.main(["joint", "ball.trc", "--child", CHILD]) == 1
    last = capsys.readouterr().err.splitlines()[-1]
    assert last == "baryscope: ball.trc: cb is never seen, expected a frame that shows all of ca, cb, cc, cd"

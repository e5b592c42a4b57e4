"""`baryscope estimate --camera --rig` on a camera that turns, made by the test."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator import FeatureTracks
from baryscope.scripts.cli import app
from synthetic import box_features

ARM = np.array([0.8, -0.3, 0.5])
CENTRE = np.array([1.0, -20.0, 2.0])


@pytest.fixture
def files(tmp_path):
    """Tracks of a body that turns about a point at rest, the attitude of a camera that turns, and its rig."""
    rng, time = np.random.default_rng(4), np.arange(60.0)
    turn = Rotation.from_rotvec(0.1 * time[:, None] * [0.0, 0.6, 0.8]).as_matrix()
    camera = Rotation.from_rotvec(np.column_stack([0.02 * time, 0.3 * np.sin(0.1 * time), 0.0 * time]))
    points = box_features(5, (4, 3, 2), seed=1) @ np.swapaxes(turn, 1, 2) + CENTRE
    seen = (points - camera.apply(ARM)[:, None]) @ camera.as_matrix() + 0.01 * rng.normal(size=points.shape)
    FeatureTracks(time, seen, [f"F{i}" for i in range(5)]).write_csv(tmp_path / "tracks.csv")
    rows = np.column_stack([time, np.roll(camera.as_quat(), 1, axis=1)])
    np.savetxt(tmp_path / "attitude.csv", rows, delimiter=",", header="time,qw,qx,qy,qz", comments="")
    rig = f"[rig]\nlever_arm = {ARM.tolist()}\nscale_deviation = 1e-3\nboresight_deviation = [0, 1e-3, 0]\n"
    (tmp_path / "rig.toml").write_text(rig, encoding="utf-8")
    return tmp_path


def run(files, *more):
    return app.main(["estimate", str(files / "tracks.csv"), "--trajectory", "fixed", *map(str, more)])


def test_the_camera_is_turned_and_its_errors_are_told(files, capsys):
    assert run(files, "--camera", files / "attitude.csv", "--rig", files / "rig.toml") == 0
    said = capsys.readouterr().out
    path = np.loadtxt(files / "tracks.estimate.csv", delimiter=",", skiprows=1)
    document = json.loads((files / "tracks.estimate.json").read_text(encoding="utf-8"))
    assert [one["name"] for one in document["forces"]] == ["boresight y", "scale"]
    assert [one["unit"] for one in document["forces"]] == ["rad", "1"]
    assert "boresight y" in said
    error, deviation = np.linalg.norm(path[:, 1:4] - CENTRE, axis=1), np.sqrt(path[:, [4, 7, 9]].sum(axis=1))
    assert np.all(error < 4 * deviation)
    assert np.all(deviation > 0.02)  # the scale's: 1e-3 of 20 m, which a fixed point does not tell


def test_an_epoch_dates_tracks_in_seconds_for_a_camera_at_utc_times(files, capsys):
    """The attitude begins 5 s before the tracks; they were refused as being in seconds, and --epoch for the camera."""
    rows = (files / "attitude.csv").read_text(encoding="utf-8").splitlines()
    begin = np.datetime64("2026-03-01T00:00:00")
    dated = [f"{begin + np.timedelta64(second, 's')}Z,{row.split(',', 1)[1]}" for second, row in enumerate(rows[1:])]
    (files / "utc.csv").write_text("\n".join([rows[0], *dated]), encoding="utf-8")
    tracks = FeatureTracks.read_csv(files / "tracks.csv")
    FeatureTracks(tracks.time[5:] - 5, tracks.position[5:], tracks.labels).write_csv(files / "tracks.csv")
    camera = ("--camera", files / "utc.csv", "--rig", files / "rig.toml")
    assert run(files, *camera, "--epoch", "2026-03-01T00:00:05Z") == 0
    path = np.loadtxt(files / "tracks.estimate.csv", delimiter=",", skiprows=1)
    error, deviation = np.linalg.norm(path[:, 1:4] - CENTRE, axis=1), np.sqrt(path[:, [4, 7, 9]].sum(axis=1))
    assert np.all(error < 4 * deviation)
    assert json.loads((files / "tracks.estimate.json").read_text(encoding="utf-8"))["epoch"] == "2026-03-01T00:00:05Z"
    capsys.readouterr()
    assert run(files, *camera) == 2
    assert "UTC times of the attitude, but seconds of the tracks" in capsys.readouterr().err
    undated = ("--camera", files / "attitude.csv", "--epoch", "2026-03-01")
    assert run(files, *undated, "--rig", files / "rig.toml") in (0, 3)  # seconds of both go on as they are


def test_a_camera_that_is_forgotten_does_not_pass(files, capsys):
    assert run(files) == 3
    assert "does not fit" in capsys.readouterr().out


def test_wrong_combinations_get_one_line(files, capsys):
    assert run(files, "--rig", files / "rig.toml") == 2
    assert "--rig: needs the camera's attitude, expected --camera ATTITUDE.csv" in capsys.readouterr().err
    attitude = files / "attitude.csv"
    attitude.write_text("".join(attitude.read_text().splitlines(keepends=True)[:40]))
    assert run(files, "--camera", attitude) == 2
    said = capsys.readouterr().err
    assert "camera's attitude: none for the time 39 s" in said
    assert f"baryscope: {attitude}: camera" in said


def test_an_attitude_in_milliseconds_is_doubted(files, capsys):
    """All frames were between its first two rows, and the camera all but stood still, without a word."""
    rows = np.loadtxt(files / "attitude.csv", delimiter=",", skiprows=1)
    rows[:, 0] *= 1000
    np.savetxt(files / "ms.csv", rows, delimiter=",", header="time,qw,qx,qy,qz", comments="")
    run(files, "--camera", files / "ms.csv")
    doubt = "ms.csv: all times of the tracks are between two of its rows, 0 and 1000 s: times in milliseconds? Seconds"
    assert doubt in capsys.readouterr().err
    run(files, "--camera", files / "attitude.csv")
    assert "milliseconds" not in capsys.readouterr().err


@pytest.mark.parametrize("dated", [False, True], ids=["seconds", "UTC"])
def test_thrust_in_the_camera_s_axes_and_a_prediction_beyond_its_attitude(files, capsys, dated):
    """A burn of 5 s: the attitude is needed for that time alone, and its times may be UTC as those of the tracks."""
    time = np.arange(60.0)
    tracks = FeatureTracks.read_csv(files / "tracks.csv")
    rows = np.loadtxt(files / "attitude.csv", delimiter=",", skiprows=1)
    R = Rotation.from_quat(np.roll(rows[:, 1:], -1, axis=1)).as_matrix()
    begin, push, fine = 20.0, np.array([4e-3, 0.0, 0.0]), np.linspace(20.0, 25.0, 2001)
    pushed = Rotation.from_rotvec(np.column_stack([0.02 * fine, 0.3 * np.sin(0.1 * fine), 0.0 * fine])).apply(push)
    moments = np.append(time, 80.0)
    reach = np.clip(moments[:, None] - fine, 0.0, None)[:, :, None]
    moved = -np.trapezoid(reach * pushed, fine, axis=1)  # of the centre of mass from the chaser, m
    seen = tracks.position + (moved[:-1, None] @ R)
    names = {"epoch": "2026-03-01T00:00:00Z"} if dated else {}
    FeatureTracks(time, seen, tracks.labels, **names).write_csv(files / "tracks.csv")
    log = [f"{begin},4e-3,0,0", f"{begin + 5},0,0,0"]
    lines = (files / "attitude.csv").read_text(encoding="utf-8").splitlines()[1:]
    if dated:
        start = np.datetime64("2026-03-01T00:00:00", "ms")

        def in_utc(row):
            moment, rest = row.split(",", 1)
            return f"{start + np.timedelta64(round(1000 * float(moment)), 'ms')}Z,{rest}"

        log, lines = [in_utc(row) for row in log], [in_utc(row) for row in lines]
    (files / "attitude.csv").write_text("\n".join(["time,qw,qx,qy,qz", *lines]), encoding="utf-8")
    (files / "log.csv").write_text("\n".join(["time,ax,ay,az", *log]), encoding="utf-8")
    (files / "rig.toml").write_text(f"[rig]\nlever_arm = {ARM.tolist()}\n", encoding="utf-8")
    command = ["--camera", files / "attitude.csv", "--rig", files / "rig.toml", "--predict", 21]
    command += ["--acceleration", files / "log.csv", "--acceleration-axes", "camera", "--process-noise", "none"]
    assert app.main(["estimate", str(files / "tracks.csv"), "--trajectory", "polynomial:1", *map(str, command)]) == 0
    last = np.loadtxt(files / "tracks.estimate.prediction.csv", delimiter=",", skiprows=1)[-1]
    assert last[0] == 80.0
    error, variance = last[1:4] - CENTRE - moved[-1], last[[7, 13, 18]]
    assert np.linalg.norm(moved[-1]) > 1.0
    assert error @ error < 16 * variance.sum()

"""Predictions at the times of a file: before, between and after the frames, in seconds or UTC."""

import numpy as np
import pytest

from baryscope.estimator import FeatureTracks, PathOptions, estimate
from baryscope.scripts.cli import app
from synthetic import ENVISAT, attitude, box_features, make_case

GAP = (40.0, 70.0)  # s, in which nothing is seen
ASKED = np.array([-5.0, 30.5, 45.0, 62.5, 130.0])  # s
EPOCH = np.datetime64("2026-03-01T00:00:00", "ms")


@pytest.fixture
def tracks(tmp_path):
    """A tumbling target at rest, for 100 s."""
    time = np.concatenate([np.arange(0.0, GAP[0]), np.arange(GAP[1], 100.0)])
    R_I_B = attitude(ENVISAT, np.deg2rad([3.0, 1.0, 2.0]), time)
    case = make_case(time, R_I_B, np.zeros((len(time), 3)), box_features(6, (10, 5, 5), seed=3), noise=0.01, seed=1)
    case.tracks.write_csv(tmp_path / "tracks.csv")
    return case.tracks


@pytest.mark.parametrize("dated", [False, True], ids=["seconds", "UTC"])
def test_times_of_a_file_may_be_in_gaps(tracks, tmp_path, capsys, dated):
    texts = [f"{EPOCH + np.timedelta64(round(1000 * one), 'ms')}Z" if dated else str(one) for one in ASKED]
    (tmp_path / "times.csv").write_text("\n".join(["time", *texts]), encoding="utf-8")
    command = ["estimate", str(tmp_path / "tracks.csv"), "--trajectory", "polynomial:1"]
    command += ["--predict-at", str(tmp_path / "times.csv"), *(["--epoch", f"{EPOCH}Z"] if dated else [])]
    assert app.main(command) == 0
    assert "centre of mass at 5 times: ±0.0" in capsys.readouterr().out
    rows = np.loadtxt(tmp_path / "tracks.estimate.prediction.csv", delimiter=",", skiprows=1)
    np.testing.assert_allclose(rows[:, 0], ASKED, atol=1e-9)
    read = FeatureTracks.read_csv(tmp_path / "tracks.csv")
    expected = estimate(read, options=PathOptions("polynomial:1")).predict(ASKED)
    np.testing.assert_allclose(rows[:, 1:4], expected.position, atol=1e-9)
    np.testing.assert_allclose(rows[:, [7, 13, 18]], expected.covariance[:, range(3), range(3)], rtol=1e-6)


def test_utc_needs_an_epoch(tracks, tmp_path, capsys):
    (tmp_path / "times.csv").write_text(f"time\n{EPOCH}Z\n", encoding="utf-8")
    assert app.main(["estimate", str(tmp_path / "tracks.csv"), "--predict-at", str(tmp_path / "times.csv")]) == 2
    assert "times.csv: UTC times, expected seconds, as in the tracks; or UTC times there" in capsys.readouterr().err

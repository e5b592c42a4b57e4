"""`baryscope estimate` on small files: what it prints."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator import FeatureTracks
from baryscope.scripts.cli import app
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

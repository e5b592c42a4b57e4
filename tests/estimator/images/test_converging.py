"""A pair whose cameras are turned towards one another: in rectified images, what is far off may lie farther right in
the right one."""

import numpy as np
import pytest

from baryscope.estimator.images import track
from baryscope.estimator.images.rectify import Rectified
from baryscope.study.images import scene
from pictures import scene as scene_of

pytest.importorskip("cv2", reason="OpenCV, the extra images, is not installed")

FRAMES = 9  # one more than a feature needs


@pytest.mark.parametrize("toe_in", [0.0, 3.0])  # °; 1.72 would meet at the target; other tests have 1.5
def test_features_are_found_wherever_the_cameras_meet(toe_in, tmp_path, monkeypatch):
    """Beyond the point where they meet, none was: matches were looked for farther left only."""
    monkeypatch.setattr(scene, "TOE_IN", np.deg2rad(toe_in))
    truth = scene_of.__wrapped__(FRAMES)
    assert (Rectified.of(truth.pair).shift > 0) == (toe_in > 0)
    found = track(*scene.write_images(truth, tmp_path), truth.pair, times=1.0)
    tracks = found.tracks
    assert len(tracks.labels) >= 20
    depth = truth.camera.inertial(tracks).position[tracks.seen] @ [0.6, -0.8, 0.0]  # along the way to the target
    assert np.abs(depth - 5).max() < 1.2  # the body is 2 m wide

"""ml with a camera that turns, whose attitude is noisy and whose boresight and scale are uncertain."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator.camera.attitude import AttitudeSeries
from baryscope.estimator.camera.camera import Camera
from baryscope.estimator.camera.rig import Rig
from baryscope.estimator.methods import estimate
from baryscope.estimator.options import PathOptions
from baryscope.estimator.tracks import FeatureTracks
from synthetic import ENVISAT, attitude, box_features

NOISE, TURN_NOISE, SCALE = 0.01, 5e-4, 1e-3
POINTS = box_features(8, (10, 5, 5), seed=3, centre=(1, 0.5, 0))
CENTRE = np.array([4.0, -19.0, 3.0])


def tracks_of(seed, noisy):
    """Tracks in C of a body at rest, turned about the chaser by the noise of its attitude and grown by its scale."""
    rng, time = np.random.default_rng(seed), np.arange(150.0)
    R = attitude(ENVISAT, np.deg2rad([2.4, 4.4, 4.8]), time)
    turn = Rotation.from_rotvec(TURN_NOISE * noisy * rng.normal(size=(150, 3))).as_matrix()
    seen = (CENTRE + POINTS @ np.swapaxes(R, 1, 2)) @ np.swapaxes(turn, 1, 2) * (1 + SCALE * rng.normal())
    seen = seen + NOISE * rng.normal(size=seen.shape)
    series = AttitudeSeries(time, np.tile([1.0, 0, 0, 0], (150, 1)))
    rig = Rig(attitude_noise=(TURN_NOISE * noisy,) * 3, scale_deviation=SCALE)
    return FeatureTracks(time, seen, [f"F{k}" for k in range(8)], camera=Camera(series, rig))


@pytest.mark.parametrize("noisy", [True, False])
def test_error_and_covariance_agree_with_those_of_the_camera(noisy):
    squares = []
    for seed in range(4):
        found = estimate(tracks_of(seed, noisy), method="ml", options=PathOptions(trajectory="fixed", sigma=NOISE))
        assert found.findings == ()
        error = found.position[0] - CENTRE
        squares.append(error @ np.linalg.solve(found.covariance[0], error))
        sight = CENTRE / np.linalg.norm(CENTRE)
        # The scale is not told by the tracks: 1e-3 of 20 m along the line of sight.
        assert np.sqrt(sight @ found.covariance[0] @ sight) == pytest.approx(0.0197, rel=0.1)
    assert np.sum(squares) < 33  # χ²₁₂ with probability 1e-3

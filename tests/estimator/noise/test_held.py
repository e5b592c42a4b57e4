"""Frames that a tracker holds when it has lost the body."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator import FeatureTracks, PathOptions, ScrewOptions, estimate
from baryscope.estimator.findings import HeldFrames
from baryscope.estimator.noise.held import held_frames
from baryscope.estimator.result import Status
from baryscope.models.errors import ComputationError

TIME = np.arange(200) / 10
TIP = np.array([0.12, 0.04, 0.9])
TOOL = np.array([[0.0, 0.0, 0.2], [0.06, 0.0, 0.22], [0.0, 0.06, 0.24], [0.03, 0.03, 0.3]])
FIXED = PathOptions(trajectory="fixed")
HELD = slice(60, 140)


def probe(noise=2e-4, rate=1.0):
    """A probe that turns about its tip at rest; four markers with white noise, m."""
    rates = rate * np.array([0.9, 1.5, 0.7])
    turn = Rotation.from_rotvec(0.5 * np.sin(TIME[:, None] * rates)).as_matrix()
    rng = np.random.default_rng(1)
    return FeatureTracks(
        TIME, TIP + TOOL @ np.swapaxes(turn, 1, 2) + noise * rng.normal(size=(200, 4, 3)), tuple("abcd")
    )


def with_position(tracks, position):
    return replace(tracks, position=position)


def frozen(tracks):
    position = tracks.position.copy()
    position[HELD] = position[HELD.start - 1]
    return with_position(tracks, position)


@pytest.mark.parametrize("method", ["pivot", "score"])
def test_held_frames_count_as_not_seen(method):
    """They seemed to have no noise: the estimate was made of them alone, metres of a claim for a tip known to 0.1 mm.

    It is that of tracks without them.
    """
    found = estimate(frozen(probe()), method=method, options=FIXED)
    assert found.findings == (HeldFrames(6.0, 13.9, 80),)
    assert found.status is Status.GOOD
    hidden = probe().position.copy()
    hidden[HELD] = np.nan
    alone = estimate(with_position(probe(), hidden), method=method, options=FIXED)
    assert found.position == pytest.approx(alone.position, abs=1e-12)
    assert np.linalg.norm(found.position[0] - TIP) < 1e-3


def test_the_screw_methods_leave_them_out_too():
    found = estimate(frozen(probe()), method="screw-gpa", options=ScrewOptions())
    assert HeldFrames(6.0, 13.9, 80) in found.findings
    assert not found.covered[HELD].any()


def test_tracks_resampled_without_interpolation_are_those_before():
    tracks = probe()
    five = np.repeat(tracks.position[::5], 5, axis=0)
    assert (held_frames(with_position(tracks, five)) == (np.arange(200) % 5 > 0)).all()


def test_a_feature_that_is_missing_or_at_rest_hides_no_held_frame():
    held = np.zeros(200, dtype=bool)
    held[HELD] = True
    position = frozen(probe()).position.copy()
    position[:, 3] = [1.0, 2.0, 3.0]
    assert (held_frames(with_position(probe(), position)) == held).all()
    position[:, 2] = np.nan
    position[100] = np.nan
    held[100] = False
    assert (held_frames(with_position(probe(), position)) == held).all()


def test_rounding_holds_no_frames():
    """A slow probe in whole centimetres: many frames are alike, but so are many coordinates of those that are not."""
    slow = np.round(probe(noise=0.0, rate=0.1).position, 2)
    alike = (slow[1:] == slow[:-1]).all(axis=(1, 2))
    assert alike.mean() > 0.1
    assert not held_frames(with_position(probe(), slow)).any()


def test_a_body_at_rest_in_a_simulation_without_noise_is_no_held_one():
    still = np.repeat(probe().position[:1], 200, axis=0)
    assert not held_frames(with_position(probe(), still)).any()


def test_a_few_held_frames_do_no_harm():
    position = probe().position.copy()
    position[50] = position[49]
    assert not held_frames(with_position(probe(), position)).any()


def test_tracks_of_held_frames_alone_say_so():
    position = np.repeat(probe().position[[0, 70, 140]], 67, axis=0)[:200]
    with pytest.raises(
        ComputationError, match=r"too few.*; 197 frames repeat the one before in every digit, from 0\.1 to"
    ):
        estimate(with_position(probe(), position), options=PathOptions(trajectory="polynomial:3"))

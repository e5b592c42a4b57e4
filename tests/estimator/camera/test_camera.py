"""Tracks turned from camera axes into C, and what the errors of the rig do to them, against a camera of the test's."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator.camera.attitude import AttitudeSeries
from baryscope.estimator.camera.camera import Camera
from baryscope.estimator.camera.rig import Rig
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import InputError

TIME = np.arange(20.0)
TURN = Rotation.from_rotvec(np.column_stack([0.3 + 0.02 * TIME, 1 - 0.01 * TIME, 0.05 * TIME]))
MOUNTING = Rotation.from_rotvec([0.2, -0.5, 1.0])
ARM = np.array([1.0, -0.4, 0.3])
POINTS = np.random.default_rng(0).uniform(-3, 3, (20, 4, 3)) + np.array([4.0, -20.0, 2.0])


def scalar_first(rotation):
    return np.roll(rotation.as_quat(), 1, axis=-1)


def seen_by(points, turn, place):
    """Points (n, m, 3) in C as seen in the axes of a camera of attitude `turn` at place (n, 3)."""
    return np.stack([one.inv().apply(own - c) for one, own, c in zip(turn, points, place, strict=True)])


def camera(**rig):
    rig = {"lever_arm": ARM, "lever_arm_axes": "chaser", "mounting": scalar_first(MOUNTING)} | rig
    return Camera(AttitudeSeries(TIME, scalar_first(TURN)), Rig(**rig))


PLACE = (TURN * MOUNTING.inv()).apply(ARM)
LABELS = tuple("abcd")


def test_tracks_are_turned_with_their_covariances():
    rng = np.random.default_rng(3)
    roots = rng.normal(size=(20, 4, 3, 3))
    covariance = roots @ np.swapaxes(roots, 2, 3)
    tracks = FeatureTracks(TIME, seen_by(POINTS, TURN, PLACE), LABELS, covariance)
    found = camera().inertial(tracks)
    np.testing.assert_allclose(found.position, POINTS, atol=1e-12)
    R = TURN.as_matrix()
    for k, j in ((0, 0), (7, 2), (19, 3)):
        np.testing.assert_allclose(found.covariance[k, j], R[k] @ covariance[k, j] @ R[k].T, atol=1e-12)
    with pytest.raises(InputError, match="turned into inertial axes already"):
        camera().inertial(found)


def test_what_is_not_seen_stays_so():
    position = seen_by(POINTS, TURN, PLACE)
    position[3, 1] = np.nan
    assert np.isnan(camera().inertial(FeatureTracks(TIME, position, LABELS)).position[3, 1]).all()


@pytest.mark.parametrize("which", range(7))
def test_shifts_are_the_derivatives_of_what_is_seen(which):
    """A camera with a small error sees the points; the tracks are turned as if there were none."""
    step = 1e-6
    error = np.zeros(7)
    error[which] = step
    turn = TURN * Rotation.from_rotvec(-error[:3])
    place = (TURN * MOUNTING.inv()).apply(ARM - error[4:])
    seen = (1 + error[3]) * seen_by(POINTS, turn, place)
    all_uncertain = camera(lever_arm_deviation=1.0, boresight_deviation=0.1, scale_deviation=0.1)
    moved = (all_uncertain.inertial(FeatureTracks(TIME, seen, LABELS)).position - POINTS) / step
    found = all_uncertain.errors(TIME)
    for j in range(4):
        np.testing.assert_allclose(found.shifts(POINTS[:, j])[:, :, which], moved[:, j], atol=1e-4)
    expected = np.zeros((20, 3))
    if which < 3:
        expected = Rotation.as_rotvec(TURN * Rotation.from_rotvec(error[:3]) * TURN.inv()) / step
    np.testing.assert_allclose(found.turns()[:, :, which], expected, atol=1e-6)


def test_only_uncertain_errors_have_columns():
    found = camera(scale_deviation=1e-4, boresight_deviation=(0.0, 1e-3, 0.0)).errors(TIME)
    np.testing.assert_array_equal(found.deviations, [1e-3, 1e-4])
    assert found.shifts(POINTS[:, 0]).shape == found.turns().shape == (20, 3, 2)
    assert not found.noisy
    assert camera().errors(TIME).shifts(POINTS[:, 0]).shape == (20, 3, 0)


def test_a_pure_scale_error_has_its_deviation_along_the_line_of_sight():
    found = camera(scale_deviation=1e-3).errors(TIME).consider_covariance(POINTS[:, 0])
    sight = POINTS[:, 0] - PLACE
    np.testing.assert_allclose(found, 1e-6 * sight[:, :, None] * sight[:, None], rtol=1e-9)


def test_noise_of_the_attitude_moves_points_across_their_direction_from_the_chaser():
    """Of variance σ² r² across it, none along it: a lever arm turns with the attitude, as tracks are placed by it."""
    place = POINTS[:, 0]
    square = np.einsum("ki,ki->k", place, place)[:, None, None]
    across = square * np.eye(3) - place[:, :, None] * place[:, None]
    equal = camera(attitude_noise=1e-3).errors(TIME)
    assert equal.noisy
    np.testing.assert_allclose(equal.shift_covariance(place), 1e-6 * across, atol=1e-12)
    np.testing.assert_allclose(equal.turn_covariance(), np.tile(1e-6 * np.eye(3), (20, 1, 1)), atol=1e-15)


def test_points_placed_by_noisy_attitudes_scatter_as_told():
    """A camera at the end of a long arm, near the target: 20,000 draws of its attitude place what it sees."""
    arm, noise, count = np.array([0.0, -15.0, 2.0]), np.array([1e-4, 2e-4, 1e-3]), 20000
    seen, time = np.array([1.0, -4.0, 0.5]), np.arange(float(count))
    told = TURN[5] * Rotation.from_rotvec(noise * np.random.default_rng(7).normal(size=(count, 3)))
    rig = Rig(lever_arm=arm, attitude_noise=noise)
    tracks = FeatureTracks(time, np.tile(seen, (count, 1, 1)), ["F"])
    drawn = np.cov(Camera(AttitudeSeries(time, scalar_first(told)), rig).inertial(tracks).position[:, 0].T)
    true = Camera(AttitudeSeries([0.0], scalar_first(TURN[5:6])), rig).errors(np.zeros(1))
    found = true.shift_covariance(TURN[5:6].apply(seen + arm))[0]
    np.testing.assert_allclose(found, drawn, atol=0.05 * np.trace(drawn))  # 5σ of a variance from 20000 draws

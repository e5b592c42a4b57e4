"""Tracks from images beside the motion that these were rendered from."""

import shutil
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator.images import track
from baryscope.models.errors import ComputationError, InputError
from baryscope.study.images.scene import Setting, watched, write_images
from pictures import scene, video

pytest.importorskip("cv2", reason="OpenCV, the extra images, is not installed")

FRAMES = 12
TURN = np.arange(13.0)  # s
PLACE = np.tile([3.0, -4.0, 0.5], (len(TURN), 1))
SIGHT = PLACE[0] / np.linalg.norm(PLACE[0])


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    return write_images(scene(FRAMES), tmp_path_factory.mktemp("images"))


@pytest.fixture(scope="module")
def tracked(written):
    return track(*written, scene(FRAMES).pair, times=1.0)


def facing(lean):
    """Attitudes (n, 3, 3) of a body whose z-axis is towards the cameras, but for a lean (n,), rad."""
    side = np.cross([0.0, 0.0, 1.0], -SIGHT) / np.linalg.norm(SIGHT[:2])
    upright = np.column_stack([side, np.cross(-SIGHT, side), -SIGHT])
    return upright @ Rotation.from_rotvec(lean[:, None] * np.array([0.6, 0.8, 0.0])).as_matrix()


def on_the_body(tracks):
    """Where the features are on the body, (n, m, 3) in B, by the true attitudes and path; and R_B_V (n, 3, 3)."""
    truth = scene(FRAMES)
    position = truth.camera.inertial(tracks).position - truth.path[:, None]
    turned = np.swapaxes(truth.attitude, 1, 2) @ truth.camera.attitude.at(truth.time)
    return position @ truth.attitude, turned


def test_features_stay_where_they_are_on_the_body(tracked):
    """Their scatter about their means is what the covariances say, to a third: of few features, on few facets."""
    tracks = tracked.tracks
    assert tracks.covariance is not None
    place, R_B_V = on_the_body(tracks)
    squares, count = 0.0, 0
    for k in range(len(tracks.labels)):
        own = tracks.seen[:, k]
        precision = np.linalg.inv(R_B_V[own] @ tracks.covariance[own, k] @ np.swapaxes(R_B_V[own], 1, 2))
        weighted = (precision @ place[own, k, :, None]).sum(axis=0)
        off = place[own, k] - np.linalg.solve(precision.sum(axis=0), weighted)[:, 0]
        squares += float(np.einsum("ki,kij,kj->", off, precision, off))
        count += 3 * (own.sum() - 1)
    assert count > 400
    assert 0.4 < squares / count < 1.5
    assert 0.005 < tracked.pixel_noise < 0.06
    assert abs(tracked.row_offset) < tracked.pixel_noise  # the calibration is the true one


def test_features_lie_on_the_surface(tracked):
    """On the box, the wing or what stands on them, whose size is known: within four standard deviations of depth."""
    place, _ = on_the_body(tracked.tracks)
    depth = np.sqrt(np.nanmax(np.linalg.eigvalsh(tracked.tracks.covariance[tracked.tracks.seen])))
    found = place[tracked.tracks.seen]
    low, high = np.array([-0.42, -0.345, -0.17]), np.array([0.80, 0.525, 0.175])
    assert (found > low - 4 * depth).all()
    assert (found < high + 4 * depth).all()


def test_the_points_of_a_face_that_leans_do_not_move_together(tmp_path):
    """A face of 0.6 by 0.8 m turns from 25° to the other side to 25° to this one about its diagonal. Errors that points
    have by themselves are √n times smaller in the mean of n. Perspective that nothing takes off patches moved all of
    them together by 0.01 px, which is √n times the mean that is left, and was taken for a motion of the body.
    """
    motion = (TURN, PLACE, facing(np.deg2rad(np.linspace(-25, 25, len(TURN)))))
    truth = watched(Setting(width=400, noise=1.0), scene(3).orbit, motion, np.random.SeedSequence(1))
    found = track(*write_images(truth, tmp_path), truth.pair, times=TURN)
    tracks, all_along = found.tracks, found.tracks.seen.all(axis=0)
    assert all_along.sum() > 20
    place = (truth.camera.inertial(tracks).position[:, all_along] - truth.path[:, None]) @ truth.attitude
    off = np.einsum("kij,kmj->kmi", truth.attitude, place - place.mean(axis=0))
    across = off - (off @ SIGHT)[..., None] * SIGHT
    own = np.sqrt(np.mean(across**2))
    together = np.sqrt(np.mean(across.mean(axis=1) ** 2))
    assert together < own / np.sqrt(all_along.sum())


def test_times_are_those_that_are_given(written):
    given = np.linspace(3.0, 5.0, FRAMES)
    found = track(*written, scene(FRAMES).pair, times=given, epoch="2030-01-01T00:00:00Z")
    np.testing.assert_array_equal(found.tracks.time, given)
    assert found.tracks.epoch is not None
    for times, words in (
        (None, "does not tell the images' times"),
        (0.0, "rate: found 0 Hz"),
        (given[:-1], "more than 11 images, expected one for each time"),
        (np.append(given, 6.0), "12 images, expected 13, one for each time"),
    ):
        with pytest.raises(InputError, match=words):
            track(*written, scene(FRAMES).pair, times=times)


def test_pairs_that_are_missing_by_their_numbers_take_their_time(written, tmp_path):
    """The rate is the camera's: what it dropped on both sides made the rest of the tracks too early."""
    for side in written:
        shutil.copytree(side, tmp_path / side.name)
        files = sorted((tmp_path / side.name).iterdir(), key=lambda file: int(file.stem))
        files[1].unlink()
    sides = [tmp_path / side.name for side in written]
    found = track(*sides, scene(FRAMES).pair, times=2.0)
    assert found.missing == 1
    np.testing.assert_allclose(found.tracks.time, 0.5 * np.delete(np.arange(FRAMES), 1))
    given = track(*sides, scene(FRAMES).pair, times=np.arange(FRAMES - 1.0))
    assert given.missing == 0


def test_videos_of_two_rates_are_refused(tmp_path):
    left, right = (video(tmp_path / f"{rate}.avi", rate, [100] * 3) for rate in (12.5, 25.0))
    with pytest.raises(InputError, match=r"25.0.avi: found 25 images a second, expected 12.5 as in .*12.5.avi"):
        track(left, right, scene(FRAMES).pair)


def test_too_few_images_are_refused(tmp_path):
    with pytest.raises(ComputationError, match="no feature is seen 8 times in 3 pairs of images: of ") as no:
        track(*write_images(scene(3), tmp_path), scene(3).pair, times=1.0)
    assert ", +0 px from their rows in the median, and " in str(no.value)


def test_rows_that_do_not_match_are_told(written):
    """Of a rig whose calibration is off by three pixels, nothing was told but that there are no features."""
    pair = scene(FRAMES).pair
    u, v = pair.right.principal_point
    wrong = replace(pair, right=pair.right.model_copy(update={"principal_point": (u, v - 3)}))
    with pytest.raises(ComputationError, match=r"[+-]\d px from their rows in the median") as no:
        track(*written, wrong, times=1.0)
    assert ", +0 px" not in str(no.value)

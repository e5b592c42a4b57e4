"""What both methods do, and what is refused."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator.joint import joint
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import ComputationError, InputError, Reason
from joints import SHAPE, TIME, TRUTH, recording


def test_bodies_that_do_not_turn_and_other_times_are_refused():
    parent, child, _ = recording(np.random.default_rng(1), 0.0, 0.0, hinge=True)
    with pytest.raises(ComputationError, match="do not turn against each other"):
        joint(parent, FeatureTracks(TIME, parent.position + 1.0, parent.labels))
    with pytest.raises(InputError, match="different times"):
        joint(parent, FeatureTracks(TIME + 1, child.position, child.labels))
    with pytest.raises(InputError, match="found 'sara', expected one of score, ml"):
        joint(parent, child, method="sara")
    with pytest.raises(InputError, match=r"^parent: found ndarray, expected FeatureTracks, as of read_tracks"):
        joint(parent.position, child)
    with pytest.raises(InputError, match=r"^child: found NoneType, expected FeatureTracks, as of read_tracks"):
        joint(parent, None)


def swapped(tracks, first, frames, pair=(0, 1)):
    position = tracks.position.copy()
    position[first : first + frames, pair] = position[first : first + frames, pair[::-1]]
    return FeatureTracks(tracks.time, position, tracks.labels)


def with_zeros(tracks):
    position = tracks.position.copy()
    position[100:130, 2] = 0.0  # as some recorders write what is not seen
    return FeatureTracks(tracks.time, position, tracks.labels)


def jumping(tracks):
    rng = np.random.default_rng(5)
    position = tracks.position.copy()
    position[1 + rng.choice(len(position) - 1, 20, replace=False), 1] += 0.3 * rng.normal(size=(20, 3))
    return FeatureTracks(tracks.time, position, tracks.labels)


@pytest.mark.parametrize("method", ["ml", "score"])
@pytest.mark.parametrize("spoilt, left_out", [
    (lambda tracks: swapped(tracks, 300, 50), [50, 50]),
    (lambda tracks: swapped(tracks, 300, 5), [5, 5]),
    (with_zeros, [0, 0, 30, 0]),
    (jumping, [0, 20, 0, 0]),
])  # fmt: skip
def test_wrong_positions_of_markers_are_left_out(method, spoilt, left_out):
    """As good as the recording without them, within a standard deviation; a ball stays one."""
    parent, child, _ = recording(np.random.default_rng(1), 0.002, 0.5)
    clean, found = joint(parent, child, method=method), joint(parent, spoilt(child), method=method)
    change = found.in_child - clean.in_child
    assert change @ np.linalg.solve(clean.covariance[3:, 3:], change) < 1
    assert not found.hinge
    np.testing.assert_array_equal(found.child_left_out[: len(left_out)] >= np.array(left_out), True)
    assert found.child_left_out.sum() <= 4 * max(left_out)
    assert clean.child_left_out.sum() == found.parent_left_out.sum() == 0


def test_swapped_labels_of_a_regular_triangle_turn_it_over():
    """All distances fit, and the pose is exact: only the attitude jumps."""
    parent, child, _ = recording(np.random.default_rng(1), 0.0005, 0.5)
    pose = joint(parent, child).pair.child
    triangle = 0.1 * np.array([[1.0, 0.0, 0.0], [-0.5, np.sqrt(0.75), 0.0], [-0.5, -np.sqrt(0.75), 0.0]])
    points = pose.place[:, None] + triangle @ np.swapaxes(pose.rotation, 1, 2)
    plate = FeatureTracks(TIME, points, tuple("abc"))
    clean, found = joint(parent, plate), joint(parent, swapped(plate, 300, 50))
    assert found.child_left_out.tolist() == [50, 50, 50]
    np.testing.assert_allclose(found.in_child, clean.in_child, atol=0.001)


def test_a_body_that_is_turned_over_between_gaps_tears_the_joint_apart():
    """For seven frames between two gaps of twenty, by swapped labels of three markers: nothing nearby tells of that."""
    parent, child, _ = recording(np.random.default_rng(1), 0.001, 0.5)
    pose = joint(parent, child).pair.child
    triangle = 0.1 * np.array([[1.0, 0.0, 0.0], [-0.5, np.sqrt(0.75), 0.0], [-0.5, -np.sqrt(0.75), 0.0]])
    points = pose.place[:, None] + triangle @ np.swapaxes(pose.rotation, 1, 2)
    points[280:300] = points[307:327] = np.nan
    plate = FeatureTracks(TIME, points, tuple("abc"))
    clean, found = joint(parent, plate), joint(parent, swapped(plate, 300, 7, (1, 2)))
    assert found.child_left_out.tolist() == [7, 7, 7]
    np.testing.assert_allclose(found.in_child, clean.in_child, atol=0.001)


def test_skin_that_moves_after_standing_still_is_no_outlier():
    """Each marker by 5 mm rms by itself, in the second half of the recording: the first one tells nothing of that."""
    parent, child, _ = recording(np.random.default_rng(2), 0.0002, 0.0)
    rng = np.random.default_rng(3)
    slide = 0.005 * rng.normal(size=child.position.shape) * (TIME > 6)[:, None, None]
    found = joint(parent, FeatureTracks(TIME, child.position + slide, child.labels))
    assert found.child_left_out.sum() == 0
    assert len(found.time) == len(TIME)


def test_labels_swapped_half_of_the_time_leave_the_other_half():
    parent, child, centre = recording(np.random.default_rng(1), 0.002, 0.5)
    found = joint(parent, swapped(child, 300, 300, (0, 3)))
    assert found.child_left_out.tolist() == [300, 0, 0, 300]
    kept = np.isin(TIME, found.time)
    assert np.sqrt(np.mean((found.position - centre[kept]) ** 2)) < 0.003


def test_labels_in_a_new_order_in_each_frame_are_refused():
    parent, child, _ = recording(np.random.default_rng(1), 0.002, 0.5)
    mixed = np.random.default_rng(1).permuted(np.tile(np.arange(4), (600, 1)), axis=1)
    shuffled = FeatureTracks(TIME, np.take_along_axis(child.position, mixed[..., None], axis=1), child.labels)
    for method in ("ml", "score"):
        with pytest.raises(
            ComputationError, match=r"600 show three: labels may be swapped|off it most often"
        ) as raised:
            joint(parent, shuffled, method=method)
        assert raised.value.reason is Reason.TOO_FEW_FRAMES


@pytest.mark.parametrize("method", ["ml", "score"])
@pytest.mark.parametrize("sigma", [0.0, 1e-9, 1e-6, 1e-4])
def test_a_hinge_may_be_exact(method, sigma):
    """Markers of a model, or on a machine: the axis, x of the child, is exact, and along it the centre is unknown."""
    parent, child, centre = recording(np.random.default_rng(1), sigma, 0.0, hinge=True)
    found = joint(parent, child, method=method)
    assert found.hinge
    body = found.pair.child
    true = np.einsum("kji,kj->ki", body.rotation, centre - body.place).mean(axis=0)
    axis = found.hinge_axis.in_child
    error = found.in_child - true
    np.testing.assert_allclose(error - axis * (axis @ error), 0.0, atol=1e-9 + 2 * sigma)
    reach = 3 * body.radius
    assert np.sqrt(axis @ found.covariance[3:, 3:] @ axis) == pytest.approx(reach, rel=0.05)
    assert abs(axis @ error) < 3 * reach
    assert found.hinge_axis.turned == pytest.approx(0.8 * np.sqrt(0.5), rel=0.1)
    assert found.hinge_axis.residual < 1e-9 + 20 * sigma


@pytest.mark.parametrize("method", ["ml", "score"])
def test_skin_that_follows_a_hinge_moves_its_centre_by_its_leverage(method):
    """By a closed form: skin s θ of the parent looks like a centre that is d off, where a × d = s, but for θ²."""
    rng, bend = np.random.default_rng(1), 0.3 * np.sin(2 * np.pi * 0.53 * TIME)
    parent, _, centre = recording(rng, 0.0, 0.0, hinge=True)
    R_T_P = Rotation.from_rotvec(0.7 * np.sin(2 * np.pi * np.array([0.31, 0.47, 0.23]) * TIME[:, None] + [0, 1, 2]))
    R_T_C = R_T_P * Rotation.from_rotvec(bend[:, None] * [1.0, 0.0, 0.0])
    place = centre - R_T_C.apply(TRUTH)
    points = place[:, None] + SHAPE @ np.swapaxes(R_T_C.as_matrix(), 1, 2)
    child = FeatureTracks(TIME, points + 1e-5 * rng.normal(size=points.shape), tuple("efgh"))
    slide = 0.002 * np.sqrt(2) * np.sin(2 * np.pi * 0.53 * TIME)  # 2 mm rms, along the parent's y
    moved = parent.position + R_T_P.apply(slide[:, None] * [0.0, 1.0, 0.0])[:, None]
    still, skin = (
        joint(FeatureTracks(TIME, position, parent.labels), child, method=method)
        for position in (parent.position + 1e-5 * rng.normal(size=points.shape), moved)
    )
    assert still.hinge_axis is not None
    assert still.hinge_axis.leverage == pytest.approx(np.sqrt(2) / 0.3, rel=0.01)
    moved_by, axis = skin.in_child - still.in_child, still.hinge_axis.in_child
    across = moved_by - moved_by @ axis * axis
    assert np.linalg.norm(across) == pytest.approx(0.002 * still.hinge_axis.leverage, rel=0.3**2)


@pytest.mark.parametrize("method", ["ml", "score"])
def test_a_ball_that_hardly_turns_is_no_hinge(method):
    """By ±2° about all axes, with markers on 5 cm and 2 mm of noise: nothing is known, along no axis more than others.

    SCoRE named an axis, far off, and claimed to know it.
    """
    rng = np.random.default_rng(4)
    phase = 2 * np.pi * np.array([0.53, 0.37, 0.71]) * TIME[:, None]
    turns = Rotation.from_rotvec(0.035 * np.sin(phase)).as_matrix()
    plate = 0.05 * np.array([[1.0, 0.0, 0.0], [-0.8, 0.9, 0.0], [-0.7, -0.8, 0.3], [0.0, 0.2, 1.1]]) + [0.0, 0.0, 0.3]
    points = plate @ np.swapaxes(turns, 1, 2) + 0.002 * rng.normal(size=(600, 4, 3))
    found = joint(None, FeatureTracks(TIME, points, tuple("abcd")), method=method)
    assert not found.observable
    assert not found.hinge
    assert found.hinge_axis is None


@pytest.mark.parametrize("method", ["ml", "score"])
def test_a_covariance_of_few_frames_has_no_negative_variance(method):
    """A child that hardly turns in 5 frames: terms of the covariance cancel, and left a variance of -1e-5 m²."""
    k = np.arange(5)[:, None]
    tilt = Rotation.from_rotvec(0.2 * np.sin(0.1 * k) * [1, 0, 0])
    R = (tilt * Rotation.from_rotvec(0.01 * np.sin(0.3 * k) * [0, 0, 1])).as_matrix()
    for seed in range(10, 20):
        points = 0.1 * np.random.default_rng(seed).normal(size=(4, 3))
        tracks = FeatureTracks(
            0.1 * k[:, 0], np.sin(0.05 * k)[:, None] * [1, 2, 3] + points @ np.swapaxes(R, 1, 2), tuple("abcd")
        )
        found = joint(None, tracks, method=method)
        assert np.linalg.eigvalsh(found.covariance)[0] > 0

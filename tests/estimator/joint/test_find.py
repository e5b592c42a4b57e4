"""What both methods do, and what is refused."""

import numpy as np
import pytest

from baryscope.estimator.joint import joint
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import ComputationError, InputError, Reason
from joints import TIME, recording


def test_bodies_that_do_not_turn_and_other_times_are_refused():
    parent, child, _ = recording(np.random.default_rng(1), 0.0, 0.0, hinge=True)
    with pytest.raises(ComputationError, match="no single centre"):
        joint(parent, child)
    with pytest.raises(InputError, match="different times"):
        joint(parent, FeatureTracks(TIME + 1, child.position, child.labels))
    with pytest.raises(InputError, match="found 'sara', expected one of score, ml"):
        joint(parent, child, method="sara")


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

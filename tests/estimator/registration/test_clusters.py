"""Which features are one body: by construction, with the truth's shape and attitude."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator.registration.clusters import find_bodies
from baryscope.models.errors import ComputationError
from synthetic import box_features, make_case

N = 400
TIME = np.arange(float(N))


@pytest.fixture(scope="module")
def turning():
    """A steady turn about a skew axis with a slow one on top: any attitudes do."""
    slow = Rotation.from_rotvec(np.outer(TIME, [0, 0, 0.004]))
    return (slow * Rotation.from_rotvec(np.outer(TIME, [0.04, 0.02, 0.01]))).as_matrix()


@pytest.fixture(scope="module")
def seen_in(turning):
    """Positions (n, m, 3) of ten features that clusters show, and which are seen."""
    features = box_features(10, (10, 5, 5), seed=7)

    def make(clusters, noise=0.0, features=features):
        com = np.tile([4.0, -19.0, 3.0], (N, 1))
        tracks = make_case(TIME, turning, com, features, noise=noise, clusters=clusters).tracks
        return tracks.position, tracks.seen, features

    return make


def groups(bodies):
    return [one.features.tolist() for one in bodies]


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_attitude_shape_and_noise_of_one_body(seen_in, turning, noise):
    position, seen, features = seen_in([(0, N, range(10))], noise)
    registered = find_bodies(position, seen)
    (one,), (origin,) = registered.bodies, registered.origins
    np.testing.assert_array_equal(one.frames, np.arange(N))
    # To 6 deviations of an attitude, σ √(1.5/(n ρ²)), and of a mean point.
    R_S_B = np.swapaxes(one.attitude, 1, 2) @ turning
    turned_off = Rotation.from_matrix(R_S_B @ R_S_B[0].T).magnitude()
    assert turned_off.max() < 1e-8 + 2 * 6 * noise * np.sqrt(1.5 / 10) / 4
    shape = (features - features.mean(axis=0)) @ R_S_B[0].T
    np.testing.assert_allclose(one.points, shape, atol=1e-8 + 6 * noise)
    centre = origin - np.array([4.0, -19, 3])
    np.testing.assert_allclose(centre, turning @ features.mean(axis=0), atol=1e-8 + 6 * noise)
    # 400 frames × 30 coordinates less unknowns: 2 % is four deviations.
    assert registered.noise == pytest.approx(noise, rel=0.02, abs=1e-9)


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_three_shared_features_tie_intervals_and_two_do_not(seen_in, noise):
    tied = [(0, 150, [0, 1, 2, 3, 4]), (150, 250, [2, 3, 4, 5, 6])]
    position, seen, _ = seen_in([*tied, (250, 400, [5, 6, 7, 8, 9])], noise)
    bodies = find_bodies(position, seen).bodies
    assert sorted(groups(bodies)) == [[0, 1, 2, 3, 4, 5, 6], [5, 6, 7, 8, 9]]
    frames = {len(one.features): one.frames for one in bodies}
    np.testing.assert_array_equal(frames[7], np.arange(250))
    np.testing.assert_array_equal(frames[5], np.arange(250, 400))


def test_a_chain_of_intervals_is_one_body_and_its_shape_the_truth(seen_in, turning):
    """The ends share nothing with each other, and the last one ties to what the second brought."""
    chain = [(0, 130, [0, 1, 2, 3]), (130, 260, [1, 2, 3, 4, 5, 6]), (260, 400, [4, 5, 6, 7, 8, 9])]
    position, seen, features = seen_in(chain)
    (one,) = find_bodies(position, seen).bodies
    assert one.features.tolist() == list(range(10))
    found, true = (p - p.mean(axis=0) for p in (one.points, features))
    turn = Rotation.align_vectors(found, true)[0]
    # What the iteration of the mean shape leaves where not all features are seen together.
    np.testing.assert_allclose(found, turn.apply(true), atol=1e-6)
    np.testing.assert_allclose(one.attitude @ turn.as_matrix(), turning, atol=1e-6)


def test_gaps_do_not_split_and_what_returns_is_known_again(seen_in):
    returning = [(0, 100, [0, 1, 2, 3]), (120, 200, [6, 7, 8, 9]), (250, 400, [0, 1, 2, 3])]
    position, seen, _ = seen_in(returning, 0.02)
    bodies = find_bodies(position, seen).bodies
    assert sorted(groups(bodies)) == [[0, 1, 2, 3], [6, 7, 8, 9]]
    main = next(one for one in bodies if 0 in one.features)
    np.testing.assert_array_equal(main.frames, np.concatenate([np.arange(100), np.arange(250, 400)]))
    assert [(one.start, one.stop) for one in main.intervals] == [(0, 100), (250, 400)]


def test_labels_that_mean_other_features_are_not_merged(seen_in):
    """After 200 s the labels 0 … 4 stand for five other features."""
    position, seen, _ = seen_in([(0, 200, [0, 1, 2, 3, 4]), (210, 400, [5, 6, 7, 8, 9])], 0.02)
    position[210:, :5], seen[210:, :5] = position[210:, 5:], seen[210:, 5:]
    bodies = find_bodies(position[:, :5], seen[:, :5]).bodies
    assert groups(bodies) == [[0, 1, 2, 3, 4], [0, 1, 2, 3, 4]]
    assert sorted(len(one.frames) for one in bodies) == [190, 200]


def test_features_shared_in_a_line_do_not_tie(seen_in):
    features = box_features(10, (10, 5, 5), seed=7)
    features[2:5] = np.outer([1.0, 2, 3], [1.0, 0.5, -0.3])
    position, seen, _ = seen_in([(0, 200, [0, 1, 2, 3, 4]), (210, 400, [2, 3, 4, 5, 6])], 0.02, features)
    bodies = find_bodies(position, seen).bodies
    assert sorted(groups(bodies)) == [[0, 1, 2, 3, 4], [2, 3, 4, 5, 6]]


def test_frames_that_show_only_a_line_are_left_out(seen_in):
    features = box_features(10, (10, 5, 5), seed=7)
    features[2:5] = np.outer([1.0, 2, 3], [1.0, 0.5, -0.3])
    clusters = [(0, 100, [0, 1, 2, 3, 4]), (100, 110, [2, 3, 4]), (110, 400, [0, 1, 2, 3, 4])]
    position, seen, _ = seen_in(clusters, 0.02, features)
    (one,) = find_bodies(position, seen).bodies
    np.testing.assert_array_equal(one.frames, np.concatenate([np.arange(100), np.arange(110, 400)]))


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_a_line_of_features_and_too_few_are_refused(seen_in, noise):
    line = np.outer(np.arange(10.0), [1.0, 2, 3])
    position, seen, _ = seen_in([(0, N, range(4))], noise, line)
    with pytest.raises(ComputationError, match="lie in a line"):
        find_bodies(position, seen)
    position, seen, _ = seen_in([(0, N, [0, 1])], noise)
    with pytest.raises(ComputationError, match="at most 2 features are seen together in a frame, at least 3"):
        find_bodies(position, seen)

"""Features are grouped into bodies as constructed, with the true shape and attitude."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator.registration import clusters
from baryscope.estimator.registration.clusters import find_bodies
from baryscope.estimator.registration.gathering import Shape
from baryscope.estimator.registration.screening import screen
from baryscope.models.errors import ComputationError
from synthetic import box_features, make_case

N = 400
TIME = np.arange(float(N))


@pytest.fixture(scope="module")
def attitude():
    """Attitudes (n, 3, 3): a constant rotation about an oblique axis, and a slow one about z."""
    slow = Rotation.from_rotvec(np.outer(TIME, [0, 0, 0.004]))
    return (slow * Rotation.from_rotvec(np.outer(TIME, [0.04, 0.02, 0.01]))).as_matrix()


@pytest.fixture(scope="module")
def observed(attitude):
    """A function of the clusters: positions (n, m, 3) of ten features, which are seen (n, m), and the features."""
    features = box_features(10, (10, 5, 5), seed=7)

    def make(clusters, noise=0.0, features=features):
        com = np.tile([4.0, -19.0, 3.0], (N, 1))
        tracks = make_case(TIME, attitude, com, features, noise=noise, clusters=clusters).tracks
        return tracks.position, tracks.seen, features

    return make


def groups(bodies):
    return [one.features.tolist() for one in bodies]


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_attitude_shape_and_noise_of_one_body(observed, attitude, noise):
    position, seen, features = observed([(0, N, range(10))], noise)
    registered = find_bodies(position, seen)
    (one,), (origin,) = registered.bodies, registered.origins
    np.testing.assert_array_equal(one.frames, np.arange(N))
    # 6 standard deviations of an attitude, σ √(1.5/(n ρ²)), and of a mean point.
    R_S_B = np.swapaxes(one.attitude, 1, 2) @ attitude
    attitude_error = Rotation.from_matrix(R_S_B @ R_S_B[0].T).magnitude()
    assert attitude_error.max() < 1e-8 + 2 * 6 * noise * np.sqrt(1.5 / 10) / 4
    shape = (features - features.mean(axis=0)) @ R_S_B[0].T
    np.testing.assert_allclose(one.points, shape, atol=1e-8 + 6 * noise)
    centre = origin - np.array([4.0, -19, 3])
    np.testing.assert_allclose(centre, attitude @ features.mean(axis=0), atol=1e-8 + 6 * noise)
    # 400 frames × 30 coordinates less unknowns: 2 % is four standard deviations.
    assert registered.noise == pytest.approx(noise, rel=0.02, abs=1e-9)


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_three_shared_features_connect_intervals_and_two_do_not(observed, noise):
    connected = [(0, 150, [0, 1, 2, 3, 4]), (150, 250, [2, 3, 4, 5, 6])]
    position, seen, _ = observed([*connected, (250, 400, [5, 6, 7, 8, 9])], noise)
    bodies = find_bodies(position, seen).bodies
    assert sorted(groups(bodies)) == [[0, 1, 2, 3, 4, 5, 6], [5, 6, 7, 8, 9]]
    frames = {len(one.features): one.frames for one in bodies}
    np.testing.assert_array_equal(frames[7], np.arange(250))
    np.testing.assert_array_equal(frames[5], np.arange(250, 400))


def test_a_chain_of_intervals_is_one_body_of_the_true_shape(observed, attitude):
    """The first and the last interval share no feature; the second connects them."""
    chain = [(0, 130, [0, 1, 2, 3]), (130, 260, [1, 2, 3, 4, 5, 6]), (260, 400, [4, 5, 6, 7, 8, 9])]
    position, seen, features = observed(chain)
    (one,) = find_bodies(position, seen).bodies
    assert one.features.tolist() == list(range(10))
    found, true = (p - p.mean(axis=0) for p in (one.points, features))
    turn = Rotation.align_vectors(found, true)[0]
    # The convergence error of the mean shape if not all features are seen together.
    np.testing.assert_allclose(found, turn.apply(true), atol=1e-6)
    np.testing.assert_allclose(one.attitude @ turn.as_matrix(), attitude, atol=1e-6)


def test_a_body_continues_across_gaps_when_its_features_return(observed):
    returning = [(0, 100, [0, 1, 2, 3]), (120, 200, [6, 7, 8, 9]), (250, 400, [0, 1, 2, 3])]
    position, seen, _ = observed(returning, 0.02)
    bodies = find_bodies(position, seen).bodies
    assert sorted(groups(bodies)) == [[0, 1, 2, 3], [6, 7, 8, 9]]
    main = next(one for one in bodies if 0 in one.features)
    np.testing.assert_array_equal(main.frames, np.concatenate([np.arange(100), np.arange(250, 400)]))
    assert [(one.start, one.stop) for one in main.intervals] == [(0, 100), (250, 400)]


def test_reused_labels_of_other_features_are_not_merged(observed):
    """After 200 s the labels 0 … 4 belong to five other features."""
    position, seen, _ = observed([(0, 200, [0, 1, 2, 3, 4]), (210, 400, [5, 6, 7, 8, 9])], 0.02)
    position[210:, :5], seen[210:, :5] = position[210:, 5:], seen[210:, 5:]
    bodies = find_bodies(position[:, :5], seen[:, :5]).bodies
    assert groups(bodies) == [[0, 1, 2, 3, 4], [0, 1, 2, 3, 4]]
    assert sorted(len(one.frames) for one in bodies) == [190, 200]


def test_collinear_shared_features_do_not_connect_bodies(observed):
    features = box_features(10, (10, 5, 5), seed=7)
    features[2:5] = np.outer([1.0, 2, 3], [1.0, 0.5, -0.3])
    position, seen, _ = observed([(0, 200, [0, 1, 2, 3, 4]), (210, 400, [2, 3, 4, 5, 6])], 0.02, features)
    bodies = find_bodies(position, seen).bodies
    assert sorted(groups(bodies)) == [[0, 1, 2, 3, 4], [2, 3, 4, 5, 6]]


def test_frames_with_collinear_features_are_left_out(observed):
    features = box_features(10, (10, 5, 5), seed=7)
    features[2:5] = np.outer([1.0, 2, 3], [1.0, 0.5, -0.3])
    clusters = [(0, 100, [0, 1, 2, 3, 4]), (100, 110, [2, 3, 4]), (110, 400, [0, 1, 2, 3, 4])]
    position, seen, _ = observed(clusters, 0.02, features)
    (one,) = find_bodies(position, seen).bodies
    np.testing.assert_array_equal(one.frames, np.concatenate([np.arange(100), np.arange(110, 400)]))


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_collinear_and_too_few_features_are_refused(observed, noise):
    line = np.outer(np.arange(10.0), [1.0, 2, 3])
    position, seen, _ = observed([(0, N, range(4))], noise, line)
    with pytest.raises(ComputationError, match="lie in a line"):
        find_bodies(position, seen)
    position, seen, _ = observed([(0, N, [0, 1])], noise)
    with pytest.raises(ComputationError, match="at most 2 features are seen together in a frame, at least 3"):
        find_bodies(position, seen)


def test_fragments_are_part_of_the_body_that_their_features_are_of(observed):
    """With a third of the sightings lost, few frames in a row see the same features; each fragment alone is no body."""
    position, seen, features = observed([(0, N, range(7))], 0.02)
    seen = seen & (np.random.default_rng(5).random(seen.shape) < 0.6)
    enough = np.nonzero(seen.sum(axis=1) >= 3)[0]
    (one,) = find_bodies(position, seen).bodies
    assert len(one.frames) > 0.99 * len(enough)
    found, true = (p - p.mean(axis=0) for p in (one.points, features[:7]))
    np.testing.assert_allclose(found, Rotation.align_vectors(found, true)[0].apply(true), atol=6 * 0.02 / np.sqrt(100))


def test_every_frame_a_fragment(observed):
    """Gaps after each frame: no interval has a residual, distances tell the noise."""
    position, seen, _ = observed([(0, N, range(7))], 0.02)
    seen[np.arange(N) % 7 != 0] = False
    registered = find_bodies(position, seen)
    assert [len(one.frames) for one in registered.bodies] == [len(range(0, N, 7))]
    assert registered.noise == pytest.approx(0.02, rel=0.1)


def test_a_body_of_a_few_frames_is_left_out(observed):
    position, seen, _ = observed([(0, 200, [0, 1, 2, 3]), (205, 212, [6, 7, 8, 9]), (215, 400, [3, 4, 5, 6])], 0.02)
    assert sorted(groups(find_bodies(position, seen).bodies)) == [[0, 1, 2, 3], [3, 4, 5, 6]]
    position, seen, _ = observed([(0, 6, [0, 1, 2, 3]), (8, 13, [6, 7, 8, 9])], 0.02)
    assert sorted(groups(find_bodies(position, seen).bodies)) == [[0, 1, 2, 3]]


def test_features_as_near_together_as_the_noise_is_great(observed, attitude):
    """Ten features with a spread of three times the noise: many features make up for what each of them lacks."""
    features = box_features(10, (1.5, 1.5, 1.5), seed=7)
    position, seen, _ = observed([(0, N, range(10))], 0.2, features)
    (one,) = find_bodies(position, seen).bodies
    assert len(one.frames) > 0.98 * N
    R_S_B = Rotation.from_matrix(np.swapaxes(one.attitude, 1, 2) @ attitude[one.frames])
    error = (R_S_B * R_S_B.mean().inv()).magnitude()
    assert np.sqrt(np.mean(error**2)) < 1.5 * 0.2 * np.sqrt(1.5 / 10 * 3) / np.sqrt((features**2).sum() / 10)


def test_outliers_do_not_count_as_noise(observed):
    position, seen, _ = observed([(0, N, range(10))], 0.002)
    rng = np.random.default_rng(2)
    wrong = rng.random(seen.shape) < 0.004
    position[wrong] += rng.uniform(-3, 3, (int(wrong.sum()), 3))
    inliers = screen(position, seen)
    assert find_bodies(position, inliers).noise == pytest.approx(0.002, rel=0.05)


def test_the_order_of_merging_two_shapes_does_not_matter():
    """Their points are weighed by how often each is seen: the same body either way, but for its axes."""
    rng = np.random.default_rng(5)
    points, turn = rng.uniform(-3, 3, (6, 3)), Rotation.random(rng=6).as_matrix()

    def shapes():
        """One of features 0 to 4, in some axes, and one of 1 to 5, in others, seen less often."""
        first = {index: points[index] + 1e-3 * noise[index] for index in range(5)}
        second = {index: turn @ (points[index] - 1e-3 * noise[index]) + [1, 2, 3] for index in range(1, 6)}
        counts = {index: 30 + index for index in range(5)}, {index: 10 + 2 * index for index in range(1, 6)}
        return Shape(first, counts[0], []), Shape(second, counts[1], [])

    def distances(whole, other):
        assert clusters._merge(whole, other, 0.02)
        merged = np.array([whole.points[index] for index in range(6)])
        assert whole.counts == {0: 30, **{index: 40 + 3 * index for index in range(1, 5)}, 5: 20}
        return np.linalg.norm(merged[:, None] - merged, axis=2)

    noise = rng.normal(size=(6, 3))
    one, two = shapes()
    between = distances(one, two)
    one, two = shapes()
    np.testing.assert_allclose(distances(two, one), between, rtol=0, atol=1e-12)
    np.testing.assert_allclose(between, np.linalg.norm(points[:, None] - points, axis=2), rtol=0, atol=5e-3)


@pytest.mark.parametrize(("frames", "bodies"), [(15, 1), (100, 2)])
def test_a_shape_that_a_longer_body_contradicts_in_a_few_frames_is_a_wrong_label(observed, frames, bodies):
    """A ghost takes a marker's label for some frames: three markers are another triangle there, of wrong attitudes.

    It was a body, which drew the path of a probe's tip from its dimple to the markers. For a quarter of the time
    it is one: labels may be exchanged for as long.
    """
    position, seen, _ = observed([(0, N, range(3))], 0.01)
    ghost = np.arange(N) >= N - frames
    position[ghost, 2] += [0.0, 1.0, 0.5]
    seen[N - frames - 6 : N - frames, 1] = False  # an occlusion comes before it
    assert len(find_bodies(position, seen).bodies) == bodies

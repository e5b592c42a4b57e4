"""Bodies with one, two or collinear tie points, against the same observations as one body with common axes."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from baryscope.estimator.adjustment.frame_shifts import FrameShifts
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.geometry.gauge import offset_by_points
from baryscope.estimator.options import PathOptions
from baryscope.estimator.paths.path import Polynomial
from baryscope.estimator.pivot.free_attitudes import gauss_newton_step
from baryscope.estimator.pivot.method import estimate_by_pivot, solve_pivot
from baryscope.estimator.pivot.tie_points import tie_bodies
from baryscope.estimator.prose import sentence
from baryscope.estimator.registration.body import Body
from baryscope.estimator.tracks import FeatureTracks
from baryscope.study.population.cases import drawn
from baryscope.study.population.judging import of_estimate, wrong
from baryscope.study.population.sensing import sampled
from free_paths import (
    BOTH,
    NOISE,
    ORBIT,
    TEN,
    found_by,
    in_orbit,
    rms,
    squared_error,
    squared_error_of_cluster,
    turning,
    with_positions,
)
from synthetic import make_case

PATH = Polynomial(1, 0.0, 11.0)
X = np.array([4.0, -19.0, 3.0, 0.5, 0.2, -0.3])
FINE = 1e-3  # m, of each coordinate
POINTS = 2 * np.random.default_rng(0).normal(size=(8, 3))
SHARED = {"one": [3], "two": [3, 4], "three in a line": [3, 4, 5]}


def scene(groups, points, seed=0):
    """Observations of one group of points after the other, 12 frames each; a body for each group, and one for all.

    The body rotates by about a radian while a group is seen, so that a group alone determines the centre poorly.
    """
    rng = np.random.default_rng(seed)
    n, m = 12 * len(groups), len(points)
    sampled = PATH.at(np.linspace(0.0, 11.0, n))
    spin, roll = (Rotation.from_rotvec(np.outer(0.1 * np.arange(n), axis)) for axis in ([1.0, 0, 0], [0, 0.6, 0.8]))
    attitude = (spin * roll).as_matrix()
    position = sampled.position(X)[:, None] + points @ np.swapaxes(attitude, 1, 2)
    position += FINE * rng.normal(size=position.shape)
    weight, bodies = np.zeros((n, m)), []
    for index, features in enumerate(groups):
        frames, turn = np.arange(12 * index, 12 * index + 12), Rotation.random(random_state=index).as_matrix()
        weight[np.ix_(frames, features)] = 1.0
        bodies.append(Body(np.array(features), frames, points[features] @ turn.T, attitude[frames] @ turn.T))
    whole = Body(np.arange(m), np.arange(n), points, attitude)
    return Observations(position * (weight[..., None] > 0), weight), sampled, tuple(bodies), whole


def converged(bodies, observations, sampled):
    x = X
    for _ in range(4):
        found = gauss_newton_step(bodies, observations, sampled, x)
        bodies, x = found.bodies, found.x
    return found


def in_line(points):
    points = points.copy()
    points[3:6] = np.array([0.5, 1, 2]) + np.outer([1.0, 2, 3], [1, 0.5, -0.3])
    return points


@pytest.mark.parametrize("kind", SHARED)
def test_tied_bodies_agree_with_one_body(kind):
    shared = SHARED[kind]
    points = in_line(POINTS) if kind == "three in a line" else POINTS
    first, second = [0, 1, 2, *shared], [*shared, *range(shared[-1] + 1, 8)]
    observations, sampled, bodies, whole = scene([first, second], points)
    apart, one = converged(bodies, observations, sampled), converged((whole,), observations, sampled)
    found, made, refused = tie_bodies(apart, FINE**2, observations, sampled.position(X))
    assert [made[0].bodies, made[0].features.tolist(), len(made), refused] == [(0, 1), shared, 1, ()]
    deviation = FINE * np.sqrt(np.diag(one.covariance))
    assert np.trace(apart.covariance) > 1.1 * np.trace(one.covariance)
    # The remaining difference is of second order in 1 mm over the metres of the points.
    np.testing.assert_allclose((found.x - one.x) / deviation, 0.0, atol=0.01)
    np.testing.assert_allclose(found.covariance, one.covariance, atol=2e-3 * one.covariance.max())
    joint = one.points_covariance[0] + one.by_path[0] @ one.covariance @ one.by_path[0].T
    for k, (body, features) in enumerate(zip(found.bodies, (first, second), strict=True)):
        rows = (3 * np.array(features)[:, None] + np.arange(3)).ravel()
        # The same offset in axes attached to the body's points, expressed in the body's axes S.
        turn = Rotation.align_vectors(body.points, whole.points[features])[0].as_matrix()
        attached = turn @ offset_by_points(one.bodies[0].points[features])
        expected = attached @ joint[np.ix_(rows, rows)] @ attached.T
        own = slice(3 * k, 3 * k + 3)
        np.testing.assert_allclose(found.offset_covariance[own, own], expected, atol=5e-3 * expected.max())
        expected = -attached @ one.by_path[0][rows] @ one.covariance
        np.testing.assert_allclose(found.offset_path[own], expected, atol=5e-3 * np.abs(expected).max())
    a, b = (body.points[rows] for body, rows in zip(found.bodies, made[0].rows, strict=True))
    np.testing.assert_allclose(a @ a.T, b @ b.T, atol=20 * FINE**2)


def test_bodies_are_tied_although_their_frames_are_shifted():
    """By 7 cm, as by a camera's attitude: frames tell less of the offsets, and so does the noise of the attitudes."""
    observations, sampled, bodies, _ = scene([[0, 1, 2, 3], [3, 4, 5, 6]], POINTS)
    rng, shift = np.random.default_rng(1), 0.07
    position = observations.position + shift * rng.normal(size=(24, 1, 3)) * (observations.weight[..., None] > 0)
    observations = replace(observations, position=position)
    noise = FrameShifts(np.tile((shift / FINE) ** 2 * np.eye(3), (24, 1, 1)))
    x = X
    for _ in range(4):
        apart = gauss_newton_step(bodies, observations, sampled, x, noise)
        bodies, x = apart.bodies, apart.x
    origin = sampled.position(x)
    found, made, refused = tie_bodies(apart, FINE**2, observations, origin, noise)
    assert ([one.features.tolist() for one in made], refused) == ([[3]], ())
    error, deviation = found.x - X, FINE * np.sqrt(np.diag(found.covariance))
    assert np.trace(found.covariance) < np.trace(apart.covariance)
    assert (np.abs(error) < 4 * deviation).all()


def test_relabelled_points_are_no_tie_points():
    """F3 of the second body is a different point, 1 % farther away, with the same label."""
    points = np.concatenate([POINTS, POINTS[3:4] * 1.01])
    observations, sampled, bodies, _ = scene([[0, 1, 2, 3], [8, 4, 5, 6]], points)
    apart = converged(bodies, observations, sampled)
    first, second = apart.bodies
    renamed = replace(apart, bodies=(first, replace(second, features=np.array([3, 4, 5, 6]))))
    found, made, refused = tie_bodies(renamed, FINE**2, observations, sampled.position(X))
    assert found is renamed
    assert made == ()
    assert [(one.features.tolist(), one.disagreement) for one in refused] == [([3], None)]


def test_bodies_that_share_all_the_same_features_and_claim_too_little_disagree():
    """Three features are the same in both, but of a noise that is told five times too small."""
    observations, sampled, bodies, _ = scene([[0, 1, 2, 3, 4], [2, 3, 4, 5, 6]], POINTS)
    apart = converged(bodies, observations, sampled)
    found, made, refused = tie_bodies(apart, (FINE / 5) ** 2, observations, sampled.position(X))
    assert (found, made) == (apart, ())
    (one,) = refused
    assert one.features.tolist() == [2, 3, 4]
    low, high = np.sqrt(chi2.ppf([0.001, 0.999], len(one.compared)) / len(one.compared))
    assert 5 * low < one.disagreement < 5 * high


def test_unchanged_features_tie_although_others_are_relabelled():
    points = np.concatenate([POINTS, POINTS[4:5] * 1.01])
    observations, sampled, bodies, _ = scene([[0, 1, 2, 3, 4], [3, 8, 5, 6]], points)
    apart = converged(bodies, observations, sampled)
    first, second = apart.bodies
    renamed = replace(apart, bodies=(first, replace(second, features=np.array([3, 4, 5, 6]))))
    _, made, refused = tie_bodies(renamed, FINE**2, observations, sampled.position(X))
    assert [one.features.tolist() for one in made] == [[3]]
    assert [one.features.tolist() for one in refused] == [[4]]


def test_a_feature_that_comes_back_as_far_from_the_centre_as_before_is_found_by_the_others():
    """F3 of the second body is turned about the centre of mass: only its distances from the others are not what they
    were. All together would disagree.
    """
    turned = Rotation.from_rotvec([0.02, -0.02, 0.01]).apply(POINTS[3:4])
    observations, sampled, bodies, _ = scene([[0, 1, 2, 3, 4], [1, 2, 8, 4, 5]], np.concatenate([POINTS, turned]))
    apart = converged(bodies, observations, sampled)
    first, second = apart.bodies
    renamed = replace(apart, bodies=(first, replace(second, features=np.array([1, 2, 3, 4, 5]))))
    _, made, refused = tie_bodies(renamed, FINE**2, observations, sampled.position(X))
    assert [one.features.tolist() for one in made] == [[1, 2, 4]]
    assert [(one.features.tolist(), one.disagreement) for one in refused] == [([3], None)]


def test_many_shared_features_are_averaged_in_groups():
    """Bodies that share 120 features in a line: all their products would be a matrix of 14,400 rows."""
    on_line = np.array([0.5, 1, 2]) + np.outer(np.linspace(-3, 3, 120), [1, 0.5, -0.3])
    points = np.concatenate([POINTS, on_line])
    line = list(range(8, 128))
    observations, sampled, bodies, whole = scene([[0, 1, 2, *line], [*line, 4, 5, 6]], points)
    apart, one = converged(bodies, observations, sampled), converged((whole,), observations, sampled)
    found, made, refused = tie_bodies(apart, FINE**2, observations, sampled.position(X))
    assert [len(tie.features) for tie in made] == [120]
    assert refused == ()
    gained = np.trace(apart.covariance) - np.trace(found.covariance)
    assert gained > 0.9 * (np.trace(apart.covariance) - np.trace(one.covariance))


@BOTH
def test_a_label_of_two_points_is_reported(method):
    time, R = turning(120)
    clusters = [(0.0, 59.0, [0, 1, 2, 3]), (61.0, 120.0, [3, 4, 5, 6])]
    case = make_case(time, R, in_orbit(time), TEN, noise=NOISE, clusters=clusters)
    position = case.tracks.position.copy()
    position[60:, 3] += R[60:] @ (0.1 * TEN[3])
    found = found_by(method, with_positions(case, position), "relative-orbit")
    assert found.rejected_share < 0.01
    assert [sentence(finding) for finding in found.findings] == ["F3: not the same in clusters 0 and 1, no tie point"]
    assert squared_error(found, case) < 4.5**2
    # `ml`, which has one body, gives the second point a label of its own.
    names = [list(cluster.labels) for cluster in found.clusters]
    assert names == [["F0", "F1", "F2", "F3"], ["F3 (2)" if method == "ml" else "F3", "F4", "F5", "F6"]]


def test_a_label_temporarily_of_another_point():
    """`ml` finds that F3 is the same point in the first and the third cluster, and another in the second."""
    time, R = turning(120)
    clusters = [(0.0, 39.0, [0, 1, 2, 3]), (41.0, 79.0, [3, 4, 5, 6]), (80.0, 120.0, [3, 7, 8, 9])]
    case = make_case(time, R, in_orbit(time), TEN, noise=NOISE, seed=3, clusters=clusters)
    position = case.tracks.position.copy()
    position[40:80, 3] += R[40:80] @ (0.1 * TEN[3])
    found = found_by("ml", with_positions(case, position), "relative-orbit")
    names = {found.time[cluster.frames[0]]: cluster.labels[0] for cluster in found.clusters}
    assert names == {0.0: "F0", 41.0: "F3 (2)", 80.0: "F3"}
    assert found.rejected_share < 0.01
    assert squared_error(found, case) < 4.5**2


def test_bodies_without_shared_features_are_not_tied():
    observations, sampled, bodies, _ = scene([[0, 1, 2, 3], [4, 5, 6, 7]], POINTS)
    apart = converged(bodies, observations, sampled)
    assert tie_bodies(apart, FINE**2, observations, sampled.position(X)) == (apart, (), ())


def test_a_body_is_tied_to_the_nearest_one_with_each_feature():
    """The second body connects the first and the third; the fourth shares a feature with the first alone."""
    groups = [[0, 1, 2, 3], [3, 4, 5, 6], [3, 7, 5, 4], [0, 6, 7, 4]]
    observations, sampled, bodies, _ = scene(groups, POINTS)
    _, made, _ = tie_bodies(converged(bodies, observations, sampled), FINE**2, observations, sampled.position(X))
    assert [one.bodies for one in made] == [(0, 1), (1, 2), (2, 3), (1, 3), (0, 3)]


@pytest.mark.parametrize("lateral_offset", [0.0, 0.5 * FINE])
def test_features_collinear_with_the_centre_of_mass_compare_their_distances_only(lateral_offset):
    """The angle between them at the centre of mass is a second-order function, which a linear model must not use."""
    points = POINTS.copy()
    points[3], points[4] = [2.0, lateral_offset, 0.0], [3.0, 0.0, -lateral_offset]
    squares = []
    for seed in range(40):
        observations, sampled, bodies, _ = scene([[0, 1, 2, 3, 4], [3, 4, 5, 6, 7]], points, seed)
        found, made, _ = tie_bodies(
            converged(bodies, observations, sampled), FINE**2, observations, sampled.position(X)
        )
        assert len(made[0].compared) == 2
        error = found.x - X
        squares.append(error @ np.linalg.solve(FINE**2 * found.covariance, error))
    low, high = chi2.ppf([0.005, 0.995], 6 * 40) / 40
    assert low < np.mean(squares) < high


@settings(max_examples=40, deadline=None, derandomize=True)
@given(st.lists(st.integers(4, 14), min_size=2, max_size=5), st.integers(0, 10**6), st.sampled_from([1e-9, 1e-3, 0.3]))
def test_covariances_with_ties_are_positive_semidefinite(lengths, seed, noise):
    """Bodies of a few frames each, which overlap in random features, are as ill-conditioned as they come."""
    rng = np.random.default_rng(seed)
    groups = [np.sort(rng.choice(8, 4, replace=False)) for _ in lengths]
    n, begins = sum(lengths), np.cumsum([0, *lengths])
    sampled = PATH.at(np.linspace(0.0, 11.0, n))
    spin = Rotation.from_rotvec(np.outer(rng.uniform(0.001, 0.3) * np.arange(n), [1.0, 0, 0]))
    attitude = (spin * Rotation.from_rotvec(np.outer(0.1 * np.arange(n), [0, 0.6, 0.8]))).as_matrix()
    position = sampled.position(X)[:, None] + POINTS @ np.swapaxes(attitude, 1, 2)
    position += noise * rng.normal(size=position.shape)
    weight, bodies = np.zeros(position.shape[:2]), []
    for group, begin, end in zip(groups, begins, begins[1:], strict=False):
        frames = np.arange(begin, end)
        weight[np.ix_(frames, group)] = 1.0
        bodies.append(Body(group, frames, POINTS[group], attitude[frames]))
    observations = Observations(position * (weight[..., None] > 0), weight)
    apart = gauss_newton_step(tuple(bodies), observations, sampled, X)
    found, _, _ = tie_bodies(apart, noise**2, observations, sampled.position(X))
    joint = np.block([[found.offset_covariance, found.offset_path], [found.offset_path.T, found.covariance]])
    scale = 1 / np.sqrt(np.maximum(np.diag(joint), 1e-300))
    assert np.linalg.eigvalsh(joint * np.outer(scale, scale))[0] > -1e-9
    # Ties add information.
    before = np.diag(apart.covariance)
    assert (np.diag(found.covariance) <= before * (1 + 1e-6)).all()


# Clusters of which successive ones share one or two features, and the bound of the path's error over that without ties.
CHAINS = {
    "one": ([[0, 1, 2, 3], [3, 4, 5, 6], [6, 7, 8, 9]], 0.93),
    "two": ([[0, 1, 2, 3], [2, 3, 4, 5], [4, 5, 6, 7]], 0.8),
}
DRAWS = 16


def relabelled(tracks):
    """The same tracks, with different labels in each of the three parts."""
    parts = [slice(0, 41), slice(41, 81), slice(81, 120)]
    position = np.full((len(tracks.time), 3 * len(tracks.labels), 3), np.nan)
    for k, part in enumerate(parts):
        position[part, k * len(tracks.labels) : (k + 1) * len(tracks.labels)] = tracks.position[part]
    return FeatureTracks(tracks.time, position, tuple(f"{label}-{k}" for k in range(3) for label in tracks.labels))


@pytest.mark.parametrize("kind", CHAINS)
def test_returning_features_reduce_the_error_as_predicted(kind):
    groups, gain = CHAINS[kind]
    shared = [[f"F{k}" for k in one if k in other] for one, other in pairwise(groups)]
    clusters = [(begin, begin + 39.0, features) for begin, features in zip((0.0, 41.0, 81.0), groups, strict=True)]
    time, R = turning(120)
    com = in_orbit(time)
    errors, squares = [], []
    for seed in range(DRAWS):
        case = make_case(time, R, com, TEN, noise=NOISE, seed=seed, clusters=clusters)
        found = found_by("pivot", case.tracks, "relative-orbit", process_noise="none")
        assert sorted(list(one.labels) for one in found.details.tie_points) == shared
        alone = found_by("pivot", relabelled(case.tracks), "relative-orbit", process_noise="none")
        assert alone.details.tie_points == ()
        errors.append([rms(found, case) ** 2, rms(alone, case) ** 2])
        squares.append([squared_error(found, case), *(squared_error_of_cluster(found, case, k) for k in range(3))])
    tied, untied = np.sqrt(np.mean(errors, axis=0))
    assert tied < gain * untied
    # Eight means in all: 1 in 100 for the smallest and the greatest of them.
    low, high = chi2.ppf([0.005 / 8, 1 - 0.005 / 8], 3 * DRAWS) / DRAWS
    assert (low < np.mean(squares, axis=0)).all()
    assert (np.mean(squares, axis=0) < high).all()


def test_solutions_are_compared_where_the_iteration_has_ended():
    """Tie points move a path's noise by the covariance over all its densities: by that of none, which is the likeliest
    here, it is most improbable there, and a solution with burns was dropped for it.
    """
    groups, _ = CHAINS["two"]
    clusters = [(begin, begin + 39.0, features) for begin, features in zip((0.0, 41.0, 81.0), groups, strict=True)]
    time, R = turning(120)
    case = make_case(time, R, in_orbit(time), TEN, noise=NOISE, seed=4, clusters=clusters)
    found = solve_pivot(case.tracks, ORBIT.model(), PathOptions())
    assert found.tie_points
    precision = found.path.prior.precision(found.posterior.theta)
    tied, untied = (float(precision @ x**2) for x in (found.solution.x, found.untied_problem.x))
    assert untied < 1.0 < tied


def test_ties_that_depend_on_others_are_not_magnified():
    """Four bodies that share 17 to 26 features with each other: a combination of their misclosures vanishes, but for
    what its linear model neglects. Of `python -m baryscope.study.population case --seed 102 --index 13 --orbit
    --method pivot --draws 5`, three were wrong, with a NEES up to 287.
    """
    case = drawn(102, 13)
    found = estimate_by_pivot(sampled(case, 2).tracks, case.orbit, PathOptions())
    assert len(found.details.tie_points) > 3
    assert not wrong(of_estimate(found, case.path))


def test_a_body_known_by_the_noise_of_its_attitudes_is_not_tied():
    """Both bodies spin about one axis: what they seem to tell of the position along it would disagree."""
    n = 200
    sampled = Polynomial(0, 0.0, 11.0).at(np.linspace(0.0, 11.0, n))
    attitude = Rotation.from_rotvec(np.outer(0.1 * np.arange(n), [0, 0, 1.0])).as_matrix()
    x, groups = X[:3], ([0, 1, 2, 3], [3, 4, 5, 6])
    position = sampled.position(x)[:, None] + POINTS @ np.swapaxes(attitude, 1, 2)
    position += 0.1 * np.random.default_rng(0).normal(size=position.shape)
    weight, bodies = np.zeros(position.shape[:2]), []
    for group, frames in zip(groups, (np.arange(100), np.arange(100, 200)), strict=True):
        weight[np.ix_(frames, group)] = 1.0
        bodies.append(Body(np.array(group), frames, POINTS[group], attitude[frames]))
    observations = Observations(position * (weight[..., None] > 0), weight)
    apart = gauss_newton_step(tuple(bodies), observations, sampled, x)
    assert tie_bodies(apart, 0.01, observations, sampled.position(x)) == (apart, (), ())

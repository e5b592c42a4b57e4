"""Gauss–Newton with free attitudes, against the dense problem with every unknown, and scipy's least_squares."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from baryscope.estimator.adjustment.elimination import chunks_of
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.geometry.gauge import offset_by_points
from baryscope.estimator.paths.path import Polynomial
from baryscope.estimator.pivot.free_attitudes import gauss_newton_step, linearised
from baryscope.estimator.registration.body import Body
from synthetic import differences, roots, turned_back

N, M = 9, 7  # frames, features: two bodies with different frames and features, and one feature in common
FEATURES = [np.array([0, 1, 2, 3]), np.array([3, 4, 5, 6])]
FRAMES = [np.arange(0, 5), np.arange(5, 9)]
NOISE = 0.05
PATH = Polynomial(1, 0.0, 8.0)


def scene(full, seed=0, start=0.02):
    """Noisy observations, and bodies and path with errors of about `start`."""
    rng = np.random.default_rng(seed)
    x = np.array([4.0, -19.0, 3.0, 0.5, 0.2, -0.3])
    sampled = PATH.at(np.arange(float(N)))
    origin = sampled.position(x)
    position, used, bodies = np.zeros((N, M, 3)), np.zeros((N, M), dtype=bool), []
    for features, frames in zip(FEATURES, FRAMES, strict=True):
        points, attitude = rng.normal(size=(4, 3)) * 2, Rotation.random(len(frames), random_state=seed).as_matrix()
        block = np.ix_(frames, features)
        position[block] = origin[frames][:, None] + points @ np.swapaxes(attitude, 1, 2)
        used[block] = True
        turn = Rotation.from_rotvec(start * rng.normal(size=(len(frames), 3))).as_matrix()
        bodies.append(Body(features, frames, points + start * rng.normal(size=(4, 3)), attitude @ turn))
    used[2, 1] = False
    position += NOISE * rng.normal(size=position.shape)
    weight = np.where(used, rng.uniform(0.5, 2, (N, M)), 0.0)
    precision = None
    if full:
        factor = rng.normal(size=(N, M, 3, 3))
        precision = factor @ np.swapaxes(factor, 2, 3) + 0.3 * np.eye(3)
    observations = Observations(np.where(used[..., None], position, 0.0), weight, precision)
    return observations, sampled, tuple(bodies), x + start * rng.normal(size=6)


def whitened(observations, sampled, bodies, x):
    """Residuals of unit variance as a function of all unknowns: δx (6,), δb and φ of each body."""
    root = roots(observations.weight, observations.precision)

    def function(unknowns):
        origin, rest, values = sampled.position(x + unknowns[:6]), unknowns[6:], []
        for body in bodies:
            m, n = len(body.features), len(body.frames)
            points = body.points + rest[: 3 * m].reshape(m, 3)
            turn = Rotation.from_rotvec(rest[3 * m : 3 * (m + n)].reshape(n, 3)).as_matrix()
            rest = rest[3 * (m + n) :]
            model = origin[body.frames][:, None] + points @ np.swapaxes(body.attitude @ turn, 1, 2)
            block = np.ix_(body.frames, body.features)
            values.append((root[block] @ (observations.position[block] - model)[..., None]).ravel())
        return np.concatenate(values)

    return function, 6 + sum(3 * (len(body.features) + len(body.frames)) for body in bodies)


def distances(points):
    points = points.reshape(-1, 3)
    return np.linalg.norm(points[:-1] - points[1:], axis=1)


def points_of(bodies):
    """The indices of each body's points among the unknowns."""
    place, found = 6, []
    for body in bodies:
        m, n = len(body.features), len(body.frames)
        found.append(np.arange(place, place + 3 * m))
        place += 3 * (m + n)
    return found


def test_a_feature_of_which_all_is_rejected_does_not_distort_the_others():
    """Its point moves by metres, where it seems to be: the step of the others is the one without it.

    Oracle: the same step of the bodies without that feature; its weights, 1e-9, tell as much less of the others.
    """
    observations, sampled, bodies, x = scene(full=False)
    position, weight = observations.position.copy(), observations.weight.copy()
    position[:5, 1] += bodies[0].attitude @ [40.0, -20.0, 30.0]
    weight[:5, 1] *= 1e-9
    rejected = Observations(position, weight)
    found = gauss_newton_step(bodies, rejected, sampled, x)
    told = np.array([True, False, True, True])
    alone = gauss_newton_step((bodies[0].of_features(told), bodies[1]), rejected, sampled, x)
    assert np.linalg.norm(found.bodies[0].points[1] - bodies[0].points[1]) > 30
    np.testing.assert_allclose(found.x, alone.x, rtol=0, atol=1e-5)
    lengths = [distances(one.bodies[0].points[own]) for one, own in ((found, told), (alone, slice(None)))]
    np.testing.assert_allclose(*lengths, rtol=0, atol=1e-5)


@pytest.mark.parametrize("full", [False, True], ids=["isotropic", "precisions"])
def test_a_feature_of_which_nothing_counts_takes_no_prior_from_the_others(full):
    """It was part of the centroid that is held near the centre of mass, so that it went to where the others needed no
    prior, by kilometres in few steps. Oracle: the steps of the bodies without that feature.
    """
    observations, sampled, bodies, x = scene(full)
    weight = observations.weight.copy()
    weight[:, 1] = 0.0
    rejected = observations.weighted(weight)
    told = np.array([True, False, True, True])
    alone, y, known = (bodies[0].of_features(told), *bodies[1:]), x, np.tile(9.0 * np.eye(3), (2, 1, 1))
    for _ in range(5):
        found = linearised(bodies, rejected, sampled, x, offset_information=known).step()
        expected = linearised(alone, rejected, sampled, y, offset_information=known).step()
        bodies, x, alone, y = found.bodies, found.x, expected.bodies, expected.x
        np.testing.assert_allclose(x, y, rtol=0, atol=1e-9)
        np.testing.assert_allclose(distances(bodies[0].points[told]), distances(alone[0].points), rtol=0, atol=1e-9)
        assert np.linalg.norm(bodies[0].points[1]) < 10  # m


@pytest.mark.parametrize("full", [False, True], ids=["isotropic", "precisions"])
def test_axes_are_attached_to_the_features_that_count(full):
    """Else they were to one that is far off: what a change of the path did to the others was a turn by radians."""
    observations, sampled, bodies, x = scene(full)
    weight = observations.weight.copy()
    weight[:, 1] *= 1e-12
    told = np.array([True, False, True, True])
    points = np.where(told[:, None], bodies[0].points, [400.0, -200.0, 300.0])
    rejected = observations.weighted(weight)
    far = linearised((replace(bodies[0], points=points), bodies[1]), rejected, sampled, x)
    alone = linearised((bodies[0].of_features(told), bodies[1]), rejected, sampled, x)
    for name in ("by_path", "inverse"):
        some = np.repeat(told, 3)
        own = getattr(far, name)[0][some]
        own = own[:, some] if name == "inverse" else own
        np.testing.assert_allclose(own, getattr(alone, name)[0], rtol=0, atol=1e-6 * np.abs(own).max())


def test_a_step_changes_a_body_no_more_than_it_is_large():
    """Two halves with one feature in common, 300 m from the centre of mass: how they stand to each other is hardly
    told, and the prior of the offset bends the body, by more than is linear.
    """
    observations, sampled, bodies, x = scene(full=False)
    points, far = np.concatenate([bodies[0].points, bodies[1].points[1:]]), np.array([300.0, 0.0, 0.0])
    position = observations.position.copy()
    for body in bodies:
        position[body.block] += (body.attitude @ far)[:, None]
    seen = Observations(np.where((observations.weight > 0)[..., None], position, 0.0), observations.weight)
    attitude = np.concatenate([body.attitude for body in bodies])
    joined = Body(np.arange(M), np.arange(N), points + far, attitude)
    problem = linearised((joined,), seen, sampled, x, offset_information=1e-3 * np.eye(3)[None])
    step = problem.step()
    whole = problem.inverse[0] @ problem.points_rhs[0] - problem.by_path[0] @ (step.x - x)
    made = step.bodies[0].points - problem.bodies[0].points
    size, asked, changed = (np.linalg.norm(one - one.mean(axis=0)) for one in (points, whole.reshape(-1, 3), made))
    assert asked > 2 * size
    assert changed < 1.5 * size


@pytest.mark.parametrize("full", [False, True], ids=["isotropic", "precisions"])
def test_a_step_agrees_with_the_dense_normal_equations(full):
    """With all rotations, points and path as unknowns; the pseudo-inverse fixes the gauge of the bodies' axes."""
    observations, sampled, bodies, x = scene(full)
    found = gauss_newton_step(bodies, observations, sampled, x)
    # Start from the attitudes after the step in the rotations.
    turned = tuple(
        Body(body.features, body.frames, body.points, new.attitude)
        for body, new in zip(bodies, found.bodies, strict=True)
    )
    function, size = whitened(observations, sampled, turned, x)
    residual, J = function(np.zeros(size)), differences(function, np.zeros(size))
    covariance = np.linalg.pinv(J.T @ J, rcond=1e-9, hermitian=True)
    assert np.linalg.matrix_rank(J, tol=1e-5) == size - 3 * len(bodies)
    change = -covariance @ J.T @ residual
    np.testing.assert_allclose(found.x - x, change[:6], atol=1e-6)
    np.testing.assert_allclose(found.covariance, covariance[:6, :6], rtol=1e-5, atol=1e-6 * covariance[0, 0])
    assert found.squares.sum() == pytest.approx(residual @ residual, rel=1e-9)
    offsets = []
    for body, new, own in zip(bodies, found.bodies, points_of(bodies), strict=True):
        attached = differences(lambda p, b=body: turned_back(p.reshape(-1, 3), b.points), body.points.ravel(), 1e-5)
        # In the axes attached to the points after the step.
        old, moved = (points - points.mean(axis=0) for points in (body.points, new.points))
        attached = Rotation.align_vectors(moved, old)[0].as_matrix() @ attached
        offsets.append(attached @ np.eye(size)[own])
        # Points are compared by their distances, which do not depend on the gauge.
        step = (new.points - body.points).ravel()
        lengths = differences(distances, body.points.ravel())
        np.testing.assert_allclose(lengths @ step, lengths @ change[own], atol=1e-6)
    # A finite rotation differs from the linear step by 0.02 rad squared.
    by_all = np.concatenate(offsets)
    expected = by_all @ covariance @ by_all.T
    np.testing.assert_allclose(found.offset_covariance, expected, atol=1e-3 * expected.max())
    expected = by_all @ covariance[:, :6]
    np.testing.assert_allclose(found.offset_path, expected, atol=1e-3 * np.abs(expected).max())


@pytest.mark.parametrize("full", [False, True], ids=["isotropic", "precisions"])
def test_a_prior_of_the_offsets_agrees_with_scipys_least_squares_of_all_unknowns(full):
    """As three further residuals of each body: its centroid from the centre of mass, in deviations along its axes."""
    observations, sampled, bodies, x = scene(full, seed=1)
    function, size = whitened(observations, sampled, bodies, x)
    places, root = points_of(bodies), 3.0

    def with_prior(unknowns):
        pairs = zip(bodies, places, strict=True)
        offsets = [body.points.mean(axis=0) + unknowns[own].reshape(-1, 3).mean(axis=0) for body, own in pairs]
        return np.concatenate([function(unknowns), *(root * offset for offset in offsets)])

    best = least_squares(with_prior, np.zeros(size), xtol=1e-15, ftol=1e-15, gtol=1e-12)
    base, known = x, np.tile(root**2 * np.eye(3), (2, 1, 1))
    for _ in range(60):
        problem = linearised(bodies, observations, sampled, x, offset_information=known)
        found = problem.step()
        bodies, start, x = found.bodies, x, found.x
    np.testing.assert_allclose(start, x, atol=1e-8)
    assert problem.squares.sum() + problem.offset_cost == pytest.approx(2 * best.cost, rel=1e-8)
    np.testing.assert_allclose(x, base + best.x[:6], atol=1e-5)


@pytest.mark.parametrize("full", [False, True], ids=["isotropic", "precisions"])
def test_steps_converge_to_scipys_least_squares(full):
    observations, sampled, bodies, x = scene(full, seed=1)
    function, size = whitened(observations, sampled, bodies, x)
    best = least_squares(function, np.zeros(size), xtol=1e-15, ftol=1e-15, gtol=1e-12)
    for _ in range(30):
        found = gauss_newton_step(bodies, observations, sampled, x)
        bodies, start, x = found.bodies, x, found.x
    np.testing.assert_allclose(start, x, atol=1e-9)
    assert found.decrease < 1e-12
    assert found.squares.sum() == pytest.approx(2 * best.cost, rel=1e-9)
    base = scene(full, seed=1)[3]
    np.testing.assert_allclose(x, base + best.x[:6], atol=1e-5)


def test_only_relative_weights_matter_for_the_step():
    observations, sampled, bodies, x = scene(full=False)
    one = gauss_newton_step(bodies, observations, sampled, x)
    two = gauss_newton_step(bodies, observations.weighted(1e-6 * observations.weight), sampled, x)
    np.testing.assert_allclose(two.x, one.x, rtol=1e-9)
    np.testing.assert_allclose(two.covariance, 1e6 * one.covariance, rtol=1e-6)


def test_many_frames_agree_with_few_of_more_weight():
    """More frames than fit a chunk, against the 60 different ones among them with 200 times the weight."""
    rng = np.random.default_rng(0)
    n, points = 12_000, rng.normal(size=(4, 3))
    attitude = Rotation.random(60, random_state=0).as_matrix()[np.arange(n) % 60]
    position = np.array([4.0, -19.0, 3.0]) + points @ np.swapaxes(attitude, 1, 2)
    position += NOISE * rng.normal(size=(60, 4, 3))[np.arange(n) % 60]
    body = Body(np.arange(4), np.arange(n), points, attitude)
    assert len(list(chunks_of(body))) > 1
    path = Polynomial(0, 0.0, 1.0)
    many = gauss_newton_step(
        (body,), Observations(position, np.ones((n, 4))), path.at(np.zeros(n)), np.array([4.0, -19, 3])
    )
    few_body = Body(np.arange(4), np.arange(60), points, attitude[:60])
    few = gauss_newton_step(
        (few_body,),
        Observations(position[:60], np.full((60, 4), n / 60)),
        path.at(np.zeros(60)),
        np.array([4.0, -19, 3]),
    )
    np.testing.assert_allclose(many.x, few.x, rtol=1e-10)
    np.testing.assert_allclose(many.covariance, few.covariance, rtol=1e-8)
    np.testing.assert_allclose(many.offset_covariance, few.offset_covariance, rtol=1e-8)


def test_offset_by_points_agrees_with_differences_of_scipys_alignment():
    points = np.random.default_rng(3).normal(size=(5, 3)) + np.array([3.0, -1, 2])
    expected = differences(lambda p: turned_back(p.reshape(-1, 3), points), points.ravel(), 1e-5)
    np.testing.assert_allclose(offset_by_points(points), expected, atol=1e-8)
    # In axes attached to the points a rotation of everything changes nothing; a shift changes the offset by itself.
    turn = np.cross([0.1, 0.2, -0.3], points).ravel()
    np.testing.assert_allclose(offset_by_points(points) @ turn, 0, atol=1e-12)
    np.testing.assert_allclose(offset_by_points(points) @ np.tile([1.0, 2, 3], 5), [1, 2, 3], atol=1e-12)


def test_the_null_space_of_a_constant_attitude():
    """If the attitude never changes, a shift of the path cannot be distinguished from one of all points."""
    points = np.random.default_rng(0).normal(size=(4, 3))
    position = np.tile(np.array([4.0, -19, 3]) + points, (6, 1, 1))
    body = Body(np.arange(4), np.arange(6), points, np.tile(np.eye(3), (6, 1, 1)))
    path = Polynomial(0, 0.0, 5.0)
    found = gauss_newton_step(
        (body,), Observations(position, np.ones((6, 4))), path.at(np.arange(6.0)), np.array([4.0, -19, 3])
    )
    assert np.linalg.matrix_rank(found.null_space) == 3
    # A shift of the path is the opposite shift of the body's offset.
    np.testing.assert_allclose(found.offset_null_space, -found.null_space, atol=1e-6 * np.abs(found.null_space).max())
    np.testing.assert_allclose(found.x, [4, -19, 3], atol=1e-9)
    observations, sampled, bodies, x = scene(full=False)
    assert gauss_newton_step(bodies, observations, sampled, x).null_space.shape == (6, 0)

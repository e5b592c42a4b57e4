"""The elimination of rotations for equal weights along all axes, against that for precisions, which are unit there."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator.adjustment import elimination
from baryscope.estimator.adjustment.elimination import AllFrames, ReducedEquations, eliminated
from baryscope.estimator.adjustment.frame_shifts import FrameShifts
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.paths.path import Polynomial
from baryscope.estimator.registration.body import Body

N, M = 30, 5


@pytest.mark.parametrize("shifted", [False, True], ids=["", "with shifts that are zero"])
def test_both_ways_give_the_same_sums(shifted):
    rng = np.random.default_rng(0)
    points, attitude = rng.normal(size=(M, 3)), Rotation.random(N, random_state=1).as_matrix()
    path = Polynomial(2, 0.0, 1.0).at(np.linspace(0.0, 1.0, N))
    origin = path.position(rng.normal(size=9))
    frames, features = np.delete(np.arange(N), [3, 17]), np.arange(M)
    position = origin[:, None] + points @ np.swapaxes(attitude, 1, 2) + 0.05 * rng.normal(size=(N, M, 3))
    weight = rng.uniform(0.0, 2.0, (N, M)) * (rng.random((N, M)) < 0.9)
    body = Body(features, frames, points + 0.02 * rng.normal(size=(M, 3)), attitude[frames])
    simple = eliminated(body, Observations(position, weight), AllFrames(path, origin, None))
    unit = None if shifted else np.broadcast_to(np.eye(3), (N, M, 3, 3))
    shifts = FrameShifts(np.zeros((N, 3, 3))) if shifted else None
    general = eliminated(body, Observations(position, weight, unit), AllFrames(path, origin, shifts))
    np.testing.assert_allclose(simple[0].attitude, general[0].attitude, atol=1e-12)
    if not shifted:  # else the residuals are those after a further step of the rotations
        np.testing.assert_allclose(simple[2], general[2], atol=1e-12)
    for name, found in vars(simple[1]).items():
        expected = getattr(general[1], name)
        np.testing.assert_allclose(found, expected, atol=1e-11 * max(np.abs(expected).max(), 1.0), err_msg=name)


@pytest.mark.parametrize("kind", ["weights", "precisions", "shifts"])
def test_features_that_come_one_group_after_the_other_are_eliminated_each_by_itself(kind, monkeypatch):
    """Two bodies of five features, of which one is seen in the first hundred frames and the other after them: as one
    body of ten, chunk by chunk of 64 frames, of which the second sees all.
    """
    monkeypatch.setattr(elimination, "CHUNK_SIZE", 1)
    n, rng = 180, np.random.default_rng(3)
    first = np.arange(n) < 100
    points, attitude = rng.normal(size=(2 * M, 3)), Rotation.random(n, random_state=1).as_matrix()
    path = Polynomial(2, 0.0, 1.0).at(np.linspace(0.0, 1.0, n))
    origin = path.position(rng.normal(size=9))
    position = origin[:, None] + points @ np.swapaxes(attitude, 1, 2) + 0.05 * rng.normal(size=(n, 2 * M, 3))
    weight = np.where(first[:, None] == (np.arange(2 * M) < M), rng.uniform(0.5, 2.0, (n, 2 * M)), 0.0)
    root = np.eye(3) + 0.2 * rng.normal(size=(n, 2 * M, 3, 3))
    observations = Observations(position, weight, root @ np.swapaxes(root, 2, 3) if kind == "precisions" else None)
    shifts = FrameShifts(np.broadcast_to(1e-3 * np.eye(3), (n, 3, 3))) if kind == "shifts" else None
    frames = AllFrames(path, origin, shifts)
    whole, sums, squares = eliminated(Body(np.arange(2 * M), np.arange(n), points, attitude), observations, frames)
    expected = ReducedEquations.zero(path.size, 6 * M)
    for half, features in ((first, np.arange(M)), (~first, np.arange(M, 2 * M))):
        own = np.flatnonzero(half)
        body = Body(features, own, points[features], attitude[own])
        found, part, part_squares = eliminated(body, observations.features(features), frames)
        np.testing.assert_allclose(whole.attitude[own], found.attitude, atol=1e-12)
        np.testing.assert_allclose(squares[np.ix_(own, features)], part_squares, atol=1e-11)
        expected.add(part, features)
    assert not squares[weight == 0].any()
    for name, found in vars(sums).items():
        np.testing.assert_allclose(found, getattr(expected, name), atol=1e-10 * np.abs(found).max(), err_msg=name)


def test_movements_of_frames_cost_nothing_where_they_explain_all():
    """Without noise their squares are rounding, half of which is below zero: variances were negative."""
    frames, features = np.arange(N), np.arange(M)
    for draw in range(20):
        rng = np.random.default_rng(draw)
        points, attitude = rng.normal(size=(M, 3)), Rotation.random(N, random_state=draw).as_matrix()
        path = Polynomial(2, 0.0, 1.0).at(np.linspace(0.0, 1.0, N))
        origin = path.position(rng.normal(size=9))
        observations = Observations(origin[:, None] + points @ np.swapaxes(attitude, 1, 2), np.ones((N, M)))
        shifts = FrameShifts(np.broadcast_to(1e18 * np.eye(3), (N, 3, 3)))
        _, sums, _ = eliminated(Body(features, frames, points, attitude), observations, AllFrames(path, origin, shifts))
        assert 0 <= sums.noise_cost < 1e-24


def test_frames_that_move_cost_what_the_determinant_of_all_their_observations_does():
    """The dense restricted likelihood of each frame: its noise and its shift's as one covariance, its turn unknown."""
    rng = np.random.default_rng(5)
    frames, features = np.arange(N), np.arange(M)
    points, attitude = rng.normal(size=(M, 3)), Rotation.random(N, random_state=5).as_matrix()
    path = Polynomial(2, 0.0, 1.0).at(np.linspace(0.0, 1.0, N))
    origin = path.position(rng.normal(size=9))
    square = rng.normal(size=(N, 3, 3))
    covariance = square @ np.swapaxes(square, 1, 2)
    shift = np.einsum("kij,kj->ki", square, rng.normal(size=(N, 3)))
    places = (origin + 1e-6 * shift)[:, None] + points @ np.swapaxes(attitude, 1, 2)
    position = places + 1e-6 * rng.normal(size=(N, M, 3))  # so small that all is linear
    observations = Observations(position, np.ones((N, M)))
    body = Body(features, frames, points, attitude)
    _, sums, squares = eliminated(body, observations, AllFrames(path, origin, FrameShifts(covariance)))
    cost, volume = 0.0, 0.0
    for k in frames:
        place = points @ attitude[k].T
        turn = np.concatenate([np.cross(np.eye(3), one).T for one in place])
        whole = np.eye(3 * M) + np.tile(covariance[k], (M, M))
        information = np.linalg.inv(whole)
        left = information @ turn
        information -= left @ np.linalg.inv(turn.T @ left) @ left.T
        residual = (position[k] - origin[k] - place).ravel()
        cost += residual @ information @ residual
        volume += (
            np.linalg.slogdet(whole)[1] + np.linalg.slogdet(turn.T @ left)[1] - np.linalg.slogdet(turn.T @ turn)[1]
        )
    assert squares.sum() + sums.noise_cost == pytest.approx(cost, rel=1e-4)
    assert sums.noise_volume == pytest.approx(volume, rel=1e-9)

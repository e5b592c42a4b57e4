"""Products of errors in `ml` against the equations of observations that they move."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation as ScipyRotation

from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.products import independent, product_shifts
from baryscope.estimator.dynamics.rotation import Rotation
from baryscope.estimator.geometry.extent import rms_radius
from baryscope.estimator.methods import estimate
from baryscope.estimator.ml.jacobians import Jacobians
from baryscope.estimator.ml.likelihood import equations
from baryscope.estimator.ml.model import FrameNoise, Model
from baryscope.estimator.ml.products import product_errors
from baryscope.estimator.options import PathOptions
from baryscope.estimator.paths.blocks import Blocks
from baryscope.estimator.paths.path import Polynomial
from baryscope.estimator.result import Status
from synthetic import ENVISAT, attitude, box_features, make_case

N, M = 12, 6
TIME = np.arange(0.0, 5.0 * N, 5.0)
NOISE = 0.1  # m
OFFSET = np.diag([0.01, 0.01, 4.0])  # m²


@pytest.fixture(scope="module", params=[False, True], ids=["still frames", "shifted frames"])
def best(request):
    """A maximum of `ml`: rotation, path and points with noisy observations, some missing."""
    rng = np.random.default_rng(0)
    start = Rotation(20.0, ScipyRotation.random(random_state=0).as_matrix(), np.array([0.03, 0.05, 0.04]), ENVISAT)
    sampled, motion, points = Polynomial(1, 0.0, TIME[-1]).at(TIME), start.at(TIME), 2 * rng.normal(size=(M, 3))
    x = np.array([4.0, -19.0, 3.0, 0.5, 0.2, -0.3])
    position = sampled.position(x)[:, None] + points @ np.swapaxes(motion.attitude, 1, 2)
    position = position + NOISE * rng.normal(size=position.shape)
    observations = Observations(position, (rng.random((N, M)) < 0.8).astype(float), None)
    shift, none = np.tile(np.diag([2.0, 1.0, 0.5]), (N, 1, 1)), np.zeros((N, 3, 3))
    noise = FrameNoise(none, shift) if request.param else None
    found = equations(observations, Model(motion, sampled, sampled.position(x), points, noise))
    variance = NOISE**2
    named = SimpleNamespace(rotation=start, motion=motion, sampled=sampled, x=x, equations=found, noise=noise)
    named.seen_points = found.points
    named.observations, named.variance = observations, variance
    named.turn = Jacobians.of(motion.turn_in_C, TIME, Blocks.over(TIME, 10.0))
    named.y = variance * np.linalg.inv(found.matrix + 1e-6 * np.diag(found.sizes))
    turns = motion.turn - motion.turn.mean(axis=0)
    named.spread = turns @ named.y[: start.size, : start.size] @ np.swapaxes(turns, 1, 2)
    return named


def test_errors_are_those_of_observations_that_the_products_move(best):
    """One Gauss–Newton step for each pattern, which moves all points of a frame."""
    of_y, of_points = product_errors(best, best.turn, best.y, best.spread, OFFSET)
    size, R = best.rotation.size, best.motion.attitude
    turns = np.swapaxes(R, 1, 2) @ best.turn.times(independent(best.y[:size, :size])[0])
    shift = R @ product_shifts(turns, OFFSET, best.sampled.covariance(best.y[size:, size:]))
    origin = best.sampled.position(best.x)
    model = Model(best.motion, best.sampled, origin, best.equations.points, best.noise)
    rest = equations(best.observations, model)
    assert of_y.shape[1] == shift.shape[2] > 0
    for k in range(0, shift.shape[2], 5):
        moved = replace(best.observations, position=best.observations.position + shift[:, None, :, k])
        found = equations(moved, model)
        step = best.y @ (found.rhs - rest.rhs) / best.variance
        points = (found.points - rest.points).ravel() - rest.by_unknowns @ step
        np.testing.assert_allclose(of_y[:, k], step, rtol=1e-6, atol=1e-9 * np.abs(of_y).max())
        np.testing.assert_allclose(of_points[:, k], points, rtol=1e-6, atol=1e-9 * np.abs(of_points).max())


def test_products_count_in_a_spin_of_so_many_frames_that_its_path_is_interpolated():
    """About the greatest principal axis, along which the centre of mass is unknown."""
    time = np.linspace(0.0, 300.0, 1001)
    R = attitude(ENVISAT, np.deg2rad(3.5) * np.linalg.eigh(ENVISAT)[1][:, 2], time)
    com = np.array([4.0, -19.0, 3.0]) + np.outer(time, [0.01, -0.02, 0.01])
    case = make_case(time, R, com, box_features(6, (10, 5, 5), seed=3, centre=(1, 0.5, 0)), noise=0.02, seed=0)
    found = estimate(case.tracks, method="ml", options=PathOptions(trajectory="polynomial:1"))
    assert found.status is Status.NOT_OBSERVABLE
    for k in (0, 500, 1000):
        error = found.position[k] - com[k]
        assert (
            error @ np.linalg.solve(found.covariance[k], error) < 16.3
        )  # of three degrees of freedom, in a thousandth


def test_products_are_not_those_of_deviations_that_unobserved_directions_are_given():
    """In the spin of a body at rest the inertia is unobserved, too: claims were of 20,000 km."""
    time = np.linspace(0.0, 400.0, 1300)
    R = attitude(ENVISAT, np.deg2rad(3.5) * np.linalg.eigh(ENVISAT)[1][:, 2], time)
    gaps = [(0.0, 100.0, range(8)), (150.0, 250.0, range(8)), (300.0, 400.0, range(8))]
    com, points = np.tile([4.0, -19.0, 3.0], (len(time), 1)), box_features(8, (10, 4, 4), 1)
    tracks = make_case(time, R, com, points, noise=0.02, seed=5, clusters=gaps).tracks
    found = estimate(tracks, method="ml", options=PathOptions(trajectory="fixed"))
    assert found.predicted_rmse < 20 * rms_radius(points)


def test_there_are_none_where_they_are_negligible(best):
    of_y, of_points = product_errors(best, best.turn, best.y, best.spread, 1e-12 * OFFSET)
    assert of_y.shape == (len(best.y), 0)
    assert of_points.shape == (3 * M, 0)

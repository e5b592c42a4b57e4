"""The linearised problem of `ekf` against residuals of the nonlinear one."""

import numpy as np
import pytest

from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.ekf.linearised import Nodes, Reference, linearised, moved, points_in
from baryscope.estimator.ekf.motion import free_motion
from baryscope.estimator.paths.path import Polynomial
from synthetic import ENVISAT, attitude, box_features


def test_nodes_fill_long_gaps():
    nodes = Nodes.between(np.array([0.0, 1.0, 6.0, 7.0]), 2.0)
    np.testing.assert_allclose(nodes.time, [0.0, 1.0, 1.0 + 5 / 3, 1.0 + 10 / 3, 6.0, 7.0])
    np.testing.assert_array_equal(nodes.frames, [0, 1, 4, 5])


@pytest.fixture(params=[False, True], ids=["weights", "precisions"])
def case(request):
    """A reference, nodes and noisy observations of six features in eight frames, some not seen."""
    rng = np.random.default_rng(0)
    time = np.arange(8.0)
    R, points = attitude(ENVISAT, np.array([0.06, 0.01, 0.01]), time), box_features(6, (10, 5, 5), seed=3)
    reference = Reference(
        free_motion(Polynomial(2, 0.0, 7.0), time, np.array([4.0, -19.0, 3.0]), 7.0),
        rng.normal(size=9),
        rng.normal(size=(8, 6)),
        R,
        np.tile([0.06, 0.01, 0.01], (8, 1)),
        ENVISAT / np.trace(ENVISAT),
        points,
        np.zeros((7, 3)),
    )
    nodes = Nodes(time, np.arange(8))
    position = reference.seen_at(nodes) + 0.1 * rng.normal(size=(8, 6, 3))
    root = rng.normal(size=(8, 6, 3, 3)) + 2 * np.eye(3)
    precision = root @ np.swapaxes(root, 2, 3) if request.param else None
    return reference, nodes, Observations(position, rng.integers(0, 2, (8, 6)).astype(float), precision)


def cost_of(reference, nodes, observations):
    residual = observations.position - reference.seen_at(nodes)
    precision = np.eye(3) if observations.precision is None else observations.precision
    precision = np.broadcast_to(precision, (*residual.shape, 3))
    return float(np.einsum("km,kmi,kmij,kmj", observations.weight, residual, precision, residual))


def test_the_quadratic_cost_is_that_of_moved_points_and_poses(case):
    """To first order in the change of the residuals: the error falls with the cube of the step."""
    reference, nodes, observations = case
    system = linearised(reference, nodes, observations)
    rng = np.random.default_rng(1)
    state, theta = rng.normal(size=(8, 12)), np.zeros(points_in(9).start + 18)
    theta[points_in(9)] = rng.normal(size=18)
    errors = []
    for step in (1e-3, 1e-4):
        s, y = step * state, np.concatenate([[1.0], step * theta])
        seen = (system.observed @ s[:, :, None])[:, :, 0]
        linear = y @ system.static @ y - 2 * np.einsum("ki,kic,c", seen, system.rhs, y)
        linear += np.einsum("ki,kij,kj", seen, system.information, seen)
        exact = cost_of(moved(reference, s, step * theta), nodes, observations)
        errors.append(abs(linear - exact) / exact)
    assert errors[0] < 1e-3
    assert errors[1] < 0.05 * errors[0]


def test_the_drive_is_what_the_reference_departs_from_its_motion(case):
    """The reference is a motion of constant rate, and its path has random unknowns and deviations.

    A parabola x₂ T₂ of 7 s has the acceleration 16/7² x₂, which moves it by half of that in the first second.
    """
    reference, nodes, observations = case
    system = linearised(reference, nodes, observations)
    acceleration = 16 / 7**2 * reference.x[6:]
    driven = np.concatenate([acceleration / 2, 7 * acceleration])
    expected = reference.path.transition[0] @ reference.deviation[0] + driven - reference.deviation[1]
    np.testing.assert_allclose(system.drive[0, :6, 0], expected)
    J, w = ENVISAT, np.array([0.06, 0.01, 0.01])
    np.testing.assert_allclose(system.drive[0, 9:, 0], np.linalg.solve(J, -np.cross(w, J @ w)), rtol=0.05)


def test_whitened_observations_tell_what_the_frames_do(case):
    """For frames of one feature and of none, too, of which the information is of less than six dimensions."""
    reference, nodes, observations = case
    seen = observations.weight.sum(axis=1)
    assert seen.min() == 1
    observations = observations.weighted(
        np.where(np.arange(8)[:, None] == int(seen.argmax()), 0.0, observations.weight)
    )
    system = linearised(reference, nodes, observations)
    white = system.whitened
    transposed = white.from_pose.transpose(0, 2, 1)
    np.testing.assert_allclose(transposed @ white.from_pose, system.information, atol=1e-12 * system.information.max())
    np.testing.assert_allclose(transposed @ white.rhs, system.rhs, atol=1e-12 * np.abs(system.rhs).max())
    np.testing.assert_array_equal(white.observed, white.from_pose @ system.observed)
    rows = white.rhs.reshape(-1, white.rhs.shape[2])
    np.testing.assert_allclose(white.left + rows.T @ rows, system.static, atol=1e-12 * np.abs(system.static).max())
    assert not white.rhs[~system.seen].any()

"""The published method against theory: the error in figure 5 of the paper is the distance v⊥/ω of the axes."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator.methods import estimate
from baryscope.estimator.options import ScrewOptions
from baryscope.estimator.screws.gpa import screws
from baryscope.estimator.screws.motion import pairs_of, register_motion
from synthetic import make_case


def distance(point, axis, com):
    return np.linalg.norm(np.cross(com - point, axis), axis=1)


@pytest.mark.parametrize("turn_deg", [5.0, 40.0, 90.0, 150.0])
def test_axis_distance_of_a_spinning_and_drifting_body(turn_deg, features):
    time, lag, v = np.arange(60.0), 7, np.array([0.02, -0.01, 0.03])
    axis, theta = np.array([0.0, 0.6, 0.8]), np.deg2rad(turn_deg)
    R = Rotation.from_rotvec(np.outer(theta / lag * time, axis)).as_matrix()
    case = make_case(time, R, np.array([1.0, -20, 3]) + np.outer(time, v), features)
    pairs = pairs_of(register_motion(case.tracks, None, "mean"), lag)
    found = screws(pairs)
    step = np.linalg.norm(v - axis * (v @ axis)) * lag
    np.testing.assert_allclose(found.angle, theta, atol=1e-9)
    np.testing.assert_allclose(found.axis, np.tile(axis, (len(found.angle), 1)), atol=1e-9)
    # From the centre of mass at either end of the lag: ‖v⊥‖Δt / (2 sin(θ/2)); at its middle ‖v⊥‖Δt / (2 tan(θ/2)).
    for com in (case.com[pairs.first], case.com[pairs.second]):
        np.testing.assert_allclose(distance(found.point, found.axis, com), step / (2 * np.sin(theta / 2)), rtol=1e-7)
    middle = 0.5 * (case.com[pairs.first] + case.com[pairs.second])
    np.testing.assert_allclose(distance(found.point, found.axis, middle), step / (2 * np.tan(theta / 2)), rtol=1e-6)


def test_figure_5_axis_distance_of_a_tumbling_and_drifting_body(time, case_of):
    """A lag of 4 s turns Envisat by 14°: short enough for the law of the instantaneous axis, to 5 %."""
    v = np.array([0.015, -0.01, 0.01])
    case = case_of(np.array([0.0, -20, 0]) + np.outer(time, v), clusters=None)
    lag = 4
    pairs = pairs_of(register_motion(case.tracks, None, "mean"), lag)
    found = screws(pairs)
    middle = 0.5 * (case.com[pairs.first] + case.com[pairs.second])
    # The body's own angular velocity, from the truth.
    turned = Rotation.from_matrix(case.R_I_B[pairs.second] @ np.swapaxes(case.R_I_B[pairs.first], 1, 2)).as_rotvec()
    omega = np.linalg.norm(turned, axis=1) / lag
    direction = turned / np.linalg.norm(turned, axis=1, keepdims=True)
    across = np.linalg.norm(v - (direction @ v)[:, None] * direction, axis=1)
    np.testing.assert_allclose(distance(found.point, found.axis, middle), across / omega, rtol=0.05)


def test_a_short_segment_does_not_imply_a_small_error(time, case_of):
    """With a short lag successive axes have nearly the same error, so the segment between them is much shorter."""
    case = case_of(np.array([0.0, -20, 0]) + np.outer(time, [0.015, -0.01, 0.01]), clusters=None)
    found = estimate(case.tracks, method="screw-gpa", options=ScrewOptions(lag=2.0, degree=1))
    error = np.linalg.norm(found.position - case.com, axis=1)
    assert error.mean() > 0.2
    assert found.details.segment_median < 0.2 * error.mean()


def test_twice_the_drift_is_twice_the_error(time, case_of):
    errors = []
    for factor in (1.0, 2.0):
        case = case_of(np.array([0.0, -20, 0]) + factor * np.outer(time, [0.01, 0.01, 0.0]), clusters=None)
        found = estimate(case.tracks, method="screw-gpa", options=ScrewOptions(lag=20.0, cutoff=np.inf, degree=1))
        errors.append(found.position - case.com)
    np.testing.assert_allclose(errors[1], 2 * errors[0], rtol=0.1, atol=0.02)


def test_a_flat_cluster_with_the_axis_in_its_plane():
    time = np.arange(600.0)
    from synthetic import attitude

    R = attitude(np.diag([1.0, 1.4, 1.6]), np.deg2rad([3.0, 2.0, 1.0]), time)
    flat = np.array([[1.0, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]])
    case = make_case(time, R, np.tile([0.0, 5, 0], (600, 1)), flat)
    found = estimate(case.tracks, method="screw-gpa")
    assert found.details.screws == {"sound": sum(found.details.screws.values())}
    np.testing.assert_allclose(found.position, case.com, atol=1e-6)

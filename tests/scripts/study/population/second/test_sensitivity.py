"""The Jacobians of the bound, against closed forms and against motions that start a little elsewhere."""

import numpy as np
from scipy.spatial.transform import Rotation

from baryscope.study.population.second.cases import drawn
from baryscope.study.population.second.motion import relative_motion, tumble
from baryscope.study.population.second.orbits import Elements
from baryscope.study.population.second.sensitivity import Start, path_jacobian, turn

CIRCLE = Elements(7e6, 0.0, 0.3, 1.0, 0.0, 2.0)


def test_a_ball_turns_by_its_rate():
    """δφ in B is t J(ωt) δω, with the right Jacobian J of SO(3) (Chirikjian 2012, 10.86)."""
    rate, times = np.array([0.02, -0.01, 0.03]), np.linspace(0, 200, 9)
    still = np.array([1.0, 0, 0, 0])
    found = turn(Start(0.0, CIRCLE, np.zeros(6), np.eye(3), rate, still), times)
    for t, slope in zip(times, found[:, :, :3], strict=True):
        angle = np.linalg.norm(rate) * t
        K = np.cross(rate / np.linalg.norm(rate), np.eye(3)).T  # [n]×
        by = 1.0 if angle == 0 else np.sin(angle) / angle
        across = 0.0 if angle == 0 else (1 - np.cos(angle)) / angle
        expected = t * (np.eye(3) - across * K + (1 - by) * K @ K)
        np.testing.assert_allclose(slope, expected, atol=1e-4)


def test_a_start_a_little_elsewhere_is_told_by_the_jacobians():
    """To first order: what is left of 1e-4 of rate and inertia, and of 2 m, is of second order."""
    case = drawn(1, 0)
    start, trace = case.start, np.trace(case.start.inertia)
    change = 1e-4 * np.array([0.3, -0.5, 0.2, 0.4, 0.1, -0.3, 0.5, -0.2])
    change[:3] *= np.linalg.norm(start.rate)
    a, b, c, d, e = change[3:]
    inertia = start.inertia + trace * np.array([[d, a, b], [a, e - d, c], [b, c, -e]])
    R, _ = tumble(inertia, start.rate + change[:3], start.quaternion, start.time, case.time)
    found = Rotation.from_matrix(np.swapaxes(case.attitude, 1, 2) @ R).as_rotvec()
    np.testing.assert_allclose(found, case.turn @ change, atol=0.01 * np.abs(found).max())
    n = start.orbit.n
    moved = np.array([1.0, -1.0, 0.5, 0.3 * n, n, -0.7 * n])
    path = -relative_motion(start.orbit, start.time, start.state + moved, case.time)[:, :3]
    np.testing.assert_allclose(path - case.path, case.path_jacobian @ moved, atol=1e-4)


def test_the_path_begins_with_the_state():
    case = drawn(1, 0)
    begin = path_jacobian(case.start, np.array([case.start.time, case.start.time + 1.0]))
    np.testing.assert_allclose(begin[0], np.hstack([-np.eye(3), np.zeros((3, 3))]), atol=1e-12)
    np.testing.assert_allclose(begin[1, :, 3:], -np.eye(3), atol=1e-5)  # n² = 1e-6

"""The bound of the population's cases, against the least squares of all unknowns at once."""

from dataclasses import replace

import numpy as np
import pytest

from baryscope.study.population.cases import drawn
from baryscope.study.population.information import Watched, path_bound, polynomial_jacobian, polynomial_misfit, rms
from baryscope.study.population.sensing import sampled


def brute_force(jacobian, attitude, points, sigma, turn=None):
    """Covariance of the path from the pseudo-inverse of the whole Fisher matrix, every point seen in every frame."""
    n, m, p = len(jacobian), len(points), jacobian.shape[2]
    rows = []
    for k, R in enumerate(attitude):
        for i, b in enumerate(points):
            by_phi = np.column_stack([R @ np.cross(e, b) for e in np.eye(3)])
            by_points = np.zeros((3, 3 * m))
            by_points[:, 3 * i : 3 * i + 3] = R
            if turn is None:
                by_turn = np.zeros((3, 3 * n))
                by_turn[:, 3 * k : 3 * k + 3] = by_phi
            else:
                by_turn = by_phi @ turn[k]
            rows.append(np.concatenate([jacobian[k], by_points, by_turn], axis=1))
    J = np.concatenate(rows) / sigma
    scale = 1 / np.linalg.norm(J, axis=0)
    inverse = scale[:, None] * np.linalg.pinv((J * scale).T @ (J * scale), rcond=1e-13, hermitian=True) * scale
    return jacobian @ inverse[:p, :p] @ np.swapaxes(jacobian, 1, 2)


@pytest.mark.parametrize("free", [True, False])
def test_bound_is_that_of_the_whole_fisher_matrix(free):
    rng = np.random.default_rng(2)
    case = drawn(7, 3)
    frames = np.linspace(0, len(case.time) - 1, 15).astype(int)
    points, sigma = rng.standard_normal((5, 3)) * 2, 0.02
    jacobian, attitude = polynomial_jacobian(case.time[frames], 1), case.attitude[frames]
    turn = None if free else case.turn[frames]
    precision = np.broadcast_to(np.eye(3) / sigma**2, (15, 6, 3, 3))
    right = np.tile(np.arange(6) < 5, (15, 1))  # the sixth is never seen
    seen = Watched(attitude, np.append(points, [[1.0, 2.0, 3.0]], axis=0), precision, right, turn)
    found = path_bound(jacobian, seen)
    np.testing.assert_allclose(found, brute_force(jacobian, attitude, points, sigma, turn), rtol=1e-3, atol=1e-9)


def test_a_known_tumble_never_has_the_higher_bound():
    for index in (2, 8, 15, 30):
        case = drawn(1, index)
        sample = sampled(case)
        seen = Watched(case.attitude, case.points, sample.precision, sample.right)
        free, tumble = (rms(path_bound(case.path_jacobian, replace(seen, turn=turn))) for turn in (None, case.turn))
        assert tumble <= free


def test_a_polynomial_is_reproduced():
    time = np.linspace(3, 9, 30)
    path = np.column_stack([time**2, 1 - time, np.ones(30)])
    assert polynomial_misfit(time, path, 2) == pytest.approx(0, abs=1e-12)
    assert polynomial_misfit(time, path, 1) > 0.1

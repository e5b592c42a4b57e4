"""Cases of the population: reproducible, within what the population promises, and tracks with the noise they claim."""

import numpy as np
import pytest

from baryscope.study.population.cases import FARTHEST, NEAREST, drawn
from baryscope.study.population.sensing import sampled

SOME = range(12)


@pytest.fixture(scope="module")
def cases():
    return [drawn(7, index) for index in SOME]


def test_a_case_is_a_function_of_seed_and_index(cases):
    again, other = drawn(7, 3), drawn(8, 3)
    np.testing.assert_array_equal(again.path, cases[3].path)
    np.testing.assert_array_equal(sampled(again).tracks.position, sampled(cases[3]).tracks.position)
    assert not np.array_equal(other.rate[0], again.rate[0])


def test_cases_stay_within_their_ranges(cases):
    for case in cases:
        away = np.linalg.norm(case.path, axis=1)
        assert NEAREST < away.min() <= away.max() < FARTHEST
        assert 20 <= len(case.time) <= 2000
        assert 3 <= len(case.points) <= 30
        assert (np.diff(case.time) > 0).all()
        assert 0.09 <= np.rad2deg(np.linalg.norm(case.rate[0])) <= 20.1


def test_the_jacobians_are_slopes(cases):
    """A rotation vector that a change of the rate makes grows like the time, at first."""
    case = next(case for case in cases if case.rotations > 0.5)
    early = case.time[1]
    np.testing.assert_allclose(case.turn[1, :, :3], early * np.eye(3), atol=early * 2 * early)
    np.testing.assert_allclose(case.path_jacobian[0, :, :3].T @ case.path_jacobian[0, :, :3], np.eye(3), atol=1e-6)


def test_residuals_of_right_observations_have_the_claimed_precision(cases):
    """Their normalised squares are 3 on average; a stereo rig's are so to first order."""
    for case in cases:
        sample = sampled(case)
        count = sample.right.sum()
        if count < 100:
            continue
        true = case.path[:, None] + case.points @ np.swapaxes(case.attitude, 1, 2)
        residual = (sample.tracks.position - true)[sample.right]
        squares = np.einsum("ki,kij,kj->k", residual, sample.precision[sample.right], residual)
        allowed = 5 * np.sqrt(6 / count) + (0.1 if case.sensor.baseline else 0.0)
        assert squares.mean() == pytest.approx(3, abs=allowed), case.kind

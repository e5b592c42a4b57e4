"""The noise of the second population's sensor is that which it tells; gross and swapped observations are known."""

import numpy as np
import pytest

from baryscope.study.population.second.cases import drawn, sampled
from baryscope.study.population.second.sensing import Sensor, observed

RIG, BOTH = (2, 41), Sensor(0.01, outliers=0.1, kind="both", least=0.5, most=2.0)


def places(n=300, m=6):
    return np.random.default_rng(4).uniform([-1, -1, 19], [1, 1, 21], (n, m, 3))


def squares(found, true):
    """eᵀ P⁻¹ e of the right observations."""
    residual = (found.position - true)[found.right]
    return np.einsum("ki,kij,kj->k", residual, found.precision[found.right], residual)


@pytest.mark.parametrize("sensor", [Sensor(0.02), Sensor(0.1, ratio=12.0), BOTH, Sensor(0.1, 5.0, False, 0.2, "swap")])
def test_noise_has_the_told_covariance(sensor):
    true = places()
    found = observed(np.random.default_rng(5), sensor, true)
    values = squares(found, true)
    assert values.mean() == pytest.approx(3, abs=5 * np.sqrt(6 / len(values)))
    if found.covariance is not None:
        identity = (found.covariance @ found.precision)[found.right]
        np.testing.assert_allclose(identity, np.broadcast_to(np.eye(3), identity.shape), atol=1e-9)


def test_depth_is_worse_than_the_rest_by_the_ratio():
    """At the median range; across the ray sigma grows like the range, along it like its square."""
    true = np.array([[[0.0, 0.0, z] for z in (10.0, 20.0, 40.0)]])
    found = observed(np.random.default_rng(5), Sensor(0.1, ratio=10.0), true)
    for k, (across, along) in enumerate([(0.005, 0.025), (0.01, 0.1), (0.02, 0.4)]):
        np.testing.assert_allclose(found.covariance[0, k], np.diag([across, across, along]) ** 2, atol=1e-15)


def test_gross_and_swapped_observations_are_not_right():
    true = places()
    found = observed(np.random.default_rng(5), BOTH, true)
    off = np.linalg.norm(found.position - true, axis=2)
    assert off[found.right].max() < 0.07
    assert off[~found.right].min() > 0.07
    # a twentieth is displaced, and a twentieth of three pairs changes places
    assert (~found.right).mean() == pytest.approx(0.1, abs=0.03)


def test_what_is_not_seen_stays_so():
    true = places()
    true[3, 2] = np.nan
    found = observed(np.random.default_rng(5), Sensor(0.1, 5.0, False, 0.2, "both", 0.5, 2.0), true)
    assert not np.isfinite(found.position[3, 2]).any()
    assert not found.right[3, 2]
    assert np.isfinite(found.precision).all()


def test_another_draw_has_other_noise_alone():
    case = drawn(*RIG)
    true = case.path[:, None] + case.points @ np.swapaxes(case.attitude, 1, 2)
    first, second = sampled(case), sampled(case, 1)
    assert np.array_equal(first.tracks.seen, second.tracks.seen)
    np.testing.assert_allclose(first.precision[case.seen], second.precision[case.seen], rtol=1e-9)
    errors = [(sample.tracks.position - true)[case.seen].ravel() for sample in (first, second)]
    assert abs(np.corrcoef(errors)[0, 1]) < 5 / np.sqrt(len(errors[0]))

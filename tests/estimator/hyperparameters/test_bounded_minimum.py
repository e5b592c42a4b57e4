"""Newton's steps within bounds: against closed forms, and against scipy."""

import numpy as np
import pytest
from scipy.optimize import minimize, rosen, rosen_der, rosen_hess

from baryscope.estimator.hyperparameters.bounded_minimum import bounded_minimum

WIDE = np.array([[-1e3, 1e3], [-1e3, 1e3]])


def rosenbrock(at):
    return float(rosen(at)), lambda: (rosen_der(at), rosen_hess(at))


def counted(function):
    """The function, and a list that has an entry for each of its values."""
    calls = []

    def with_count(at):
        calls.append(at)
        return function(at)

    return with_count, calls


def test_a_quadratic_takes_a_step():
    A = np.array([[3.0, 1.0], [1.0, 2.0]])
    function, calls = counted(lambda x: (float(x @ A @ x / 2 - x.sum()), lambda: (A @ x - 1, A)))
    found, value = bounded_minimum(function, np.array([1.0, -1.0]), WIDE, 50)
    np.testing.assert_allclose(found, np.linalg.solve(A, np.ones(2)))
    assert value == pytest.approx(-np.ones(2) @ np.linalg.solve(A, np.ones(2)) / 2)
    assert len(calls) == 2


def test_a_curved_valley_is_followed_to_its_end():
    function, calls = counted(rosenbrock)
    found, value = bounded_minimum(function, np.array([-1.2, 1.0]), WIDE, 100)
    np.testing.assert_allclose(found, 1.0, atol=5e-3)
    assert value < 1e-5
    assert len(calls) < 40


@pytest.mark.parametrize("seed", range(20))
def test_a_minimum_at_bounds_is_that_of_scipy(seed):
    """From random places in a box that ends before the minimum, where one variable stays, or both."""
    rng = np.random.default_rng(seed)
    bounds = np.column_stack([rng.uniform(-2.0, 0.0, 2), rng.uniform(0.1, 0.8, 2)])
    start = rng.uniform(*bounds.T)
    found, value = bounded_minimum(rosenbrock, start, bounds, 200)
    assert np.all((bounds[:, 0] <= found) & (found <= bounds[:, 1]))
    peer = minimize(
        rosen, start, jac=rosen_der, bounds=bounds, method="L-BFGS-B", options={"ftol": 1e-14, "gtol": 1e-9}
    )
    assert value <= peer.fun + 1e-4


def test_a_maximum_between_two_minima_is_left():
    """x⁴ − x²/2 is curved downwards at 0.1, and has its minima at ±½."""
    found, value = bounded_minimum(
        lambda x: (float(x[0] ** 4 - x[0] ** 2 / 2), lambda: (4 * x**3 - x, np.diag(12 * x**2 - 1))),
        np.array([0.1]),
        WIDE[:1],
        50,
    )
    assert found[0] == pytest.approx(0.5, abs=0.02)
    assert value == pytest.approx(-1 / 16, abs=1e-4)

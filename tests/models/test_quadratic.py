import casadi as ca
import numpy as np
import pytest

from baryscope.models.quadratic import quadratic_form
from baryscope.models.target import PLACE_START, RATE_PART, tumbling_target
from baryscope.models.variables import Kind

X, C = ca.SX.sym("x", 4), ca.SX.sym("c", 2)
PRODUCTS = ca.vertcat(C[0] * X[0] * X[2] - X[3] * X[3], X[2] * X[3] / C[1], 3 * X[1] * X[3], X[2] ** 2 - X[2] * X[3])


def test_the_form_is_what_the_rates_have_in_products():
    form = quadratic_form("example", PRODUCTS + C[0], X, C, slice(2, 4))
    rng = np.random.default_rng(3)
    x, c = rng.normal(size=4), rng.normal(size=2)
    expected = np.array(ca.Function("f", [X, C], [PRODUCTS])(x, c)).ravel()
    found = np.array(form.rates(np.outer(x, x[2:]), form.weights(c))).ravel()
    np.testing.assert_allclose(found, expected, rtol=1e-14)


def test_the_form_of_two_states_is_symmetric():
    """Products of two different states stand for the second term of a Taylor series: d/dt f = J ẋ."""
    form = quadratic_form("example", PRODUCTS, X, C, slice(2, 4))
    rng = np.random.default_rng(4)
    x, v, c = rng.normal(size=4), rng.normal(size=4), rng.normal(size=2)
    expected = np.array(ca.Function("J", [X, C], [ca.jacobian(PRODUCTS, X)])(x, c)) @ v
    found = np.array(form.rates(np.outer(x, v[2:]) + np.outer(v, x[2:]), form.weights(c))).ravel()
    np.testing.assert_allclose(found, expected, rtol=1e-13)


@pytest.mark.parametrize("extra", [X[0], X[2] ** 3, X[0] * X[1], X[0] ** 2, ca.sin(X[2]), X[2] / X[3]])
def test_other_terms_are_refused(extra):
    with pytest.raises(ValueError, match="found other terms than products with the states"):
        quadratic_form("example", ca.vertcat(PRODUCTS[:3], PRODUCTS[3] + extra), X, C, slice(2, 4))


def test_the_free_attitude_is_a_constant_torque_and_products_with_the_rate(envisat):
    system, p = tumbling_target(len(envisat.features.points)), envisat.flat_parameters()
    c, u = system.constants(p), np.zeros(sum(v.size for v in system.of_kind(Kind.INPUT)))
    rng = np.random.default_rng(5)
    x = rng.normal(size=14)[: PLACE_START + 1]
    expected = np.array(system.free_attitude_rates(x, u, c)).ravel()
    form = system.free_attitude_form
    found = np.array(form.rates(np.outer(x, x[RATE_PART]), form.weights(c))).ravel()
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-15)

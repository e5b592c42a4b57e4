"""Generated Taylor series: what they refuse, and the attitude under torques of the place against scipy."""

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from baryscope.fmu import Session
from baryscope.fmu.units.series import series_source
from baryscope.models.target import PLACE_START
from oracles import slope_of

X, C = ca.SX.sym("x", 3), ca.SX.sym("c", 2)


def source(*rates):
    return series_source(ca.Function("rates", [X, C], [ca.vertcat(*rates)]), 2)


@pytest.mark.parametrize(
    "rate, why",
    [
        (ca.sin(X[0]), "sin of a fast value"),
        (1 / X[0], "a fast value is divided by"),
        (ca.fmin(X[2], 1), "no series is known of CasADi's operation"),
        (ca.sqrt(X[0] * X[1]), "sqrt of a fast value"),
    ],
)
def test_rates_without_a_series_are_left_to_dop853(rate, why):
    text = source(rate, X[1], X[2])
    assert why in text
    assert "#define TURNED_SERIES 0" in text


def test_a_place_that_depends_on_the_attitude_has_none():
    assert "the place depends on the attitude" in source(X[0], X[1], X[0])


def test_products_with_both_squares_are_taken_from_squares():
    text = source(X[0] * X[1] + X[0] * X[0], X[1] * X[1] * C[0], ca.cos(X[2]) * C[1])
    assert "#define TURNED_SERIES 1" in text
    assert "(terms[k].of[0] + terms[k].of[1])" in text
    assert "slow_circle" in text


def test_twice_a_product_from_squares_is_taken_before_it_is_halved():
    text = source(2 * (X[0] * X[1]) + X[0] * X[0], X[1] * X[1] * C[0], X[2])
    assert "const double twice_p0 = p0_sum - p1 - p2;" in text
    assert "= twice_p0 + p1;" in text
    assert "2.0 * p0;" not in text


def test_coefficients_of_the_solution_are_read_where_they_stand():
    """A pair of states needs no copy, one with another value does."""
    assert "roots" not in source(X[0] * X[0], X[1] * X[1], X[2])
    text = source(X[0] * X[0], X[1] * X[1] + (X[0] * X[0]) * (X[0] * X[0]), X[2])
    assert "PRODUCT(terms[m].pairs[0], terms[k - m].pairs[0])" in text
    assert "work->rows2[k].roots.of[0] = p0;" in text


@pytest.mark.parametrize(("first", "second"), [(X[0], X[0] * X[1]), (X[0] * X[1], X[0])])
def test_a_product_comes_after_both_of_its_operands(first, second):
    """Whichever is deeper: sums of products x₀ (x₀ x₁) come in a level of their own, behind those of x₀ x₁."""
    text = source(first * second, X[1], X[2])
    levels = [text.index(f"Rows{level} rows{level}[") for level in (1, 2)]
    assert levels == sorted(levels)


@pytest.mark.parametrize("rate", [0.0, 0.002, 0.02, 0.2])
@pytest.mark.parametrize("eccentricity", [0.0, 0.6])
def test_the_attitude_under_the_gravity_gradient(envisat, envisat_fmu, rate, eccentricity):
    """Also of a body that turns more slowly than the orbit, where the place's series bound the steps."""
    turn = rate * np.array([0.3, -0.5, 0.81])
    values = envisat.parameters() | {
        "target.angularRate0": turn, "gravityGradient": 1.0, "orbit.eccentricity": eccentricity,
        "orbit.semiMajorAxis": 7.15e6 / (1 - eccentricity),
    }  # fmt: skip
    system = envisat.system
    p = np.concatenate([np.ravel(values[v.name]) for v in system.variables if v.kind == "parameter"])
    x = np.array(system.initial(p)).ravel()
    duration = 2000.0
    rates = slope_of(system.rhs, len(x), np.zeros(6), p)
    expected = solve_ivp(rates, (0, duration), x, "DOP853", rtol=1e-12, atol=1e-15).y[:PLACE_START, -1]
    with Session(envisat_fmu, values) as session:
        session.step(duration)
        found = np.concatenate([session.attitude, session["target.angularRate"]])
    np.testing.assert_allclose(found[:4], expected[:4] / np.linalg.norm(expected[:4]), atol=2e-9)
    np.testing.assert_allclose(found[4:], expected[4:], atol=1e-9 * max(rate, 1e-3))

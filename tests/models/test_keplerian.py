"""The target's orbit against root finding by scipy, complex steps, vis-viva and the geostationary orbit."""

from decimal import Decimal, localcontext
from itertools import accumulate

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from baryscope.models.keplerian import Elements, Ellipse, conic, eccentric_anomaly, true_anomaly_after

MU = 3.986004418e14
AXIS = 9.0e6
KEPLER_TOLERANCE = 1e-11  # rad: rounding of M (60 rad) times (1+e)^½ (1−e)^(−3/2) = 125 at e = 0.95


def elements(semi_major_axis, eccentricity, true_anomaly=0.0):
    """Numbers in the place of symbols."""
    return Elements.of(ca.DM([semi_major_axis, eccentricity, 0.4, 0.5, 0.6, true_anomaly, MU]))


def true_anomaly_by_bisection(time, e, theta0):
    """θ(t), unwrapped; E and θ agree at whole and half turns, so whole turns carry over."""

    def eccentric(theta):
        turns = np.floor((theta + np.pi) / (2 * np.pi))
        half = (theta - 2 * np.pi * turns) / 2
        return 2 * np.arctan(np.sqrt((1 - e) / (1 + e)) * np.tan(half)) + 2 * np.pi * turns

    E0 = eccentric(theta0)
    M = E0 - e * np.sin(E0) + np.sqrt(MU / AXIS**3) * time
    E = brentq(lambda E: E - e * np.sin(E) - M, M - 1.001, M + 1.001, xtol=1e-14, rtol=1e-15)
    turns = np.floor((E + np.pi) / (2 * np.pi))
    half = (E - 2 * np.pi * turns) / 2
    return 2 * np.arctan(np.sqrt((1 + e) / (1 - e)) * np.tan(half)) + 2 * np.pi * turns


@given(e=st.floats(0, 0.95), time=st.floats(-40_000, 40_000), theta0=st.floats(-10, 10))
def test_keplers_equation(e, time, theta0):
    theta = float(ca.evalf(true_anomaly_after(ca.DM(time), elements(AXIS, e, theta0))))
    assert abs(theta - true_anomaly_by_bisection(time, e, theta0)) < KEPLER_TOLERANCE


@pytest.mark.parametrize("e", [0.0, 1e-9, 0.1, 0.5, 0.9, 0.99, 0.999])
def test_eccentric_anomaly_near_and_far_from_periapsis(e):
    """What is left of Kepler's equation is rounding, also where its slope 1 − e cos E is small."""
    M = np.concatenate([np.linspace(-np.pi, np.pi, 401), np.geomspace(1e-9, 1, 181), -np.geomspace(1e-9, 1, 181)])
    symbol = ca.SX.sym("M")
    E = np.array(ca.Function("E", [symbol], [eccentric_anomaly(symbol, e)]).map(M.size)(M[None])).ravel()
    assert np.abs(E - e * np.sin(E) - M).max() < 1e-15


def sine(x):
    """Of a decimal number up to π in size, by 40 terms of its series, the next of which is below 1e-75."""
    terms = accumulate(range(1, 40), lambda term, n: -term * x * x / (2 * n * (2 * n + 1)), initial=x)
    return sum(terms, Decimal(0))


@pytest.mark.parametrize("e", [0.0, 1e-9, 0.01, 0.1, 0.3, 0.5, 0.7, 0.8, 0.89, 0.99, 0.9999, 0.999999])
def test_eccentric_anomaly_to_rounding(e):
    """E is given, and M computed with fifty digits and rounded once.

    Tolerance, in halves of an ulp: the last addition makes one of E; M, sin E, e sin E and the differences of these
    with E, all no larger than E, make one of E each, over the slope 1 − e cos E.
    """
    E = np.concatenate([np.geomspace(1e-9, 3.1, 120), np.linspace(0.05, 3.14, 60)])
    with localcontext(prec=50):
        M = np.array([float(Decimal(x) - Decimal(e) * sine(Decimal(x))) for x in E.tolist()])
    symbol = ca.SX.sym("M")
    solve = ca.Function("E", [symbol], [eccentric_anomaly(symbol, e)]).map(2 * E.size)
    found = np.array(solve(np.concatenate([M, -M])[None])).ravel()
    half_ulp = np.finfo(float).eps / 2
    tolerance = half_ulp * (1 + 5 / (1 - e * np.cos(E)))
    assert np.all(np.abs(np.split(found, 2) / np.array([E, -E]) - 1) < tolerance)


@pytest.mark.parametrize("e", [0.0, 0.1, 0.5, 0.8, 0.95])
def test_anomaly_over_several_revolutions(e):
    """On a grid with perigee and apogee, forwards and backwards: never a jump of 2π."""
    period = 2 * np.pi * np.sqrt(AXIS**3 / MU)
    times = np.linspace(-3.5 * period, 3.5 * period, 281)
    theta = np.array([float(ca.evalf(true_anomaly_after(ca.DM(t), elements(AXIS, e)))) for t in times])
    assert np.all(np.diff(theta) > 0)
    np.testing.assert_allclose(theta[40::40] - theta[:-40:40], 2 * np.pi, atol=1e-10)
    assert abs(theta[-1] - 7 * np.pi) < 1e-7  # apogee, where the last bit of t is worth less than this


@given(e=st.floats(0, 0.95), theta=st.floats(-10, 10))
def test_rates_of_the_conic(e, theta):
    """Complex steps through r(θ) and θ̇(r) give ṙ and θ̈; vis-viva and h tie r, ṙ and θ̇ together."""
    here = conic(Ellipse.of(*map(ca.DM, (AXIS, e, MU))), ca.DM(theta))
    r, r_dot, rate, rate_dot = (
        float(ca.evalf(x)) for x in (here.radius, here.radial_rate, here.anomaly_rate, here.anomaly_acceleration)
    )
    p = AXIS * (1 - e**2)

    def radius(angle):
        return p / (1 + e * np.cos(angle))

    def anomaly_rate(angle):
        return np.sqrt(MU * p) / radius(angle) ** 2

    step = 1e-30
    assert r == pytest.approx(radius(theta), rel=1e-13)
    assert rate == pytest.approx(anomaly_rate(theta), rel=1e-13)
    assert r_dot == pytest.approx(radius(theta + 1j * step).imag / step * rate, rel=1e-11, abs=1e-9)
    assert rate_dot == pytest.approx(anomaly_rate(theta + 1j * step).imag / step * rate, rel=1e-11, abs=1e-18)
    assert r_dot**2 + (r * rate) ** 2 == pytest.approx(MU * (2 / r - 1 / AXIS), rel=1e-10)


def test_mean_motion_of_the_geostationary_orbit():
    """a = 42,164.17 km turns once in a sidereal day, 86,164.1 s (published, to the last digit shown)."""
    n = float(ca.evalf(elements(42_164_170.0, 0.0).mean_motion))
    assert 2 * np.pi / n == pytest.approx(86_164.1, abs=0.05)

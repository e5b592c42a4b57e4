"""A smooth path outside its time, against closed forms: a parabola, and derivatives that grow."""

import numpy as np
import pytest
from numpy.polynomial import Chebyshev

from baryscope.estimator.paths.extrapolated_path import extrapolated, untold_of
from baryscope.estimator.paths.path import Polynomial, SmoothPath
from baryscope.estimator.paths.process_noise import ProcessNoisePath

BEGIN, END, DEGREE = 100.0, 300.0, 80
SPAN = END - BEGIN
OUTSIDE = np.array([BEGIN - SPAN, BEGIN - 10.0, END, END + 10.0, END + SPAN])
SMOOTH = SmoothPath(DEGREE, BEGIN, END)


def coefficients(path, degree):
    """Those (q, 3), flat, of a function of the time (n,) → (n, 3), which is a polynomial of a degree to rounding."""
    axes = [Chebyshev.interpolate(lambda t, k=k: path(t)[:, k], degree, [BEGIN, END]).coef for k in range(3)]
    return np.pad(np.array(axes).T, ((0, DEGREE - degree), (0, 0))).ravel()


def parabola(time):
    s = time[:, None] / 100
    return np.array([4.0, -19.0, 3.0]) + s * [0.5, 0.2, -0.3] + s**2 * [-0.2, 0.1, 0.1]


def continued(path, degree=2, deviation=1e-9):
    x = coefficients(path, degree)
    return extrapolated(SMOOTH, x, deviation**2 * np.diag(np.exp(-np.repeat(np.arange(DEGREE + 1.0), 3)))), x


def test_within_its_time_it_is_the_path_itself():
    found, x = continued(parabola)
    time = np.linspace(BEGIN, END, 11)
    for own, expected in ((found.at, SMOOTH.at), (found.rate_at, SMOOTH.rate_at)):
        np.testing.assert_array_equal(own(time).position(x), expected(time).position(x))
    np.testing.assert_array_equal(untold_of(found, time), 0.0)
    assert untold_of(SMOOTH, OUTSIDE).max() == 0.0


def test_a_parabola_goes_on_as_one_where_its_polynomial_does_not():
    """A change of 1e-9 m of eighty coefficients is more than 1e30 m in the polynomial. Rounding of the first three, of
    some 1e-14 m, times the second derivatives of their polynomials, four over the half span squared.
    """
    found, x = continued(parabola)
    claimed = np.sqrt(np.trace(untold_of(found, OUTSIDE)[:, :3, :3], axis1=1, axis2=2))
    assert claimed.max() < 1e-3
    np.testing.assert_allclose(found.at(OUTSIDE).position(x), parabola(OUTSIDE), atol=1e-6)
    step = 1e-3
    rate = (parabola(OUTSIDE + step) - parabola(OUTSIDE - step)) / (2 * step)
    np.testing.assert_allclose(found.rate_at(OUTSIDE).position(x), rate, atol=1e-7)
    assert np.abs(SMOOTH.at(OUTSIDE).position(x + 1e-9) - parabola(OUTSIDE)).max() > 1e30


@pytest.mark.parametrize("way", [1, -1])
def test_derivatives_that_grow_go_on_growing(way):
    """Of exp(λ t) every derivative grows by e^λt: the next ones, from the end or the begin on, are no less than is
    claimed, and what is claimed is no hundred times as large.
    """
    rate = way * 0.02

    def growing(time):
        return np.exp(rate * (time[:, None] - (BEGIN + END) / 2)) * [1.0, -2.0, 0.5]

    found, x = continued(growing, 40, 1e-6)
    ahead = (END if way > 0 else BEGIN) + way * SPAN * np.array([0.25, 0.5, 1.0])
    error = np.linalg.norm(found.at(ahead).position(x) - growing(ahead), axis=1)
    claimed = np.sqrt(np.trace(untold_of(found, ahead)[:, :3, :3], axis1=1, axis2=2))
    assert (error < 2 * claimed).all()
    assert (claimed < 100 * error).all()


def test_other_paths_go_on_as_they_are():
    cubic = Polynomial(3, BEGIN, END)
    assert extrapolated(cubic, np.zeros(12), np.eye(12)) is cubic


def test_what_is_added_to_a_smooth_path_stays():
    path = ProcessNoisePath(SMOOTH, BEGIN, END, density=1e-9)
    x = np.append(coefficients(parabola, 2), np.zeros(3 * path.count))
    x[SMOOTH.size] = 0.1  # of the first mode, whose value is 2 and whose slope is 2 β tanh(β/2), β = 4.7300, at its end
    found = extrapolated(path, x, 1e-24 * np.eye(path.size))
    moved = found.at(OUTSIDE[3:]).position(x) - parabola(OUTSIDE[3:])
    assert found.size == path.size
    np.testing.assert_allclose(moved[:, 0], 0.2 + 0.2 * 4.7300 * 0.98250 * np.array([10.0, SPAN]) / SPAN, rtol=1e-4)

"""The arithmetic of pairs against exact fractions and series."""

from fractions import Fraction

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from baryscope.models import differences as dif
from baryscope.models.differences import Pair

ROUNDING = 1e-15  # of an excess, but for sums of excesses that cancel

sizes = st.floats(0.5, 2.0) | st.floats(-2.0, -0.5)
tiny = st.floats(1e-14, 1e-3) | st.floats(-1e-3, -1e-14)


def pair(base, excess):
    return Pair(ca.DM(base), ca.DM(excess))


def exact(base, excess):
    return Fraction(base), Fraction(base) + Fraction(excess)


@given(b=sizes, beta=tiny, c=sizes, gamma=tiny)
@pytest.mark.parametrize(
    "formula",
    [
        lambda x, y: x + y,
        lambda x, y: x - y,
        lambda x, y: x * y,
        lambda x, y: x / y,
        lambda x, y: 1 - x,
        lambda x, y: 3 / x,
        lambda x, y: x * 2 - 3,
    ],
)
def test_arithmetic(formula, b, beta, c, gamma):
    found = formula(pair(b, beta), pair(c, gamma))
    (x, x_other), (y, y_other) = exact(b, beta), exact(c, gamma)
    expected = float(formula(x_other, y_other) - formula(x, y))
    assert float(found.base) == pytest.approx(float(formula(x, y)), rel=ROUNDING, abs=ROUNDING)
    assert float(found.excess) == pytest.approx(expected, abs=20 * ROUNDING * (abs(beta) + abs(gamma)))
    assert float(found.other) == float(found.base) + float(found.excess)


@given(b=st.floats(0.5, 2.0), beta=tiny)
def test_square_root(b, beta):
    """√(b + β) − √b times the sum of both is β."""
    found = dif.sqrt(pair(b, beta))
    assert float(found.excess) * (np.sqrt(b) + np.sqrt(b + beta)) == pytest.approx(beta, rel=4 * ROUNDING)


@given(b=st.floats(-7, 7), beta=st.floats(-1e-4, 1e-4))
def test_sine_and_cosine(b, beta):
    """Taylor's series about the middle: sin(m + h) − sin(m − h) = 2 cos m (h − h³/6 + …), h = β/2."""
    middle, h = b + beta / 2, beta / 2
    chord = 2 * (h - h**3 / 6 + h**5 / 120)
    found = dif.sin(pair(b, beta)), dif.cos(pair(b, beta))
    assert float(found[0].excess) == pytest.approx(np.cos(middle) * chord, abs=4 * ROUNDING * abs(beta))
    assert float(found[1].excess) == pytest.approx(-np.sin(middle) * chord, abs=4 * ROUNDING * abs(beta))


def test_vectors():
    r, v = pair([1.0, 2.0, 3.0], [0.5, 0.0, -0.25]), pair([4.0, 0.0, 1.0], [0.0, 1.0, 0.5])
    product = dif.dot(r, v)
    assert (float(product.base), float(product.other)) == (7.0, 1.5 * 4 + 2 * 1 + 2.75 * 1.5)
    np.testing.assert_array_equal(np.array((pair(2.0, 1.0) * r).other).ravel(), [4.5, 6.0, 8.25])

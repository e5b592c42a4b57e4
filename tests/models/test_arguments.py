import numpy as np
import pytest

from baryscope.models.arguments import array_of, number_of, number_within
from baryscope.models.errors import InputError


def test_what_numpy_has_masked_is_not_a_number():
    """Only the numbers beside the mask are the caller's: what is below it is fill values, or what was there before."""
    masked = np.ma.masked_array([1, 2, 9999], [False, False, True])
    np.testing.assert_array_equal(array_of("x", masked), [1.0, 2.0, np.nan])
    np.testing.assert_array_equal(array_of("x", np.ma.masked_equal([[3.0, -1.0]], -1.0)), [[3.0, np.nan]])
    assert np.isnan(number_of("x", np.ma.masked))


@pytest.mark.parametrize("value", ["far", [1.0, "far"], [[1.0], [1.0, 2.0]], 1j, np.array([1], "m8[ms]"), {}, 10**400])
def test_what_is_no_real_number_is_refused_in_one_line(value):
    with pytest.raises(InputError, match=r"^x: found .*, expected real numbers$"):
        array_of("x", value)
    with pytest.raises(InputError, match=r"^x: found shape \(2,\), expected \(3,\)$"):
        array_of("x", [1.0, 2.0], (3,))


@pytest.mark.parametrize("value", [1, 1.0, np.float32(1), np.int8(1), np.array(1.0)])
def test_single_numbers_of_any_kind_are_floats(value):
    found = number_within("sigma", value, 1.0, 2.0, "1 to 2 m")
    assert type(found) is float
    assert found == 1.0


@pytest.mark.parametrize(
    "value",
    ["1.5", "x", True, np.True_, None, [1.5], np.array([1.5]), np.ones((40, 40)), 1.5j, 10**400, np.nan, 0.99, 2.01,
     np.timedelta64(1, "s")],
)  # fmt: skip
def test_what_is_no_single_number_in_the_range_is_refused_in_one_line(value):
    with pytest.raises(InputError, match=r"^sigma is [^\n]*, expected 1 to 2 m$"):
        number_within("sigma", value, 1.0, 2.0, "1 to 2 m")

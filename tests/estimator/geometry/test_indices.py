"""Indices as slices: they index what the arrays of them do."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from baryscope.estimator.geometry.indices import as_slice, block_of

SHAPE = (7, 5, 3)
ARRAY = np.arange(np.prod(SHAPE)).reshape(SHAPE)


def subsets(size):
    """Ascending indices below a size, sometimes none, often contiguous."""
    some = st.lists(st.integers(0, size - 1), unique=True).map(sorted)
    run = st.tuples(st.integers(0, size), st.integers(0, size)).map(lambda ends: list(range(min(ends), max(ends))))
    return st.one_of(some, run).map(lambda index: np.array(index, dtype=np.intp))


def test_rows_that_follow_each_other_are_a_slice():
    assert as_slice(np.array([3, 4, 5])) == slice(3, 6)
    assert as_slice(np.array([7])) == slice(7, 8)
    for index in (np.array([3, 5, 6]), np.array([5, 4, 3]), np.array([1, 3, 2, 4]), np.array([], dtype=int)):
        assert as_slice(index) is index


@given(subsets(SHAPE[0]), subsets(SHAPE[1]))
def test_a_block_is_of_all_pairs_of_rows_and_columns(rows, columns):
    expected = ARRAY[rows][:, columns]
    np.testing.assert_array_equal(ARRAY[block_of(rows, columns)], expected)
    changed = ARRAY.copy()
    changed[block_of(rows, columns)] *= -1
    assert changed.sum() == ARRAY.sum() - 2 * expected.sum()
    if len(rows) and len(columns) and len(columns) == np.ptp(columns) + 1 and len(rows) == np.ptp(rows) + 1:
        assert np.shares_memory(ARRAY[block_of(rows, columns)], ARRAY)

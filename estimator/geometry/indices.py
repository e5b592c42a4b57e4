"""Indices of rows and columns, as slices where these are contiguous: slices give views, and arrays of them copies."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

IntArray = NDArray[np.intp]
Index: TypeAlias = slice | IntArray


def as_slice(index: Index) -> Index:
    """An index of contiguous rows as a slice, so that indexing gives a view; any other index unchanged."""
    if isinstance(index, slice) or not len(index):
        return index
    first, stop = int(index[0]), int(index[-1]) + 1
    return slice(first, stop) if stop - first == len(index) and np.all(np.diff(index) == 1) else index


def block_of(rows: IntArray, columns: IntArray) -> tuple[Index, Index]:
    """The index of some rows (k,) and columns (l,) of an array, which gives the block (k, l, ...) of all pairs."""
    first, second = as_slice(rows), as_slice(columns)
    if isinstance(first, slice) or isinstance(second, slice):
        return first, second
    return first[:, None], second

"""A few of many, evenly spaced: what is enough to look at."""

import numpy as np
from numpy.typing import NDArray


def evenly_spaced(count: int, most: int) -> NDArray[np.intp]:
    """The indices of at most so many of `count` things, in ascending order, from the first to the last."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(np.intp))

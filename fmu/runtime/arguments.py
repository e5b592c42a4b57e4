"""Checks of arguments: arrays of numbers in a given shape, and single numbers."""

import reprlib

import numpy as np
from numpy.typing import ArrayLike, NDArray

from baryscope.models.errors import InputError


def array_of(name: str, value: ArrayLike, shape: tuple[int, ...] | None = None) -> NDArray[np.float64]:
    """The reals in `value`; with `shape`, in that shape. They need not be finite.

    Raises:
        InputError: the value is no array of real numbers, or has another shape; the message names `name`.
    """
    try:
        if np.asarray(value).dtype.kind in "mMc":  # durations and datetimes would count in units of their own
            raise TypeError
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError, OverflowError) as error:
        shown = " ".join(reprlib.repr(value).split())
        raise InputError(f"{name}: found {shown}, expected real numbers") from error
    if shape is not None and array.shape != shape:
        raise InputError(f"{name}: found shape {array.shape}, expected {shape}")
    return array


def number_of(name: str, value: ArrayLike) -> float:
    """A single real number; it need not be finite.

    Raises:
        InputError: the value is none; the message names `name`.
    """
    return float(array_of(name, value, ()))

"""Checks of arguments: arrays of numbers in a given shape, single numbers, and kinds of objects."""

import reprlib

import numpy as np
from numpy.typing import ArrayLike, NDArray

from baryscope.models.errors import InputError


def array_of(name: str, value: ArrayLike, shape: tuple[int, ...] | None = None) -> NDArray[np.float64]:
    """The reals in `value`, NaN where NumPy has them masked; with `shape`, in that shape. They need not be finite.

    Raises:
        InputError: the value is no array of real numbers, or has another shape; the message names `name`.
    """
    try:
        given = np.asanyarray(value)
        if given.dtype.kind in "mMc":  # durations and datetimes would count in units of their own
            raise TypeError
        array = np.asarray(given, dtype=float)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{name}: found {_shown(value)}, expected real numbers") from error
    if isinstance(given, np.ma.MaskedArray):  # whose numbers there are none: fill values, and what was there before
        array = np.where(np.ma.getmaskarray(given), np.nan, array)
    if shape is not None and array.shape != shape:
        raise InputError(f"{name}: found shape {array.shape}, expected {shape}")
    return array


def number_of(name: str, value: ArrayLike) -> float:
    """A single real number; it need not be finite.

    Raises:
        InputError: the value is none; the message names `name`.
    """
    return float(array_of(name, value, ()))


def number_within(name: str, value: object, low: float, high: float, expected: str) -> float:
    """A single real number from `low` to `high`: no text, truth value or array of one, which are slips.

    Raises:
        InputError: it is none, or beyond; the message has `name` and what is `expected`.
    """
    array = np.asarray(value)
    single = array.ndim == 0 and array.dtype.kind in "iuf"
    if not (single and low <= array <= high):
        raise InputError(f"{name} is {array if single else _shown(value)}, expected {expected}")
    return float(array)


def instance_of(name: str, value: object, kind: type, source: str) -> None:
    """Check that a value is of a kind, which has a `source`.

    Raises:
        InputError: it is of another kind; the message has `name` and `source`.
    """
    if not isinstance(value, kind):
        raise InputError(f"{name}: found {type(value).__name__}, expected {kind.__name__}, {source}")


def _shown(value: object) -> str:
    """A value in a few words: that of times is cut off before their unit, which matters."""
    if isinstance(value, np.ndarray) and value.dtype.kind in "mM":
        return str(value.dtype)
    return " ".join(reprlib.repr(value).split())

"""What users give the online estimator, as numbers of the core's kinds, or why it is refused."""

import operator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from baryscope.models.arguments import array_of, number_of
from baryscope.models.errors import InputError

BoolArray = NDArray[np.bool_]
FloatArray = NDArray[np.float64]

SYMMETRIC = 1e-9  # of the greatest element: what a matrix may differ from its transpose by, by rounding
ORTHONORMAL = 1e-6  # what the product of an attitude's matrix with its transpose may differ from the unit matrix by
NAMES = np.iinfo(np.int64)  # what names are within


def seconds(time: float) -> float:
    """A time in s; it need not be finite.

    Raises:
        InputError: it is no number, as a datetime.
    """
    return number_of("time", time)


def rows(name: str, value: ArrayLike, *shape: int) -> FloatArray:
    """An array (m, *shape); of an empty list, m is 0.

    Raises:
        InputError: the value has another shape, or is no array of numbers.
    """
    found = array_of(name, value)
    if found.shape == (0,):
        return np.empty((0, *shape))
    if found.shape[1:] != shape or found.ndim == 0:
        expected = ", ".join(["m", *map(str, shape)])
        raise InputError(f"{name} has the shape {found.shape}, expected ({expected})")
    return found


def flags(seen: ArrayLike) -> BoolArray:
    """Truth values.

    Raises:
        InputError: they are none.
    """
    found = _array("seen", seen, "truth values")
    if found.dtype.kind not in "biuf":
        raise InputError(f"seen: found {found.dtype}, expected truth values")
    return found.astype(bool)


def whole_numbers(names: ArrayLike) -> NDArray[np.int64]:
    """Names of features; an empty list has none, whatever its kind.

    Raises:
        InputError: they are no whole numbers, or longer than 64 bits.
    """
    found = _array("names", names, "whole numbers")
    if found.size and (found.dtype.kind not in "iu" or found.max() > NAMES.max):
        raise InputError(f"names: found {found.dtype}, expected whole numbers within 64 bits")
    return found.astype(np.int64)


def whole_number(name: int) -> int:
    """The name of a feature.

    Raises:
        InputError: it is no whole number, or longer than 64 bits.
    """
    try:
        found = operator.index(name)
    except TypeError as error:
        raise InputError(f"name: found {type(name).__name__}, expected a whole number within 64 bits") from error
    if not NAMES.min <= found <= NAMES.max:
        raise InputError(f"name: found {found}, expected a whole number within 64 bits")
    return found


def covariances_of(covariance: ArrayLike, there: BoolArray) -> FloatArray | None:
    """The covariances (k, 3, 3) of the points that are there, (m,) of which k; None where one is not symmetric.

    Whether they are definite, the core tells.

    Raises:
        InputError: they have another shape.
    """
    found = rows("covariance", covariance, 3, 3)
    if len(found) != len(there):
        raise InputError(f"covariance has the shape {found.shape}, expected ({len(there)}, 3, 3)")
    found = found[there]
    oblique = np.abs(found - np.swapaxes(found, 1, 2)) > SYMMETRIC * np.abs(found).max(initial=0.0)
    return None if oblique.any() else found


def rotation_of(name: str, matrix: ArrayLike) -> FloatArray:
    """A rotation matrix (3, 3).

    Raises:
        InputError: it is none, as a reflection.
    """
    found = array_of(name, matrix, (3, 3)).copy()
    if not ((np.abs(found @ found.T - np.eye(3)) <= ORTHONORMAL).all() and np.linalg.det(found) > 0.0):
        raise InputError(f"{name}: found {found.tolist()}, expected a rotation matrix (3, 3)")
    return found


def _array(name: str, value: ArrayLike, expected: str) -> NDArray[np.generic]:
    try:
        return np.asarray(value)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name}: found no array, expected {expected}") from error

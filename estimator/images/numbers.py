"""The numbers in the names of images: which one of the right camera is of the moment of one of the left, and which
moments have none.
"""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from baryscope.models.errors import InputError


def numbers_of(files: Sequence[Path]) -> NDArray[np.int64] | None:
    """The number of each image (n,), rising: the only one that differs among their names; None if none is such."""
    found = [[int(number) for number in re.findall(r"\d{1,18}", file.stem)] for file in files]
    if len({len(row) for row in found}) != 1:
        return None
    table = np.array(found, dtype=np.int64)
    (columns,) = np.nonzero((table != table[:1]).any(axis=0))
    if len(columns) != 1 or (np.diff(table[:, columns[0]]) <= 0).any():
        return None
    return np.asarray(table[:, columns[0]])


def places_of(files: Sequence[Path]) -> NDArray[np.int64]:
    """Which image of an evenly timed sequence each is (n,), from 0 on: numbers that are missing in it count.

    Where most numbers are one step from the one before, and all are whole steps; else none is missing.
    """
    numbers = numbers_of(files)
    if numbers is not None:
        steps = np.diff(numbers)
        step = np.median(steps).astype(np.int64)
        if 2 * np.sum(steps == step) > len(steps) and not (steps % step).any():
            return np.asarray((numbers - numbers[0]) // step)
    return np.arange(len(files))


def refuse_other_numbers(left: Sequence[Path], right: Sequence[Path]) -> None:
    """Refuse sides of which each lacks images, or one does: what is left of them would be paired with other moments.

    Sides that count from other numbers on, or most of whose names have numbers of their own, are taken as they are.

    Raises:
        InputError: it names the first image without a partner.
    """
    ours, theirs = numbers_of(left), numbers_of(right)
    if ours is None or theirs is None or (len(left) == len(right) and len(np.unique(theirs - ours)) == 1):
        return
    common = np.intersect1d(ours, theirs)
    if 2 * len(common) < max(len(left), len(right)):
        return
    alone = [
        (number, file, other[0].parent)
        for files, own, other in ((left, ours, right), (right, theirs, left))
        for number, file in zip(own.tolist(), files, strict=True)
        if number not in common
    ]
    number, file, other_folder = min(alone, key=lambda found: found[0])
    raise InputError(f"{file}: no image of number {number} in {other_folder}, expected one of each for a pair")

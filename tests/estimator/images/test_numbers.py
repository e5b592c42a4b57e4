"""The numbers in the names of images."""

from pathlib import Path

import pytest

from baryscope.estimator.images.numbers import numbers_of, places_of, refuse_other_numbers
from baryscope.models.errors import InputError


def names(pattern, numbers, folder="left"):
    return [Path(folder) / pattern.format(number) for number in numbers]


@pytest.mark.parametrize("pattern, numbers, places", [
    ("cam2_{:04}.png", [0, 1, 2, 4, 5], [0, 1, 2, 4, 5]),
    ("{}-left.png", [10, 20, 30, 50], [0, 1, 2, 4]),
    ("{}.png", [100, 203, 299, 401], [0, 1, 2, 3]),  # of no even steps, as times on a clock
    ("{}.png", [1, 5, 9, 14], [0, 1, 2, 3]),
    ("frame.png", [7], [0]),
])  # fmt: skip
def test_missing_numbers_count(pattern, numbers, places):
    assert places_of(names(pattern, numbers)).tolist() == places


def test_names_whose_numbers_say_nothing():
    assert places_of([Path("a1b1.png"), Path("a2b2.png"), Path("a4b4.png")]).tolist() == [0, 1, 2]
    assert places_of([Path("a.png"), Path("b.png"), Path("9.png")]).tolist() == [0, 1, 2]
    assert numbers_of([Path("a2.png"), Path("b1.png")]) is None


@pytest.mark.parametrize("left, right, words", [
    ([0, 1, 2, 4], [0, 1, 3, 4], r"left/2.png: no image of number 2 in right, expected one of each for a pair"),
    ([0, 1, 2, 3], [0, 2, 3], r"left/1.png: no image of number 1 in right"),
    ([1, 2, 3], [0, 1, 2, 3], r"right/0.png: no image of number 0 in left"),
])  # fmt: skip
def test_a_dropped_image_is_named(left, right, words):
    """Of equal counts, all pairs after it were of two moments; and nothing told."""
    with pytest.raises(InputError, match=words):
        refuse_other_numbers(names("{}.png", left), names("{}.png", right, "right"))


@pytest.mark.parametrize("left, right", [
    ([0, 1, 2, 4], [0, 1, 2, 4]),
    ([0, 1, 2, 3], [1, 2, 3, 4]),  # counted from one
    ([1000, 2000, 3001], [1004, 2003, 3002]),  # two clocks
])  # fmt: skip
def test_sides_that_match_pass(left, right):
    refuse_other_numbers(names("{}.png", left), names("{}.png", right, "right"))

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from baryscope.models.words import LONGEST, brief, counted, length


@pytest.mark.parametrize("number, words, expected", [
    (0, ("cluster",), "0 clusters"),
    (1, ("cluster",), "1 cluster"),
    (2, ("cluster",), "2 clusters"),
    (1, ("process", "processes"), "1 process"),
    (3, ("feature is", "features are"), "3 features are"),
])  # fmt: skip
def test_one_is_singular(number, words, expected):
    assert counted(number, *words) == expected


@pytest.mark.parametrize(
    "metres, expected", [(0.1, "0.10 m"), (12.25, "12.25 m"), (0.0999, "99.90 mm"), (0, "0.00 mm")]
)
def test_lengths_carry_their_unit(metres, expected):
    assert length(metres) == expected


@dataclass
class Shown:
    """What a notebook shows."""

    few: Any
    many: Any
    text: str

    __repr__ = brief


def test_a_value_is_shown_in_a_line():
    long = "x" * (2 * LONGEST)
    shown = repr(Shown(np.eye(2), np.zeros((1000, 3)), long))
    assert shown == f"Shown(few=array([[1., 0.], [0., 1.]]), many=<array (1000, 3)>, text='{long[: LONGEST - 1]}…)"

"""Numbers in messages, and values in a line, as notebooks show them."""

import dataclasses
from typing import Any

import numpy as np

FEW = 6  # numbers of an array that are shown
LONGEST = 120  # letters of a field


def brief(value: Any) -> str:
    """A dataclass in a line, its `__repr__`: of arrays the shape, of long fields the begin."""
    shown = (f"{one.name}={_field(getattr(value, one.name))}" for one in dataclasses.fields(value) if one.repr)
    return f"{type(value).__name__}({', '.join(shown)})"


def _field(value: Any) -> str:
    if isinstance(value, np.ndarray) and value.size > FEW:
        return f"<array {value.shape}>"
    text = " ".join(repr(value).split())
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}…"


def counted(number: int, noun: str, plural: str | None = None) -> str:
    """A number and what it counts: "1 cluster", "2 clusters"; the plural, unless given, with an s."""
    return f"{number} {noun if number == 1 else plural or noun + 's'}"


def length(metres: float) -> str:
    """A length with its unit: metres from 0.1 m on, else millimetres."""
    return f"{metres:.2f} m" if metres >= 0.1 else f"{1000 * metres:.2f} mm"

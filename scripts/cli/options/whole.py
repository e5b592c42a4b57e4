"""Whole numbers on the command line, where cyclopts would round others."""

from collections.abc import Sequence
from typing import Annotated

from cyclopts import Parameter, Token

from baryscope.models.errors import InputError


def _whole(kind: type, tokens: Sequence[Token]) -> int:
    """The number.

    Raises:
        InputError: it is none; cyclopts names the option.
    """
    value = tokens[0].value
    try:
        return int(value)
    except ValueError as error:
        raise InputError(f"found {value!r}, expected a whole number") from error


Whole = Annotated[int, Parameter(converter=_whole)]

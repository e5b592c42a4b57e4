"""How scenario and orbit files are read: TOML into pydantic models, errors into one line each.

A field's unit stands in its annotation (`Metres = Annotated[float, Unit("m")]`); the messages use it.
"""

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from baryscope.models.errors import InputError
from baryscope.models.files import read_text


@dataclass(frozen=True)
class Unit:
    """The unit of a field, for messages and for the JSON schema."""

    name: str

    def __get_pydantic_json_schema__(self, core_schema: Any, handler: Any) -> Any:
        schema = handler(core_schema)
        return schema | {"unit": self.name}


Metres = Annotated[float, Unit("m")]
Seconds = Annotated[float, Unit("s")]
Degrees = Annotated[float, Unit("deg")]

Vector = tuple[float, float, float]
PositionVector = Annotated[Vector, Unit("m")]
VelocityVector = Annotated[Vector, Unit("m/s")]
UNIT_SUFFIXES = (
    "_deg",
    "_rad",
    "_km",
    "_m",
    "_s",
    "_min",
    "_h",
    "_mm",
    "_cm",
    "_deg_s",
    "_rad_s",
    "_kg",
    "_km3_s2",
)


class FileModel(BaseModel):
    """A table of a TOML file: frozen, finite numbers only, unknown keys refused, no coercion of text."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)

    @classmethod
    def parse(cls, data: dict[str, Any], source: str) -> Self:
        """Check `data`; an error names `source` and the field.

        Raises:
            InputError: one line: where, what was found, what was expected.
        """
        try:
            return cls.model_validate(lists_to_tuples(data))
        except ValidationError as error:
            details = error.errors(include_url=False)
            more = f" (and {len(details) - 1} more)" if len(details) > 1 else ""
            raise InputError(f"{source}: {_describe(details[0], cls)}{more}") from error


def read_toml(path: Path, expected: str) -> dict[str, Any]:
    """The tables of a TOML file.

    Raises:
        InputError: the file cannot be read or is not TOML.
    """
    try:
        return tomllib.loads(read_text(path, expected))
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: {error}, expected {expected}") from error


def lists_to_tuples(value: Any) -> Any:
    """TOML's arrays as tuples, so that strict models can take them and stay hashable."""
    if isinstance(value, dict):
        return {key: lists_to_tuples(item) for key, item in value.items()}
    if isinstance(value, list):
        return tuple(lists_to_tuples(item) for item in value)
    return value


def _describe(detail: ErrorDetails, model: type[BaseModel]) -> str:
    """One line for one pydantic error: field, what was found, what was expected."""
    location = detail["loc"]
    where = _path(location)
    kind = detail["type"]
    if kind == "extra_forbidden":
        return f"{where}: unknown field{_hint(location, model)}"
    if kind == "missing":
        unit = _unit_at(location, model)
        return f"{where}: missing{f', expected a value in {unit}' if unit else ''}"
    found = _short(detail["input"])
    if kind == "value_error":  # our own validators write whole sentences
        message = str(detail["ctx"]["error"])
        return f"{where}: {message}" if where else message
    unit = _unit_at(location, model)
    message = detail["msg"][0].lower() + detail["msg"][1:]
    expectation = message.removeprefix("input should be ").removeprefix("a valid ")
    return f"{where}: found {found}, expected {expectation}{f' in {unit}' if unit else ''}"


def _path(location: Sequence[int | str]) -> str:
    """`features.points[2].normal`, arrays counted from 0 as in the file's reader."""
    text = ""
    for part in location:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else part
    return text


def _fields_along(location: Sequence[int | str], model: type[BaseModel]) -> list[FieldInfo]:
    """The pydantic fields that a location passes through, as far as they are known."""
    fields: list[FieldInfo] = []
    current: Any = model
    for part in location:
        if isinstance(part, int):
            continue
        known: dict[str, FieldInfo] = getattr(current, "model_fields", {})
        if part not in known:
            break
        fields.append(known[part])
        current = _inner_model(known[part].annotation)
    return fields


def _inner_model(annotation: Any) -> Any:
    """The model inside `Model`, `tuple[Model, ...]` or `Model | None`."""
    if hasattr(annotation, "model_fields"):
        return annotation
    for argument in getattr(annotation, "__args__", ()):
        inner = _inner_model(argument)
        if inner is not None:
            return inner
    return None


def _unit_of(field: FieldInfo) -> str | None:
    return next((item.name for item in field.metadata if isinstance(item, Unit)), None)


def _unit_at(location: Sequence[int | str], model: type[BaseModel]) -> str | None:
    fields = _fields_along(location, model)
    return _unit_of(fields[-1]) if fields else None


def _hint(location: Sequence[int | str], model: type[BaseModel]) -> str:
    """What an unknown key may have meant; a key with another unit is told the unit that is expected."""
    parents = _fields_along(location[:-1], model)
    owner = _inner_model(parents[-1].annotation) if parents else model
    known: dict[str, FieldInfo] = getattr(owner, "model_fields", {})
    name = str(location[-1])
    stem = next(
        (name.removesuffix(s) for s in sorted(UNIT_SUFFIXES, key=len, reverse=True) if name.endswith(s)), name
    )
    same = [key for key in known if stem in (key, key.removesuffix("_deg"))]
    close = same or get_close_matches(name, list(known), n=1)
    if not close:
        return f", expected one of {', '.join(known)}"
    unit = _unit_of(known[close[0]])
    return f", expected {close[0]}{f' in {unit}' if unit else ''}"


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."

"""How scenario and orbit files are read: TOML into pydantic models, errors into one line each.

The unit of a field is part of its annotation (`Seconds = Annotated[float, Unit("s")]`); the messages use it.
"""

import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from types import NoneType, UnionType
from typing import Annotated, Any, Self, Union, get_args, get_origin

from pydantic import BaseModel, ConfigDict, Field, GetCoreSchemaHandler, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema, ErrorDetails, core_schema

from baryscope.models.errors import InputError
from baryscope.models.files import AnyPath, read_text

MAX_BYTES = 5_000_000  # of a file: some 80,000 tracking intervals
MAX_DEPTH = 32  # tables and arrays in one another


@dataclass(frozen=True)
class Unit:
    """The unit of a field, for messages and for the JSON schema."""

    name: str

    def __get_pydantic_json_schema__(self, core_schema: Any, handler: Any) -> Any:
        schema = handler(core_schema)
        return schema | {"unit": self.name}


# The ranges are wider than any mission. They keep squares and products of what is in them far from overflow.
Seconds = Annotated[float, Unit("s"), Field(ge=-1e10, le=1e10)]
Degrees = Annotated[float, Unit("deg"), Field(ge=-1e6, le=1e6)]

Component = Annotated[float, Field(ge=-1e9, le=1e9)]
RateComponent = Annotated[float, Field(ge=-1e6, le=1e6)]
Vector = tuple[Component, Component, Component]
RateVector = tuple[RateComponent, RateComponent, RateComponent]  # velocities, accelerations, angular rates
PositionVector = Annotated[Vector, Unit("m")]
VelocityVector = Annotated[RateVector, Unit("m/s")]
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
            # A key that is unknown is often one that is missing, misspelt: say the former and don't count the latter.
            details = error.errors(include_url=False)
            first = next((detail for detail in details if detail["type"] == "extra_forbidden"), details[0])
            doubled = "missing" if first["type"] == "extra_forbidden" else None
            others = sum(detail is not first and detail["type"] != doubled for detail in details)
            more = f" (and {others} more)" if others else ""
            raise InputError(" ".join(f"{source}: {_describe(first, cls)}{more}".splitlines())) from error


class UnitTable(FileModel):
    """A table in the units of the file that is converted to a value in SI units."""

    def to_si(self) -> Any:
        """The value.

        Raises:
            InputError: the table gives no valid value.
        """
        raise NotImplementedError

    @classmethod
    def of(cls, value: Any) -> Self:
        """The table of a value."""
        raise NotImplementedError


@dataclass(frozen=True)
class ReadFrom:
    """Marks a field with a value in SI units that a file gives as a table: `Annotated[Orbit, ReadFrom(OrbitTable)]`.

    The field accepts the table or the value. It is serialised as the table.
    """

    table: type[UnitTable]

    def __get_pydantic_core_schema__(self, source: type, handler: GetCoreSchemaHandler) -> CoreSchema:
        def read(given: Any, of_table: Callable[[Any], UnitTable]) -> Any:
            return given if isinstance(given, source) else of_table(given).to_si()

        return core_schema.no_info_wrap_validator_function(
            read,
            handler.generate_schema(self.table),
            serialization=core_schema.plain_serializer_function_ser_schema(
                lambda value: self.table.of(value).model_dump(exclude_none=True)
            ),
        )


def read_toml(path: AnyPath, expected: str) -> dict[str, Any]:
    """The tables of a TOML file, with arrays as tuples.

    Raises:
        InputError: the file cannot be read, is longer than MAX_BYTES, is not TOML, or is nested too deeply.
    """
    return toml_of(read_text(path, expected, MAX_BYTES), str(path), expected)


def toml_of(text: str, source: str, expected: str) -> dict[str, Any]:
    """The tables of a text in TOML, with arrays as tuples; `source` names the file in errors.

    Raises:
        InputError: it is not TOML, or is nested too deeply.
    """
    try:
        tables: dict[str, Any] = lists_to_tuples(tomllib.loads(text))
    except RecursionError as error:
        raise InputError(f"{source}: nested more than {MAX_DEPTH} levels deep, expected {expected}") from error
    except ValueError as error:  # TOMLDecodeError, or a number of thousands of digits
        reason = error if isinstance(error, tomllib.TOMLDecodeError) else "a whole number has too many digits"
        raise InputError(f"{source}: {reason}, expected {expected}") from error
    return tables


def lists_to_tuples(value: Any, depth: int = 0) -> Any:
    """TOML's arrays as tuples, so that strict models can take them and stay hashable.

    Raises:
        RecursionError: there are more than MAX_DEPTH levels.
    """
    if depth > MAX_DEPTH:
        raise RecursionError
    if isinstance(value, dict):
        return {key: lists_to_tuples(item, depth + 1) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return tuple(lists_to_tuples(item, depth + 1) for item in value)
    return value


# The expectation in a message, for each of pydantic's kinds of error; pydantic's own words for all others.
EXPECTED = {
    "bool_type": "true or false",
    "finite_number": "a finite number",
    "float_type": "a number",
    "greater_than": "a value above {gt:g}",
    "greater_than_equal": "a value of at least {ge:g}",
    "int_type": "a whole number",
    "less_than": "a value below {lt:g}",
    "less_than_equal": "a value of at most {le:g}",
    "literal_error": "{expected}",
    "model_type": "a table",
    "string_too_short": "text that is not empty",
    "string_type": "text in quotes",
    "too_short": "at least {min_length}",
}
UNITLESS = ("bool_type", "literal_error", "model_type", "string_too_short", "string_type", "too_short")


def _describe(detail: ErrorDetails, model: type[BaseModel]) -> str:
    """One line for one pydantic error: field, what was found, what was expected."""
    location, kind, found = detail["loc"], detail["type"], detail["input"]
    where = _path(location)
    if kind == "extra_forbidden":
        return f"{where}: unknown field{_hint(location, model)}"
    if kind == "value_error":  # our own validators write whole sentences, some with the field
        message = str(detail["ctx"]["error"])
        return message if not where or message.startswith(f"{where}.") else f"{where}: {message}"

    field, expected = _walk(location, model)
    unit = _unit_of(field)
    in_unit = f" in {unit}" if unit else ""
    if kind == "missing" and isinstance(found, Mapping):
        return f"{where}: missing, expected {_kind_of_value(expected)}{in_unit}"
    if kind in ("missing", "too_long"):  # a list of the wrong length; what "missing" locates is its first lack
        whole = location[:-1] if kind == "missing" else location
        wanted = _kind_of_value(_walk(whole, model)[1])
        if Ellipsis in get_args(_walk(whole, model)[1]):
            wanted = f"at most {detail['ctx']['max_length']}"
        return f"{_path(whole)}: found a list of {len(found)}, expected {wanted}{in_unit}"
    shown = f"a list of {len(found)}" if kind == "too_short" else _short(found)
    if kind == "tuple_type":
        wanted = _kind_of_value(expected)
    elif kind in EXPECTED:
        wanted = EXPECTED[kind].format(**detail.get("ctx", {}))
    else:
        wanted = detail["msg"].lower().removeprefix("input should be ")
    return f"{where}: found {shown}, expected {wanted}{'' if kind in UNITLESS else in_unit}"


def _path(location: Sequence[int | str]) -> str:
    """`features.points[2].normal`, arrays counted from 0 as in the file's reader."""
    text = ""
    for part in location:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else part
    return text


@dataclass(frozen=True)
class FieldKind:
    """What a field of a file takes: the type of its value and its unit, None where it has none."""

    kind: Any
    unit: str | None


def field_at(location: Sequence[int | str], model: type[BaseModel]) -> FieldKind:
    """What stands at a location in a file, such as ("target", "angular_rate_deg", 2), places counted from 0.

    Raises:
        InputError: there is no such field.
    """
    for k in range(1, len(location) + 1):
        inner = _walk(location[: k - 1], model)[1]
        part = location[k - 1]
        if get_args(inner):
            known, hint = isinstance(part, int), ", expected a place in its list, from 0"
        else:
            fields = getattr(inner, "model_fields", {})
            known, hint = part in fields, _hint(location[:k], model) if fields else ", expected a value without fields"
        if not known:
            raise InputError(f"{_path(location[:k])}: unknown field{hint}")
    field, kind = _walk(location, model)
    return FieldKind(kind, _unit_of(field))


def _walk(location: Sequence[int | str], model: type[BaseModel]) -> tuple[FieldInfo | None, Any]:
    """The last field that a location passes through, and the type of value expected at its end."""
    field: FieldInfo | None = None
    expected: Any = model
    for part in location:
        if isinstance(part, int):
            items = [item for item in get_args(expected) if item is not Ellipsis]
            expected = _bare(items[min(part, len(items) - 1)]) if items else object
        else:
            known: dict[str, FieldInfo] = getattr(expected, "model_fields", {})
            if part not in known:
                return None, object
            field = known[part]
            table = next((item.table for item in field.metadata if isinstance(item, ReadFrom)), None)
            expected = table or _bare(field.annotation)
    return field, expected


def _bare(annotation: Any) -> Any:
    """A type without `Annotated` and without `| None`."""
    if get_origin(annotation) is Annotated:
        return _bare(get_args(annotation)[0])
    options = [option for option in get_args(annotation) if option is not NoneType]
    return _bare(options[0]) if get_origin(annotation) in (Union, UnionType) else annotation


def _unit_of(field: FieldInfo | None) -> str | None:
    return next((item.name for item in field.metadata if isinstance(item, Unit)), None) if field else None


def _kind_of_value(expected: Any) -> str:
    """What to write for a value of this type, in words."""
    if get_origin(expected) is tuple:
        items = get_args(expected)
        of = {float: "numbers", str: "texts"}.get(_bare(items[0]), "lists" if get_args(items[0]) else "tables")
        return f"a list of {of}" if Ellipsis in items else f"a list of {len(items)} {of}"
    names = {float: "a number", int: "a whole number", bool: "true or false", str: "text in quotes"}
    return names.get(expected, "a table")


def _hint(location: Sequence[int | str], model: type[BaseModel]) -> str:
    """What an unknown key may have meant; a key with another unit is told the unit that is expected."""
    known: dict[str, FieldInfo] = getattr(_walk(location[:-1], model)[1], "model_fields", {})
    name = str(location[-1])
    suffixes = sorted(UNIT_SUFFIXES, key=len, reverse=True)
    stem = next((name.removesuffix(suffix) for suffix in suffixes if name.endswith(suffix)), name)
    same = [key for key in known if stem in (key, key.removesuffix("_deg"))]
    close = same or get_close_matches(name, list(known), n=1)
    if not close:
        return f", expected {'one of ' if len(known) > 1 else ''}{', '.join(known)}"
    unit = _unit_of(known[close[0]])
    return f", expected {close[0]}{f' in {unit}' if unit else ''}"


def _short(value: Any) -> str:
    """A value as TOML writes it, cut to 60 characters."""
    text = _toml(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, Mapping):
        return "a table"
    if isinstance(value, tuple):
        return f"[{', '.join(map(_toml, value))}]"
    if isinstance(value, int) and abs(value) >= 10**60:
        return f"a whole number of {value.bit_length()} bits"
    return repr(value) if isinstance(value, str) else str(value)

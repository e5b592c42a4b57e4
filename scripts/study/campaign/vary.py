"""What a draw varies besides its noise: attitude, true anomaly, and numbers of the scenario over ranges.

An item of `--vary` is the name of one of VARIED, or `FIELD=LOW:HIGH`, with `:log` behind it where equal ratios are to
be equally frequent. A field is addressed as in a scenario file, dots between the names and places counted from 0:
`sensor.noise`, `target.angular_rate_deg.2`. A vector of three by its name alone is varied in its length.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from math import exp, floor, hypot, isfinite, log
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baryscope.models.errors import InputError
from baryscope.models.scenario import Scenario
from baryscope.models.scenario.schema import field_at

FloatArray = NDArray[np.float64]
Data = Mapping[str, Any]
Values = tuple[tuple[str, float], ...]  # fields and what they are in a draw

VARIED = ("attitude", "anomaly")  # what has no range: all rotations, and the whole orbit
ANOMALY = "orbit.true_anomaly_deg"
OWN = {"run.seed": "each draw has its own"}  # fields that a draw sets itself
SYMMETRIC = ("target.inertia", "eddy_currents.tensor")
OF_HYPERCUBE = 0x4C48  # its random numbers are none of a draw's
MOST_CORNERS = 12  # ranges whose corners are all tried

FORM = "some of attitude, anomaly and FIELD=LOW:HIGH[:log]"
_ITEM = re.compile(r"(?P<field>[^=]+)=(?P<low>[^:]+):(?P<high>[^:]+)(?P<log>:log)?")
_NEITHER = re.compile(r"[^\w.\[\]]")


@dataclass(frozen=True)
class Range:
    """A field and between which values it is drawn, evenly or, with `log`, evenly in its logarithm."""

    field: str
    low: float
    high: float
    log: bool = False

    @property
    def text(self) -> str:
        """As `--vary` takes it."""
        return f"{self.field}={_short(self.low)}:{_short(self.high)}{':log' if self.log else ''}"

    @property
    def path(self) -> tuple[str | int, ...]:
        """Names and places on the way to it."""
        return path_of(self.field)

    def at(self, share: float, whole: bool) -> float:
        """The value below which `share` of the draws are; a whole number for fields that are one."""
        if whole:
            return min(floor(self.low + share * (self.high - self.low + 1)), self.high)
        if self.log:
            return min(max(exp(log(self.low) + share * (log(self.high) - log(self.low))), self.low), self.high)
        return self.low + share * (self.high - self.low)


def path_of(field: str) -> tuple[str | int, ...]:
    """Names and places on the way to a field."""
    return tuple(int(part) if part.isdecimal() else part for part in field.split("."))


def _short(value: float) -> str:
    return repr(float(value)).removesuffix(".0")


def range_of(field: str, low: Any, high: Any, log: bool, text: str, where: str = "vary ") -> Range:
    """The range between two numbers, or texts of numbers; `text` is what was given, and `where` before the field.

    Raises:
        InputError: the limits are no numbers in their order.
    """
    name = re.sub(r"\[(\d+)\]", r".\1", field.strip()).strip(".")
    try:
        limits = float(low), float(high)
    except (TypeError, ValueError, OverflowError):
        limits = float("nan"), float("nan")
    if not all(map(isfinite, limits)) or limits[0] >= limits[1]:
        raise InputError(f"{where}{name}: found {text}, expected two numbers, the smaller first")
    if log and limits[0] <= 0:
        raise InputError(f"{where}{name}: found {text}, expected numbers above 0 for log")
    return Range(name, *limits, log)


def items_of(texts: Sequence[str]) -> tuple[str, ...]:
    """What is varied, each once and as it is compared: those of VARIED first, then the ranges.

    Raises:
        InputError: an item that is neither, or a field that stands twice.
    """
    ranges = []
    for text in texts:
        if text in VARIED:
            continue
        found = _ITEM.fullmatch(text.strip())
        if found is None or _NEITHER.search(found["field"].strip()):
            raise InputError(f"vary: found {text!r}, expected none or {FORM}")
        ranges.append(range_of(found["field"], found["low"], found["high"], bool(found["log"]), text.partition("=")[2]))
    fields = [one.field for one in ranges]
    twice = next((field for field in fields if fields.count(field) > 1), None)
    if twice is not None:
        raise InputError(f"vary {twice}: stands {fields.count(twice)} times, expected each field once")
    if "anomaly" in texts and ANOMALY in fields:
        raise InputError(f"vary {ANOMALY}: found beside anomaly, expected one of them")
    if "attitude" in texts and any(field.startswith("target.attitude") for field in fields):
        raise InputError("vary target.attitude: found beside attitude, expected one of them")
    return (*(item for item in VARIED if item in texts), *(one.text for one in ranges))


def items_of_table(table: Data, source: str) -> tuple[str, ...]:
    """What a file's table [vary] names: `attitude = true`, `sensor.noise = [0.01, 0.1, "log"]`.

    Raises:
        InputError: a value that is neither.
    """
    items = []
    for name, value in _leaves(table):
        if name in VARIED and isinstance(value, bool):
            items += [name] if value else []
        elif isinstance(value, tuple) and len(value) in (2, 3) and value[2:] in ((), ("log",)):
            text = f"[{', '.join(map(str, value))}]"
            low, high = (None if isinstance(limit, bool | str) else limit for limit in value[:2])
            items.append(range_of(name, low, high, len(value) == 3, text, f"{source}: vary.").text)
        else:
            kind = "true or false" if name in VARIED else '[LOW, HIGH] or [LOW, HIGH, "log"]'
            raise InputError(f"{source}: vary.{name}: found {value!r}, expected {kind}")
    return items_of(items)


def _leaves(table: Data, before: str = "") -> list[tuple[str, Any]]:
    """TOML reads `sensor.noise = …` as a table in a table."""
    found: list[tuple[str, Any]] = []
    for name, value in table.items():
        found += _leaves(value, f"{before}{name}.") if isinstance(value, Mapping) else [(f"{before}{name}", value)]
    return found


def ranges_of(vary: Sequence[str]) -> tuple[Range, ...]:
    """The ranges among what `items_of` gives."""
    found = [_ITEM.fullmatch(item) for item in vary]
    return tuple(Range(one["field"], float(one["low"]), float(one["high"]), bool(one["log"])) for one in found if one)


def hypercube(ranges: Sequence[Range], draws: int, seed: int) -> FloatArray:
    """Shares (draws, ranges), 0 to 1: for each range one draw in each of `draws` equal parts (a Latin hypercube)."""
    if not ranges:
        return np.zeros((draws, 0))
    from scipy.stats.qmc import LatinHypercube  # slow to load, and few need it

    own = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(OF_HYPERCUBE,)))
    shares: FloatArray = LatinHypercube(len(ranges), seed=own).random(draws)
    return shares


def values_at(shares: Sequence[float] | FloatArray, ranges: Sequence[Range]) -> Values:
    """The fields' values at shares of their ranges."""
    return tuple((one.field, one.at(float(share), _is_whole(one))) for one, share in zip(ranges, shares, strict=True))


def _is_whole(one: Range) -> bool:
    return field_at(one.path, Scenario).kind is int


def prepared(data: Data, ranges: Sequence[Range], name: str) -> dict[str, Any]:
    """A scenario's data with all lists that ranges reach into, so that `with_values` can change them.

    Raises:
        InputError: a field that the scenario hasn't, or that is no number; or a corner of the ranges that makes a
            scenario which is not valid.
    """
    whole = Scenario.parse(dict(data), name).model_dump(mode="json")
    filled = dict(data)
    for one in ranges:
        if one.field in OWN:
            raise InputError(f"vary {one.field}: {OWN[one.field]}, expected another field")
        _check_kind(one, whole, name)
        place = next((k for k, part in enumerate(one.path) if isinstance(part, int)), len(one.path))
        if isinstance(found := _at(whole, one.path[:place]), list | tuple):
            filled = _replaced(filled, one.path[:place], found)
    _check_corners(filled, ranges, name)
    return filled


def _check_kind(one: Range, whole: Data, name: str) -> None:
    """That a field is a number, or three of them."""
    try:
        kind = field_at(one.path, Scenario).kind
    except InputError as error:
        raise InputError(f"vary {error}") from error
    tables = len(one.path) - isinstance(one.path[-1], str)  # a number by its name may be absent, one in a list not
    for k in range(1, tables + 1):
        if _at(whole, one.path[:k]) is None:
            lacking = ".".join(map(str, one.path[:k]))
            raise InputError(f"vary {one.field}: {name} has no {lacking}, expected a field that is there")
    found = _at(whole, one.path)
    if isinstance(found, list) and len(found) == 3 and all(isinstance(item, float) for item in found):
        if hypot(*found) == 0:
            raise InputError(f"vary {one.field}: is zero in {name}, expected a vector with a direction to keep")
        if one.low < 0:
            raise InputError(f"vary {one.field}: found {_short(one.low)}, expected a length of at least 0 for a vector")
    elif kind not in (int, float):
        raise InputError(f"vary {one.field}: is no number in {name}, expected a number or a vector of three")
    elif kind is int and (one.log or one.low % 1 or one.high % 1):
        raise InputError(f"vary {one.field}: is a whole number, expected whole limits and no log")


def _check_corners(data: Data, ranges: Sequence[Range], name: str) -> None:
    """Each limit by itself first, for a message that names it; then all of them together, if they are not too many."""
    middle = values_at([0.5] * len(ranges), ranges)
    for k, one in enumerate(ranges):
        for limit in (one.low, one.high):
            alone = (*middle[:k], (one.field, limit), *middle[k + 1 :])
            _parse(with_values(data, alone), f"{name} with {one.field} = {_short(limit)}")
    if len(ranges) <= MOST_CORNERS:
        for limits in product(*((one.low, one.high) for one in ranges)):
            corner = tuple((one.field, limit) for one, limit in zip(ranges, limits, strict=True))
            said = ", ".join(f"{field} = {_short(value)}" for field, value in corner)
            _parse(with_values(data, corner), f"{name} with {said}")


def _parse(data: dict[str, Any], source: str) -> None:
    Scenario.parse(data, f"vary: {source}")


def _at(node: Any, path: Sequence[str | int]) -> Any:
    """What is at a path; None where there is nothing."""
    for part in path:
        if isinstance(node, Mapping):
            node = node.get(part)
        elif isinstance(node, list | tuple) and isinstance(part, int) and part < len(node):
            node = node[part]
        else:
            return None
    return node


def with_values(data: Data, values: Values) -> dict[str, Any]:
    """A scenario's data, as `prepared`, with other values in some fields; the data given stay as they are.

    A vector gets its value as its length and keeps its direction; a symmetric tensor stays symmetric.
    """
    changed = dict(data)
    for field, value in values:
        path = path_of(field)
        old = _at(changed, path)
        new: Any = int(value) if field_at(path, Scenario).kind is int else value
        if isinstance(old, list | tuple):
            new = [value * item / hypot(*old) for item in old]
        changed = _replaced(changed, path, new)
        if ".".join(map(str, path[:-2])) in SYMMETRIC:
            changed = _replaced(changed, (*path[:-2], path[-1], path[-2]), new)
    return changed


def _replaced(node: Any, path: Sequence[str | int], value: Any) -> Any:
    """A copy with another value at a path; tables that are missing are made."""
    if not path:
        return value
    head, rest = path[0], path[1:]
    if isinstance(head, int):
        return [_replaced(item, rest, value) if k == head else item for k, item in enumerate(node)]
    table = node or {}
    return {**table, head: _replaced(table.get(head), rest, value)}

"""The parts of a report as plain values, and their JSON, which the page's script draws.

Whoever changes the meaning of a field raises `FORMAT`. Arrays become lists of numbers with few digits, null where a
value is not finite.
"""

import math
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

FORMAT = 1
DIGITS = 5  # of a number, but for those of fields that say another number
MORE_DIGITS = 8
EXACT = {"digits": MORE_DIGITS}
LARGEST = 1e15  # of what stands without a decimal point
POWERS = np.array([float(f"1e{power}") for power in range(23)])  # of ten, as far as these are exact
MOMENTS = {"digits": 13}  # seconds since 1970, to a tenth of a millisecond


@dataclass(frozen=True, eq=False)
class Series:
    """A curve, or points, of a chart.

    x, y (k,): NaN in y is a gap. low, high (k,): a band around it. colour: a number of the page's palette, or ink
    for what all else is compared with. style: line, dashed, wide (for a curve that others cover), points or cross.
    shown: whether it is at first. of (k,): for points, their places in the chart's `filter`. total: how many points
    there are, of which these are drawn; these are all unless given.
    """

    label: str
    x: FloatArray = field(metadata=MOMENTS)
    y: FloatArray
    colour: int | Literal["ink"] = "ink"
    style: Literal["line", "dashed", "wide", "points", "cross"] = "line"
    low: FloatArray | None = None
    high: FloatArray | None = None
    shown: bool = True
    of: NDArray[np.intp] | None = None
    total: int | None = None


@dataclass(frozen=True, eq=False)
class Chart:
    """Curves over a common axis, of time unless told.

    about: what it shows and how to read it, in a sentence or two. shades: intervals (begin, end) that are shaded, and
    shade what they are; marks: (x, words), vertical lines; levels: (y, words), horizontal lines. filter: names among
    which the reader can choose one, for points that have `of`. timed: whether x is the scene's time.
    """

    title: str
    about: str
    y_label: str
    series: tuple[Series, ...]
    x_label: str = "time in s"
    log: bool = False
    log_x: bool = False
    shades: tuple[tuple[float, float], ...] = ()
    shade: str = ""
    marks: tuple[tuple[float, str], ...] = ()
    levels: tuple[tuple[float, str], ...] = ()
    filter: tuple[str, ...] = ()
    timed: bool = True
    kind: Literal["chart"] = "chart"


@dataclass(frozen=True, eq=False)
class Timeline:
    """Bars over time, one a row: which feature is seen when, and rejected when.

    seen, rejected: for each row a text of one digit a bin, 0 for none and 9 for all of the bin's frames; rejected may
    be empty. Bins divide begin to end, s, equally.
    """

    title: str
    about: str
    begin: float
    end: float
    rows: tuple[str, ...]
    seen: tuple[str, ...]
    rejected: tuple[str, ...] = ()
    kind: Literal["timeline"] = "timeline"


@dataclass(frozen=True)
class Sheet:
    """A table; the first `left` columns are words, the others numbers."""

    title: str
    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    about: str = ""
    left: int = 1
    kind: Literal["sheet"] = "sheet"


@dataclass(frozen=True)
class Facts:
    """Names and values in two columns."""

    title: str
    items: tuple[tuple[str, str], ...]
    kind: Literal["facts"] = "facts"


@dataclass(frozen=True)
class Words:
    """Lines of text; code: those of a program, to be copied."""

    title: str
    lines: tuple[str, ...]
    code: tuple[str, ...] = ()
    kind: Literal["words"] = "words"


@dataclass(frozen=True, eq=False)
class Ghost:
    """An estimate in the scene: offset (k, 3) of its CoM from the scene's path, and covariance (k, 6), m²."""

    label: str
    colour: int
    offset: FloatArray
    covariance: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class Scene:
    """What is where at k times, in C (origin at the chaser, inertial axes).

    path (k, 3): the CoM that all else is measured from, truly or as estimated (`path_label`); features (k, m, 3) and
    faces (f, 3), indices of features; state: for each time a text of m digits, 0 not seen, 1 seen, 2 rejected.
    attitude, orbit (k, 4): quaternions (w, x, y, z) that turn body and LVLH axes into C.
    every: how many frames of the tracks one of these stands for. gaps: places of times after which there are no frames
    for long.
    """

    time: FloatArray = field(metadata=MOMENTS)
    path: FloatArray = field(metadata=EXACT)
    path_label: str
    labels: tuple[str, ...]
    features: FloatArray
    state: tuple[str, ...]
    faces: NDArray[np.intp]
    ghosts: tuple[Ghost, ...]
    attitude: FloatArray | None = None
    orbit: FloatArray | None = None
    every: float = 1.0
    gaps: tuple[int, ...] = ()
    about: str = ""
    title: str = "Scene"
    kind: Literal["scene"] = "scene"


@dataclass(frozen=True, eq=False)
class Tabs:
    """Parts of which one choice is shown at a time, such as those of a method; at first that of the index `first`."""

    title: str
    choices: tuple[tuple[str, tuple["Part", ...]], ...]
    about: str = ""
    first: int = 0
    kind: Literal["tabs"] = "tabs"


Part = Chart | Timeline | Sheet | Facts | Words | Scene | Tabs


@dataclass(frozen=True, eq=False)
class Report:
    """A report: a title, what is to be known first, and its parts in order.

    verdict: whether the result can be used: good, warn or bad, and the sentence that says so.
    """

    title: str
    subtitle: str
    version: str
    parts: tuple[Part, ...]
    verdict: tuple[Literal["good", "warn", "bad"], str] | None = None
    notes: tuple[str, ...] = ()


def plain(value: Any, digits: int = DIGITS) -> Any:
    """A value as JSON has it: numbers with so many digits, null for those that are not finite."""
    if is_dataclass(value):
        return {one.name: plain(getattr(value, one.name), one.metadata.get("digits", DIGITS)) for one in fields(value)}
    if isinstance(value, np.ndarray):
        if value.dtype.kind in "iub":
            return value.ravel().tolist()
        return _all_rounded(value.ravel().astype(float), digits)
    if isinstance(value, list | tuple):
        return [plain(one, digits) for one in value]
    return _rounded(value, MOMENTS["digits"]) if isinstance(value, float) else value


def _rounded(number: float, digits: int) -> float | int | None:
    if not math.isfinite(number):
        return None
    short = float(f"{number:.{digits}g}")
    return int(short) if short.is_integer() and abs(short) < LARGEST else short


def _all_rounded(values: FloatArray, digits: int) -> list[float | int | None]:
    """As `_rounded`, many times as fast: the quotient of two whole numbers is the number nearest to the decimal.

    So is the product; both are exact while the power of ten is.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        places = digits - 1 - np.floor(np.log10(np.abs(values)))
        near = np.abs(places) < len(POWERS)
        power = POWERS[np.where(near, np.abs(places), 0).astype(np.intp)]
        short = np.where(places < 0, np.round(values / power) * power, np.round(values * power) / power)
    found: list[float | int | None] = [
        int(one) if one.is_integer() and abs(one) < LARGEST else one for one in np.where(near, short, 0.5).tolist()
    ]
    for k in np.flatnonzero(~near).tolist():  # not finite, zero, or far from one
        found[k] = _rounded(float(values[k]), digits)
    return found


def data_of(report: Report) -> dict[str, Any]:
    """The report as JSON has it; multi-dimensional arrays are flat, row by row."""
    data: dict[str, Any] = plain(report)
    return {"format": FORMAT} | data

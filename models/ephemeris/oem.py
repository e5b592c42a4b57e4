"""Orbit ephemeris messages (OEM, CCSDS 502.0-B §5), as lines of text or in XML, read strictly.

The package `oem` does it, too, but needs astropy, which is larger than all that baryscope needs else.
"""

import re
from collections.abc import Iterable, Mapping
from xml.etree.ElementTree import Element

import numpy as np

from baryscope.models.ephemeris.tabulated import Segment
from baryscope.models.ephemeris.utc import Moment, utc_of
from baryscope.models.errors import InputError

AXES = ("EME2000", "J2000", "GCRF", "ICRF", "TEME", "TOD", "MOD")
OFFSETS = {"UTC": 0.0, "TAI": 37.0, "TT": 69.184, "TDB": 69.184, "GPS": 18.0}  # s ahead of UTC since 2017
SINCE = np.datetime64("2017-01-01", "ns")
META = re.compile(r"([A-Z][A-Z0-9_]*)\s*=\s*(.*)")
CENTRE = "EARTH"
COMPONENTS = ("X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT")
FARTHEST, FASTEST = 1e10, 1e6  # m and m/s

Row = tuple[Moment, list[float]]


def segments_of_text(text: str, source: str) -> tuple[tuple[Segment, ...], str]:
    """The segments of an OEM in key-value notation, and the name of its axes.

    Raises:
        InputError: one line with the number of the line, what was found, what was expected.
    """
    segments: list[tuple[dict[str, str], list[Row]]] = []
    part = "header"
    for number, line in enumerate(map(str.strip, text.splitlines()), 1):
        place = f"{source}, line {number}"
        if not line or line.startswith("COMMENT"):
            continue
        if line in ("META_START", "META_STOP", "COVARIANCE_START", "COVARIANCE_STOP"):
            part = {"META_START": "metadata", "COVARIANCE_START": "covariance"}.get(line, "states")
            if line == "META_START":
                segments.append(({}, []))
        elif part in ("header", "metadata"):
            found = META.fullmatch(line)
            if found is None:
                raise InputError(f"{place}: {line[:40]!r} in the {part}, expected KEY = value")
            if part == "metadata":
                segments[-1][0][found[1]] = found[2].strip()
        elif part == "states":
            if not segments:
                raise InputError(f"{place}: {line[:40]!r} before META_START, expected the metadata of a segment")
            cells = line.split()
            if len(cells) not in (7, 10):
                raise InputError(f"{place}: {len(cells)} values, expected a time, position and velocity: 7")
            segments[-1][1].append(_row(cells[0], cells[1:7], segments[-1][0], place))
    return _checked(segments, source)


def segments_of_xml(root: Element, source: str) -> tuple[tuple[Segment, ...], str]:
    """The segments of an OEM in XML, tags without name spaces, and the name of its axes.

    Raises:
        InputError: one line: what was found, what was expected.
    """
    segments: list[tuple[dict[str, str], list[Row]]] = []
    for node in root.iter("segment"):
        meta = {one.tag: (one.text or "").strip() for one in node.iterfind("./metadata/*")}
        rows = []
        for number, state in enumerate(node.iter("stateVector"), 1):
            cells = [(state.findtext(name) or "").strip() for name in ("EPOCH", *COMPONENTS)]
            rows.append(
                _row(cells[0], cells[1:], meta, f"{source}, stateVector {number} of segment {len(segments) + 1}")
            )
        segments.append((meta, rows))
    return _checked(segments, source)


def _row(epoch: str, cells: Iterable[str], meta: Mapping[str, str], place: str) -> Row:
    try:
        values = [1e3 * float(cell) for cell in cells]
    except ValueError as error:
        raise InputError(f"{place}: {str(error)[:80]}, expected numbers of km and km/s") from error
    if not np.abs(values[:3]).max() <= FARTHEST or not np.abs(values[3:]).max() <= FASTEST:
        raise InputError(f"{place}: {values}, expected a position and velocity near the Earth, in km and km/s")
    return _moment(epoch, meta, place), values


def _moment(text: str, meta: Mapping[str, str], place: str) -> Moment:
    moment, system = utc_of(text, place), meta.get("TIME_SYSTEM", "UTC")
    if system not in OFFSETS or (system != "UTC" and moment < SINCE):
        raise InputError(f"{place}: TIME_SYSTEM is {system}, expected UTC (or, since 2017, {', '.join(OFFSETS)})")
    return moment - np.timedelta64(round(OFFSETS[system] * 1e9), "ns")


def _checked(found: list[tuple[dict[str, str], list[Row]]], source: str) -> tuple[tuple[Segment, ...], str]:
    segments, axes = [], {meta.get("REF_FRAME", "none") for meta, _ in found}
    if not found:
        raise InputError(f"{source}: no segment, expected an OEM with META_START and positions")
    if len(axes) != 1 or not axes <= set(AXES):
        raise InputError(f"{source}: REF_FRAME is {' and '.join(sorted(axes))}, expected one of {', '.join(AXES)}")
    for number, (meta, rows) in enumerate(found, 1):
        place = f"{source}, segment {number}"
        if meta.get("CENTER_NAME", CENTRE).upper() != CENTRE:
            raise InputError(f"{place}: CENTER_NAME is {meta['CENTER_NAME']}, expected {CENTRE}")
        if len(rows) < 2:
            raise InputError(f"{place}: {len(rows)} positions, expected at least two")
        moments = np.array([moment for moment, _ in rows])
        if not (np.diff(moments) > np.timedelta64(0, "ns")).all():
            raise InputError(f"{place}: times that do not ascend, expected each later than the one before")
        begin, end = (
            _moment(meta[key], meta, f"{place}, {key}") if key in meta else moment
            for key, moment in (("USEABLE_START_TIME", moments[0]), ("USEABLE_STOP_TIME", moments[-1]))
        )
        # What is not to be used is still a good neighbour to interpolate from.
        segments.append(
            Segment(moments, np.array([values for _, values in rows]), max(begin, moments[0]), min(end, moments[-1]))
        )
    return tuple(sorted(segments, key=lambda segment: segment.begin)), axes.pop()

"""Orbit messages: recognised by their content, and read into an orbit with an ephemeris."""

import json
import re
from collections.abc import Callable
from xml.etree import ElementTree

import numpy as np

from baryscope.models.ephemeris.elements import elements_of
from baryscope.models.ephemeris.mean_elements import MeanElements, satellite_of_fields, satellite_of_lines
from baryscope.models.ephemeris.oem import segments_of_text, segments_of_xml
from baryscope.models.ephemeris.tabulated import Segment, Tabulated
from baryscope.models.ephemeris.utc import DAY, Moment, seconds_between, utc_text
from baryscope.models.errors import InputError
from baryscope.models.orbit import EARTH_J2, EARTH_MU, EARTH_RADIUS, Ephemeris, Orbit

MAX_BYTES = 100_000_000  # of a file: half a million states
OLDEST = 30  # days from the tracks: SGP4 is off by a kilometre and more for each of them
KEY_AND_VALUE = re.compile(r"\s*([A-Z][A-Z0-9_]*)\s*=\s*(.*?)\s*(?:\[[^\]]*\])?\s*")
TWO_LINES = re.compile(r"(?:[^\n]*\n)?1 [^\n]*\n\s*2 ")

At = Callable[[Moment], Ephemeris]  # the ephemeris, with time 0 at a moment


def orbit_of_message(text: str, source: str, epoch: Moment | None) -> Orbit | None:
    """The orbit in a TLE, an OMM or an OEM, with J2; None if the text is none of these.

    epoch: the moment of time 0. source: names the file in errors.

    Raises:
        InputError: one line that says where, what was found, what was expected.
    """
    found = _ephemeris_of(text, source)
    if found is None:
        return None
    at, known = found
    if epoch is None:
        raise InputError(
            f"{source}: {known}, but when time 0 of the tracks is, is not known: "
            "expected --epoch with its UTC, or UTC times in the tracks"
        )
    ephemeris = at(epoch)
    elements = elements_of(ephemeris.states(np.zeros(1))[0], EARTH_MU)
    return Orbit(
        **elements,
        j2=EARTH_J2,
        equatorial_radius=EARTH_RADIUS,
        epoch=utc_text(epoch),
        accuracy=ephemeris.accuracy if isinstance(ephemeris, MeanElements) else None,
        ephemeris=ephemeris,
    )


def _ephemeris_of(text: str, source: str) -> tuple[At, str] | None:
    """The ephemeris, and what it holds in words; None for another file."""
    start = text.lstrip()
    if start.startswith("CCSDS_OEM_VERS"):
        return _tabulated(*segments_of_text(text, source), source)
    if start.startswith("CCSDS_OMM_VERS"):
        return _mean_elements(_fields_of_lines(text), source)
    if start.startswith("<"):
        return _of_xml(text, source)
    if start.startswith(("{", "[{", "[\n")) and '"MEAN_MOTION"' in text:
        return _mean_elements(_fields_of_json(text, source), source)
    if TWO_LINES.match(start):
        return _satellite(MeanElements(satellite_of_lines(text, source), np.datetime64(0, "ns"), source))
    return None


def _of_xml(text: str, source: str) -> tuple[At, str]:
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise InputError(f"{source}: XML with a document type, expected an OMM or OEM, which has none")
    try:
        root = ElementTree.fromstring(text)  # noqa: S314  without a document type there are no entities
    except ElementTree.ParseError as error:
        raise InputError(f"{source}: {error}, expected an OMM or OEM in XML") from error
    for node in root.iter():
        node.tag = node.tag.rpartition("}")[2]
    if root.tag == "oem" or root.find(".//oem") is not None:
        return _tabulated(*segments_of_xml(root, source), source)
    sets = [node for node in root.iter("segment") if node.find(".//meanElements") is not None]
    if len(sets) != 1:
        raise InputError(
            f"{source}: {len(sets)} sets of mean elements in XML, expected an OMM of one satellite or an OEM"
        )
    return _mean_elements({node.tag: (node.text or "").strip() for node in sets[0].iter()}, source)


def _fields_of_lines(text: str) -> dict[str, str]:
    return {found[1]: found[2] for line in text.splitlines() if (found := KEY_AND_VALUE.fullmatch(line))}


def _fields_of_json(text: str, source: str) -> dict[str, str]:
    try:
        data = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{source}: {str(error)[:80]}, expected an OMM in JSON") from error
    sets = data if isinstance(data, list) else [data]
    if len(sets) != 1 or not isinstance(sets[0], dict):
        raise InputError(f"{source}: {len(sets)} sets of mean elements, expected those of one satellite")
    return {str(name): str(value) for name, value in sets[0].items() if value is not None}


def _mean_elements(fields: dict[str, str], source: str) -> tuple[At, str]:
    return _satellite(MeanElements(satellite_of_fields(fields, source), np.datetime64(0, "ns"), source))


def _satellite(elements: MeanElements) -> tuple[At, str]:
    known = f"mean elements of {utc_text(elements.epoch)}"

    def at(moment: Moment) -> MeanElements:
        days = abs(seconds_between(elements.epoch, moment)) / DAY
        if days > OLDEST:
            raise InputError(
                f"{elements.source}: {known}, {days:.0f} days from time 0 of the tracks, "
                f"expected elements of within {OLDEST} days"
            )
        return MeanElements(elements.satellite, moment, elements.source)

    return at, known


def _tabulated(segments: tuple[Segment, ...], axes: str, source: str) -> tuple[At, str]:
    return (
        lambda moment: Tabulated(segments, moment, axes, source),
        f"positions from {utc_text(segments[0].begin)} on",
    )

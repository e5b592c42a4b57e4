"""What Python has of online.h: lengths, numbers of statuses and refusals, and structs, as the header has them."""

import ctypes
import re
from importlib.resources import files

import pytest

from baryscope.estimator.online import OnlineStatus
from baryscope.estimator.online.core import MOST_FEATURES, Options, State, Tumble
from baryscope.estimator.online.estimator import REFUSED
from baryscope.models.keplerian import ELEMENT_COUNT
from baryscope.models.sensor.navigation import STATUSES

HEADER = re.sub(
    r"/\*.*?\*/", "", (files("baryscope.fmu") / "csrc" / "online" / "online.h").read_text("utf-8"), flags=re.DOTALL
)


def constant(name):
    return int(re.search(rf"\b{name} = (\d+)", HEADER)[1])


def names_of(enumeration):
    return re.search(rf"typedef enum {{([^}}]*)}} {enumeration};", HEADER)[1].replace(",", " ").split()


def fields_of(struct):
    """The fields in order, each with how many numbers it has."""
    body = re.search(rf"typedef struct {{([^}}]*)}} {struct};", HEADER)[1]
    declared = re.findall(r"(\w+)((?:\[\w+\])*)(?=[,;])", body.replace("double ", ""))
    lengths = {"N_ELEMENTS": ELEMENT_COUNT}
    found = []
    for name, extents in declared:
        size = 1
        for extent in re.findall(r"\w+", extents):
            size *= lengths[extent] if extent in lengths else int(extent)
        found.append((name, size))
    return found


def test_lengths():
    assert constant("MOST_FEATURES") == MOST_FEATURES
    assert constant("N_ELEMENTS") == ELEMENT_COUNT


def test_statuses_have_the_headers_numbers():
    assert [status.upper() for status in STATUSES] == names_of("OnlineStatus")
    assert [status.value for status in OnlineStatus] == list(STATUSES)


def test_refusals_have_the_headers_numbers():
    """What Python has checked before, or answers by None, has no text here."""
    names = names_of("OnlineResult")
    assert {names[number] for number in REFUSED} == {"BAD_TIME", "BAD_COVARIANCE", "BAD_NAME", "TOO_LATE"}
    assert names[0] == "ACCEPTED"


@pytest.mark.parametrize("kind, struct", [(Options, "OnlineOptions"), (State, "OnlineState"), (Tumble, "OnlineTumble")])
def test_structs_are_those_of_the_header(kind, struct):
    number = ctypes.sizeof(ctypes.c_double)
    assert [(name, ctypes.sizeof(of) // number) for name, of in kind._fields_] == fields_of(struct)

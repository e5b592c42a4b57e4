"""OEM, written from a known orbit, and read back; interpolation against that orbit."""

from xml.sax.saxutils import escape

import numpy as np
import pytest

from baryscope.models.ephemeris.trajectory import kepler_states
from baryscope.models.errors import InputError
from baryscope.models.orbit import Orbit
from baryscope.models.scenario import load_orbit

ORBIT = Orbit(7.1e6, 0.05, 1.3, 0.4, 0.9, 0.3)
EPOCH = "2026-03-01T12:00:00Z"


def epoch_text(seconds):
    moment = np.datetime64("2026-03-01T12:00:00", "us") + np.timedelta64(round(seconds * 1e6), "us")
    return str(moment)


def message(time, meta=(), ahead=0.0):
    """Key-value notation; `ahead` s of the time system before UTC."""
    defaults = {
        "OBJECT_NAME": "TEST", "OBJECT_ID": "2002-009A", "CENTER_NAME": "EARTH", "REF_FRAME": "EME2000",
        "TIME_SYSTEM": "UTC", "START_TIME": epoch_text(time[0]), "STOP_TIME": epoch_text(time[-1]),
    }  # fmt: skip
    lines = ["META_START", *(f"{key} = {value}" for key, value in (defaults | dict(meta)).items()), "META_STOP", ""]
    for t, state in zip(time, kepler_states(ORBIT, time) / 1e3, strict=True):
        lines.append(" ".join([epoch_text(t + ahead), *(f"{value:.12f}" for value in state)]))
    lines += ["COVARIANCE_START", "EPOCH = 2026-03-01T12:00:00", "1.0", "0 1.0", "COVARIANCE_STOP"]
    return "\n".join(lines) + "\n"


HEAD = "CCSDS_OEM_VERS = 2.0\nCREATION_DATE = 2026-03-01T00:00:00\nORIGINATOR = TEST\nCOMMENT hello\n\n"


def as_xml(time):
    states = ""
    for t, state in zip(time, kepler_states(ORBIT, time) / 1e3, strict=True):
        cells = zip(("X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT"), state, strict=True)
        inner = "".join(f"<{name}>{value:.12f}</{name}>" for name, value in cells)
        states += f"<stateVector><EPOCH>{escape(epoch_text(t))}</EPOCH>{inner}</stateVector>"
    meta = "<REF_FRAME>ICRF</REF_FRAME><CENTER_NAME>Earth</CENTER_NAME><TIME_SYSTEM>UTC</TIME_SYSTEM>"
    return f"<oem><body><segment><metadata>{meta}</metadata><data>{states}</data></segment></body></oem>"


def load(tmp_path, text, epoch=EPOCH):
    path = tmp_path / "orbit.oem"
    path.write_text(text, encoding="utf-8")
    return load_orbit(path, epoch)


@pytest.mark.parametrize(("step", "tolerance"), [(60.0, 1e-5), (300.0, 0.02)])
def test_interpolation_between_the_lines(tmp_path, step, tolerance):
    orbit = load(tmp_path, HEAD + message(np.arange(-1800.0, 1801.0, step)))
    time = np.random.default_rng(1).uniform(-1800, 1800, 200)
    found, expected = orbit.ephemeris.states(time), kepler_states(ORBIT, time)
    np.testing.assert_allclose(found[:, :3], expected[:, :3], atol=tolerance)
    np.testing.assert_allclose(found[:, 3:], expected[:, 3:], atol=tolerance / 10)
    assert orbit.ephemeris.axes == "EME2000"
    np.testing.assert_allclose(orbit.elements, ORBIT.elements, rtol=1e-8)


def test_xml_time_systems_and_time_0(tmp_path):
    time = np.arange(0.0, 601.0, 60.0)
    expected = kepler_states(ORBIT, time[2:5])
    forms = [as_xml(time), HEAD + message(time, {"TIME_SYSTEM": "GPS"}, ahead=18.0)]
    for text in forms:
        orbit = load(tmp_path, text, "2026-03-01T12:02:00Z")
        np.testing.assert_allclose(orbit.ephemeris.states(time[2:5] - 120.0), expected, atol=1e-5)


def test_segments_keep_their_jumps_and_their_useable_times(tmp_path):
    """Two segments with the same positions, the later one of another orbit; each is used where it is of use."""
    first = message(np.arange(0.0, 601.0, 60.0), {"USEABLE_STOP_TIME": epoch_text(500)})
    second = message(np.arange(480.0, 1201.0, 60.0), {"USEABLE_START_TIME": epoch_text(550)})
    orbit = load(tmp_path, HEAD + first + second)
    time = np.array([10.0, 499.0, 551.0, 1190.0])
    np.testing.assert_allclose(orbit.ephemeris.states(time), kepler_states(ORBIT, time), atol=1e-4)
    with pytest.raises(InputError, match=r"has no position at 2026-03-01T12:08:45Z, expected within .*12:08:20Z and"):
        orbit.ephemeris.states(np.array([525.0]))


TIME = np.arange(0.0, 601.0, 60.0)
BAD = {
    "axes": (HEAD + message(TIME, {"REF_FRAME": "ITRF2000"}), "REF_FRAME is ITRF2000, expected one of EME2000"),
    "centre": (HEAD + message(TIME, {"CENTER_NAME": "MARS"}), "CENTER_NAME is MARS, expected EARTH"),
    "system": (HEAD + message(TIME, {"TIME_SYSTEM": "MET"}), "line 16: TIME_SYSTEM is MET, expected UTC"),
    "order": (HEAD + message(TIME[::-1]), "segment 1: times that do not ascend"),
    "one": (HEAD + message(TIME[:1]), "segment 1: 1 positions, expected at least two"),
    "none": (HEAD, "no segment, expected an OEM with META_START"),
    "cells": (HEAD + message(TIME).replace("COVARIANCE_START", "2026-03-01T12:30:00 1 2"), "3 values, expected a time"),
    "number": (HEAD + message(TIME).replace("COVARIANCE_START", "2026-03-01T12:30:00 a 2 3 4 5 6"), "numbers of km"),
    "nan": (HEAD + message(TIME).replace("COVARIANCE_START", "2026-03-01T12:30:00 nan 2 3 4 5 6"), "near the Earth"),
    "meta": (HEAD + message(TIME).replace("OBJECT_NAME =", "hello"), "expected KEY = value"),
    "states first": (HEAD + "2026-03-01T12:30:00 1 2 3 4 5 6\n", r"5 6' in the header, expected KEY = value"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_files_in_one_line(tmp_path, name):
    text, expected = BAD[name]
    with pytest.raises(InputError, match=expected) as caught:
        load(tmp_path, text)
    assert "\n" not in str(caught.value)


def test_time_0_outside(tmp_path):
    with pytest.raises(InputError, match=r"has no position at 2026-04-01T00:00:00Z, expected within 2026-03-01T12:00"):
        load(tmp_path, HEAD + message(TIME), "2026-04-01")

"""TLE and OMM against the published test vectors of SGP4, which its package brings."""

import json
from importlib.resources import files

import numpy as np
import pytest

from baryscope.models.ephemeris.utc import utc_of, utc_text
from baryscope.models.errors import InputError
from baryscope.models.scenario import load_orbit

TLE = """\
1 00005U 58002B   00179.78495062  .00000023  00000-0  28098-4 0  4753
2 00005  34.2682 348.7242 1859667 331.7664  19.3264 10.82419157413667
"""
OMM = {
    "CCSDS_OMM_VERS": "2.0",
    "CREATION_DATE": "2000-07-01T00:00:00",
    "ORIGINATOR": "TEST",
    "OBJECT_NAME": "VANGUARD 1",
    "OBJECT_ID": "1958-002B",
    "CENTER_NAME": "EARTH",
    "REF_FRAME": "TEME",
    "TIME_SYSTEM": "UTC",
    "MEAN_ELEMENT_THEORY": "SGP4",
    "EPOCH": "2000-06-27T18:50:19.733568",
    "MEAN_MOTION": "10.82419157",
    "ECCENTRICITY": "0.1859667",
    "INCLINATION": "34.2682",
    "RA_OF_ASC_NODE": "348.7242",
    "ARG_OF_PERICENTER": "331.7664",
    "MEAN_ANOMALY": "19.3264",
    "BSTAR": "0.000028098",
    "MEAN_MOTION_DOT": "0.00000023",
    "MEAN_MOTION_DDOT": "0",
}


def vectors():
    """Time (k,) in s from the epoch, states (k, 6) in m and m/s of satellite 5, as published."""
    text = (files("sgp4") / "tcppver.out").read_text(encoding="utf-8")
    rows = [line.split() for line in text[text.index("5 xx") : text.index("4632 xx")].splitlines()[1:]]
    values = np.array([row[:7] for row in rows], dtype=float)
    return values[:, 0] * 60, values[:, 1:] * 1e3


def written(path, text):
    path.write_text(text, encoding="utf-8")
    return path


def as_lines(fields):
    return "".join(f"{key} = {value}{' [deg]' if key == 'INCLINATION' else ''}\n" for key, value in fields.items())


def as_xml(fields):
    def tags(names):
        return "".join(f"<{name}>{fields[name]}</{name}>" for name in names if name in fields)

    keys = list(fields)
    return (
        '<?xml version="1.0" encoding="UTF-8"?><ndm xmlns="urn:ccsds:schema:ndmxml"><omm id="CCSDS_OMM_VERS"><body>'
        f"<segment><metadata>{tags(keys[3:9])}</metadata><data><meanElements>{tags(keys[9:16])}</meanElements>"
        f"<tleParameters>{tags(keys[16:])}</tleParameters></data></segment></body></omm></ndm>"
    )


FORMS = {
    "two lines": TLE,
    "three lines": "0 VANGUARD 1\n" + TLE,
    "omm": as_lines(OMM),
    "xml": as_xml(OMM),
    "json": json.dumps(OMM),
    "json array": json.dumps([OMM], indent=1),
}


@pytest.mark.parametrize("form", FORMS)
def test_published_positions(tmp_path, form):
    """A hundredth of a metre, the digits of the epoch; the vectors are 25 digits of the same program in C++."""
    epoch = utc_text(utc_of("2000-06-27T18:50:19.733568", "here"))
    orbit = load_orbit(written(tmp_path / "orbit.txt", FORMS[form]), epoch)
    time, expected = vectors()
    found = orbit.ephemeris.states(time)
    np.testing.assert_allclose(found[:, :3], expected[:, :3], atol=0.05)
    np.testing.assert_allclose(found[:, 3:], expected[:, 3:], atol=1e-4)
    assert orbit.ephemeris.axes == "TEME"
    assert orbit.epoch == epoch
    assert orbit.accuracy == pytest.approx(1e3, abs=0.1)


def test_another_time_0_is_a_shift(tmp_path):
    path = written(tmp_path / "satellite.tle", TLE)
    orbit = load_orbit(path, "2000-06-28T00:50:19.733568")
    time, expected = vectors()
    np.testing.assert_allclose(orbit.ephemeris.states(time - 21600.0)[:, :3], expected[:, :3], atol=0.05)
    assert orbit.accuracy == pytest.approx(1e3 + 0.25 * 2e3, abs=0.1)  # six hours from the epoch
    # The elements osculate at time 0: there the published ones of the six hours line.
    assert orbit.semi_major_axis == pytest.approx(8635341.424, abs=100)  # with another μ
    assert orbit.eccentricity == pytest.approx(0.185684, abs=2e-5)
    degrees = np.rad2deg([orbit.inclination, orbit.raan, orbit.argument_of_periapsis, orbit.true_anomaly]) % 360
    np.testing.assert_allclose(degrees, [34.26805, 347.97998, 332.85746, 252.46796], atol=2e-3)


BAD = {
    "time 0 unknown": (TLE, None, r"mean elements of 2000-06-27T18:50:19\.7.*expected --epoch with its UTC"),
    "checksum": (TLE.replace("4753", "4754"), "2000-06-28", r"line 1: found the checksum 4, expected 3"),
    "two satellites": (TLE + TLE, "2000-06-28", r"4 lines, expected two-line elements of one satellite"),
    "other satellite": (
        TLE.replace("2 00005", "2 00014").replace("13667", "13667"),
        "2000-06-28",
        r"line 2: (satellite 00014, expected 00005|found the checksum)",
    ),
    "cut": (TLE[:100], "2000-06-28", r"line 2: '2 00005 .*', expected line 2 of two-line elements, 69 characters"),
    "theory": (as_lines(OMM | {"MEAN_ELEMENT_THEORY": "SGP4-XP"}), "2000-06-28", "MEAN_ELEMENT_THEORY is SGP4-XP"),
    "axes": (as_lines(OMM | {"REF_FRAME": "EME2000"}), "2000-06-28", "REF_FRAME is EME2000, expected TEME"),
    "no number": (as_lines(OMM | {"MEAN_MOTION": "fast"}), "2000-06-28", "MEAN_MOTION is 'fast', expected a number"),
    "impossible": (as_lines(OMM | {"ECCENTRICITY": "1.5"}), "2000-06-28", "expected the mean elements of an Earth"),
    "missing": (as_lines({k: v for k, v in OMM.items() if k != "BSTAR"}), "2000-06-28", "BSTAR is missing"),
    "epoch": (as_lines(OMM | {"EPOCH": "yesterday"}), "2000-06-28", "EPOCH: found 'yesterday', expected a UTC time"),
    "entities": ("<!DOCTYPE a [<!ENTITY b 'c'>]><omm/>", "2000-06-28", "XML with a document type"),
    "xml": ("<omm>", "2000-06-28", "expected an OMM or OEM in XML"),
    "empty xml": ("<omm/>", "2000-06-28", "0 sets of mean elements in XML"),
    "json": ('{"MEAN_MOTION": 1', "2000-06-28", "expected an OMM in JSON"),
    "long ago": (
        TLE,
        "2150-06-28",
        r"2000-06-27.* days from time 0 of the tracks, expected elements of within 30 days",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_files_in_one_line(tmp_path, name):
    text, epoch, expected = BAD[name]
    path = written(tmp_path / "bad.txt", text)
    with pytest.raises(InputError, match=expected) as caught:
        load_orbit(path, epoch)
    assert "\n" not in str(caught.value)

"""Orbit messages with a part replaced: an orbit, or one line that says what is wrong, and no warning."""

import json

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from baryscope.models.errors import InputError
from baryscope.models.scenario import load_orbit

TLE = """\
1 00005U 58002B   00179.78495062  .00000023  00000-0  28098-4 0  4753
2 00005  34.2682 348.7242 1859667 331.7664  19.3264 10.82419157413667
"""
FIELDS = {
    "EPOCH": "2000-06-27T18:50:19.733568", "MEAN_MOTION": 10.82419157, "ECCENTRICITY": 0.1859667,
    "INCLINATION": 34.2682, "RA_OF_ASC_NODE": 348.7242, "ARG_OF_PERICENTER": 331.7664, "MEAN_ANOMALY": 19.3264,
    "BSTAR": 0.000028098,
}  # fmt: skip
OMM = "CCSDS_OMM_VERS = 2.0\n" + "".join(f"{key} = {value}\n" for key, value in FIELDS.items())
XML = (
    "<omm><segment><metadata/><data><meanElements>"
    + "".join(f"<{key}>{value}</{key}>" for key, value in FIELDS.items())
    + "</meanElements></data></segment></omm>"
)
OEM = """CCSDS_OEM_VERS = 2.0
META_START
REF_FRAME = ICRF
TIME_SYSTEM = UTC
META_STOP
2000-06-27T18:00:00 7000 0 0 0 7.5 0
2000-06-27T18:10:00 6000 4000 0 -4 6 0
2000-06-27T19:10:00 -6000 -4000 10 4 -6 0
"""
GOOD = [TLE, OMM, json.dumps(FIELDS), XML, OEM]
SNIPPETS = [
    "",
    "\n",
    "0",
    "-",
    "1e999",
    "nan",
    "9" * 30,
    "é",
    "\0",
    "[",
    "}",
    "<",
    "2",
    " ",
    "99999",
    "1 ",
    "=",
    "META_START\n",
]


@given(st.sampled_from(GOOD), st.floats(0, 1), st.integers(0, 30), st.sampled_from(SNIPPETS) | st.text(max_size=5))
@settings(max_examples=200, deadline=None)
def test_a_part_replaced(tmp_path_factory, good, share, length, snippet):
    place = int(share * len(good))
    path = tmp_path_factory.getbasetemp() / "hostile.txt"
    path.write_text(good[:place] + snippet + good[place + length :], encoding="utf-8", errors="replace")
    said, states = "", np.zeros(1)
    try:
        orbit = load_orbit(path, "2000-06-27T18:50:00")
        states = orbit.ephemeris.states(np.array([0.0, 60.0])) if orbit.ephemeris is not None else states
    except InputError as error:
        said = str(error)
    assert "\n" not in said
    assert np.isfinite(states).all()

"""Mean elements of the Earth's satellites, from TLE and OMM, propagated by SGP4 (Vallado et al. 2006)."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sgp4.api import SGP4_ERRORS, WGS72, Satrec
from sgp4.io import compute_checksum
from sgp4.omm import initialize

from baryscope.models.ephemeris.utc import DAY, Moment, seconds_between, utc_of, utc_text
from baryscope.models.errors import InputError

FloatArray = NDArray[np.float64]

JULIAN_1950 = 2433282.5  # the Julian date of 1950-01-01
AT_EPOCH, EACH_DAY = 1e3, 2e3  # m, standard deviation along the orbit, at the epoch and more for each day from it
LINE = 69  # characters of a line of two-line elements
NUMBERS = (
    "MEAN_MOTION",
    "ECCENTRICITY",
    "INCLINATION",
    "RA_OF_ASC_NODE",
    "ARG_OF_PERICENTER",
    "MEAN_ANOMALY",
    "BSTAR",
)
OPTIONAL = {
    "MEAN_MOTION_DOT": "0",
    "MEAN_MOTION_DDOT": "0",
    "CLASSIFICATION_TYPE": "U",
    "EPHEMERIS_TYPE": "0",
    "ELEMENT_SET_NO": "0",
    "REV_AT_EPOCH": "0",
}
FIXED = {
    "CENTER_NAME": ("EARTH",),
    "REF_FRAME": ("TEME",),
    "TIME_SYSTEM": ("UTC",),
    "MEAN_ELEMENT_THEORY": ("SGP", "SGP4"),
}


@dataclass(frozen=True, eq=False)
class MeanElements:
    """A satellite's mean elements, propagated by SGP4 from time 0 at the moment `begin`; its axes are TEME.

    source: names the file in errors.
    """

    satellite: Satrec
    begin: Moment
    source: str

    axes = "TEME"

    def states(self, time: FloatArray) -> FloatArray:
        """Position and velocity (n, 6), m and m/s, at times (n,) in s.

        Raises:
            InputError: SGP4 has no position then, as after the satellite's decay.
        """
        elapsed = seconds_between(utc_of("1950-01-01", ""), self.begin)
        whole = np.floor(elapsed / DAY)
        parts = (elapsed - whole * DAY + time) / DAY
        errors, position, velocity = self.satellite.sgp4_array(np.full(len(time), JULIAN_1950 + whole), parts)
        if errors.any():
            bad = int(np.argmax(errors != 0))
            raise InputError(
                f"{self.source}: SGP4 has no position {time[bad]:g} s after {utc_text(self.begin)} "
                f"({SGP4_ERRORS[int(errors[bad])]}), expected elements of about the time of the tracks"
            )
        return np.asarray(1e3 * np.hstack([position, velocity]))

    @property
    def accuracy(self) -> float:
        """The standard deviation of the place along the orbit at time 0, m (Vallado et al. 2006, AIAA 2006-6753)."""
        return AT_EPOCH + EACH_DAY * abs(seconds_between(self.epoch, self.begin)) / DAY

    @property
    def epoch(self) -> Moment:
        """The epoch of the elements."""
        days = self.satellite.jdsatepoch - JULIAN_1950
        nanoseconds = round(days) * 86_400_000_000_000 + round(self.satellite.jdsatepochF * 864e5) * 1_000_000
        return utc_of("1950-01-01", "") + np.timedelta64(nanoseconds, "ns")


def satellite_of_lines(text: str, source: str) -> Satrec:
    """The satellite of two lines of elements, with or without a line with its name before them.

    Raises:
        InputError: not such lines, or those of more than one satellite.
    """
    lines = [line.rstrip() for line in text.splitlines() if line.strip()]
    place = f"{source}, line"
    first = next((index for index, line in enumerate(lines) if line.startswith("1 ")), 0)
    if first > 1 or len(lines) != first + 2:
        raise InputError(
            f"{source}: {len(lines)} lines, expected two-line elements of one satellite (two or three lines)"
        )
    pair = lines[first:]
    for number, line in zip("12", pair, strict=True):
        where = f"{place} {first + int(number)}"
        if not line.startswith(f"{number} ") or len(line) < LINE - 1 or not line.isascii():
            raise InputError(f"{where}: {line[:24]!r}, expected line {number} of two-line elements, {LINE} characters")
        if len(line) >= LINE and line[LINE - 1] != str(compute_checksum(line)):
            raise InputError(f"{where}: found the checksum {line[LINE - 1]}, expected {compute_checksum(line)}")
    if pair[0][2:7] != pair[1][2:7]:
        raise InputError(
            f"{place} {first + 2}: satellite {pair[1][2:7]}, expected {pair[0][2:7]} as in the line before"
        )
    try:
        return _refused_if_wrong(Satrec.twoline2rv(*pair), source)
    except ValueError as error:
        raise InputError(f"{source}: {str(error).splitlines()[0]}, expected two-line elements") from error


def satellite_of_fields(fields: Mapping[str, str], source: str) -> Satrec:
    """The satellite of the fields of an OMM.

    Raises:
        InputError: a field is missing, is no number, or names another theory or other axes than SGP4's.
    """
    for name, values in FIXED.items():
        if name in fields and fields[name].upper() not in values:
            raise InputError(f"{source}: {name} is {fields[name]}, expected {' or '.join(values)}")
    chosen = OPTIONAL | dict(fields)
    for name in ("EPOCH", *NUMBERS):
        if name not in chosen:
            raise InputError(f"{source}: {name} is missing, expected the mean elements of SGP4")
    for name in (*NUMBERS, "MEAN_MOTION_DOT", "MEAN_MOTION_DDOT"):
        try:
            finite = np.isfinite(float(chosen[name]))
        except ValueError:
            finite = False
        if not finite:
            raise InputError(f"{source}: {name} is {chosen[name][:40]!r}, expected a number")
    epoch = utc_of(chosen["EPOCH"], f"{source}: EPOCH").astype("datetime64[us]")
    chosen |= {"EPOCH": str(epoch), "OBJECT_ID": "", "NORAD_CAT_ID": "0"} | {
        name: OPTIONAL[name] for name in ("EPHEMERIS_TYPE", "ELEMENT_SET_NO", "REV_AT_EPOCH")
    }
    satellite = Satrec()
    initialize(satellite, chosen, WGS72)
    return _refused_if_wrong(satellite, source)


def _refused_if_wrong(satellite: Satrec, source: str) -> Satrec:
    if satellite.error:
        raise InputError(f"{source}: {SGP4_ERRORS[satellite.error]}, expected the mean elements of an Earth satellite")
    return satellite

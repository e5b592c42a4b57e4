"""Units of length in which tracks may be given."""

import re
from typing import Literal, get_args

from baryscope.estimator.tracks import FeatureTracks, FloatArray
from baryscope.models.errors import InputError

Unit = Literal["m", "cm", "mm", "in", "ft", "km"]
METRES: dict[str, float] = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254, "ft": 0.3048, "km": 1e3}
"""Metres in a unit."""
SPELLINGS: dict[str, tuple[str, ...]] = {
    "m": ("metre", "meter"),
    "cm": ("centimetre", "centimeter"),
    "mm": ("millimetre", "millimeter"),
    "in": ("inch", "inches"),
    "ft": ("foot", "feet"),
    "km": ("kilometre", "kilometer"),
}
"""What files say for a unit besides, in any case, and with an s."""
_MEANT = {name + end: unit for unit, names in SPELLINGS.items() for name in (unit, *names) for end in ("", "s")}


_SQUARE = re.compile(r"\s*(.+?)\s*(?:\^|\*\*)?\s*2\s*")


def in_square_of(covariance: FloatArray, unit: str, told: str, source: str, denied: str | None = None) -> FloatArray:
    """Covariances in the square of a unit, from those in the square that is told, as mm2, mm^2 or mm**2.

    denied: what the positions are said to be in, where the unit is told to be another one instead: covariances in its
    square are then in that of the unit, too.

    Raises:
        InputError: what is told is no square of a unit of length.
    """
    found = _SQUARE.fullmatch(told)
    own = None if found is None else _MEANT.get(found[1].lower())
    if own is None:
        raise InputError(f"{source}: in {told!r}, expected the square of a unit of length, as mm2")
    meant = _MEANT.get(unit.strip().lower(), own)  # of another unit `in_metres` tells
    if denied is not None and own == _MEANT.get(denied.strip().lower()):
        return covariance
    return covariance if own == meant else covariance * (METRES[own] / METRES[meant]) ** 2


def in_metres(tracks: FeatureTracks, unit: str, source: str) -> FeatureTracks:
    """Tracks in metres, from tracks whose positions are in a unit, however spelt, and whose covariances in its square.

    Raises:
        InputError: there is no such unit; `source` names what has it.
    """
    meant = _MEANT.get(str(unit).strip().lower())
    if meant is None:
        raise InputError(f"{source}: lengths in {unit!r}, expected one of {', '.join(get_args(Unit))}")
    factor = METRES[meant]
    if factor == 1.0:
        return tracks
    covariance = None if tracks.covariance is None else tracks.covariance * factor**2
    return FeatureTracks(tracks.time, tracks.position * factor, tracks.labels, covariance, tracks.epoch)

"""Marker tracks as .c3d, as the format's manual has it (www.c3d.org): little-endian, floating-point, in mm."""

import struct
from collections.abc import Sequence

import numpy as np

from baryscope.estimator.formats.c3d_file import BLOCK, INTEL, KEY, TEXT
from baryscope.estimator.formats.markers import refuse_untold
from baryscope.estimator.tracks import FeatureTracks, FloatArray
from baryscope.models.errors import InputError
from baryscope.models.words import counted

LIST = 255  # entries of a parameter, characters of an entry, and blocks of parameters
MOST_COUNTED = 0xFFFF  # frames, in 16 bits
UNEVEN = 0.1  # of a frame: times that were rounded to milliseconds are as uneven at 200 Hz
GAP = 10  # frames that a program may interpolate; the manual's own example
SCALE = -0.1  # mm; below 0: numbers are floating-point
Value = Sequence[str] | Sequence[int] | Sequence[float]


def c3d_bytes(tracks: FeatureTracks, name: str) -> bytes:
    """Tracks, in m, as the content of a C3D file of that name, in mm, in single precision; `read_c3d` restores them.

    What is not seen has the residual -1. Frames are counted from the recording's begin, time 0.

    Raises:
        InputError: they have covariances or an epoch, which C3D has no place for; times before 0 or of no steady rate;
            or longer or more labels than it holds.
    """
    refuse_untold(tracks, name, "C3D")
    rate, first = _rate_of(tracks.time, name)
    count, m = tracks.seen.shape
    if longest := [label for label in tracks.labels if len(label.encode()) > LIST]:
        raise InputError(f"{name}: found the label {longest[0][:40]}…, expected {LIST} bytes at most, as C3D holds")
    last = first + count - 1
    lists = {f"LABELS{k + 1 if k else ''}": tracks.labels[LIST * k : LIST * (k + 1)] for k in range(-(-m // LIST))}
    point: dict[str, Value] = {"USED": [m], "SCALE": [SCALE], "RATE": [rate], "DATA_START": [0]}
    point |= {"FRAMES": [_signed(min(count, MOST_COUNTED))], "UNITS": ["mm"], **lists}
    if count > MOST_COUNTED:
        point["LONG_FRAMES"] = [float(count)]
    ends = {f"ACTUAL_{end}_FIELD": [_signed(at & 0xFFFF), at >> 16] for end, at in (("START", first), ("END", last))}
    groups: dict[str, dict[str, Value]] = {"POINT": point, "ANALOG": {"USED": [0]}, "TRIAL": {**ends}}
    blocks = len(_parameters(groups)) // BLOCK
    if blocks > LIST:
        raise InputError(f"{name}: found {m} markers, whose labels are more than C3D holds")
    start = 2 + blocks
    point["DATA_START"] = [start]
    header = struct.pack(
        "<BB5Hf2Hf", 2, KEY, m, 0, *np.minimum([first, last], MOST_COUNTED), GAP, SCALE, start, 0, rate
    )
    values = np.zeros((count, m, 4), "<f4")
    values[..., :3] = np.where(tracks.seen[..., None], 1e3 * tracks.position, 0.0)
    values[..., 3] = np.where(tracks.seen, 0.0, -1.0)
    return b"".join([_filled(header), _parameters(groups), _filled(values.tobytes())])


def _rate_of(time: FloatArray, name: str) -> tuple[float, int]:
    """Frames a second, in single precision as it is written, and the number of the first, from 1.

    Raises:
        InputError: there is none by which all times are those of frames, from 0 on.
    """
    if len(time) < 2:
        raise InputError(f"{name}: found {counted(len(time), 'frame')}, expected two or more, which tell a rate")
    rate = float(np.float32((len(time) - 1) / (time[-1] - time[0])))
    first = round(time[0] * rate)
    off = np.abs(time * rate - first - np.arange(len(time)))
    if first < 0 or off.max() > UNEVEN:
        raise InputError(
            f"{name}: found the time {time[np.argmax(off)]:g} s, expected times that C3D can tell, k / {rate:g} s with "
            "whole numbers k from 0 on; other forms have them"
        )
    return rate, first + 1


def _signed(word: int) -> int:
    return word - 0x10000 if word >= 0x8000 else word


def _parameters(groups: dict[str, dict[str, Value]]) -> bytes:
    """The blocks of parameters."""
    entries = []
    for number, (group, parameters) in enumerate(groups.items(), 1):
        entries.append(_entry(-number, group, b""))
        entries += [_entry(number, name, _value(values)) for name, values in parameters.items()]
    content = b"".join(entries) + b"\0\0"
    blocks = -(-(len(content) + 4) // BLOCK)
    return _filled(struct.pack("<4B", 1, KEY, min(blocks, LIST), INTEL) + content)


def _entry(group: int, name: str, value: bytes) -> bytes:
    """A group or parameter, without a description; the step to the next one counts from itself on."""
    return struct.pack("<bb", len(name), group) + name.encode() + struct.pack("<H", 3 + len(value)) + value + b"\0"


def _value(values: Value) -> bytes:
    """Type, dimensions and content of a parameter: texts, integers of 16 bits or numbers of 32."""
    texts = [value.encode() for value in values if isinstance(value, str)]
    if texts:
        width = max(map(len, texts))
        return struct.pack("<bBBB", TEXT, 2, width, len(texts)) + b"".join(text.ljust(width) for text in texts)
    whole = all(isinstance(value, int) for value in values)
    return (
        struct.pack("<bBB", 2 if whole else 4, 1, len(values)) + np.array(values, "<i2" if whole else "<f4").tobytes()
    )


def _filled(content: bytes) -> bytes:
    """With zeros up to a whole block."""
    return content.ljust(-(-len(content) // BLOCK) * BLOCK, b"\0")

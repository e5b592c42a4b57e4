"""Marker tracks in .c3d, the binary form of motion capture."""

import numpy as np

from baryscope.estimator.formats.c3d_file import BLOCK, KEY, Header, Numbers, Parameters, frames_of, parameters_of
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import InputError
from baryscope.models.files import AnyPath, read_bytes

WHAT = "marker tracks in C3D"
MOST_FRAMES = 0xFFFF  # that the header can count
OUTPUTS = (
    "ANGLES",
    "FORCES",
    "MOMENTS",
    "POWERS",
    "SCALARS",
    "REACTIONS",
)  # parameters that list points which are none


def read_c3d(path: AnyPath) -> tuple[FeatureTracks, str]:
    """The tracks, in the file's unit, and that unit, empty if it tells none; time 0 is that of the recording's begin.

    Points that the file lists as angles, forces and other outputs of a model, as Vicon Nexus writes them, are left out:
    they are no positions.

    Raises:
        InputError: no such file, one that is damaged, or no markers in it.
    """
    source = str(path)
    content = read_bytes(path, WHAT)
    if len(content) < BLOCK or content[1] != KEY:
        raise InputError(
            f"{source}: not {WHAT}, whose second byte is {KEY:#x} and which have a header of {BLOCK} bytes"
        )
    numbers = Numbers.of(content, source)
    header, parameters = Header.of(content, numbers), parameters_of(content, numbers, source)
    if not header.points:
        raise InputError(f"{source}: no markers, expected the positions of some in frames")
    first, count = _frames(content, header, parameters, source)
    position, valid = frames_of(content, numbers, header, count)
    position[~valid] = np.nan
    about = parameters.get("POINT", {})
    time = (first + np.arange(count)) / _rate(about, header, source)
    told = _listed(about, "LABELS", header.points)
    outputs = {label for name in OUTPUTS for label in _listed(about, name, header.points)}
    markers = [index for index, label in enumerate(told) if label not in outputs or not label]
    if not markers:
        raise InputError(f"{source}: no markers, only outputs of a model as {told[0]!r}, expected positions in frames")
    labels = _labels(told)
    try:
        tracks = FeatureTracks(time, position[:, markers], [labels[index] for index in markers])
    except InputError as error:
        raise InputError(f"{source}: {error}") from error
    return tracks, str(next(iter(about.get("UNITS", [])), ""))


def _frames(content: bytes, header: Header, parameters: Parameters, source: str) -> tuple[int, int]:
    """The first frame, from 0, and how many there are.

    Where they are more than the header can count, which then has the most that it can, or what is left of 16 bits, they
    are in parameters of which recorders have one or another, else in the length of the file, which zeros fill up to a
    block.

    Raises:
        InputError: there are none, or fewer than the header or the parameters tell.
    """
    first, count = max(header.first - 1, 0), header.last - header.first + 1
    there = max(len(content) - header.offset, 0) // header.frame if header.offset > 0 else 0
    begin, told = _told_frames(parameters, first)
    if header.last == MOST_FRAMES:
        if told is None:
            told = min(-(-len(content[header.offset :].rstrip(b"\0")) // header.frame), there)
        first, count = begin, max(told, count)
    elif told is not None and (told == count or count < told <= there):  # else they are of a longer recording
        first, count = begin, told
    if count < 1 or there < 1:
        raise InputError(f"{source}: no frames, expected the positions of markers in some")
    if there < count:
        needed = header.offset + count * header.frame
        raise InputError(f"{source}: {len(content)} bytes, its header tells of {needed}: cut short")
    return first, count


def _told_frames(parameters: Parameters, first: int) -> tuple[int, int | None]:
    """First frame, from 0, and number of frames in parameters with more than 16 bits; `first` and None without such."""
    trial = parameters.get("TRIAL", {})
    ends = [_integers(trial.get(f"ACTUAL_{end}_FIELD", [])) for end in ("START", "END")]
    if all(len(words) == 2 for words in ends):
        begin, end = (low % 0x10000 + 0x10000 * high for low, high in ends)
        return max(begin - 1, 0), end - begin + 1
    long = _integers(parameters.get("POINT", {}).get("LONG_FRAMES", []))
    return first, long[0] if long else None


def _integers(values: list[object]) -> list[int]:
    """The numbers among a parameter's values, which are floating-point in some files."""
    return [int(value) for value in values if isinstance(value, int | float) and np.isfinite(value)]


def _rate(about: dict[str, list[object]], header: Header, source: str) -> float:
    """Frames a second.

    Raises:
        InputError: none are told.
    """
    found = (*about.get("RATE", []), header.rate)
    told = [value for value in found if isinstance(value, int | float) and 0 < value < np.inf]
    if not told:
        raise InputError(f"{source}: no rate of frames in POINT:RATE or the header, expected a number above 0")
    return told[0]


def _listed(about: dict[str, list[object]], name: str, count: int) -> list[str]:
    """The texts in a parameter of `count` points, beyond 255 in NAME2 and so on; empty where there are none."""
    lists = [name, *(f"{name}{k}" for k in range(2, 2 + count // 255))]
    told = [str(label).strip() for one in lists for label in about.get(one, [])][:count]
    return told + [""] * (count - len(told))


def _labels(told: list[str]) -> list[str]:
    """The points' labels.

    Points without one get a number; so do those that share one, as of unnamed trajectories, so that none is meant by
    it alone.
    """
    shared = {label for label in told if told.count(label) > 1}
    return [
        f"{label or 'marker'} {number}" if not label or label in shared else label
        for number, label in enumerate(told, 1)
    ]

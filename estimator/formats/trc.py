"""Marker tracks in .trc, the text form of Motion Analysis and OpenSim: two lines of facts, labels, coordinates."""

from collections.abc import Mapping
from itertools import pairwise
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.formats.markers import refuse_untold
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import InputError
from baryscope.models.files import AnyPath, decoded, read_bytes
from baryscope.models.words import counted

FloatArray = NDArray[np.float64]

WHAT = "marker tracks in TRC"
FACTS, VALUES, LABELS, FIRST = 1, 2, 3, 5  # lines from 0


def read_trc(path: AnyPath) -> tuple[FeatureTracks, str]:
    """The tracks, in the file's unit, and that unit, empty if it tells none.

    A marker is not seen where its cells are empty or NaN.

    Raises:
        InputError: one line that names file and line, what was found and what was expected.
    """
    source = str(path)
    lines = _text(read_bytes(path, WHAT), source).split("\n")
    if len(lines) < FIRST or not lines[0].startswith("PathFileType"):
        raise InputError(f"{source}: not {WHAT}, which begin with PathFileType and have five lines before the frames")
    facts = dict(zip(lines[FACTS].split("\t"), lines[VALUES].split("\t"), strict=False))
    unit = facts.get("Units", "").strip()
    head = lines[LABELS].rstrip().split("\t")
    if [cell.strip() for cell in head[:2]] != ["Frame#", "Time"]:
        raise InputError(
            f"{source}, line {LABELS + 1}: begins with {', '.join(head[:2])[:40]!r}, expected Frame# and Time, and "
            "tabs between cells"
        )
    at = [column for column, cell in enumerate(head) if column > 1 and cell.strip()]
    if not at or at[0] != 2 or any(second - first != 3 for first, second in pairwise(at)):
        raise InputError(f"{source}, line {LABELS + 1}: expected a label above each three columns, from the third on")
    rows = [(number, line) for number, line in enumerate(lines[FIRST:], FIRST + 1) if line.strip()]
    numbers = np.array([_row(line, 2 + 3 * len(at), f"{source}, line {number}") for number, line in rows])
    if not len(numbers):
        raise InputError(f"{source}: no frames after line {FIRST}")
    _refuse_contradictions(facts, len(numbers), len(at), f"{source}, line {VALUES + 1}")
    position = numbers[:, 2:].reshape(len(numbers), len(at), 3)
    try:
        return FeatureTracks(numbers[:, 1], position, [head[column] for column in at]), unit
    except InputError as error:
        raise InputError(f"{source}: {error}") from error


def _text(content: bytes, source: str) -> str:
    """A file's text; recorders on Windows write its path, and labels, in Latin 1, others in UTF-8."""
    try:
        return decoded(content, source, WHAT)
    except InputError:
        return decoded(content.decode("latin-1").encode(), source, WHAT)


def write_trc(tracks: FeatureTracks, name: str, stream: TextIO) -> None:
    """Write tracks, in m, as TRC of that name, in mm, with empty cells for what is not seen; `read_trc` restores them.

    Raises:
        InputError: they have covariances or an epoch, or a label a tab or line break, which TRC has no place for.
    """
    refuse_unfit(tracks, name)
    frames, m = len(tracks.time), len(tracks.labels)
    rate = f"{1 / np.median(np.diff(tracks.time)) if frames > 1 else 1.0:.9g}"
    facts = {"DataRate": rate, "CameraRate": rate, "NumFrames": frames, "NumMarkers": m, "Units": "mm"}
    facts |= {"OrigDataRate": rate, "OrigDataStartFrame": 1, "OrigNumFrames": frames}
    rows: list[list[object]] = [["PathFileType", 4, "(X/Y/Z)", name], [*facts], [*facts.values()]]
    rows.append(["Frame#", "Time", *(cell for label in tracks.labels for cell in (label, "", ""))])
    rows.append(["", "", *(f"{axis}{index}" for index in range(1, m + 1) for axis in "XYZ")])
    rows.append([])
    for index, cells in enumerate((1e3 * tracks.position).reshape(frames, -1).tolist()):
        told = ("" if np.isnan(value) else f"{value:.15g}" for value in cells)
        rows.append([index + 1, f"{tracks.time[index]:.15g}", *told])
    stream.writelines("\t".join(map(str, row)) + "\n" for row in rows)


def refuse_unfit(tracks: FeatureTracks, name: str) -> None:
    """Check that tracks can be written as TRC of that name.

    Raises:
        InputError: as of `write_trc`.
    """
    refuse_untold(tracks, name, "TRC")
    if bad := [label for label in tracks.labels if label != label.strip() or set(label) & set("\t\r\n") or not label]:
        raise InputError(f"{name}: found the label {bad[0]!r}, expected one without tabs, line breaks and blank ends")


def _refuse_contradictions(facts: Mapping[str, str], frames: int, markers: int, place: str) -> None:
    """Check the facts of the second and third line, as far as they are there, against what follows.

    Raises:
        InputError: others are true, as in a file that is cut short.
    """
    for name in ("NumFrames", "NumMarkers", "DataRate"):
        said = facts.get(name, "").strip()
        if said and not _positive(said):
            raise InputError(f"{place}: {name} is {said[:40]!r}, expected a number above 0")
    for name, found, what in (("NumFrames", frames, "frame"), ("NumMarkers", markers, "marker")):
        said = facts.get(name, "").strip()
        if said and float(said) != found:
            raise InputError(f"{place}: {name} is {said[:40]}, expected {found}, as {counted(found, what)} follow")


def _positive(text: str) -> bool:
    try:
        return 0 < float(text) < np.inf
    except ValueError:
        return False


def _row(line: str, columns: int, place: str) -> FloatArray:
    """Frame number, time and coordinates; NaN for empty cells, also those that a line ends without."""
    cells = line.split("\t")
    if any(cell.strip() for cell in cells[columns:]):
        raise InputError(f"{place}: {len(cells)} cells, expected {columns}")
    cells = [cell.strip() for cell in cells[:columns]] + [""] * (columns - len(cells))
    numbers: list[float] = []
    try:
        numbers.extend(float(cell) if cell else np.nan for cell in cells)
    except ValueError as error:
        column = len(numbers)
        raise InputError(
            f"{place}, column {column + 1}: found {cells[column][:40]!r}, expected a number, with a point, or nothing"
        ) from error
    return np.array(numbers)

"""Marker tracks in .trc, the text form of Motion Analysis and OpenSim: two lines of facts, labels, coordinates."""

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

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
    text, source = decoded(read_bytes(path, WHAT), str(path), WHAT), str(path)
    lines = text.splitlines()
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
    try:
        return np.array([float(cell) if cell else np.nan for cell in cells])
    except ValueError as error:
        raise InputError(f"{place}: {error}, expected numbers between tabs") from error

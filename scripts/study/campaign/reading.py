"""Reading runs.jsonl: in blocks of whole lines, so that the memory it takes does not grow with the file.

A line that is no run of the plan is refused with its number: what is appended from a campaign of another seed, program
or scenario doesn't pass for a part of this one. A last line that was torn is none. A run that stands twice counts once,
if it is the same but for its wall times.
"""

import io
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from baryscope.models.errors import InputError
from baryscope.models.files import AnyPath
from baryscope.study.campaign.folder import HEADER, RUNS
from baryscope.study.campaign.plan import Plan
from baryscope.study.campaign.vary import ANOMALY

BLOCK = 1 << 22  # bytes that are read at a time; polars takes some 20 times as much for them
NUMBERS = ("rmse", "max_error", "predicted_rmse", "rejected_share", "body_error", "body_nees")
BOUNDS = ("path_rmse", "path_rmse_clean", "body_rmse")
WRONG = (pl.exceptions.PolarsError, ValueError)


@dataclass(frozen=True, eq=False)
class Block:
    """Whole lines, which of them are runs that did not stand before, and these runs."""

    lines: bytes
    fresh: NDArray[np.bool_]
    frame: pl.DataFrame


def varied_fields(plan: Plan) -> list[str]:
    """The fields whose values stand in each line."""
    return [one.field for one in plan.ranges] + ([ANOMALY] if "anomaly" in plan.vary else [])


def schema_of(plan: Plan) -> dict[str, Any]:
    """What a line of a plan's runs holds."""
    number, text = pl.Float64(), pl.String()
    outcome = pl.Struct(
        dict.fromkeys(NUMBERS, number) | {"nees": pl.List(number), "trustworthy": pl.Boolean(), "failure": text}
    )
    return {
        "plan": text,
        "seed": pl.Int64(),
        "scenario": text,
        "case": pl.Int64(),
        "varied": pl.Struct(dict.fromkeys(varied_fields(plan), number)),
        "bound": pl.Struct(dict.fromkeys(BOUNDS, number) | {"verdict": text, "failure": text}),
        "methods": pl.Struct(dict.fromkeys(plan.methods, outcome)),
        "warnings": pl.List(text),
        "wall": pl.Struct(dict.fromkeys(("flight", "bound", *plan.methods), number)),
    }


class Ended:
    """Which draws of which scenarios have ended: eight bytes for each, a hash of its line without the wall times."""

    def __init__(self, plan: Plan) -> None:
        self._places = {entry.name: k for k, entry in enumerate(plan.entries)}
        self._hashes = np.zeros((len(plan.entries), plan.draws), dtype=np.uint64)

    def of(self, scenario: str) -> NDArray[np.bool_]:
        """Whether each draw of a scenario has ended."""
        ended: NDArray[np.bool_] = self._hashes[self._places[scenario]] != 0
        return ended

    @property
    def count(self) -> int:
        """How many runs have ended."""
        return int(np.count_nonzero(self._hashes))

    def added(self, frame: pl.DataFrame) -> tuple[NDArray[np.bool_], int | None]:
        """Which runs are new, and the row of one that differs from the one that stood there; None if there is none."""
        places = frame["scenario"].replace_strict(self._places, return_dtype=pl.Int64).to_numpy()
        keys = places * self._hashes.shape[1] + frame["case"].to_numpy()
        hashes = frame.drop("wall").hash_rows().to_numpy() | np.uint64(1)
        first = np.zeros(len(keys), dtype=bool)
        first[np.unique(keys, return_index=True)[1]] = True
        flat = self._hashes.reshape(-1)
        fresh = first & (flat[keys] == 0)
        flat[keys[fresh]] = hashes[fresh]
        other = np.flatnonzero(flat[keys] != hashes)
        return fresh, int(other[0]) if other.size else None


def blocks_of(folder: AnyPath, plan: Plan, ended: Ended | None = None) -> Iterator[Block]:
    """The runs that have ended, block by block; `ended` is told of them.

    Raises:
        InputError: a line that is no run of this plan, or a second one of a draw that differs from the first.
    """
    path = Path(folder) / RUNS
    ended = Ended(plan) if ended is None else ended
    first = 1
    for lines in _whole_lines(path):
        try:
            frame = _parsed(lines, plan)
            whole = len(frame) == lines.count(b"\n") and not _strangers(frame, plan).any()
        except WRONG:
            whole = False
        if not whole:
            raise _wrong_line(lines, plan, path, first)
        fresh, other = ended.added(frame)
        if other is not None:
            where = f"{path}: line {first + other} is of {frame['scenario'][other]}, draw {frame['case'][other]}"
            raise InputError(f"{where}, and differs from a line above; expected each draw once")
        yield Block(lines, fresh, frame.filter(pl.Series(fresh)))
        first += len(frame)


def sound_length(folder: AnyPath) -> int:
    """How many bytes of the runs are whole lines; what is behind them was torn.

    Raises:
        InputError: the file cannot be read.
    """
    path = Path(folder) / RUNS
    try:
        with path.open("rb") as stream:
            size = stream.seek(0, io.SEEK_END)
            start, tail = size, b""
            while start > 0 and tail.count(b"\n") < 2:
                start = max(0, start - (1 << 16))
                stream.seek(start)
                tail = stream.read(size - start)
    except FileNotFoundError:
        return 0
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}, expected the runs of a campaign") from error
    whole = tail.rfind(b"\n") + 1
    begin = tail.rfind(b"\n", 0, max(whole - 1, 0)) + 1
    last = tail[begin:whole]  # its end may be there when its middle is not
    return start + (whole if not last or _is_object(last) else begin)


def _is_object(line: bytes) -> bool:
    try:
        return len(pl.read_ndjson(io.BytesIO(line), schema={"case": pl.Int64})) == 1
    except WRONG:
        return False


def _whole_lines(path: Path) -> Iterator[bytes]:
    """The file without a torn end, some whole lines at a time."""
    left = sound_length(path.parent)
    if not left:
        return
    rest = b""
    with path.open("rb") as stream:
        while left and (read := stream.read(min(BLOCK, left))):
            left -= len(read)
            read = rest + read
            cut = read.rfind(b"\n") + 1
            rest = read[cut:]
            if cut:
                yield read[:cut]


def _parsed(lines: bytes, plan: Plan) -> pl.DataFrame:
    return pl.read_ndjson(io.BytesIO(lines), schema=schema_of(plan))


def _strangers(frame: pl.DataFrame, plan: Plan) -> pl.Series:
    """For each run whether it is none of the plan's."""
    known = pl.col("scenario").is_in([entry.name for entry in plan.entries]) & pl.col("case").is_between(
        0, plan.draws - 1
    )
    there = [pl.col("plan") == plan.identity, pl.col("bound").is_not_null(), pl.col("wall").is_not_null()]
    for label in plan.methods:
        outcome = pl.col("methods").struct.field(label)
        there.append(outcome.struct.field("rmse").is_not_null() | outcome.struct.field("failure").is_not_null())
    return frame.select(~pl.all_horizontal(known, *there).fill_null(False)).to_series()


def _wrong_line(lines: bytes, plan: Plan, path: Path, first: int) -> InputError:
    """What to say of the first line of some that is no run."""
    for number, line in enumerate(lines.splitlines(keepends=True), start=first):
        where = f"{path}: line {number}"
        try:
            frame = _parsed(line, plan)
        except WRONG:
            return InputError(f"{where} is not the JSON of a run, expected one run a line")
        if len(frame) != 1 or frame.select("scenario", "case", "plan").row(0).count(None):
            return InputError(f"{where} is not the JSON of a run, expected one run a line")
        if _strangers(frame, plan).any():
            scenario, case, identity, seed = frame.select("scenario", "case", "plan", "seed").row(0)
            if identity != plan.identity:
                said = f"of another plan ({identity}, seed {seed}), expected runs of {HEADER} ({plan.identity}"
                return InputError(f"{where} is {said}, seed {plan.seed})")
            return InputError(f"{where} is of {scenario}, draw {case}, expected a run of {HEADER}")
    return InputError(f"{path}: lines from {first} on are not the JSON of runs, expected one run a line")

"""The result: the path of the centre of mass, and how it came about."""

import csv
import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.tables.tracks import COVARIANCE_COLUMNS, UPPER
from baryscope.models.errors import InputError
from baryscope.models.files import AnyPath, replacing

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Estimate:
    """The centre of mass in C at every time of the tracks: time (n,) in s, position (n, 3) in m.

    covariance (n, 3, 3) in m², or None where the method has none to give; diagnostics: plain values for JSON.
    """

    time: FloatArray
    position: FloatArray
    covariance: FloatArray | None = None
    diagnostics: dict[str, Any] = field(default_factory=dict)

    def write(self, path: AnyPath) -> None:
        """Write the path as a CSV file, and the diagnostics beside it with the suffix .json.

        Raises:
            InputError: a file cannot be written, or the two names are one.
        """
        path = Path(path)
        beside = path.with_suffix(".json")
        if beside == path:
            raise InputError(f"{path}: this name is kept for the diagnostics, expected another suffix than .json")
        n = len(self.time)
        columns: list[list[object]] = [self.time.tolist(), *(self.position[:, axis].tolist() for axis in range(3))]
        for row, column in UPPER:
            columns.append([""] * n if self.covariance is None else self.covariance[:, row, column].tolist())
        with replacing(beside) as temporary_json, replacing(path) as temporary:
            with temporary.open("w", encoding="utf-8", newline="") as stream:
                writer = csv.writer(stream, lineterminator="\n")
                writer.writerow(("time", "x", "y", "z", *COVARIANCE_COLUMNS))
                writer.writerows(zip(*columns, strict=True))
            text = json.dumps(_strict(self.diagnostics), indent=2, ensure_ascii=False, allow_nan=False)
            temporary_json.write_text(text + "\n", encoding="utf-8")


def _strict(value: Any) -> Any:
    """The value with numpy's numbers and arrays as plain ones, and null for what JSON has no number for."""
    if isinstance(value, dict):
        return {str(key): _strict(item) for key, item in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [_strict(item) for item in value]
    if isinstance(value, np.bool_):
        return bool(value)
    if isinstance(value, np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    return value

"""The attitude of a camera over time, from a table of quaternions, smooth between its rows."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from baryscope.estimator.camera.between_rows import interpolated
from baryscope.estimator.geometry.alignment import matrix_from_quaternion
from baryscope.estimator.limits import LATEST
from baryscope.estimator.tables.form import Form
from baryscope.estimator.tables.table import read_table
from baryscope.models.arguments import array_of
from baryscope.models.checks import UNIT_TOLERANCE
from baryscope.models.ephemeris.utc import Utc, seconds_between, utc_of, utc_text
from baryscope.models.errors import InputError
from baryscope.models.files import AnyPath, read_bytes
from baryscope.models.words import brief

FloatArray = NDArray[np.float64]

COLUMNS = ("time", "qw", "qx", "qy", "qz")
FORM = Form("the camera's attitude in CSV", COLUMNS, clock="time")
SAME_TIME = 1e-6  # s: a time so near a row's takes its attitude
WIDEST_TURN = np.deg2rad(10.0)  # from row to row, between which the attitude is interpolated
LONGEST_GAP = 10.0  # median intervals: what the camera did in a longer one is not known


@dataclass(frozen=True, eq=False, init=False)
class AttitudeSeries:
    """The camera's attitude: time (k,) in s, ascending; quaternion (k, 4), w x y z, that turns camera axes into C.

    epoch: UTC of time 0 in ISO 8601, given as text or as datetime, or None if it is not known. Signs are such that
    successive quaternions are near each other.

    Raises:
        InputError: a shape, an order or a value is not as above, or a quaternion's length is not 1.
    """

    time: FloatArray
    quaternion: FloatArray
    epoch: str | None

    __repr__ = brief

    def __init__(self, time: ArrayLike, quaternion: ArrayLike, epoch: Utc | None = None) -> None:
        times, values = array_of("camera's attitude: time", time), array_of("camera's attitude: quaternion", quaternion)
        if times.ndim != 1 or not len(times) or values.shape != (len(times), 4):
            raise InputError(
                f"camera's attitude: time has the shape {times.shape} and quaternion {values.shape}, "
                "expected (k,) and (k, 4)"
            )
        failure = _failure(times, values)
        if failure is not None:
            raise InputError(f"camera's attitude, row {failure[0]}: {failure[1]}")
        unit = values / np.linalg.norm(values, axis=1, keepdims=True)
        flips = np.sign(np.einsum("ki,ki->k", unit[1:], unit[:-1]))
        unit[1:] *= np.cumprod(np.where(flips < 0, -1.0, 1.0))[:, None]
        object.__setattr__(self, "time", times.copy())
        object.__setattr__(self, "quaternion", unit)
        object.__setattr__(self, "epoch", None if epoch is None else utc_text(utc_of(epoch, "epoch")))

    @classmethod
    def read_csv(cls, path: AnyPath) -> "AttitudeSeries":
        """Read a file of rows `time,qw,qx,qy,qz`, in the order of time; the header names the columns in any order.

        Times are seconds, or UTC in ISO 8601; time 0 is then the first.

        Raises:
            InputError: one line that names file and line, what was found and what was expected.
        """
        table = read_table(read_bytes(path, FORM.what), str(path), FORM)
        numbers = table.columns.numbers
        times, values = numbers["time"], np.column_stack([numbers[name] for name in COLUMNS[1:]])
        failure = _failure(times, values)
        if failure is not None:
            raise InputError(f"{table.place(failure[0])}: {failure[1]}")
        epoch = table.columns.epoch
        return cls(times, values, None if epoch is None else utc_text(epoch))

    def at(self, time: FloatArray, epoch: str | None = None) -> FloatArray:
        """The rotations (n, 3, 3) R_C_camera at times (n,) in s from `epoch`.

        Raises:
            InputError: a time is outside the rows' or in a gap, the camera turns too far between two rows, or only one
                of the series and the times has an epoch.
        """
        lag = self._lag(epoch)
        moments = time + lag
        outside = (moments < self.time[0] - SAME_TIME) | (moments > self.time[-1] + SAME_TIME)
        if outside.any():
            raise InputError(
                f"camera's attitude: none for the time {time[np.argmax(outside)]:.10g} s, "
                f"expected rows that span it, found {self._from_to(0, -1, lag)}"
            )
        if len(self.time) == 1:
            return np.repeat(matrix_from_quaternion(self.quaternion), len(time), axis=0)
        left = np.minimum(self._before(moments), len(self.time) - 2)
        interval = self.time[left + 1] - self.time[left]
        share = np.clip((moments - self.time[left]) / interval, 0.0, 1.0)
        between = (share * interval > SAME_TIME) & ((1 - share) * interval > SAME_TIME)
        begin, end = self.quaternion[left], self.quaternion[left + 1]
        half = np.arctan2(np.linalg.norm(end - begin, axis=1), np.linalg.norm(end + begin, axis=1))  # a quarter turn's
        self._refuse_gaps(left, between, 4 * half, lag)
        return interpolated(self.time, self.quaternion, left, self.time[left] + share * interval)

    def sharing(self, time: FloatArray, epoch: str | None = None) -> FloatArray:
        """How many of the times (n,) in s from `epoch` lie between the same two rows, or at the first of them, (n,).

        They share these rows' errors.

        Raises:
            InputError: only one of the series and the times has an epoch.
        """
        _, place, count = np.unique(self._before(time + self._lag(epoch)), return_inverse=True, return_counts=True)
        return np.asarray(count[place], dtype=np.float64)

    def _before(self, moments: FloatArray) -> NDArray[np.intp]:
        """The rows (n,) before times (n,) of the series, or at them."""
        return np.maximum(np.searchsorted(self.time, moments, side="right") - 1, 0)

    def _lag(self, epoch: str | None) -> float:
        """Seconds to add to times from an epoch for the series' own."""
        if self.epoch is None and epoch is None:
            return 0.0
        if self.epoch is None or epoch is None:
            dated, other = ("tracks", "attitude") if self.epoch is None else ("attitude", "tracks")
            raise InputError(
                f"camera's attitude: UTC times of the {dated}, but seconds of the {other}, expected the same of both"
            )
        return seconds_between(utc_of(self.epoch, "epoch"), utc_of(epoch, "epoch"))

    def _from_to(self, first: int, last: int, lag: float) -> str:
        """The times of two rows, for errors: in the seconds of those who ask, which are less by the lag."""
        return f"{self.time[first] - lag:.10g} to {self.time[last] - lag:.10g} s"

    def _refuse_gaps(self, left: NDArray[np.intp], between: NDArray[np.bool_], turn: FloatArray, lag: float) -> None:
        """Check that the attitude is not interpolated over a long interval or a wide turn; lag: see `_from_to`."""
        intervals = np.diff(self.time)
        longest = LONGEST_GAP * float(np.median(intervals))
        long = between & (intervals[left] > longest)
        if long.any():
            row = int(left[np.argmax(long)])
            raise InputError(
                f"camera's attitude: no row from {self._from_to(row, row + 1, lag)}, where there are tracks, "
                f"expected intervals of at most {longest:.3g} s (ten times the median)"
            )
        wide = between & (turn > WIDEST_TURN)
        if wide.any():
            row = int(left[np.argmax(wide)])
            raise InputError(
                f"camera's attitude: turns by {np.rad2deg(turn[np.argmax(wide)]):.3g}° from "
                f"{self._from_to(row, row + 1, lag)}, expected at most {np.rad2deg(WIDEST_TURN):.0f}° from row to row"
            )


def _failure(time: FloatArray, quaternion: FloatArray) -> tuple[int, str] | None:
    """The first row that is not valid, and what is wrong with it."""
    length = np.linalg.norm(quaternion, axis=1)
    previous = np.concatenate([[-np.inf], time[:-1]])
    wrong: tuple[tuple[NDArray[np.bool_], Callable[[int], str]], ...] = (
        (~(np.abs(time) <= LATEST), lambda row: f"time {time[row]}, expected a number within ±{LATEST:g} s"),
        (~np.isfinite(length), lambda _: "an empty cell, expected numbers of qw, qx, qy and qz"),
        (
            ~(np.abs(length - 1) <= UNIT_TOLERANCE),
            lambda row: f"quaternion of length {length[row]:.6g}, expected 1 (qw is the scalar part)",
        ),
        (
            ~(time > previous),
            lambda row: f"time {time[row]} after {previous[row]}, expected strictly increasing times",
        ),
    )
    found = [(int(np.argmax(rows)), said) for rows, said in wrong if rows.any()]
    if not found:
        return None
    row, said = min(found, key=lambda one: one[0])
    return row, said(row)

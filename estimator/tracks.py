"""Tracks of features on the target's surface, the input of the estimators, in memory and as a CSV file."""

import csv
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from numpy.typing import ArrayLike, NDArray

from baryscope.estimator.camera.camera import Camera
from baryscope.estimator.camera.shared import SharedErrors
from baryscope.estimator.geometry.symmetric import elements_of, is_covariance
from baryscope.estimator.limits import COARSEST, FARTHEST, FINEST, LATEST, SHORTEST_STEP, STRETCHED
from baryscope.estimator.tables.table import read_table
from baryscope.estimator.tables.tracks import COLUMNS, COVARIANCE_COLUMNS, FORM, arrays_of, refuse_covariances
from baryscope.models.arguments import array_of, instance_of
from baryscope.models.ephemeris.utc import Utc, utc_of, utc_text
from baryscope.models.errors import InputError
from baryscope.models.files import AnyPath, read_bytes, write_together
from baryscope.models.words import counted

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]


@dataclass(frozen=True, eq=False, init=False)
class FeatureTracks:
    """Positions of labelled features in frame C (origin at the chaser, inertial axes), frame by frame.

    time (n,) in s, strictly increasing; position (n, m, 3) in m, all three NaN, or masked, where a feature is not
    seen;
    covariance (n, m, 3, 3) in m², or None; labels, one per feature, each once, are kept without blanks around; epoch:
    UTC of time 0 in ISO 8601, given as text or as datetime, or None if it is not known; camera: the turning one through
    which they were seen, whose errors they share (`Camera.inertial`), or None. Files have no camera.

    Times, steps, positions and covariances lie within the ranges of `limits`. Arrays are copied: what becomes of those
    that were given changes nothing.

    Raises:
        InputError: a shape, an order or a value is not as above.
    """

    time: FloatArray
    position: FloatArray
    labels: tuple[str, ...]
    covariance: FloatArray | None
    epoch: str | None
    camera: Camera | None

    def __init__(
        self,
        time: ArrayLike,
        position: ArrayLike,
        labels: Sequence[str],
        covariance: ArrayLike | None = None,
        epoch: Utc | None = None,
        camera: Camera | None = None,
    ) -> None:
        if camera is not None:
            instance_of("camera", camera, Camera, "as of Camera.load")
        object.__setattr__(self, "camera", camera)
        object.__setattr__(self, "labels", labels_of("labels", labels))
        object.__setattr__(self, "covariance", None)
        given = {"time": time, "position": position} | ({} if covariance is None else {"covariance": covariance})
        for name, value in given.items():
            object.__setattr__(self, name, array_of(name, value).copy())
        object.__setattr__(self, "epoch", None if epoch is None else utc_text(utc_of(epoch, "epoch")))
        self._check_shapes()
        self._check_values()

    def __repr__(self) -> str:
        """How much they tell, in a line."""
        n, m = self.seen.shape
        about = [f"{100 * self.seen.mean():.3g} % seen" if m else "nothing seen"]
        about += ["with covariances"] if self.covariance is not None else []
        about += [f"time 0 is {self.epoch}"] if self.epoch is not None else []
        span = f"{counted(n, 'frame')} from {self.time[0]:g} to {self.time[-1]:g} s"
        return f"<FeatureTracks: {span}, {counted(m, 'feature')}, {', '.join(about)}>"

    @property
    def seen(self) -> BoolArray:
        """Which features are seen in which frames, (n, m)."""
        return np.asarray(~np.isnan(self.position[..., 0]))

    def of_features(self, labels: Sequence[str]) -> "FeatureTracks":
        """The tracks of some features at all times, in the order of the labels.

        Raises:
            InputError: there is no feature of a label, or one stands twice.
        """
        labels = labels_of("labels", labels)
        missing = next((label for label in labels if label not in self.labels), None)
        if missing is not None:
            raise InputError(f"label {missing!r}: expected some of {', '.join(self.labels)}")
        columns = [self.labels.index(label) for label in labels]
        covariance = None if self.covariance is None else self.covariance[:, columns]
        return replace(self, position=self.position[:, columns], labels=labels, covariance=covariance)

    @classmethod
    def read_csv(cls, path: AnyPath) -> "FeatureTracks":
        """Read a file of one row per observation, `time,feature,x,y,z[,cxx,cxy,cxz,cyy,cyz,czz]`, in any order.

        Times are seconds, or UTC in ISO 8601; time 0 is then the earliest. A row whose position is empty, or NaN, NA or
        another word that pandas takes for a missing value, means that the feature is not seen. If the feature is empty,
        too, the row only gives the time of a frame without observations.

        Raises:
            InputError: one line that names file, line and column, what was found and what was expected.
        """
        table = read_table(read_bytes(path, FORM.what), str(path), FORM)
        arrays, epoch = arrays_of(table), table.columns.epoch
        try:
            return cls(*arrays, epoch=None if epoch is None else utc_text(epoch))
        except InputError as error:
            refuse_covariances(table)  # names the line if a covariance is the cause
            raise InputError(f"{path}: {error}") from error

    def refuse_singular(self, place: Callable[[int, int], str] | None = None) -> None:
        """Check that the covariances are positive definite, with standard deviations within the ranges of `limits`.

        place: where an observation stands, from its frame and feature; begins the error.

        Raises:
            InputError: one is not.
        """
        if self.covariance is None:
            return
        seen = self.seen
        values = np.linalg.eigvalsh(self.covariance[seen])
        least, greatest = values[:, 0], values[:, 2]
        wrong = (least < FINEST**2) | (greatest > COARSEST**2) | (greatest > STRETCHED**2 * least)
        if wrong.any():
            first = int(np.argmax(wrong))
            frame, feature = np.argwhere(seen)[first].tolist()
            smallest, largest = np.sqrt(np.maximum([least[first], greatest[first]], 0.0))
            where = f"{self.labels[feature]!r} at {self.time[frame]} s"
            begin = "" if place is None else f"{place(frame, feature)}: "
            raise InputError(
                f"{begin}covariance of feature {where} has standard deviations "
                f"of {smallest:.2g} to {largest:.2g} m, expected {FINEST:g} to {COARSEST:g} m and a ratio of at most "
                f"{STRETCHED:g}"
            )

    def write_csv(self, path: AnyPath) -> None:
        """Write the tracks so that `read_csv` restores them exactly, with times of empty frames and order of labels.

        Raises:
            InputError, DiskError: the file cannot be written.
        """
        write_together({Path(path): self.write_rows})

    def write_rows(self, stream: TextIO) -> None:
        """Write the file of `write_csv` to a text stream that does not translate line ends."""
        columns = self.columns()
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*map(_cells, columns.values()), strict=True))

    def columns(self) -> dict[str, NDArray[Any]]:
        """The columns of a table of these tracks by name: times in s, or UTC if the epoch is known, labels, numbers.

        Where a feature is not seen, numbers are NaN; a row without a feature has None. See `rows`.
        """
        frame, feature = self.rows()
        there = self.seen[frame, feature, None]  # of feature -1, too, whose frame has none
        labels = np.array([*self.labels, None], dtype=object)[feature]
        numbers = np.where(there, self.position[frame, feature], np.nan)
        found = dict(zip(COLUMNS, (_moments(self.time[frame], self.epoch), labels, *numbers.T), strict=True))
        if self.covariance is not None:
            upper = np.where(there, elements_of(self.covariance[frame, feature]), np.nan)
            found |= dict(zip(COVARIANCE_COLUMNS, upper.T, strict=True))
        return found

    def rows(self) -> tuple[IntArray, IntArray]:
        """The frame and the feature of each row of a table of these tracks, frame by frame.

        The first frame lists all features, which keeps their order; a frame without any has one row, with feature -1.
        """
        listed = self.seen
        listed[:1] = True
        frame, feature = np.nonzero(listed)
        blank = np.nonzero(~listed.any(axis=1))[0]
        frame, feature = np.append(frame, blank), np.append(feature, np.full(len(blank), -1))
        order = np.argsort(frame, kind="stable")
        return frame[order], feature[order]

    def _check_shapes(self) -> None:
        n, m = len(self.time) if self.time.ndim == 1 else -1, len(self.labels)
        if n < 1:
            raise InputError(f"time has the shape {self.time.shape}, expected (n,) with n >= 1")
        if self.position.shape != (n, m, 3):
            raise InputError(
                f"position has the shape {self.position.shape}, expected ({n}, {m}, 3) for {counted(n, 'time')} and "
                f"{counted(m, 'label')}"
            )
        if self.covariance is not None and self.covariance.shape != (n, m, 3, 3):
            raise InputError(f"covariance has the shape {self.covariance.shape}, expected ({n}, {m}, 3, 3)")

    def _check_values(self) -> None:
        self._check_times()
        self._check_labels()
        unseen, far = np.isnan(self.position), np.abs(self.position) > FARTHEST
        partly = (unseen != unseen[..., :1]).any(axis=-1) if unseen.any() else np.zeros(unseen.shape[:2], dtype=bool)
        if partly.any():
            where = self._name(partly)
            raise InputError(f"position of {where} is partly NaN, expected three finite numbers or three NaN")
        if far.any():
            infinite = np.asarray(np.isinf(self.position).any(axis=-1))
            if infinite.any():
                where = self._name(infinite)
                raise InputError(f"position of {where} is infinite, expected three finite numbers or three NaN")
            where = self._name(np.asarray(far.any(axis=-1)))
            raise InputError(f"position of {where} is far off, expected coordinates within ±{FARTHEST:g} m")
        if self.covariance is not None:
            self._check_covariances(self.covariance)

    def _check_times(self) -> None:
        bad = np.nonzero(~np.isfinite(self.time))[0]
        if bad.size:
            raise InputError(f"time of frame {bad[0]} is {self.time[bad[0]]}, expected a finite number")
        bad = np.nonzero(np.abs(self.time) > LATEST)[0]
        if bad.size:
            raise InputError(f"time of frame {bad[0]} is {self.time[bad[0]]} s, expected within ±{LATEST:g} s")
        bad = np.nonzero(np.diff(self.time) < SHORTEST_STEP)[0]
        if bad.size:
            first, second = self.time[bad[0] : bad[0] + 2]
            wanted = "strictly increasing times" if second <= first else f"steps of at least {SHORTEST_STEP:g} s"
            raise InputError(f"time goes from {first} to {second}, expected {wanted}")

    def _check_covariances(self, covariance: FloatArray) -> None:
        wrong, seen = np.zeros(self.position.shape[:2], dtype=bool), self.seen
        given = covariance.reshape(-1, 3, 3) if seen.all() else covariance[seen]
        if given.size and max(np.fmax.reduce(given, axis=None), -np.fmin.reduce(given, axis=None)) > COARSEST**2:
            wrong[seen] = (np.abs(given) > COARSEST**2).any(axis=(-2, -1))
            raise InputError(f"covariance of {self._name(wrong)}: expected numbers within ±{COARSEST**2:g} m²")
        wrong[seen] = ~is_covariance(given)
        if wrong.any():
            raise InputError(f"covariance of {self._name(wrong)} is not a symmetric positive semidefinite matrix")

    def _check_labels(self) -> None:
        for label in self.labels:
            if not label or "\n" in label or "\r" in label:
                raise InputError(f"label {label!r}: expected a text that is not empty and has no line break")
            try:
                label.encode()
            except UnicodeEncodeError as error:
                raise InputError(f"label {label!r} cannot be written in UTF-8") from error
        if len(set(self.labels)) != len(self.labels):
            twice = next(label for label in self.labels if self.labels.count(label) > 1)
            raise InputError(f"label {twice!r} stands twice, expected each feature once")

    def _name(self, wrong: BoolArray) -> str:
        frame, feature = np.argwhere(wrong)[0]
        return f"feature {self.labels[feature]!r} at {self.time[frame]} s"


def errors_of(tracks: FeatureTracks) -> SharedErrors | None:
    """The errors of the tracks' camera at their times; None without a camera."""
    return None if tracks.camera is None else tracks.camera.errors(tracks.time, tracks.epoch)


def labels_of(name: str, labels: Sequence[str]) -> tuple[str, ...]:
    """Labels without blanks around.

    Raises:
        InputError: they are none, or one is no text; the message has `name`.
    """
    if not isinstance(labels, Iterable):
        raise InputError(f"{name}: found {labels!r}, expected a text for each feature")
    return tuple(map(_label, labels))


def _label(label: object) -> str:
    if not isinstance(label, str):
        raise InputError(f"label {label!r}: expected a text")
    return label.strip()


def _moments(time: FloatArray, epoch: str | None) -> NDArray[Any]:
    """Times (n,) as they are, or in UTC if the epoch is known."""
    if epoch is None:
        return time
    return np.asarray(utc_of(epoch, "epoch") + np.round(time * 1e9).astype("timedelta64[ns]"))


def _cells(values: NDArray[Any]) -> list[object]:
    """A column as the cells of a CSV file, empty for NaN and None."""
    if values.dtype.kind == "M":
        return [utc_text(moment) for moment in values]
    return ["" if cell is None or cell != cell else cell for cell in values.tolist()]  # NaN differs from itself

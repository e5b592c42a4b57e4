"""What `baryscope estimate` predicts: where the centre of mass, or a point of the body, is at times without frames."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from cyclopts import Parameter
from numpy.typing import NDArray

from baryscope.estimator.limits import LATEST
from baryscope.estimator.methods import PREDICTING, TURNING
from baryscope.estimator.prediction import Point, Prediction
from baryscope.estimator.result import Estimate
from baryscope.estimator.tables.times import read_times_in
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import ComputationError, InputError
from baryscope.models.words import counted

MOST_ROWS = 100_000


@dataclass(frozen=True)
class Refused:
    """A prediction that cannot be made of an estimate, and why."""

    reason: str


@dataclass(frozen=True, eq=False)
class AskedFor:
    """Times (n,) in s of a prediction, and the point."""

    time: NDArray[np.float64]
    point: Point

    def made(self, result: Estimate) -> Prediction | Refused:
        """The prediction of an estimate, which stands without one: there may be no tumble that a point could follow."""
        try:
            return result.predict(self.time, self.point)
        except (ComputationError, InputError) as error:
            return Refused(str(error))


@Parameter(name="*")
@dataclass(frozen=True)
class PredictionChoices:
    """What is predicted.

    Parameters
    ----------
    predict
        Seconds after the last frame, or, below zero, before the first one (pivot, ml, ekf): position and velocity with
        their covariance, at the tracks' sampling until then, go into a file of the output's name with .prediction.csv.
    predict_at
        A CSV file with the column `time`, in s as in the tracks or UTC, ascending: the same at these times, which may
        lie before, between and after the frames, in gaps, too.
    point
        The point of the body to predict (ml, ekf): the label of a feature, or x,y,z in m in the axes of the cluster of
        most frames, from the centroid of its features, as in `features` of the .json file. Default: the centre of mass.
    """

    predict: float | None = None
    predict_at: Path | None = None
    point: str | None = None

    def check(self, method: str) -> None:
        """Check the options before anything is read.

        Raises:
            InputError: a method that cannot predict this, a span that is none, or a point without one.
        """
        if self.predict is None and self.predict_at is None:
            if self.point is not None:
                expected = "expected --predict SECONDS or --predict-at TIMES.csv, too"
                raise InputError(f"--point: found {self.point} without a time, {expected}")
            return
        if self.predict is not None and self.predict_at is not None:
            raise InputError(f"--predict: found {self.predict:g} beside --predict-at, expected one of the two")
        if self.predict is not None and not 0 < abs(self.predict) <= LATEST:
            expected = f"expected seconds ahead, or back below 0, at most {LATEST:g} of them"
            raise InputError(f"--predict: found {self.predict:g}, {expected}")
        able = PREDICTING if self.point is None else TURNING
        if method not in able:
            asked = "--predict" if self.predict_at is None else "--predict-at"
            name = asked if self.point is None else "--point"
            why = "which has attitudes in its frames only, " if method == "pivot" else ""
            expected = f"{', '.join(able[:-1])} or {able[-1]}"
            raise InputError(f"{name}: found with --method {method}, {why}expected {expected}")

    def of(self, tracks: FeatureTracks, epoch: str | None) -> "AskedFor | None":
        """What is asked for of tracks, of which `epoch` is the UTC of time 0, if known; None if nothing is.

        Raises:
            InputError: a point that is none, too many times, or a file of times that is wrong.
        """
        if self.predict is None and self.predict_at is None:
            return None
        time = self._times(tracks) if self.predict_at is None else read_times_in(self.predict_at, epoch)
        if len(time) > MOST_ROWS:
            raise InputError(f"{self.predict_at}: found {len(time)} times, expected {MOST_ROWS} at most")
        return AskedFor(time, self._point_of(tracks))

    def _point_of(self, tracks: FeatureTracks) -> Point:
        """The point: a label of the tracks, or coordinates.

        Raises:
            InputError: it is neither.
        """
        if self.point is None or self.point in tracks.labels:
            return self.point
        try:
            values = [float(item) for item in self.point.split(",")]
        except ValueError:
            values = []
        if len(values) != 3 or not all(math.isfinite(value) for value in values):
            few = ", ".join(tracks.labels[:5]) + (", …" if len(tracks.labels) > 5 else "")
            raise InputError(f"--point: found {self.point!r}, expected x,y,z in m or a feature: {few}")
        return values

    def _times(self, tracks: FeatureTracks) -> NDArray[np.float64]:
        """The times (n,) in s, ascending, as far apart as frames usually are, up to the one that is asked for.

        Raises:
            InputError: there are too many.
        """
        assert self.predict is not None  # noqa: S101  asked for
        span = abs(self.predict)
        step = float(np.median(np.diff(tracks.time))) if len(tracks.time) > 1 else span
        if span / step > MOST_ROWS:
            raise InputError(
                f"--predict: found {self.predict:g} s at steps of {step:g} s, expected {MOST_ROWS} at most"
            )
        away = np.append(step * np.arange(1.0, math.ceil(span / step - 1e-9)), span)
        return np.asarray(tracks.time[-1] + away if self.predict > 0 else tracks.time[0] - away[::-1])

    def line(self, found: Prediction, path: Path) -> str:
        """How accurate the prediction is at the time asked for, or between which it is at those of a file."""
        what = "centre of mass" if self.point is None else self.point
        deviations = np.sqrt(np.diagonal(found.covariance, axis1=1, axis2=2).reshape(-1, 2, 3).sum(axis=2))
        if self.predict is None:
            (least, _), (most, fastest) = deviations.min(axis=0), deviations.max(axis=0)
            when = f"at {counted(len(deviations), 'time')}"
            return f"{what} {when}: ±{least:.2g} to ±{most:.2g} m, up to ±{fastest:.2g} m/s; {path}"
        when = f"in {self.predict:g} s" if self.predict > 0 else f"{-self.predict:g} s before the first frame"
        place, rate = deviations[-1 if self.predict > 0 else 0]
        return f"{what} {when}: ±{place:.2g} m, ±{rate:.2g} m/s; {path}"


def prediction_path(target: Path) -> Path:
    """The file of the prediction beside the estimate's."""
    return target.with_suffix(".prediction.csv")

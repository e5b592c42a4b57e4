"""The result of an estimation as values: the path of the centre of mass, its covariance, and findings against models.

See `prose` for sentences and `document` for files.
"""

from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from importlib.metadata import version
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import chdtrc

from baryscope.estimator.details import Details
from baryscope.estimator.findings import MISFITS, UNCHECKED, Finding, FreeAttitudes
from baryscope.estimator.formats.dataset import dataset
from baryscope.estimator.geometry.extent import rms_coordinates, rms_radius
from baryscope.estimator.observability import Observability
from baryscope.estimator.options import Options
from baryscope.estimator.paths.extended_path import Factor
from baryscope.estimator.prediction import Point, Prediction, Predictor, times_of
from baryscope.estimator.registration.intervals import Interval
from baryscope.estimator.widening import UNCHANGED, Widening
from baryscope.models.errors import ComputationError, InputError, Reason
from baryscope.models.words import brief, counted, length

if TYPE_CHECKING:
    from xarray import Dataset

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

VERSION = version("baryscope")
NEGLIGIBLE = 0.05  # probability by chance, above which process noise does not differ from zero
PERSISTENT = 0.5  # share of a feature's observations that are rejected, above which the feature is rejected


class Status(StrEnum):
    """Whether an estimate can be used."""

    GOOD = "good"
    NOT_CONVERGED = "not converged"
    NOT_OBSERVABLE = "not observable"
    MODEL_DOES_NOT_FIT = "model does not fit"
    NOT_CHECKED = "not checked"

    @property
    def trustworthy(self) -> bool:
        """Whether the covariance describes the position's error; this includes directions that are not observable."""
        return self in (Status.GOOD, Status.NOT_OBSERVABLE)


@dataclass(frozen=True, eq=False)
class Cluster:
    """Features that are seen together: a rigid body with its own axes S (with `ml` all clusters have the same axes).

    labels, and features (m,): their indices in the tracks; frames (n,): indices of the frames with an attitude;
    intervals in which it is seen; points (m, 3) in S from their centroid, m; centre_of_mass (3,) in S from there, m;
    covariance (3, 3) of it, m², in axes attached to the points, None if the method has none.
    """

    labels: tuple[str, ...]
    features: IntArray
    frames: IntArray
    intervals: tuple[Interval, ...]
    points: FloatArray
    centre_of_mass: FloatArray
    covariance: FloatArray | None

    __repr__ = brief

    @property
    def radius(self) -> float:
        """The rms distance of the features from their centroid, m."""
        return rms_radius(self.points)


@dataclass(frozen=True)
class Noise:
    """Standard deviation of an observation's coordinate: a priori, as given or None, and a posteriori, from residuals.

    In m, or, if `relative`, as a factor on the standard deviations of the tracks' covariances. lasting: how many
    successive frames have the same error of a feature, 1 + 2 Σ ρ with its autocorrelations ρ; covariances allow for it.
    """

    a_priori: float | None
    a_posteriori: float
    relative: bool = False
    lasting: float = 1.0


@dataclass(frozen=True)
class ProcessNoise:
    """White acceleration on the path beside its model, the same on every axis.

    source: whether the density is estimated from the tracks, given, or there is no noise; density in m²/s³, or,
    if of_position, variance of white noise of a fixed path's position, m²; 0 for none. If it is estimated: interval,
    the bounds that hold 90 %; significance: 2 ln of the likelihood over that without noise, None if the method does not
    tell. displacement: rms displacement of the path that it explains and the model cannot, m, None if unknown.
    """

    source: Literal["estimated", "given", "none"]
    density: float
    interval: tuple[float, float] | None = None
    significance: float | None = None
    displacement: float | None = None
    of_position: bool = False

    @property
    def negligible(self) -> bool:
        """Whether an estimated density does not differ from zero (by chance in more than 5 %)."""
        return self.density == 0 or (self.significance is not None and self.by_chance > NEGLIGIBLE)

    @property
    def by_chance(self) -> float:
        """The probability of such a significance without any noise.

        The density is at the boundary of its range then: half of χ² with one degree of freedom (Self and Liang 1987).
        """
        return 1.0 if self.significance is None else 0.5 * float(chdtrc(1, max(self.significance, 0.0)))


@dataclass(frozen=True, eq=False)
class Motion:
    """The target's motion at n times; None for what a method does not estimate.

    velocity (n, 3) of the centre of mass in C, m/s. attitude (n, 3, 3) R_C_B of the axes of the cluster of most frames,
    NaN where it has no attitude; angular_rate (n, 3), rad/s in B. Covariances (n, 3, 3): of the velocity in C, (m/s)²;
    of the attitude, a small rotation vector in B, rad²; of the rate in B, (rad/s)². B is attached to the points of the
    cluster, whose uncertainty they include with `ml` and `ekf`, not with `pivot`.
    """

    velocity: FloatArray | None = None
    velocity_covariance: FloatArray | None = None
    attitude: FloatArray | None = None
    attitude_covariance: FloatArray | None = None
    angular_rate: FloatArray | None = None
    angular_rate_covariance: FloatArray | None = None

    __repr__ = brief


@dataclass(frozen=True, eq=False)
class Estimate:
    """The centre of mass in C at every time of the tracks, and the circumstances of the estimate.

    Attributes:
        time: (n,), s.
        labels: of the m features; `ml` may add features, see `relabelling`.
        position: (n, 3), m in C.
        covariance: (n, 3, 3), m², None if the method has none.
        motion: velocity, attitude and angular rate.
        observability: None if the method has no covariance.
        clusters: the rigid clusters of features.
        noise: of the observations.
        residuals: (n, m, 3), observed less estimated, m in C; NaN without an observation or a cluster's attitude.
        used: (n, m), the observations that the method processed, including rejected ones.
        rejected: (n, m), the observations rejected as outliers.
        covered: (n,), the times at which the tracks determine an attitude.
        converged, rounds: of the method's iteration.
        findings: evidence against the models.
        method, path, options, version: path is the path's model; options include those chosen from the data.
        details: results specific to the method.
        wall_time: s.
        forces: the estimated factors of forces: an accelerometer's scale, constant accelerations.
        process_noise: None if the method has no model of it.
        predictor: of positions and velocities at other times, see `predict`; None if the method has none.
        widening: what misfits add to predictions; the covariances above have it already.
        epoch: UTC of time 0 in ISO 8601, as tracks or orbit tell; None if it is not known.
    """

    time: FloatArray
    labels: tuple[str, ...]
    position: FloatArray
    covariance: FloatArray | None
    motion: Motion
    observability: Observability | None
    clusters: tuple[Cluster, ...]
    noise: Noise
    residuals: FloatArray
    used: BoolArray
    rejected: BoolArray
    covered: BoolArray
    converged: bool
    rounds: int
    findings: tuple[Finding, ...]
    method: str
    path: str
    options: Options
    details: Details
    wall_time: float
    process_noise: ProcessNoise | None = None
    predictor: Predictor | None = None
    version: str = VERSION
    forces: tuple[Factor, ...] = ()
    widening: Widening = UNCHANGED
    epoch: str | None = None

    def __repr__(self) -> str:
        """Whether it can be used, and what it claims, in a line; `prose.summary` says more."""
        rmse = self.predicted_rmse
        about = [
            f"{counted(len(self.time), 'position')} from {self.time[0]:g} to {self.time[-1]:g} s",
            f"path {self.path}",
            "no covariance, so no claim" if rmse is None else f"claimed to ±{length(rmse)} rms",
            f"{counted(len(self.clusters), 'cluster')} of {counted(len(self.labels), 'feature')}",
            f"{100 * self.rejected_share:.2g} % rejected",
        ]
        against = ", ".join(sorted({type(one).__name__ for one in self.findings})) or "none"
        return f"<Estimate by {self.method}: {self.status}; {', '.join(about)}; findings: {against}>"

    def to_dataset(self) -> "Dataset":
        """The estimate over time as a dataset of xarray, in the units above: what the method has of position, velocity,
        attitude (a matrix, from axes B to C) and angular rate with their covariances, and of each feature residual,
        `used` and `rejected`.

        Raises:
            InputError: xarray is not installed (`pip install 'baryscope[io]'`).
        """
        vector, square = ("time", "axis"), ("time", "axis", "axis_")
        of_feature = ("time", "feature")
        motion = self.motion
        values = {
            "position": (vector, self.position, "m"),
            "covariance": (square, self.covariance, "m2"),
            "velocity": (vector, motion.velocity, "m s-1"),
            "velocity_covariance": (square, motion.velocity_covariance, "m2 s-2"),
            "attitude": (square, motion.attitude, "1"),
            "attitude_covariance": (square, motion.attitude_covariance, "rad2"),
            "angular_rate": (vector, motion.angular_rate, "rad s-1"),
            "angular_rate_covariance": (square, motion.angular_rate_covariance, "rad2 s-2"),
            "covered": (("time",), self.covered.astype(np.int8), "1"),
            "residual": ((*of_feature, "axis"), self.residuals, "m"),
            "used": (of_feature, self.used.astype(np.int8), "1"),
            "rejected": (of_feature, self.rejected.astype(np.int8), "1"),
        }
        present = {
            name: (dims, given, {"units": unit}) for name, (dims, given, unit) in values.items() if given is not None
        }
        found = dataset(self.time, self.epoch, present, "centre of mass in frame C", {"feature": list(self.labels)})
        found.attrs |= {"method": self.method, "path": self.path, "status": str(self.status)}
        found.attrs["source"] = f"baryscope {self.version}"
        return found

    def predict(self, times: ArrayLike, point: Point = None) -> Prediction:
        """Position and velocity in C, with their joint covariance, at any times.

        Inside gaps, before the first frame and after the last, too: from there process and torque noise add to the
        covariance.

        Args:
            times: (n,) in s, in any order.
            point: the label of a feature, or coordinates (3,) in m in the axes of the cluster of most frames, from the
                centroid of its features, as those of `Cluster.points`; None: the centre of mass. A point needs
                `ml` or `ekf`; its covariance is that of attitude, rate, path and point together.

        Raises:
            InputError: times that are none, no such point, or a method without predictions of it.
            ComputationError: `ml` has found no tumble that a point could follow, or none that can be followed so far.
        """
        if self.predictor is None:
            raise InputError(f"the method {self.method} predicts nothing, expected pivot, ml or ekf")
        free = next((finding for finding in self.findings if isinstance(finding, FreeAttitudes)), None)
        if point is not None and free is not None:
            raise ComputationError(f"{free.reason}: no point can be predicted without a tumble", Reason.DIVERGED)
        return self.predictor.at(times_of(times), point).widened(self.widening, self.time[0], self.time[-1])

    @property
    def status(self) -> Status:
        """Whether the estimate can be used: the most severe of its defects."""
        if not self.converged:
            return Status.NOT_CONVERGED
        if any(isinstance(finding, MISFITS) for finding in self.findings):
            return Status.MODEL_DOES_NOT_FIT
        if any(isinstance(finding, UNCHECKED) for finding in self.findings):
            return Status.NOT_CHECKED
        if self.observability is not None and not self.observability.observable.all():
            return Status.NOT_OBSERVABLE
        return Status.GOOD

    @property
    def velocity(self) -> FloatArray | None:
        """Velocity of the centre of mass in C, (n, 3), m/s."""
        return self.motion.velocity

    @property
    def attitude(self) -> FloatArray | None:
        """R_C_B, (n, 3, 3), see `Motion`."""
        return self.motion.attitude

    @property
    def angular_rate(self) -> FloatArray | None:
        """Angular rate in B, (n, 3), rad/s, see `Motion`."""
        return self.motion.angular_rate

    @cached_property
    def predicted_rmse(self) -> float | None:
        """The root mean squared error of the path that the covariance predicts, m; None without a covariance."""
        if self.covariance is None:
            return None
        return float(np.sqrt(np.trace(self.covariance, axis1=1, axis2=2).mean()))

    @property
    def coverage(self) -> float:
        """Share of the times at which the tracks determine an attitude."""
        return float(self.covered.mean())

    @cached_property
    def feature_rms(self) -> FloatArray:
        """Rms of each feature's residuals per coordinate, (m,), m, without rejected ones; NaN if none is left."""
        return rms_coordinates(self.residuals, ~self.rejected)

    @property
    def rejected_share(self) -> float:
        """The share of the used observations that are rejected."""
        return float(self.rejected.sum() / max(int(self.used.sum()), 1))

    @property
    def rejected_features(self) -> tuple[str, ...]:
        """Labels of the features with more than PERSISTENT of their observations rejected."""
        wrong, total = self.rejected.sum(axis=0), np.maximum(self.used.sum(axis=0), 1)
        return tuple(self.labels[index] for index in np.nonzero(wrong > PERSISTENT * total)[0])

    def sources(self, labels: tuple[str, ...]) -> IntArray:
        """The index among the tracks' labels of each of its own (m,), which may be `F3 (2)` for another point of F3."""
        own = (label if label in labels else label.rpartition(" ")[0] for label in self.labels)
        return np.array([labels.index(label) for label in own], dtype=np.intp)

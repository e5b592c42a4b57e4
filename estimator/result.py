"""The result of an estimation as values: the path of the centre of mass, how sure it is, and what speaks against it.

Sentences and files are made from these elsewhere: see `prose` and `document`.
"""

from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from importlib.metadata import version
from typing import Self

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.details import Details
from baryscope.estimator.options import Options
from baryscope.estimator.registration.intervals import Interval

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

FREE_TUMBLE = "free tumble"  # the model of an ExcessResiduals that is no path
VERSION = version("baryscope")
UNOBSERVABLE = 0.25  # deviation over the features' radius, from which on a direction counts as not observable
PERSISTENT = 0.5  # share of a feature's observations rejected, from which on the feature is


class Status(StrEnum):
    """Whether an estimate can be used."""

    GOOD = "good"
    NOT_CONVERGED = "not converged"
    NOT_OBSERVABLE = "not observable"
    MODEL_DOES_NOT_FIT = "model does not fit"

    @property
    def trustworthy(self) -> bool:
        """Whether position and covariance mean what they say; where a direction is not observable, they do."""
        return self in (Status.GOOD, Status.NOT_OBSERVABLE)


@dataclass(frozen=True, eq=False)
class PrincipalAxes:
    """A covariance by its principal axes: deviations (3,) in m, rising, and directions (3, 3), a unit vector a row."""

    deviations: FloatArray
    directions: FloatArray

    @classmethod
    def of(cls, covariance: FloatArray) -> Self:
        """Those of a covariance (3, 3) in m²."""
        values, vectors = np.linalg.eigh(covariance)
        return cls(np.sqrt(np.maximum(values, 0.0)), vectors.T)


@dataclass(frozen=True, eq=False)
class Observability:
    """How well the centre of mass is seen.

    body: in the axes of the cluster that was seen in most frames, which `cluster` counts; inertial: in C, the mean over
    all times of the path's covariance; threshold: deviation in m from which on a direction counts as not observable.
    """

    body: PrincipalAxes
    inertial: PrincipalAxes
    cluster: int
    threshold: float

    @property
    def observable(self) -> BoolArray:
        """Which of the directions in body axes are observable, (3,)."""
        return np.asarray(self.body.deviations <= self.threshold)

    @property
    def condition_number(self) -> float:
        """Greatest over least variance in body axes; infinite where a direction has none."""
        least, _, greatest = self.body.deviations
        return float((greatest / least) ** 2) if least > 0 else np.inf


@dataclass(frozen=True, eq=False)
class Cluster:
    """Features that are seen together, a rigid body in axes S of its own (with `ml` all clusters have the same).

    labels, and features (m,), their indices in the tracks; frames (n,): indices of those with an attitude; intervals in
    which it was seen; points (m, 3) in S from their centroid, m; centre_of_mass (3,), from there, too; covariance
    (3, 3) of it, m², in axes that the points hold, None where the method has none.
    """

    labels: tuple[str, ...]
    features: IntArray
    frames: IntArray
    intervals: tuple[Interval, ...]
    points: FloatArray
    centre_of_mass: FloatArray
    covariance: FloatArray | None

    @property
    def radius(self) -> float:
        """Of the features about their centroid, rms, m."""
        return float(np.sqrt((self.points**2).sum() / len(self.points)))


@dataclass(frozen=True)
class Noise:
    """Standard deviation of an observation's coordinate: a priori as it was given, None if it was not, and a posteriori
    as the residuals show it. In m, or where the tracks bring covariances (relative) as a factor on their deviations.
    """

    a_priori: float | None
    a_posteriori: float
    relative: bool = False


@dataclass(frozen=True)
class LackOfFit:
    """The path departs from its model, by about `magnitude` m: a cubic in time gains chi_square, dof expected."""

    path: str
    magnitude: float
    chi_square: float
    dof: int


@dataclass(frozen=True)
class ExcessResiduals:
    """The residuals with a model (a path's name, or "free tumble") are `ratio` times those without it."""

    model: str
    ratio: float


@dataclass(frozen=True)
class DifferentPoints:
    """Features whose labels stand for other points in the second cluster than in the first: they tie nothing."""

    labels: tuple[str, ...]
    clusters: tuple[int, int]


Finding = LackOfFit | ExcessResiduals | DifferentPoints


@dataclass(frozen=True, eq=False)
class Motion:
    """How the target moves at n times; what a method does not tell is None.

    velocity (n, 3) of the centre of mass in C, m/s. attitude (n, 3, 3) R_C_B of the axes of the cluster that was seen
    in most frames, NaN where it has none; angular_rate (n, 3), rad/s in B. Covariances (n, 3, 3): of the velocity in
    C, (m/s)²; of the attitude, a small rotation vector in B, rad²; of the rate in B, (rad/s)². The points that hold
    the axes B count as known.
    """

    velocity: FloatArray | None = None
    velocity_covariance: FloatArray | None = None
    attitude: FloatArray | None = None
    attitude_covariance: FloatArray | None = None
    angular_rate: FloatArray | None = None
    angular_rate_covariance: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class Estimate:
    """The centre of mass in C at every time of the tracks, and how it came about.

    Attributes:
        time: (n,), s.
        labels: of the m features, as the method tells them apart.
        position: (n, 3), m in C.
        covariance: (n, 3, 3), m², None where the method has none.
        motion: velocity, attitude and angular rate.
        observability: None where the method has no covariance.
        clusters: the rigid clusters of features.
        noise: of the observations.
        residuals: (n, m, 3), observed less estimated, m in C; NaN where nothing is seen or no cluster has an attitude.
        used: (n, m), of which observations the method took account, be it to reject them.
        rejected: (n, m), which of these count as wrong.
        covered: (n,), at which times the tracks show an attitude.
        converged, rounds: of the method's iteration.
        findings: what speaks against the models.
        method, path, options, version: what made it; path is the kind of path, options have what was chosen.
        details: what only this method knows.
        wall_time: s.
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
    version: str = VERSION

    @property
    def status(self) -> Status:
        """Whether the estimate can be used: the worst of what is known against it."""
        if not self.converged:
            return Status.NOT_CONVERGED
        if any(isinstance(finding, LackOfFit | ExcessResiduals) for finding in self.findings):
            return Status.MODEL_DOES_NOT_FIT
        if self.observability is not None and not self.observability.observable.all():
            return Status.NOT_OBSERVABLE
        return Status.GOOD

    @property
    def velocity(self) -> FloatArray | None:
        """Of the centre of mass in C, (n, 3), m/s."""
        return self.motion.velocity

    @property
    def attitude(self) -> FloatArray | None:
        """R_C_B, (n, 3, 3), see `Motion`."""
        return self.motion.attitude

    @property
    def angular_rate(self) -> FloatArray | None:
        """In B, (n, 3), rad/s, see `Motion`."""
        return self.motion.angular_rate

    @cached_property
    def predicted_rmse(self) -> float | None:
        """What the covariance predicts for the root of the mean squared error of the path, m; None without one."""
        if self.covariance is None:
            return None
        return float(np.sqrt(np.trace(self.covariance, axis1=1, axis2=2).mean()))

    @property
    def coverage(self) -> float:
        """Share of the times at which the tracks show an attitude."""
        return float(self.covered.mean())

    @cached_property
    def feature_rms(self) -> FloatArray:
        """Rms of each feature's residuals per coordinate, without those rejected, (m,), m; NaN where none is left."""
        used = np.isfinite(self.residuals[..., 0]) & ~self.rejected
        squares = np.where(used, np.einsum("kmi,kmi->km", self.residuals, self.residuals), 0.0).sum(axis=0)
        count = used.sum(axis=0)
        return np.sqrt(np.where(count > 0, squares / np.maximum(3 * count, 1), np.nan))

    @property
    def rejected_share(self) -> float:
        """Of the observations in use, the share that counts as wrong."""
        return float(self.rejected.sum() / max(self.used.sum(), 1))

    @property
    def rejected_features(self) -> tuple[str, ...]:
        """Labels of the features that are wrong most of the time."""
        wrong, total = self.rejected.sum(axis=0), np.maximum(self.used.sum(axis=0), 1)
        return tuple(self.labels[index] for index in np.nonzero(wrong > PERSISTENT * total)[0])

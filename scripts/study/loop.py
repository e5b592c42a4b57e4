"""The closed loop: target, rig, estimator and controller flown together on estimates alone, and what came of it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.geometry.alignment import matrix_from_quaternion
from baryscope.estimator.geometry.extent import rms_coordinates
from baryscope.estimator.geometry.symmetric import FULL
from baryscope.estimator.tracks import FeatureTracks
from baryscope.fmu import Recording
from baryscope.fmu.runtime import UnitError
from baryscope.fmu.system import Master, open_system
from baryscope.fmu.system.master import Unit
from baryscope.models.approach.reckoning import RETREAT
from baryscope.models.errors import InputError
from baryscope.models.files import AnyPath
from baryscope.models.keplerian import PARAMETERS
from baryscope.models.orbit import Orbit
from baryscope.models.sensor.navigation import STATUSES
from baryscope.models.variables import Kind, variable_table
from baryscope.models.words import brief
from baryscope.progress import Progress, stage
from baryscope.report.charts import nees_of
from baryscope.study.flight import TRUTH_COLUMNS
from baryscope.study.loop_remarks import warn_before, warn_of_blind_camera

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

MODELS = {
    "target": "TumblingTarget",
    "rig": "StereoRig",
    "estimator": "CentreOfMassEstimator",
    "controller": "ApproachController",
}
Pilot = Callable[[Mapping[str, Unit], float], None]
"""Called at each communication point with the units, by the names of MODELS, and the time in s: may set their inputs.

Outputs have been handed on by then; what it sets holds in the next step.
"""
COMMAND, MODE = "command.acceleration", "guidance.mode"
MOST_STEPS = 10_000_000
POINTED = 1  # the step by which a controller has pointed the camera
TRACKING = STATUSES.index("tracking")


@dataclass(frozen=True, eq=False)
class SampleResiduals:
    """How far n samples of m features were off the map of the estimator when it took them.

    time (n,), s; labels; residuals (n, m, 3) in C, m, NaN where it tells none; used (n, m): what was seen of features
    that the map had; rejected (n, m): of these, what it left out.
    """

    time: FloatArray
    labels: tuple[str, ...]
    residuals: FloatArray
    used: BoolArray
    rejected: BoolArray

    __repr__ = brief

    @cached_property
    def feature_rms(self) -> FloatArray:
        """Rms of each feature's residuals per coordinate, (m,), m, without rejected ones; NaN if none is left."""
        return rms_coordinates(self.residuals, ~self.rejected)


@dataclass(frozen=True, eq=False)
class Loop:
    """A flown loop at n communication points after the start; frame C has its origin at the chaser, inertial axes.

    Attributes:
        truth: the target's position, velocity, attitude and rate.
        tracks: what the rig has sampled, in C by the measured attitude.
        position, covariance: (n, 3) and (n, 3, 3), the estimated CoM, m; zeros while the estimator waits.
        status: (n,), of the estimator, places in `STATUSES`.
        attitude: (n, 4), the estimated one, a quaternion (w, x, y, z) from the axes of its map to those of C.
        residuals: of the samples in `tracks`; None if the estimator takes none of them, or does not tell.
        map: (m, 3), where the estimator has the features at last, from the CoM, m; NaN for those it has not.
        tumble: (n,), whether the estimator knows rate and inertia.
        chaser: (n, 3), LVLH, m.
        clearance: (n,), from the nearest feature of the target to the chaser's centre of mass, m.
        command: (n, 3), m/s², LVLH.
        to_grapple: (n,), how far the chaser is from the true point before the true grapple point, m; from the grapple
            point itself where the controller has no `grapple.standoff`.
        miss: (n,), how far it is from where it shall be, m: from there while synchronised, else from `hold.position`,
            or from where it starts if the controller has none. While it retreats, or a controller that has no
            `guidance.mode` was told nothing, it shall be where it was to be before.
        synchronised: (n,), whether the goal turns with the body; never with a controller that does not tell.
        mode: (n,), of the controller, places in `MODES` of `baryscope.models.approach.reckoning`; NaN if it has none.
        inside: (n,), whether the chaser's centre of mass is in the convex hull of the target's features.
        orbit: of the target, from the parameters of its unit.
    """

    truth: Recording
    tracks: FeatureTracks
    position: FloatArray
    covariance: FloatArray
    status: NDArray[np.intp]
    attitude: FloatArray
    residuals: SampleResiduals | None
    map: FloatArray
    tumble: BoolArray
    chaser: FloatArray
    clearance: FloatArray
    command: FloatArray
    to_grapple: FloatArray
    miss: FloatArray
    synchronised: BoolArray
    mode: FloatArray
    inside: BoolArray
    orbit: Orbit

    __repr__ = brief

    @property
    def time(self) -> FloatArray:
        """The communication points (n,), s."""
        return self.truth.time

    @property
    def error(self) -> FloatArray:
        """Of the estimated CoM, (n,), m; NaN while the estimator waits."""
        error = np.linalg.norm(self.position - self.truth["target.position"], axis=1)
        return np.where(self.status > 0, error, np.nan)

    @property
    def deviation(self) -> FloatArray:
        """That the estimator claims for it, (n,), m; NaN while it waits."""
        return np.where(self.status > 0, np.sqrt(np.trace(self.covariance, axis1=1, axis2=2)), np.nan)

    @property
    def nees(self) -> FloatArray:
        """eᵀ P⁻¹ e of the CoM, (n,), of 3 degrees of freedom; NaN unless the estimator tracks the target."""
        squares = nees_of(self.position - self.truth["target.position"], self.covariance)
        return np.where(self.tracking, squares, np.nan)

    @property
    def tracking(self) -> BoolArray:
        """Whether the estimator tracks the target, (n,)."""
        return np.asarray(self.status == TRACKING)


def fly_loop(
    path: AnyPath,
    *,
    duration: float | None = None,
    step: float | None = None,
    approach: bool = False,
    pilot: Pilot | None = None,
    progress: Progress | None = None,
) -> Loop:
    """Fly a system that `baryscope system` wrote. Warns of what its user will not have meant (`loop_remarks`).

    Args:
        path: the .ssp archive.
        duration: s; None: that of the archive.
        step: from one communication point to the next, s; None: the units' own.
        approach: begin the approach to the grapple point as soon as the tumble is known.
        pilot: interferes between two steps.
        progress: told how far the flight is.

    Raises:
        InputError: the archive holds no such system, or a number is out of range.
        UnitError: a unit refuses a value or a step.
    """
    with open_system(Path(path), step) as master:
        units = {name: _unit(master, path, name) for name in MODELS}
        length = master.stop_time if duration is None else duration
        if length is None or not master.step_size <= length <= MOST_STEPS * master.step_size:
            raise InputError(
                f"duration: found {length} s, expected {master.step_size:g} s or more, in steps of that size, "
                f"and {MOST_STEPS * master.step_size:g} s at most"
            )
        if approach:
            controller = units["controller"]
            if not controller.scalars("synchronised"):
                raise InputError(f"{path}: {controller.model} has no synchronised, by which an approach begins")
            controller.set(["synchronised"], np.ones(1))
        warn_before(master, units)
        count = round(length / master.step_size)
        recorder = _Recorder(units, count)
        with stage(progress, f"flying {length:.0f} s at {1 / master.step_size:g} Hz") as share:
            for index in range(count):
                master.step()
                recorder.take(index, master.time)
                if index == POINTED:
                    warn_of_blind_camera(units)
                if pilot is not None:
                    pilot(units, master.time)
                if index % max(1, count // 200) == 0:
                    share(index / count)
        return recorder.loop()


def _unit(master: Master, path: AnyPath, name: str) -> Unit:
    """The unit of our model; as controller any that has a command."""
    found = master.of_model(MODELS[name])
    if found is None and name == "controller":
        found = next((unit for unit in master.units.values() if len(unit.scalars(COMMAND)) == 3), None)
    if found is None:
        raise InputError(f"{path}: has no {MODELS[name]}, expected a system made by `baryscope system`")
    return found


Sample = tuple[float, FloatArray, FloatArray]
"""Time in s, points (m, 3) in C, m, and their covariances (m, 3, 3), m²; NaN for what is not seen."""


def _labels(rig: Unit, features: int) -> tuple[str, ...]:
    """The features' labels, from descriptions of a rig of ours, `Whether the feature is seen: LABEL`; else numbers."""
    told = [rig.descriptions.get(name, "").partition(": ")[2] for name in rig.scalars("seen")]
    if len(set(told) - {""}) == features:
        return tuple(told)
    return tuple(str(k + 1) for k in range(features))


class RigReader:
    """Reads the samples of a rig as they come."""

    def __init__(self, rig: Unit) -> None:
        self._rig, self._arm = rig, rig.vector("camera.leverArm")
        self._taken, self._time = 0.0, -np.inf

    def newest(self) -> Sample | None:
        """The newest sample, by the measured attitude, if it is another one than before, and of later inputs."""
        rig = self._rig
        (number,), (time,) = rig.vector("sample.number"), rig.vector("sample.time")
        if number <= self._taken or time <= self._time:
            return None
        self._taken, self._time = number, time
        R = matrix_from_quaternion(rig.vector("camera.measuredAttitude")[None])[0]
        seen = rig.vector("seen")[:, None] > 0
        points = (rig.vector("points").reshape(-1, 3) + self._arm) @ R.T
        covariances = R @ rig.vector("covariances").reshape(-1, 6)[:, FULL] @ R.T
        return float(time), np.where(seen, points, np.nan), np.where(seen[..., None], covariances, np.nan)


class _ResidualReader:
    """Reads what the estimator tells of each sample, when it has taken it."""

    def __init__(self, estimator: Unit) -> None:
        self._estimator, self._taken = estimator, 0.0
        self._told: dict[float, tuple[FloatArray, FloatArray, FloatArray]] = {}

    def read(self) -> None:
        taken = float(self._estimator.vector("samples")[0])
        if taken == self._taken or not self._estimator.scalars("sight.residuals"):
            return
        self._taken = taken
        time, residuals, fits, rejected = (
            self._estimator.vector(f"sight.{name}") for name in ("time", "residuals", "fits", "rejected")
        )
        self._told[float(time[0])] = residuals.reshape(-1, 3), fits, rejected

    def of(self, time: FloatArray, labels: tuple[str, ...]) -> SampleResiduals | None:
        """Of samples at these times; None if the unit does not tell any."""
        if not self._told:
            return None
        none = np.zeros((len(labels), 3)), np.zeros(len(labels)), np.zeros(len(labels))
        rows = [self._told.get(moment, none) for moment in time.tolist()]
        residuals, fits, rejected = (np.array(values) for values in zip(*rows, strict=True))
        told = np.where((residuals != 0.0).any(axis=2, keepdims=True), residuals, np.nan)
        return SampleResiduals(time, labels, told, (fits > 0) | (rejected > 0), rejected > 0)


class _Recorder:
    """What is seen of the units at each communication point."""

    def __init__(self, units: dict[str, Unit], count: int) -> None:
        self._units = units
        self._time = np.empty(count)
        self._rows: dict[str, FloatArray] = {}
        self._places = {
            "target": (*TRUTH_COLUMNS, "chaser.position"),
            "estimator": ("target.position", "target.positionCovariance", "target.attitude", "status", "tumble.known"),
            "controller": (COMMAND, "goal.synchronised", MODE),
        }
        for name, variables in self._places.items():
            for variable in variables:
                self._rows[f"{name} {variable}"] = np.empty((count, len(units[name].scalars(variable))))
        self._to_grapple, self._miss, self._clearance = np.empty(count), np.empty(count), np.empty(count)
        self._samples: list[Sample] = []
        self._rig, controller = RigReader(units["rig"]), units["controller"]
        self._residuals = _ResidualReader(units["estimator"])
        a, e, inclination, raan, periapsis, anomaly, mu = (
            float(units["target"].vector(name)[0]) for name in PARAMETERS
        )
        self._orbit = Orbit(a, e, inclination, raan, periapsis, anomaly, mu)
        held, standoff = controller.vector("hold.position"), controller.vector("grapple.standoff")
        self._hold = held if held.size else units["target"].vector("chaser.position0")
        self._standoff = float(standoff.sum())  # 0 where the controller has none
        self._turns = False

    def take(self, index: int, time: float) -> None:
        """Record the point of that index."""
        self._time[index] = time
        for name, variables in self._places.items():
            for variable in variables:
                self._rows[f"{name} {variable}"][index] = self._units[name].vector(variable)
        features = self._units["target"].vector("features").reshape(-1, 3)
        self._clearance[index] = np.linalg.norm(features, axis=1).min()
        self._to_grapple[index] = self._from_goal(features[0], self._rows["target target.position"][index])
        mode = self._rows[f"controller {MODE}"][index]
        told = index > 0 and self._rows["estimator status"][index - 1] == TRACKING  # the controller, in this step
        if (mode != RETREAT).all() if mode.size else told:
            self._turns = bool(self._rows["controller goal.synchronised"][index].any())
        off = self._rows["target chaser.position"][index] - self._hold
        self._miss[index] = self._to_grapple[index] if self._turns else np.linalg.norm(off)
        self._residuals.read()
        sample = self._rig.newest()
        if sample is not None:
            self._samples.append(sample)

    def _from_goal(self, feature: FloatArray, centre: FloatArray) -> float:
        outward = feature - centre
        return float(np.linalg.norm(feature + self._standoff * outward / np.linalg.norm(outward)))

    def loop(self) -> Loop:
        """All that was recorded.

        Raises:
            UnitError: the rig has taken no sample.
        """
        if not self._samples:
            raise UnitError("the rig has taken no sample: fly longer than its period and latency")
        rows, truth = self._rows, [self._rows[f"target {name}"] for name in TRUTH_COLUMNS]
        mode, body = rows[f"controller {MODE}"], self._units["target"].vector("target.features").reshape(-1, 3)
        R = matrix_from_quaternion(rows["target target.attitude"])
        table = {variable.name: variable for variable in variable_table(3) if variable.kind == Kind.OUTPUT}
        time, position, covariance = (np.array(values) for values in zip(*self._samples, strict=True))
        labels = _labels(self._units["rig"], position.shape[1])
        estimator = self._units["estimator"]
        known = estimator.vector("body.known")[:, None] > 0
        return Loop(
            truth=Recording(self._time, np.hstack(truth), tuple(table[name] for name in TRUTH_COLUMNS)),
            tracks=FeatureTracks(time, position, labels, covariance),
            position=rows["estimator target.position"],
            covariance=rows["estimator target.positionCovariance"][:, FULL],
            status=rows["estimator status"][:, 0].astype(np.intp),
            attitude=rows["estimator target.attitude"],
            residuals=self._residuals.of(time, labels),
            map=np.where(known, estimator.vector("body.features").reshape(-1, 3), np.nan),
            tumble=rows["estimator tumble.known"][:, 0] > 0,
            chaser=rows["target chaser.position"],
            clearance=self._clearance,
            command=rows[f"controller {COMMAND}"],
            to_grapple=self._to_grapple,
            miss=self._miss,
            synchronised=np.asarray((rows["controller goal.synchronised"] > 0).any(axis=1)),
            mode=mode[:, 0] if mode.size else np.full(len(mode), np.nan),
            inside=inside_hull(body, np.einsum("nji,nj->ni", R, -rows["target target.position"])),
            orbit=self._orbit,
        )


def inside_hull(points: FloatArray, places: FloatArray) -> BoolArray:
    """Which places (n, 3) are in the convex hull of points (m, 3); none if these lie in a plane."""
    from scipy.spatial import ConvexHull, QhullError  # slow to load, and few commands need it

    try:
        planes = ConvexHull(points).equations
    except QhullError:
        return np.zeros(len(places), dtype=np.bool_)
    return np.asarray((places @ planes[:, :3].T + planes[:, 3] < 0).all(axis=1))

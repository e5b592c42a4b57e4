"""The Cramér–Rao bound of a scenario: the least covariance of any unbiased estimate, without simulated tracks.

The Fisher information is that of `ml`'s normal equations at the true values, with the true noise of each observation
and without a prior. Attitude, rate and inertia are those of axes attached to the features, as no others are observable;
the inertia is up to scale (trace 1).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.diagnostics import cluster_of, observability_of
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.camera.rig import Rig
from baryscope.estimator.camera.shared import SharedErrors
from baryscope.estimator.dynamics.rotation import RATE_AND_INERTIA, Attitudes, Rotation
from baryscope.estimator.geometry.alignment import matrix_from_quaternion
from baryscope.estimator.limits import LATEST
from baryscope.estimator.ml.attached import AttachedAxes
from baryscope.estimator.ml.likelihood import Equations, equations
from baryscope.estimator.ml.model import FrameNoise, Model
from baryscope.estimator.observability import Observability
from baryscope.estimator.options import DENSEST, PathOptions
from baryscope.estimator.paths.path import Path
from baryscope.estimator.paths.process_noise import ProcessNoisePath
from baryscope.estimator.paths.relative_motion import PerturbedOrbit
from baryscope.estimator.paths.sampled_path import SampledPath
from baryscope.estimator.paths.seen_path import as_seen, errors_in, of_true_size
from baryscope.estimator.paths.trajectory import chosen_path, trajectory_of
from baryscope.estimator.prediction import PredictedPath
from baryscope.estimator.registration.body import Body
from baryscope.estimator.thrust import KnownAcceleration
from baryscope.models.errors import ComputationError, InputError, Reason
from baryscope.models.lvlh import lvlh_attitude
from baryscope.models.relative_orbit import relative_path
from baryscope.models.scenario import Scenario
from baryscope.models.sensor.directions import axes_along
from baryscope.models.sensor.tracking import observation_covariance, visible
from baryscope.models.words import brief

FloatArray = NDArray[np.float64]

MOST_MODES = 192  # of process noise


@dataclass(frozen=True, eq=False)
class Bound:
    """The bound for all unbiased estimates from a scenario's observations.

    time (n,) in s; position_covariance (n, 3, 3) of the CoM in C, m²; offset_covariance (3, 3) of the CoM in axes
    attached to all features, m². In these axes: attitude_covariance (n, 3, 3), rad²; rate_covariance (3, 3), rad²/s²,
    at the middle of the time; inertia_covariance (5, 5), of the coefficients of INERTIA_BASIS for trace 1.
    observations: their number; observability of the CoM;
    predicted_covariance (6, 6) of position and velocity in C, m and m/s, at the predicted time, or at the last frame.
    """

    time: FloatArray
    position_covariance: FloatArray
    offset_covariance: FloatArray
    attitude_covariance: FloatArray
    rate_covariance: FloatArray
    inertia_covariance: FloatArray
    observations: int
    observability: Observability
    predicted_covariance: FloatArray

    __repr__ = brief

    @property
    def predicted_deviation(self) -> float:
        """Bound of the root mean squared error of the position at the predicted time, m."""
        return _rms(self.predicted_covariance[None, :3, :3])

    @cached_property
    def position_deviation(self) -> float:
        """Bound of the root mean squared error of the CoM's path, over all times, m."""
        return _rms(self.position_covariance)

    @cached_property
    def offset_deviation(self) -> float:
        """Bound of the root mean squared error of the CoM in the features' axes, m."""
        return _rms(self.offset_covariance[None])

    @cached_property
    def attitude_deviation(self) -> float:
        """Bound of the root mean squared error of the attitude, rad, over three axes."""
        return _rms(self.attitude_covariance)

    @cached_property
    def rate_deviation(self) -> float:
        """Bound of the root mean squared error of the angular rate, rad/s, over three axes."""
        return _rms(self.rate_covariance[None])

    @cached_property
    def inertia_deviation(self) -> float:
        """Bound of the root mean squared error of the inertia over its trace (Frobenius norm)."""
        return _rms(self.inertia_covariance[None])


@dataclass(frozen=True)
class _Known:
    """The arguments of `cramer_rao_bound`."""

    trajectory: str | None = None
    process_noise: float = 0.0
    acceleration_scale: float = 0.0
    consider: Rig | None = None
    predict: float = 0.0

    def __post_init__(self) -> None:
        limits = {"process_noise": DENSEST, "acceleration_scale": 1.0, "predict": LATEST}
        for name, most in limits.items():
            if not 0 <= getattr(self, name) <= most:
                raise InputError(f"{name} is {getattr(self, name)}, expected 0 to {most:g}")


def cramer_rao_bound(
    scenario: Scenario,
    *,
    trajectory: str | None = None,
    process_noise: float = 0.0,
    acceleration_scale: float = 0.0,
    consider: Rig | None = None,
    predict: float = 0.0,
) -> Bound:
    """The bound of a scenario for a given path model: relative-orbit unless given, see `PathOptions`.

    A polynomial needs its degree. The information is reduced by the shares of dropped, wrong and swapped observations;
    drifting features are not taken into account. A constant acceleration of the chaser is known to the estimator, and
    of white noise of its thrusters (`acceleration_noise`) the density.

    process_noise: density of further white acceleration beside the path's model, m²/s³, none of a fixed one;
    acceleration_scale: standard
    deviation of the scale with which the chaser's acceleration is measured; consider: what is uncertain about the
    camera, which looks at the target; predict: how long after the last frame `predicted_covariance` is, s. The unknowns
    they add have priors, so this is the posterior bound (Van Trees 1968), for the mean over their draws.

    Raises:
        InputError: a polynomial without a degree, or a value out of its range.
        ComputationError: no feature is seen, or there is no noise.
    """
    noise_density = process_noise + scenario.chaser.acceleration_noise
    known = _Known(trajectory, noise_density, acceleration_scale, consider, predict)
    time = scenario.sample_times
    truth = Truth.of(scenario, time)
    observations = expected_observations(scenario, time, truth)
    if not observations.count:
        raise ComputationError("no feature is seen at any time of the scenario", Reason.TOO_FEW_FEATURES)
    errors = None if known.consider is None else SharedErrors.of(axes_along(truth.origin), known.consider)
    path, found, y = _information(observations, truth, _path(scenario, known, time, errors), time, errors)
    of_x = y[RATE_AND_INERTIA:, RATE_AND_INERTIA:]
    position_covariance = path.at(time).covariance(of_x)
    seen = np.nonzero(observations.weight.any(axis=0))[0]
    points = truth.points[seen]
    offset, crossed = found.offset_covariance(y, seen)
    if errors is not None and errors.scale is not None:
        scale = RATE_AND_INERTIA + errors_in(path).start + errors.scale
        offset = of_true_size(points.mean(axis=0), offset, crossed[:, scale], float(y[scale, scale]))
    attached = AttachedAxes.of(found, y, seen)
    turn = np.concatenate([truth.motion.turn, np.zeros((len(time), 3, len(of_x)))], axis=2)
    body = Body(seen, np.arange(len(time)), points, truth.motion.attitude)
    return Bound(
        time,
        position_covariance,
        offset,
        attached.covariance(turn, np.broadcast_to(np.eye(3), (len(time), 3, 3))),
        attached.of_rate(truth.rotation.rate),
        attached.of_inertia(truth.rotation.inertia),
        observations.count,
        observability_of([cluster_of(body, points, offset, scenario.features.labels)], position_covariance),
        _predicted(path, of_x, known, time),
    )


def _information(
    observations: Observations, truth: "Truth", path: Path, time: FloatArray, errors: SharedErrors | None
) -> tuple[Path, Equations, FloatArray]:
    """The path with as many modes of process noise as the observations tell, the normal equations of `ml` at the truth,
    and the covariance (q, q) of their unknowns: of rate and inertia, and of the path's.
    """
    origin, n = truth.origin, len(time)
    distance = float(np.linalg.norm(origin, axis=1).max())
    noise = None
    if errors is not None and errors.noisy:
        noise = FrameNoise(errors.turn_covariance(), np.zeros((n, 3, 3)))
    while True:
        sampled = path.at(time)
        seen_path = as_seen(path, SampledPath(sampled.jacobian, lambda _: origin), errors, np.zeros(path.size))
        found = equations(observations, Model(truth.motion, seen_path, origin, truth.points, noise))
        richer = _richer(path, found)
        if richer is None:
            precision = np.concatenate([np.zeros(RATE_AND_INERTIA), path.prior.precision(np.zeros(0))])
            return path, found, found.covariance(sampled, distance, np.diag(precision))
        path = richer


def _predicted(path: Path, of_x: FloatArray, known: _Known, time: FloatArray) -> FloatArray:
    """The covariance (6, 6) of position and velocity in C at the time that is asked for, or at the last frame."""
    begin, end = float(time[0]), float(time[-1])
    whole = PredictedPath(path, np.zeros(path.size), of_x, begin, end, known.process_noise)
    at = np.array([end + known.predict])
    jacobian = np.concatenate([path.at(at).jacobian, path.rate_at(at).jacobian], axis=1)[0]
    return np.asarray(jacobian @ of_x @ jacobian.T + whole.added(at)[0])


def _richer(path: Path, found: Equations) -> Path | None:
    """The path with all modes of process noise that the observations could tell from none; None if it has them."""
    if not isinstance(path, ProcessNoisePath) or path.density is None:
        return None
    count = path.told_modes(path.density, found.sizes[found.rotation_size :], MOST_MODES)
    return path.with_modes(count) if count > path.count else None


def _rms(covariance: FloatArray) -> float:
    return float(np.sqrt(np.trace(covariance, axis1=1, axis2=2).mean()))


def _path(scenario: Scenario, known: _Known, time: FloatArray, errors: SharedErrors | None) -> Path:
    kind, logged = trajectory_of(known.trajectory, scenario.orbit), _logged(scenario, known, time)
    if kind.kind == "polynomial" and kind.degree is None:
        raise InputError("trajectory is polynomial, expected its degree for a bound, polynomial:N")
    if kind.degree == 0 and known.process_noise > 0:
        found = f"{known.process_noise:g} m²/s³, with the thrusters' noise"
        raise InputError(f"process_noise is {found}, expected 0 where the trajectory is fixed")
    options = PathOptions(known.trajectory, acceleration=logged, process_noise=known.process_noise or "none")
    return chosen_path(options, scenario.orbit, float(time[0]), float(time[-1]), errors)


def _logged(scenario: Scenario, known: _Known, time: FloatArray) -> KnownAcceleration | None:
    """The log of the chaser's acceleration, None without one."""
    value = scenario.chaser.acceleration
    if not np.any(value):
        return None
    return KnownAcceleration([min(0.0, float(time[0]))], [value], "lvlh", scale=known.acceleration_scale)


@dataclass(frozen=True, eq=False)
class Truth:
    """What a scenario tells: the rotation with its epoch in the middle of n times, its attitudes, the path of the CoM,
    origin (n, 3) in C, and the features, points (m, 3) from the CoM in body axes.
    """

    rotation: Rotation
    motion: Attitudes
    origin: FloatArray
    points: FloatArray

    @classmethod
    def of(cls, scenario: Scenario, time: FloatArray) -> "Truth":
        """The truth at times (n,), s."""
        rotation = _rotation(scenario, float(time[0] + time[-1]) / 2)
        points = np.array([point.position for point in scenario.features.points])
        return cls(rotation, rotation.at(time), _origin(scenario, time), points)


def _rotation(scenario: Scenario, epoch: float) -> Rotation:
    """The true rotation, by its state at an epoch, s."""
    target = scenario.target
    quaternion = np.array(target.attitude) / np.linalg.norm(target.attitude)
    start = Rotation(
        0.0,
        matrix_from_quaternion(quaternion[None])[0],
        np.deg2rad(target.angular_rate_deg),
        np.array(target.inertia),
        scenario.orbit if target.gravity_gradient else None,
    )
    then = start.at(np.array([epoch]))
    return Rotation(epoch, then.attitude[0], then.rate[0], start.inertia, start.orbit)


def _origin(scenario: Scenario, time: FloatArray) -> FloatArray:
    """The true path of the CoM in C, (n, 3) in m."""
    state = np.concatenate([scenario.chaser.position, scenario.chaser.velocity])
    logged = _logged(scenario, _Known(), time)
    if logged is None and scenario.orbit.j2 is None:
        rho_L = relative_path(scenario.orbit, state, time)[:, :3]
        return np.asarray(-(lvlh_attitude(scenario.orbit, time) @ rho_L[:, :, None])[:, :, 0])
    x = state / np.repeat([1.0, scenario.orbit.mean_motion], 3)
    return PerturbedOrbit(scenario.orbit, 0.0, logged).at(time).position(x)


def expected_observations(scenario: Scenario, time: FloatArray, truth: Truth) -> Observations:
    """The true positions of the features, with the true precision and the probability of each observation."""
    R_B_C = np.swapaxes(truth.motion.attitude, 1, 2)
    features_C = truth.origin[:, None] + truth.points @ R_B_C
    normals = np.array([point.normal for point in scenario.features.points])
    covariance = observation_covariance(scenario, features_C, truth.origin)
    seen = visible(scenario, time, features_C, normals @ R_B_C)
    seen &= np.isfinite(covariance[..., 0, 0])
    kept = (1 - scenario.sensor.dropout) * (1 - scenario.sensor.outliers.share) * (1 - scenario.sensor.outliers.swapped)
    weight = np.where(seen, kept, 0.0)
    position = np.where(seen[..., None], features_C, 0.0)
    if scenario.sensor.stereo is None:
        if scenario.sensor.noise == 0:
            raise ComputationError("sensor.noise is 0: without noise there is no bound above zero", Reason.NO_NOISE)
        return Observations(position, weight / scenario.sensor.noise**2)
    precision = np.linalg.inv(np.where(seen[..., None, None], covariance, np.eye(3)))
    return Observations(position, weight, precision)

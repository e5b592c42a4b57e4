"""Initial values of the passes of `ekf`: from the first frames, then from the result of the previous pass."""

from dataclasses import dataclass

import numpy as np

from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.reweighting import MEDIAN
from baryscope.estimator.adjustment.stereo import moved_to
from baryscope.estimator.ekf.filter import Run
from baryscope.estimator.ekf.motion import ROTATION, span_of
from baryscope.estimator.ekf.smoother import SmoothedPath
from baryscope.estimator.ekf.start import Start
from baryscope.estimator.ekf.state import Measured
from baryscope.estimator.options import PathOptions
from baryscope.estimator.progress import Rounds
from baryscope.estimator.tracks import BoolArray, FeatureTracks, FloatArray
from baryscope.models.lvlh import lvlh_attitude
from baryscope.models.orbit import Orbit

INFLATION = 10.0  # factor on the standard deviations of the previous pass
INITIAL_DISTANCE = 3.0  # radii of the features: initial standard deviation of the centre of mass from their centroid
INITIAL_INERTIA_DEVIATION = 0.5  # initial standard deviation of the inertia's logarithmic errors
MIN_NOISE = 1e-5  # radii of the features: least standard deviation of an observation


@dataclass(frozen=True, eq=False)
class Problem:
    """The tracks, orbit and options, and the initial state.

    on_orbit: whether the path is free relative motion; degree: of the derivative of the path that is constant or noisy,
    None if the path model is not given; inliers (n, m): from the screening; observations with their precisions, if any;
    rounds: told of each pass.
    """

    tracks: FeatureTracks
    orbit: Orbit | None
    options: PathOptions
    on_orbit: bool
    degree: int | None
    inliers: BoolArray
    observations: Observations
    start: Start
    rounds: Rounds


@dataclass(frozen=True, eq=False)
class Guess:
    """The initial values of a pass.

    nominal: the chaser's (ρ, ρ̇) in LVLH, m and m/s, about which the process of an orbit is linearised; u (p,) of the
    path and its covariance (p, p); inertia and the covariance (5, 5) of its errors; measured; scale: factor on the
    given covariances, or variance of a coordinate in m².
    """

    nominal: FloatArray
    u: FloatArray
    covariance: FloatArray
    inertia: FloatArray
    inertia_covariance: FloatArray
    measured: Measured
    scale: float


def first_guess(problem: Problem) -> Guess:
    """The initial values of the first pass: centre of mass at rest in the features' centroid, a sphere's inertia."""
    start, orbit = problem.start, problem.orbit
    size = 2 if problem.on_orbit else 4 if problem.degree is None else problem.degree + 1
    nominal = np.zeros(6)
    if problem.on_orbit and orbit is not None:
        R_I_L = lvlh_attitude(orbit, problem.tracks.time[start.frame : start.frame + 1])[0]
        nominal[:3] = -R_I_L.T @ start.centroid
    scale = _first_scale(problem)
    return Guess(
        nominal,
        np.zeros(3 * size),
        _first_covariance(problem, size),
        np.eye(3) / 3,
        INITIAL_INERTIA_DEVIATION**2 * np.eye(5),
        _measured(problem, problem.observations, scale),
        scale,
    )


def _first_covariance(problem: Problem, size: int) -> FloatArray:
    """The initial covariance (p, p) of the path's u, from the features' radius and the speed of their centroid."""
    span = span_of(problem.tracks.time)
    deviation = np.repeat([INITIAL_DISTANCE * problem.start.radius, *[problem.start.speed * span] * (size - 1)], 3)
    return np.diag(deviation**2)


def _first_scale(problem: Problem) -> float:
    """The variance of a coordinate, or the factor on the given covariances: as given, or from the registration."""
    if problem.options.sigma is not None:
        return problem.options.sigma**2
    return _scale_of(problem, max(problem.start.noise, MIN_NOISE * problem.start.radius))


def _scale_of(problem: Problem, noise: float) -> float:
    """The variance of a coordinate, or the factor on the given covariances, of a standard deviation in m."""
    if problem.tracks.covariance is None:
        return noise**2
    given = np.trace(problem.tracks.covariance[problem.inliers], axis1=1, axis2=2)
    return noise**2 / float(np.median(given)) * 3


def _measured(problem: Problem, observations: Observations, scale: float) -> Measured:
    tracks = problem.tracks
    if observations.precision is None:
        covariance = np.broadcast_to(scale * np.eye(3), (*tracks.seen.shape, 3, 3))
    else:
        covariance = np.asarray(scale * np.linalg.inv(observations.precision))
    return Measured(observations.position, covariance, problem.inliers)


def next_guess(problem: Problem, last: Guess, run: Run, path: SmoothedPath, order: int) -> Guess:
    """The initial values after a pass: its result, with INFLATION of its deviations up to the first pass's.

    A hundredth of the information is thus used twice.
    """
    frame, state = problem.start.frame, run.state
    p, used = len(last.u), 3 * (order + 1)
    u, nominal = path.u[frame], last.nominal
    covariance = _first_covariance(problem, p // 3)
    if np.trace(path.covariance[frame, :3, :3]) < np.trace(covariance[:3, :3]):
        covariance[:used, :used] = _capped(
            INFLATION**2 * path.covariance[frame, :used, :used], covariance[:used, :used]
        )
    else:  # the state of a noisy path, propagated back over a long time, has no information
        u, covariance = last.u, last.covariance
    if problem.on_orbit:
        nominal = nominal + np.concatenate([u[:3], u[3:] / span_of(problem.tracks.time)])
        u = np.zeros(6)
    inertia = state.inertia[0] / np.trace(state.inertia[0])
    of_inertia = state.covariance[0, p + 6 : p + ROTATION, p + 6 : p + ROTATION]
    scale, observations = last.scale, problem.observations
    if problem.options.sigma is None:
        scale = max(renewed_scale(last, run), _scale_of(problem, MIN_NOISE * problem.start.radius))
    if observations.precision is not None and problem.options.noise == "stereo":
        predicted = run.predicted[0]
        observations = moved_to(
            observations, observations, np.where(np.isfinite(predicted), predicted, observations.position)
        )
    return Guess(
        nominal,
        u,
        covariance,
        inertia,
        _capped(INFLATION**2 * of_inertia, INITIAL_INERTIA_DEVIATION**2 * np.eye(5)),
        _measured(problem, observations, scale),
        scale,
    )


def renewed_scale(guess: Guess, run: Run) -> float:
    """The variance of a coordinate, or the factor on the given covariances, from the innovations of a pass."""
    return guess.scale * float(np.median(run.accepted)) / MEDIAN


def _capped(covariance: FloatArray, most: FloatArray) -> FloatArray:
    """The covariance of combined information, (A⁻¹ + B⁻¹)⁻¹ = A (A + B)⁻¹ B, which is below both A and B."""
    found = covariance @ np.linalg.solve(covariance + most, most)
    return np.asarray(0.5 * (found + found.T))

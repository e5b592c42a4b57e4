"""What `ekf` answers: the estimate of its last pass, averaged over the probable densities of the process noises."""

import time as clock
from dataclasses import dataclass, replace

import numpy as np

from baryscope.estimator.adjustment.diagnostics import (
    cluster_of,
    covered_by,
    few_frames,
    observability_of,
    rejected_by,
)
from baryscope.estimator.adjustment.reweighting import NEGLIGIBLE, REJECTED
from baryscope.estimator.details import FilterDetails
from baryscope.estimator.ekf.densities import bounds_of, likeliest_of, process_noise_of
from baryscope.estimator.ekf.linearised import INERTIA, PATH, RATE, TURN
from baryscope.estimator.ekf.passes import Passes
from baryscope.estimator.ekf.prediction import PredictedTumble
from baryscope.estimator.ekf.products import product_gradient
from baryscope.estimator.ekf.spurious import attached_offset, growth, spurious_growth
from baryscope.estimator.findings import EstimatedOrbit, FewFrames, UnknownBurn
from baryscope.estimator.geometry.gauge import are_in_line, attached_turn
from baryscope.estimator.geometry.so3 import cross_matrices
from baryscope.estimator.orbits.estimated import estimated_orbit
from baryscope.estimator.paths.extended_path import Factor, parts_of
from baryscope.estimator.paths.seen_path import SeenPath
from baryscope.estimator.pivot.burns.solution import unknown_burns
from baryscope.estimator.registration.body import Body
from baryscope.estimator.registration.intervals import cut_intervals
from baryscope.estimator.result import Cluster, Estimate, Motion, Noise
from baryscope.estimator.tracks import FeatureTracks, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class _Answer:
    """Position and velocity (n, 3) at the frames, and the offset (3,) of the features' centroid from the centre of mass
    in axes attached to the points; with covariances without spurious information. products (q, k): of errors.
    """

    position: FloatArray
    covariance: FloatArray
    velocity: FloatArray
    velocity_covariance: FloatArray
    offset: FloatArray
    offset_covariance: FloatArray
    products: FloatArray


def answer_of(found: Passes, begin: float) -> Estimate:
    """The estimate of passes; begin: when the work began, s of the performance counter."""
    problem, last, at, features = found.problem, found.last, found.reference, _features(found)
    tracks, options, start = problem.tracks, problem.options, problem.start
    answer, densities, bounds = _answer(found, features), likeliest_of(found), bounds_of(found)
    cluster = _cluster(tracks, at.points[features], features, last.weight, answer)
    weight = np.where(tracks.seen, np.maximum(last.weight, NEGLIGIBLE), 0.0)
    gravity_gradient = start.rotation.orbit is not None
    return Estimate(
        time=tracks.time,
        labels=tracks.labels,
        position=answer.position,
        covariance=answer.covariance,
        motion=_motion(found, features, answer),
        observability=observability_of([cluster], answer.covariance),
        clusters=(cluster,),
        noise=Noise(options.sigma, float(np.sqrt(last.residual_variance)), tracks.covariance is not None, last.lasting),
        residuals=np.where(tracks.seen[..., None], tracks.position - at.seen_at(start.nodes), np.nan),
        used=weight > 0,
        rejected=rejected_by(weight),
        covered=covered_by([cluster], len(tracks.time)),
        converged=found.converged,
        rounds=found.count,
        findings=_of_path(found) + _few_frames(found),
        method="ekf",
        path=problem.path.name,
        options=replace(options, torque="gravity-gradient" if gravity_gradient else "none"),
        details=FilterDetails(
            process_noise=densities.path,
            process_noise_bounds=bounds[0],
            torque_noise=densities.turn,
            torque_noise_bounds=bounds[1],
            gravity_gradient=gravity_gradient,
            nis=last.residual_variance / last.frame_variance,
            log_likelihood=-0.5 * (last.parameters.log_determinant + last.parameters.squares / last.variance),
            final_covariance=answer.covariance[-1],
            angular_rate=at.rate[start.nodes.frames[-1]],
            inertia=at.inertia,
        ),
        wall_time=clock.perf_counter() - begin,
        forces=_camera_errors(found),
        process_noise=process_noise_of(found, densities.path, bounds[0]),
        predictor=PredictedTumble(found, tracks.labels, features, answer.products),
    )


def _of_path(found: Passes) -> tuple[EstimatedOrbit | UnknownBurn, ...]:
    """The findings of an orbit and of burns among the path's unknowns."""
    path, x = found.problem.path, found.shift + found.reference.x
    own = slice(INERTIA, INERTIA + path.size)
    of_x = found.solution.of_theta[own, own]
    return estimated_orbit(path, x, of_x) + unknown_burns(path, x, of_x)


def _camera_errors(found: Passes) -> tuple[Factor, ...]:
    """The constant errors of the camera, as far as the tracks tell them."""
    path, own = found.problem.path, slice(INERTIA, INERTIA + found.problem.path.size)
    parts = [part for part in parts_of(path) if isinstance(part, SeenPath)]
    of_x = found.solution.of_theta[own, own]
    return tuple(factor for part in parts for factor in part.factors(found.shift + found.reference.x, of_x))


def _few_frames(found: Passes) -> tuple[FewFrames, ...]:
    """A finding if there are too few frames for what the tracks tell of path, rate and inertia."""
    last = found.last
    own = slice(last.system.points.start)
    held = np.vdot(last.prior.information[own, own], last.parameters.covariance[own, own])
    return few_frames(last.weight, own.stop - float(held), last.lasting)


def _features(found: Passes) -> IntArray:
    """The features of which not all observations are rejected."""
    return np.asarray(np.nonzero((found.last.observations.weight >= REJECTED).any(axis=0))[0])


def _answer(found: Passes, features: IntArray) -> _Answer:
    """What passes tell of path and offset, the offset of these features; wider by spurious information and products."""
    at, frames, solution, last = found.reference, found.problem.start.nodes.frames, found.solution, found.last
    points = last.system.points
    offset, attached, least = attached_offset(found, features)
    of_offset = attached @ solution.of_theta[points, points] @ attached.T
    spurious, _, _ = spurious_growth(solution, last.system, last.variance, attached, least)
    noise = found.problem.noise([last.member], last.noise_variance)
    products = product_gradient(last.system, noise, solution, of_offset + spurious @ spurious.T)
    columns, of_states, _ = growth(found, solution, last.system, features, products)
    of_states = of_states[frames, PATH]
    of_path = solution.of_state[frames, PATH, PATH] + of_states @ np.swapaxes(of_states, 1, 2)
    return _Answer(
        at.origin[frames],
        of_path[:, :3, :3],
        at.path.velocity(at.deviation)[frames],
        of_path[:, 3:, 3:] / at.path.span**2,
        offset,
        of_offset + columns @ columns.T,
        products,
    )


def _motion(found: Passes, features: IntArray, answer: _Answer) -> Motion:
    """Velocity of the centre of mass, and attitude and rate of axes that are attached to some features' points."""
    at, frames, solution = found.reference, found.problem.start.nodes.frames, found.solution
    points, of_state = found.last.system.points, solution.of_state[frames]
    turn = np.zeros((3, 3 * len(at.points)))
    turn.reshape(3, -1, 3)[:, features] = attached_turn(at.points[features]).reshape(3, -1, 3)
    of_turn, rate = turn @ solution.of_theta[points, points] @ turn.T, at.rate[frames]

    def attached(own: slice, by_turn: FloatArray) -> FloatArray:
        """The covariance (n, 3, 3) of what the axes' turn changes by by_turn (n, 3, 3)."""
        crossed = solution.crossed[frames, own, points] @ turn.T @ np.swapaxes(by_turn, 1, 2)
        turned = by_turn @ of_turn @ np.swapaxes(by_turn, 1, 2)
        return np.asarray(of_state[:, own, own] + crossed + np.swapaxes(crossed, 1, 2) + turned)

    return Motion(
        velocity=answer.velocity,
        velocity_covariance=answer.velocity_covariance,
        attitude=at.attitude[frames],
        attitude_covariance=attached(TURN, np.broadcast_to(np.eye(3), (len(rate), 3, 3))),
        angular_rate=rate,
        angular_rate_covariance=attached(RATE, cross_matrices(rate)),
    )


def _cluster(
    tracks: FeatureTracks, points: FloatArray, features: IntArray, weight: FloatArray, answer: _Answer
) -> Cluster:
    """All features as one cluster, with the mean offset."""
    least = 2 if are_in_line(points) else 3  # features by which a frame tells of the body
    frames = np.nonzero((weight > NEGLIGIBLE).sum(axis=1) >= least)[0]
    intervals = cut_intervals(tracks.seen, np.zeros(len(tracks.time) - 1, dtype=bool))
    moved = points - points.mean(axis=0) + answer.offset
    body = Body(features, frames, moved, np.empty((0, 3, 3)), intervals)
    return cluster_of(body, moved, answer.offset_covariance, tracks.labels)

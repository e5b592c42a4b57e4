"""The maximum a posteriori estimate: damped Gauss–Newton steps with updates of robust weights and noise densities."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct

from baryscope.estimator.adjustment.degrees_of_freedom import least_variance
from baryscope.estimator.adjustment.evidence import Linear, conditional, held, maximise, ranges
from baryscope.estimator.adjustment.integration import Posterior, posterior
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.reweighting import NEGLIGIBLE, WEIGHT_CHANGE_TOLERANCE, reweighted
from baryscope.estimator.adjustment.stereo import StereoNoise, observations_of
from baryscope.estimator.camera.shared import SharedErrors
from baryscope.estimator.dynamics.blocks import Blocks
from baryscope.estimator.dynamics.inertia import of_a_body
from baryscope.estimator.dynamics.interpolated_path import interpolated
from baryscope.estimator.dynamics.paths import Path
from baryscope.estimator.dynamics.prior import Prior
from baryscope.estimator.dynamics.process_noise import Disturbed, enriched
from baryscope.estimator.dynamics.rotation import Attitudes, Rotation
from baryscope.estimator.dynamics.sampled_path import SampledPath
from baryscope.estimator.dynamics.seen import as_seen, errors_in
from baryscope.estimator.dynamics.torque import Torque
from baryscope.estimator.geometry.symmetric import symmetric_pseudo_inverse
from baryscope.estimator.ml.initial_tumble import MAX_NODES, NODES_PER_FRAME, Tumble
from baryscope.estimator.ml.jacobians import PHASE, Knots, worthwhile
from baryscope.estimator.ml.likelihood import Equations, FrameNoise, Model, equations
from baryscope.estimator.ml.priors import Priors
from baryscope.estimator.options import PathOptions
from baryscope.estimator.pivot.found import Pivot
from baryscope.estimator.progress import Rounds
from baryscope.estimator.tracks import FeatureTracks, errors_of

FloatArray = NDArray[np.float64]

MAX_ROUNDS = 25
DAMPING = 1e-8  # of the first step, over the diagonal: more slows down what tells rate from inertia in long tracks
STEP_TOLERANCE = 1e-2  # squared length of the last step, in units of the covariance, and increase of −2 ln p by a step
ROUNDING = 1e-7  # relative to the distance: about the interpolation error of attitudes
STAGE = 0.5  # of the unit of progress, that the start, the tumble and each round take
FEWEST_MODES, MANY_MODES, MOST_MODES = 6, 36, 100  # of the torque, of each axis: always, to begin with, at all
FLAT = 7.0  # of a hyperparameter's logarithm, from its lower bound to where a mode's variance is that of its estimate
RESOLVED = 3.0  # highest frequency of the modes over that at which the noise of the attitudes hides the torque's


@dataclass(frozen=True, eq=False)
class Likelihood:
    """The maximum a posteriori estimate of motion, path and points, with the normal equations there.

    blocks of the frames; noise of the frames' movements; observations with their final weights; variance of an
    observation of weight 1 in what all frames tell together, as given or from the residuals: in m², or as a factor on
    the given covariances; residual_variance: that from the residuals, of a frame by itself; unknowns: the number of
    unknowns y that the observations determine; posterior of y and of the hyperparameters.
    """

    rotation: Rotation
    motion: Attitudes
    x: FloatArray
    path: Path
    sampled: SampledPath
    blocks: Blocks
    noise: FrameNoise | None
    found: Equations
    priors: Priors
    posterior: Posterior
    observations: Observations
    variance: float
    residual_variance: float
    unknowns: float
    converged: bool
    rounds: int


@dataclass(frozen=True, eq=False)
class _State:
    """A rotation, its motion at the tracks' times, and the path's x (p,)."""

    rotation: Rotation
    motion: Attitudes
    x: FloatArray

    @property
    def values(self) -> FloatArray:
        return Priors.values(self.rotation, self.x)


@dataclass(frozen=True, eq=False)
class _Problem:
    """What an iteration does not change: times (n,), path and priors.

    floor: least variance of an observation; lasting: how many frames have the same errors of the features; stereo:
    the noise of a stereo rig, if the covariances are its at the measured points.
    """

    time: FloatArray
    path: Path
    sampled: SampledPath
    blocks: Blocks
    noise: FrameNoise | None
    priors: Priors
    floor: float
    lasting: float
    stereo: StereoNoise | None

    @cached_property
    def path_at_knots(self) -> FloatArray | None:
        """The path's Jacobian (k, 3, p) at the knots of the blocks; None if it is not smooth, or knots are no help."""
        smooth = np.isfinite(self.path.frequency) and self.sampled.seen_of is None
        return self.path.at(self.blocks.knots.ravel()).jacobian if smooth and worthwhile(self.blocks) else None

    def model(self, state: _State, points: FloatArray) -> Model:
        """What is seen of points (m, 3) at a state."""
        knots = None if self.path_at_knots is None else Knots(self.blocks, state.motion, self.path_at_knots)
        origin, turned = self.sampled.position(state.x), turned_by(self.sampled, state.x)
        return Model(state.motion, self.sampled, origin, points, self.noise, knots, turned)

    def equations(self, observations: Observations, state: _State, points: FloatArray) -> Equations:
        """The normal equations at a state, linearised at points (m, 3)."""
        return equations(observations, self.model(state, points))

    def moved(self, state: _State, change: FloatArray) -> _State | None:
        """The state after a change (q,) of the unknowns; None if the rotation is not possible."""
        size = state.rotation.size
        rotation = state.rotation.changed(np.zeros(3), change[:size])
        if not rotation.possible:
            rotation = replace(rotation, inertia=of_a_body(rotation.inertia))
        near = rotation.reaches(self.time, MAX_NODES + NODES_PER_FRAME * len(self.time))
        motion = rotation.try_at(self.time) if near else None
        return None if motion is None else _State(rotation, motion, state.x + change[size:])

    def with_weights(self, observations: Observations, state: _State, points: FloatArray) -> Observations:
        """The observations, if `stereo` with the covariances of the estimated points (m, 3)."""
        if self.stereo is None:
            return observations
        model = self.model(state, points)
        estimated = points @ np.swapaxes(model.attitude, 1, 2) + model.origin[:, None]
        return self.stereo.moved_to(estimated, observations.weight)


@dataclass(frozen=True, eq=False)
class _Iterate:
    """The result of an iteration; theta (h,): the hyperparameters; unknowns: how many the observations determine."""

    state: _State
    observations: Observations
    found: Equations
    variance: float
    theta: FloatArray
    unknowns: float = 0.0
    converged: bool = False
    rounds: int = 0


def maximised(tracks: FeatureTracks, pivot: Pivot, tumble: Tumble, options: PathOptions, done: Rounds) -> Likelihood:
    """The maximum, from the path of `pivot` and the fitted rotation, with as many modes of both noises as it needs.

    A tumble may tell the path far better than free attitudes do, and modes of which these see nothing.
    """
    measured = observations_of(tracks, tracks.seen)
    weight = np.where(tracks.seen, NEGLIGIBLE, 0.0)
    weight = np.where(pivot.observations.weight > 0, pivot.observations.weight, weight)
    observations, floor = measured.weighted(weight), least_variance(measured, ROUNDING)
    density = None if isinstance(options.torque_noise, str) else float(options.torque_noise)
    stereo = StereoNoise.of(measured) if pivot.stereo else None
    noise = _frame_noise(errors_of(tracks), pivot.slip, len(tracks.time), max(pivot.variance, floor))

    def problem_of(rotation: Rotation, path: Path, sampled: SampledPath) -> _Problem:
        priors = Priors.of(rotation, path, sampled.itself, _padded(pivot.solution.x, path), density)
        blocks = Blocks.over(tracks.time, _block_length(rotation, path))
        return _Problem(tracks.time, path, sampled, blocks, noise, priors, floor, pivot.lasting, stereo)

    rotation = tumble.rotation
    if options.torque_noise != "none":
        rotation = _with_modes(rotation, tracks.time)
    problem = problem_of(rotation, pivot.path, pivot.sampled)
    state = _State(rotation, rotation.at(tracks.time), pivot.solution.x)
    found = problem.equations(observations, state, common_points(pivot, tumble))
    at = _Iterate(state, observations, found, max(pivot.variance, floor), pivot.posterior.theta)
    best = _converged(problem, at, done)
    while best.converged:
        richer, path = _richer(best, tracks.time, density), _richer_path(problem, best)
        if richer is None and path is None:
            break
        rotation, sampled, x = richer or best.state.rotation, problem.sampled, best.state.x
        if path is not None:
            x = _padded(x, path)
            sampled = as_seen(path, interpolated(path.at, path.frequency, tracks.time), errors_of(tracks), x)
        problem = problem_of(rotation, path or problem.path, sampled)
        state = _State(rotation, rotation.at(tracks.time), x)
        found = problem.equations(best.observations, state, best.found.points)
        best = _converged(problem, replace(best, state=state, found=found, converged=False), done)
    residual = best.found.cost / _dof(best.observations, best.unknowns)
    variance = pivot.lasting * (residual if options.sigma is None else options.sigma**2)
    linear = problem.priors.linear(best.found, best.state.values, max(variance, floor))
    return Likelihood(
        rotation=best.state.rotation,
        motion=best.state.motion,
        x=best.state.x,
        path=problem.path,
        sampled=problem.sampled,
        blocks=problem.blocks,
        noise=noise,
        found=_of_true_size(best.found, problem.path, errors_of(tracks)),
        priors=problem.priors,
        posterior=posterior(linear, problem.priors.own, best.theta),
        observations=best.observations,
        variance=variance,
        residual_variance=residual,
        unknowns=best.unknowns,
        converged=best.converged,
        rounds=best.rounds,
    )


def _converged(problem: _Problem, start: _Iterate, done: Rounds) -> _Iterate:
    """Damped Gauss–Newton steps until steps and changes of the weights are small."""
    at, damping, own = start, DAMPING, problem.priors.own
    while not at.converged and at.rounds < MAX_ROUNDS:
        done.did(STAGE)
        values = at.state.values
        linear = problem.priors.linear(at.found, values, at.variance)
        theta = maximise(linear, own, _start(linear, own, at.theta))
        precision = held(linear, own, theta)[0]
        matrix = at.variance * (linear.information + np.diag(precision))
        rhs = at.variance * (linear.rhs - precision * values)
        cost = at.found.cost + at.variance * problem.priors.cost(values, precision)
        moved = None
        while moved is None and damping < 1e10:
            change = symmetric_pseudo_inverse(matrix + damping * np.diag(np.diag(matrix))) @ rhs
            moved = problem.moved(at.state, change)
            if moved is not None:
                found = problem.equations(at.observations, moved, at.found.points)
                reached = found.cost + at.variance * problem.priors.cost(moved.values, precision)
                if reached > cost + STEP_TOLERANCE * at.variance:
                    moved = None
            damping = damping * 10 if moved is None else damping / 30
        unknowns = len(values) - float(precision @ np.diag(conditional(linear, own, theta)[1]))
        at = replace(at, theta=theta, unknowns=unknowns, rounds=at.rounds + 1)
        if moved is None:
            return at
        dof = _dof(at.observations, unknowns)
        of_frame = max(found.cost / dof, problem.floor)
        variance = problem.lasting * of_frame
        weight = reweighted(found.squares, at.observations.weight, dof, problem.floor)
        unweighted = found.squares / np.where(weight > 0, at.observations.weight, 1.0)
        reduced = float(np.vdot(unweighted, weight) - found.squares.sum())
        steady = abs(reduced) <= WEIGHT_CHANGE_TOLERANCE * of_frame * dof
        converged = steady and float(change @ matrix @ change) <= STEP_TOLERANCE * variance and damping < 1e-2
        observations = at.observations
        if not converged and (problem.stereo is not None or not steady):
            observations = problem.with_weights(observations.weighted(weight), moved, found.points)
            found = problem.equations(observations, moved, found.points)
        at = replace(at, state=moved, observations=observations, found=found, variance=variance, converged=converged)
    return at


def _start(linear: Linear, own: Prior, theta: FloatArray) -> FloatArray:
    """The hyperparameters to start their search from, away from lower bounds, where the likelihood is flat.

    theta: those that are known, the last of them.
    """
    start = ranges(linear, own)[:, 0] + FLAT
    known = slice(len(start) - len(theta), None)
    start[known] = np.maximum(theta, start[known])
    return start


def _richer(best: _Iterate, time: FloatArray, density: float | None) -> Rotation | None:
    """The rotation with more modes of a torque, if those there do not suffice; None if they do."""
    rotation, span = best.state.rotation, float(time[-1] - time[0])
    if rotation.torque is None:
        return None
    # White noise of density q, twice integrated, has the spectrum q/f⁴; that of the attitudes' noise is 1/information.
    q = float(np.exp(best.theta[0])) if density is None else density
    corner = (q * _attitude_information(best) / span) ** 0.25
    waves = int(np.ceil(RESOLVED * corner * span / np.pi))
    if waves <= FEWEST_MODES:
        return None
    highest = min(waves + _half_turns(rotation, span), MOST_MODES, len(time) // 4)
    orders = np.union1d(rotation.torque.orders, np.arange(highest))
    if len(orders) <= len(rotation.torque.orders):
        return None
    return replace(rotation, torque=rotation.torque.with_orders(orders))


def _richer_path(problem: "_Problem", best: _Iterate) -> Path | None:
    """The path with as many modes of process noise as it needs; None if it has them."""
    if not isinstance(problem.path, Disturbed):
        return None
    linear = problem.priors.linear(best.found, best.state.values, best.variance)
    of_all, first = conditional(linear, problem.priors.own, best.theta)[1], best.state.rotation.size
    of_x, sampled = of_all[first:, first:], problem.sampled.itself
    path = None
    while (richer := enriched(path or problem.path, best.theta, sampled, of_x)) is not None:
        path = richer
    return path


def _padded(x: FloatArray, path: Path) -> FloatArray:
    """Unknowns x (p,) of a path with fewer modes, as those of a path."""
    return np.pad(x, (0, path.size - len(x)))


def turned_by(sampled: SampledPath, x: FloatArray) -> FloatArray | None:
    """The rotation vectors (n, 3) in C by which a camera with errors in x (p,) sees attitudes turned; None without."""
    return None if sampled.turn is None else sampled.turn @ x


def _of_true_size(found: Equations, path: Path, errors: SharedErrors | None) -> Equations:
    """The equations with the derivatives of the true points, which a camera of a wrong scale s sees times 1 + s."""
    if errors is None or errors.scale is None:
        return found
    by_unknowns = found.by_unknowns.copy()
    by_unknowns[:, found.rotation_size + errors_in(path).start + errors.scale] += found.points.ravel()
    return replace(found, by_unknowns=by_unknowns)


def _frame_noise(errors: SharedErrors | None, slip: float, frames: int, variance: float) -> FrameNoise | None:
    """That of the camera's attitude, and of a position that slips, for a variance of an observation of weight 1.

    slip: standard deviation of the position's white noise, m.
    """
    noisy = errors is not None and errors.noisy
    if not noisy and slip == 0:
        return None
    shift = np.tile(slip**2 / variance * np.eye(3), (frames, 1, 1))
    if errors is None or not noisy:
        return FrameNoise(np.zeros_like(shift), shift)
    return FrameNoise(errors.turn_covariance() / variance, shift)


def _with_modes(rotation: Rotation, time: FloatArray) -> Rotation:
    """The rotation with the modes of a torque that changes slowly in axes of the body or of the chaser.

    The latter are as many as half turns; of many, only those that are strong in the elements of the attitude.
    """
    span = float(time[-1] - time[0])
    if span <= 0:
        return rotation
    count = max(min(FEWEST_MODES + _half_turns(rotation, span), len(time) // 4), 1)
    orders = np.arange(count)
    if count > MANY_MODES:
        even = np.linspace(time[0], time[-1], 8 * count)
        power = (dct(rotation.at(even).attitude.reshape(-1, 9), axis=0, norm="ortho")[:count] ** 2).sum(axis=1)
        strong = np.argsort(power)[::-1][: MANY_MODES - FEWEST_MODES]
        orders = np.union1d(np.arange(FEWEST_MODES), strong)
    return replace(rotation, torque=Torque.none(float(time[0]), float(time[-1]), orders))


def _half_turns(rotation: Rotation, span: float) -> int:
    """The number of half turns in a span in s, at the rate at the epoch."""
    return int(np.ceil(float(np.linalg.norm(rotation.rate)) * span / np.pi))


def _attitude_information(best: _Iterate) -> float:
    """The information on the attitude in all frames, 1/rad², a mean over axes, for a known centre of mass."""
    squares = np.einsum("mi,mi->m", best.found.points, best.found.points)
    weight = best.observations.weight
    if best.observations.precision is not None:
        weight = weight * np.trace(best.observations.precision, axis1=2, axis2=3) / 3
    return float(2 / 3 * (weight @ squares).sum() / best.variance)


def _block_length(rotation: Rotation, path: Path) -> float:
    """The longest block in s in which rotation and path are polynomials, or the rotation alone if the path jumps."""
    rate = float(np.linalg.norm(rotation.rate))
    torque = 0.0 if rotation.torque is None else rotation.torque.highest_frequency
    highest = max(rate + torque, path.frequency if np.isfinite(path.frequency) else 0.0)
    return PHASE / highest if highest > 0 else np.inf


def _dof(observations: Observations, unknowns: float) -> float:
    seen = np.count_nonzero(observations.weight.max(axis=0, initial=0.0) > NEGLIGIBLE)
    return max(3 * float(observations.weight.sum()) - 3 * seen - unknowns, 1.0)


def common_points(pivot: Pivot, tumble: Tumble) -> FloatArray:
    """The points (m, 3) of all features in the axes B of the tumble, m; means where bodies share features."""
    m = pivot.observations.weight.shape[1]
    total, points = np.zeros(m), np.zeros((m, 3))
    for body, R_B_S in zip(pivot.bodies, tumble.bodies, strict=True):
        weight = pivot.observations.weight[np.ix_(body.frames, body.features)].sum(axis=0)
        points[body.features] += weight[:, None] * (body.points @ R_B_S.T)
        total[body.features] += weight
    return np.asarray(points / np.where(total > 0, total, 1.0)[:, None])

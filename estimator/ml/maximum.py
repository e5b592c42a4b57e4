"""The maximum a posteriori estimate, with as many modes of process noise and of torque as the tracks tell."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.degrees_of_freedom import degrees_of_freedom_of_points, least_variance
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.reweighting import NEGLIGIBLE
from baryscope.estimator.adjustment.stereo import StereoNoise, observations_of
from baryscope.estimator.camera.shared import SharedErrors
from baryscope.estimator.dynamics.rotation import Attitudes, Rotation
from baryscope.estimator.hyperparameters.integration import Posterior, posterior
from baryscope.estimator.ml.initial_tumble import Tumble
from baryscope.estimator.ml.iteration import ROUNDING, Iterate, Problem, State, iterated
from baryscope.estimator.ml.jacobians import PHASE
from baryscope.estimator.ml.likelihood import Equations
from baryscope.estimator.ml.model import FrameNoise
from baryscope.estimator.ml.priors import Priors
from baryscope.estimator.ml.torque_modes import with_modes, with_needed_modes
from baryscope.estimator.options import PathOptions
from baryscope.estimator.paths.blocks import Blocks
from baryscope.estimator.paths.interpolated_path import interpolated
from baryscope.estimator.paths.path import Path
from baryscope.estimator.paths.process_noise import enriched, with_fewest_modes
from baryscope.estimator.paths.sampled_path import SampledPath
from baryscope.estimator.paths.seen_path import as_seen, errors_in, growth_in
from baryscope.estimator.pivot.pivot_solution import PivotSolution
from baryscope.estimator.progress import Rounds
from baryscope.estimator.tracks import FeatureTracks, errors_of

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MaximumAPosteriori:
    """The maximum a posteriori estimate of motion, path and points, with the normal equations there.

    equations: with points of their true size, which a camera of a wrong scale sees `growth` times as large;
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
    equations: Equations
    growth: float
    priors: Priors
    posterior: Posterior
    observations: Observations
    variance: float
    residual_variance: float
    unknowns: float
    converged: bool
    rounds: int

    @property
    def seen_points(self) -> FloatArray:
        """The points (m, 3) in B, m, as the camera sees them."""
        return self.growth * self.equations.points


@dataclass(frozen=True, eq=False)
class _Given:
    """What holds however many modes path and torque have.

    density: that of the white torque, rad²/s³, None if it is estimated. The others are as in `Problem`.
    """

    tracks: FeatureTracks
    pivot: PivotSolution
    density: float | None
    noise: FrameNoise | None
    floor: float
    stereo: StereoNoise | None

    def problem(self, rotation: Rotation, path: Path, sampled: SampledPath) -> Problem:
        """The problem of a rotation and a path, sampled at the tracks' times, with their modes."""
        time, x = self.tracks.time, _resized(self.pivot.solution.x, path)
        priors = Priors.of(rotation, path, sampled.itself, x, self.density)
        blocks = Blocks.over(time, _block_length(rotation, path))
        return Problem(
            time=time,
            path=path,
            sampled=sampled,
            blocks=blocks,
            noise=self.noise,
            priors=priors,
            floor=self.floor,
            lasting=self.pivot.lasting,
            free_variance=max(self.pivot.residual_variance, self.floor),
            stereo=self.stereo,
        )

    def enriched(self, problem: Problem, best: Iterate) -> tuple[Problem, Iterate] | None:
        """The problem with as many modes of both noises as it needs, and its start; None if it has them."""
        time, errors = self.tracks.time, errors_of(self.tracks)
        turning, path = self._richer_rotation(best), _richer_path(problem, best)
        if turning is None and path is None:
            return None
        rotation, sampled, x = turning or best.state.rotation, problem.sampled, best.state.x
        if path is not None:
            sampled, x = _sampled(path, x, time, errors)
        wider = self.problem(rotation, path or problem.path, sampled)
        state = State(rotation, rotation.at(time), x)
        found = wider.equations(best.observations, state, best.equations.points)
        return wider, replace(best, state=state, equations=found, converged=False)

    def _richer_rotation(self, best: Iterate) -> Rotation | None:
        """The rotation with more modes of a torque, if those there do not suffice; None if they do."""
        rotation = best.state.rotation
        if rotation.torque is None:
            return None
        density = float(np.exp(best.theta[0])) if self.density is None else self.density
        information = _attitude_information(best)
        return with_needed_modes(rotation, rotation.torque, self.tracks.time, density, information)


def maximised(
    tracks: FeatureTracks, pivot: PivotSolution, tumble: Tumble, options: PathOptions, done: Rounds
) -> MaximumAPosteriori:
    """The maximum, from the path of `pivot` and the fitted rotation, with as many modes of both noises as it needs.

    A tumble may tell the path far better than free attitudes do, and modes of which these see nothing.
    """
    measured, errors = observations_of(tracks, tracks.seen), errors_of(tracks)
    weight = np.where(tracks.seen, NEGLIGIBLE, 0.0)
    weight = np.where(pivot.observations.weight > 0, pivot.observations.weight, weight)
    observations, floor = measured.weighted(weight), least_variance(measured, ROUNDING)
    variance = max(pivot.variance, floor)
    density = None if isinstance(options.torque_noise, str) else float(options.torque_noise)
    stereo = StereoNoise.of(measured, max(pivot.frame_variance, floor)) if pivot.stereo else None
    noise = FrameNoise.of(errors, pivot.slip.deviation, len(tracks.time), variance)
    given = _Given(tracks, pivot, density, noise, floor, stereo)

    rotation = tumble.rotation if options.torque_noise == "none" else with_modes(tumble.rotation, tracks.time)
    path, sampled, x = pivot.path, pivot.sampled, pivot.solution.x
    posed = np.concatenate([body.frames for body in pivot.bodies])
    if np.isin(np.flatnonzero(tracks.seen.any(axis=1)), posed, invert=True).any():
        # Many modes would follow what the fitted rotation is off at first where no attitude is seen, for good.
        path = with_fewest_modes(pivot.path)
    if path is not pivot.path:
        sampled, x = _sampled(path, x, tracks.time, errors)
    problem = given.problem(rotation, path, sampled)
    state = State(rotation, rotation.at(tracks.time), x)
    found = problem.equations(observations, state, common_points(pivot, tumble))
    best = iterated(problem, Iterate(state, observations, found, variance, pivot.posterior.theta), done)
    while best.converged and (richer := given.enriched(problem, best)) is not None:
        problem, start = richer
        best = iterated(problem, start, done)

    residual = best.equations.cost / degrees_of_freedom_of_points(best.observations, best.unknowns)
    variance = pivot.lasting * (residual if options.sigma is None else options.sigma**2)
    linear = problem.priors.linear(best.equations, best.state.values, max(variance, floor))
    growth = growth_in(problem.path, errors, best.state.x)
    return MaximumAPosteriori(
        rotation=best.state.rotation,
        motion=best.state.motion,
        x=best.state.x,
        path=problem.path,
        sampled=problem.sampled,
        blocks=problem.blocks,
        noise=noise,
        equations=_of_true_size(best.equations, problem.path, errors, growth),
        growth=growth,
        priors=problem.priors,
        posterior=posterior(linear, problem.priors.own, best.theta),
        observations=best.observations,
        variance=variance,
        residual_variance=residual,
        unknowns=best.unknowns,
        converged=best.converged,
        rounds=best.rounds,
    )


def _richer_path(problem: Problem, best: Iterate) -> Path | None:
    """The path with as many modes of process noise as it needs; None if it has them."""
    information = np.diag(best.equations.matrix)[best.state.rotation.size :] / best.variance
    return enriched(problem.path, best.theta, information)


def _sampled(
    path: Path, x: FloatArray, time: FloatArray, errors: SharedErrors | None
) -> tuple[SampledPath, FloatArray]:
    """A path as it is seen at times (n,) in s, and its unknowns, from x (p,) of one with other modes."""
    x = _resized(x, path)
    return as_seen(path, interpolated(path.at, path.frequency, time), errors, x), x


def _resized(x: FloatArray, path: Path) -> FloatArray:
    """Unknowns x (p,) of a path with fewer or more modes, as those of a path."""
    return np.pad(x[: path.size], (0, max(path.size - len(x), 0)))


def _of_true_size(found: Equations, path: Path, errors: SharedErrors | None, growth: float) -> Equations:
    """The equations with the true points and their derivatives; a camera of a wrong scale s sees them times 1 + s."""
    if errors is None or errors.scale is None:
        return found
    points, by_unknowns = found.points / growth, found.by_unknowns / growth
    by_unknowns[:, found.rotation_size + errors_in(path).start + errors.scale] += points.ravel() / growth
    return replace(found, points=points, by_unknowns=by_unknowns, points_covariance=found.points_covariance / growth**2)


def _attitude_information(best: Iterate) -> float:
    """The information on the attitude in all frames, 1/rad², a mean over axes, for a known centre of mass."""
    squares = np.einsum("mi,mi->m", best.equations.points, best.equations.points)
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


def common_points(pivot: PivotSolution, tumble: Tumble) -> FloatArray:
    """The points (m, 3) of all features in the axes B of the tumble, m; means where bodies share features."""
    m = pivot.observations.weight.shape[1]
    total, points = np.zeros(m), np.zeros((m, 3))
    for body, R_B_S in zip(pivot.bodies, tumble.bodies, strict=True):
        weight = pivot.observations.weight[body.block].sum(axis=0)
        points[body.features] += weight[:, None] * (body.points @ R_B_S.T)
        total[body.features] += weight
    return np.asarray(points / np.where(total > 0, total, 1.0)[:, None])

"""The passes of `ekf`: linearise, choose the process noise, filter and smooth, until the linearisation holds."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from baryscope.estimator.adjustment.lasting_errors import frames_per_error
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.reweighting import WEIGHT_CHANGE_TOLERANCE, reweighted
from baryscope.estimator.adjustment.stereo import StereoNoise, stereo_noise
from baryscope.estimator.dynamics.inertia import of_a_body
from baryscope.estimator.ekf.bank import GENEROUS, Bank, Member
from baryscope.estimator.ekf.camera import CameraErrors
from baryscope.estimator.ekf.linearised import (
    INERTIA,
    RATE,
    TURN,
    Linearised,
    Reference,
    linearised,
    moved,
    points_in,
    residuals,
)
from baryscope.estimator.ekf.motion import mean_gradient_axis
from baryscope.estimator.ekf.problem import FAR, ROUNDING, Problem
from baryscope.estimator.ekf.smoothness import Smoothness
from baryscope.estimator.ekf.solution import Parameters, Prior, Solution, diverged, log_likelihoods, mixed, solve
from baryscope.estimator.geometry.alignment import FEWEST_POINTS
from baryscope.estimator.geometry.symmetric import eigen
from baryscope.estimator.registration.body import Body
from baryscope.estimator.tracks import FloatArray
from baryscope.models.errors import ComputationError

MAX_PASSES = 12  # a filter that does not come to rest in so many is taken for one that does not
ROUGH_TURN = 0.03  # rad, median of a pass
MAX_TURN, MAX_RATE_RATIO = 1.0, 3.0  # of a pass: greater turns in rad, or rates over the greatest at first, are cut
TOLERANCE = 0.1  # of the linearisation, in standard deviations of the position
STEP_TOLERANCE = 0.1  # squared length of the last step of the inertia, in units of its covariance
LOST = 1e-15  # of the greatest variance of the inertia's coefficients: a smaller one is rounding
MAX_SOUGHT = 3  # how often a path's hyperparameters are sought anew
THETA_TOLERANCE = 0.1  # of these logarithms
VARIANCE_TOLERANCE = 0.05  # change of the logarithm of an observation's variance
ANOTHER_VARIANCE = np.log(2.0)  # change of it, from which on the process noise is sought anew


@dataclass(frozen=True, eq=False)
class Pass:
    """A pass: the system about a reference, and the solution for the best member.

    noise_variance: to which the process noise was relative; frame_variance: of an observation of weight 1, as given or
    from the innovations, residual_variance; lasting: how many frames have the same errors of the features; after: the
    reference after the pass; weight (frames, m): new weights; bank: None in the first pass; linear: whether the
    linearisation error is small; steady: whether the weights are settled.
    """

    observations: Observations
    system: Linearised
    prior: Prior
    dof: float
    bank: Bank | None
    member: Member
    noise_variance: float
    solution: Solution
    parameters: Parameters
    frame_variance: float
    residual_variance: float
    lasting: float
    after: Reference
    weight: FloatArray
    linear: bool
    steady: bool

    @property
    def variance(self) -> float:
        """The variance of an observation of weight 1 in what all frames tell together."""
        return self.lasting * self.frame_variance

    @property
    def settled(self) -> bool:
        """Whether the variance is about that to which the process noise was relative."""
        return bool(abs(np.log(self.variance / self.noise_variance)) <= VARIANCE_TOLERANCE)

    @property
    def final(self) -> bool:
        """Whether another pass would change nothing."""
        return self.bank is not None and self.linear and self.steady and self.settled


@dataclass(frozen=True, eq=False)
class Passes:
    """The last of `count` passes, and what follows from it; covariances are averaged only where they are asked for.

    about: what the last pass is linearised about, its nominal path moved by shift (s,).
    """

    problem: Problem
    about: Reference
    shift: FloatArray
    last: Pass
    count: int

    @property
    def converged(self) -> bool:
        """Whether the linearisation holds, and the weights are settled."""
        return self.last.final

    @cached_property
    def members(self) -> tuple[Member, ...]:
        """The probable members (k,) of the last bank."""
        return self._posterior[0]

    @cached_property
    def probability(self) -> FloatArray:
        """Their probabilities (k,)."""
        return self._posterior[1]

    @cached_property
    def mean_density(self) -> Member:
        """The mean densities of the process noises, over improbable members, too."""
        return self.last.member if self.last.bank is None else self.last.bank.mean(self.last.member)

    @cached_property
    def variance(self) -> FloatArray:
        """The variance (k,) of an observation of weight 1 for each member."""
        least, given, last = self.problem.floor, self.problem.given_variance, self.last
        own = [given or max(parameters.squares / last.dof, least) for _, parameters in self._solved]
        return last.lasting * np.array(own)

    @cached_property
    def solution(self) -> Solution:
        """The mean over the members, in SI units."""
        return mixed([one for one, _ in self._solved], self.probability, self.variance)

    @cached_property
    def reference(self) -> Reference:
        """The reference of the solution."""
        return moved(self.about, self.solution.state, self.solution.theta)

    @cached_property
    def _posterior(self) -> tuple[tuple[Member, ...], FloatArray]:
        if self.last.bank is None:
            return (self.last.member,), np.ones(1)
        members, probability = self.last.bank.posterior(self.last.member)
        return tuple(members), probability

    @cached_property
    def _solved(self) -> list[tuple[Solution, Parameters]]:
        last = self.last
        known = {} if len(self.problem.theta) else {last.member: (last.solution, last.parameters)}
        others = [member for member in self.members if member not in known]
        if others:
            noise = self.problem.noise(others, last.noise_variance)
            known |= zip(others, solve(last.system, noise, last.prior, self.added), strict=True)
        return [known[member] for member in self.members]

    @cached_property
    def added(self) -> FloatArray | float:
        """What the uncertainty of the path's hyperparameters adds to the covariance of the parameters."""
        theta = self.problem.theta
        return _smoothness(self.problem, self.about, self.last).added(theta) if len(theta) else 0.0


def passes(problem: Problem) -> Passes:
    """Passes until the linearisation holds, the first with generous process noise, and the mean over the bank.

    The hyperparameters of a smooth path are then sought anew, as a tumble tells more of the path than free attitudes.
    """
    start, time = problem.start, problem.start.nodes.time
    axis = mean_gradient_axis(start.rotation.orbit, time)
    shift, still = np.zeros(problem.path.size), np.zeros((len(time), 6))
    path, inertia = problem.process(shift), of_a_body(start.rotation.inertia)
    reference = Reference(
        path=path,
        x=shift,
        deviation=still,
        attitude=start.attitude,
        rate=start.rate,
        inertia=inertia,
        points=start.points,
        axis=axis,
        camera=CameraErrors.of(problem.errors, problem.path),
    )
    observations = problem.measured.weighted(start.weight)
    variance = problem.given_variance or max(start.noise**2 / problem.unit, problem.floor)
    last = _pass(problem, reference, shift, observations, variance, None)
    told = problem.given_variance or 1.0
    stereo = stereo_noise(problem.measured, last.after.seen_at(start.nodes), problem.options.noise, told)
    count, sought = 1, 0
    while count < MAX_PASSES:
        if last.final:
            theta = problem.theta if sought == MAX_SOUGHT else _likeliest(problem, reference, last)
            given, stereo = stereo, None if stereo is None else stereo.of_variance(last.frame_variance)
            if np.allclose(theta, problem.theta, rtol=0.0, atol=THETA_TOLERANCE) and stereo is given:
                break
            problem, sought = replace(problem, theta=theta), sought + 1
        reference = last.after
        if problem.on_orbit:
            shift = shift + reference.x
            reference = replace(reference, path=problem.process(shift), x=np.zeros_like(shift), deviation=still)
        last = _pass(problem, reference, shift, _renewed(problem, stereo, last), last.variance, last)
        count += 1
    return Passes(problem, reference, shift, last, count)


def _smoothness(problem: Problem, about: Reference, last: Pass) -> Smoothness:
    """What the last pass, linearised about a reference, tells of a smooth path."""
    x = about.x + last.parameters.theta[INERTIA : INERTIA + len(about.x)]
    return Smoothness.of(last.parameters, last.prior, problem.path.prior, x, last.noise_variance)


def _likeliest(problem: Problem, about: Reference, last: Pass) -> FloatArray:
    """The likeliest hyperparameters (h,) of the path after a pass."""
    theta = problem.theta
    return _smoothness(problem, about, last).likeliest(theta) if len(theta) else theta


def refuse_lost(origin: FloatArray, seen: FloatArray) -> None:
    """Check that a path (n, 3) is not further away than its weak prior says, for features seen at (n, m, 3), in m.

    Raises:
        ComputationError: it is, as passes that do not come to rest may lead anywhere.
    """
    if not np.abs(origin).max() <= FAR * np.abs(seen).max():
        raise diverged()


def _pass(
    problem: Problem,
    reference: Reference,
    shift: FloatArray,
    observations: Observations,
    variance: float,
    last: Pass | None,
) -> Pass:
    """A pass; the noise of the first is generous, that of the others from a bank around the last one's."""
    nodes, noise = problem.start.nodes, problem.frame_noise(variance)
    system = linearised(reference, nodes, observations, noise)
    prior = problem.prior(reference, reference.x + shift, variance)
    dof = problem.dof(observations)
    bank, member = _process_noise(problem, system, prior, dof, variance, last)
    member, solution, parameters = _solved(problem, system, prior, variance, bank, member)
    lasting = 1.0 if last is None else last.lasting
    residual_variance = max(parameters.squares / dof, problem.floor)
    used = problem.given_variance or residual_variance
    after = moved(reference, _bounded(problem, reference, solution), solution.theta)
    refuse_lost(after.origin, observations.position)
    squares = observations.weight * observations.squares(residuals(after, nodes, observations, noise))
    turn = np.linalg.norm(solution.state[system.seen, TURN], axis=1)
    rough = bank is None or float(np.median(turn)) > ROUGH_TURN  # the residuals do not tell outliers yet
    weight = observations.weight if rough else reweighted(squares, observations.weight, dof, problem.floor)
    if not rough:
        lasting = _frames_per_error(problem, observations, after)
    changed = float(np.vdot(squares, weight / np.where(observations.weight > 0, observations.weight, 1.0) - 1))
    problem.rounds.did(0.5)
    return Pass(
        observations=observations,
        system=system,
        prior=prior,
        dof=dof,
        bank=bank,
        member=member,
        noise_variance=variance,
        solution=solution,
        parameters=parameters,
        frame_variance=used,
        residual_variance=residual_variance,
        lasting=lasting,
        after=after,
        weight=weight,
        linear=_is_linear(problem, reference, solution, lasting * used)
        or _has_stayed(problem, after, solution, lasting * used, last),
        steady=not rough and abs(changed) <= WEIGHT_CHANGE_TOLERANCE * float(squares.sum()),
    )


def _process_noise(
    problem: Problem, system: Linearised, prior: Prior, dof: float, variance: float, last: Pass | None
) -> tuple[Bank | None, Member]:
    """The bank of process noises and its best member: one around that of the last pass, unless that stands already.

    In the first pass there is no bank, and the noise is generous.
    """
    axes = problem.axes(variance)
    if last is None:
        return None, Member(axes[0].at(GENEROUS), problem.first_torque(axes[1]))
    if last.bank and last.linear and last.settled:
        return last.bank, last.member
    lasting = last.lasting

    def scores(members: Sequence[Member]) -> FloatArray:
        values = (dof + problem.weakly_known) / lasting
        given = problem.given_variance and lasting * problem.given_variance
        return log_likelihoods(system, problem.noise(members, variance), prior, values, given)

    bank = Bank(*axes, scores)
    ratio = variance / last.noise_variance
    near = last.bank is not None and abs(np.log(ratio)) < ANOTHER_VARIANCE
    return bank, bank.best(bank.scaled(last.member, ratio) if near else None)


def _solved(
    problem: Problem, system: Linearised, prior: Prior, variance: float, bank: Bank | None, member: Member
) -> tuple[Member, Solution, Parameters]:
    """The solution for a member; in the first pass with plenty of torque noise, where there is none for less.

    Raises:
        ComputationError: there is none.
    """
    try:
        return member, *solve(system, problem.noise([member], variance), prior)[0]
    except ComputationError:
        turn = problem.axes(variance)[1]
        if bank is not None or not turn.free:
            raise
        # The motion is unstable, and lost in rounding without noise.
        member = replace(member, turn=problem.plenty_of_torque(turn))
        return member, *solve(system, problem.noise([member], variance), prior)[0]


def _frames_per_error(problem: Problem, observations: Observations, after: Reference) -> float:
    """How many frames have the same errors of the features, about a reference."""
    frames = np.flatnonzero((observations.weight > 0).sum(axis=1) >= FEWEST_POINTS)
    attitude, origin, points = after.as_seen(problem.start.nodes)
    return frames_per_error([Body(np.arange(len(points)), frames, points, attitude[frames])], observations, origin)


def _bounded(problem: Problem, reference: Reference, solution: Solution) -> FloatArray:
    """The state (n, d) with turns and rates that the linearisation may be moved by: others are shortened.

    Raises:
        ComputationError: they are not finite.
    """
    state = solution.state.copy()
    turn, rate = state[:, TURN], reference.rate + state[:, RATE]
    if not (np.isfinite(state).all() and np.isfinite(solution.theta).all()):
        raise diverged()
    most = MAX_RATE_RATIO * float(np.linalg.norm(problem.start.rate, axis=1).max())
    turn *= np.minimum(1.0, MAX_TURN / np.maximum(np.linalg.norm(turn, axis=1), 1e-300))[:, None]
    rate *= np.minimum(1.0, most / np.maximum(np.linalg.norm(rate, axis=1), 1e-300))[:, None]
    state[:, RATE] = rate - reference.rate
    return state


def _renewed(problem: Problem, stereo: StereoNoise | None, last: Pass) -> Observations:
    """The observations with new weights, and covariances at the estimated points."""
    if stereo is None:
        return last.observations.weighted(last.weight)
    return stereo.moved_to(last.after.seen_at(problem.start.nodes), last.weight)


def _is_linear(problem: Problem, reference: Reference, solution: Solution, variance: float) -> bool:
    """Whether terms of second order are small: of turns times points, of rate and inertia over the time span, and of
    errors of the camera times what moves.
    """
    turn = float(np.linalg.norm(solution.state[:, TURN], axis=1).max())
    rate = float(np.linalg.norm(solution.state[:, RATE], axis=1).max())
    inertia = float(np.linalg.norm(solution.theta[:INERTIA]))
    points = float(np.abs(solution.theta[points_in(len(reference.x))]).max())
    speed = float(np.linalg.norm(reference.rate, axis=1).max())
    radius = float(np.linalg.norm(reference.points, axis=1).max())
    error = turn * (turn * radius + points) + radius * problem.span * inertia * (rate + speed * inertia)
    if reference.camera is not None:
        shift = float(np.linalg.norm(solution.state[:, :3], axis=1).max())
        error += reference.camera.greatest(solution.theta[INERTIA:][: len(reference.x)]) * (shift + turn * radius)
    least = float(_position_variance(solution).min())
    return bool(error < TOLERANCE * np.sqrt(max(variance * least, 0.0)) + ROUNDING * radius)


def _has_stayed(problem: Problem, after: Reference, solution: Solution, variance: float, last: Pass | None) -> bool:
    """Whether path and inertia have hardly moved since the last pass with a bank."""
    if last is None or last.bank is None:
        return False
    inertia, own = solution.theta[:INERTIA], variance * solution.of_theta[:INERTIA, :INERTIA]
    if squared_length(inertia, own) > STEP_TOLERANCE:
        return False
    squares = np.sum((after.origin - last.after.origin) ** 2, axis=1)
    return bool(np.all(squares <= TOLERANCE**2 * variance * _position_variance(solution) + problem.floor))


def squared_length(step: FloatArray, covariance: FloatArray) -> float:
    """The square of a step (q,) in units of a covariance (q, q), whose smallest variances may be lost in rounding."""
    values, axes = eigen(covariance)
    return float(np.sum((axes.T @ step) ** 2 / np.maximum(values, LOST * values[-1] + 1e-300)))


def _position_variance(solution: Solution) -> FloatArray:
    """The sum (n,) of the variances of the position's coordinates, in the units of the weights."""
    return np.asarray(np.trace(solution.of_state[:, :3, :3], axis1=1, axis2=2))

"""The solution of the linearised problem for one or several process noises: parameters, states, likelihood."""

from dataclasses import dataclass
from math import ceil

import numpy as np

from baryscope.estimator.ekf.filter import FilterHistory, Forward, ProcessNoise, filtered, smoothed
from baryscope.estimator.ekf.linearised import TURN, Linearised
from baryscope.estimator.geometry.symmetric import eigen
from baryscope.estimator.tracks import FloatArray
from baryscope.models.errors import ComputationError, Reason

LARGEST = 1e100  # number in a cost that is still one
MARGIN = 10.0  # of an eigenvalue of the parameters' scaled information over its rounding errors, to be known
LOST = 1e-6  # of the squares at the reference, by which those at the minimum are negative: lost in rounding
INDISTINCT = 1e-3  # such rounding errors of which hardly anything is known
MEMORY = 1e8  # bytes for the smoother of some members at a time
IMPOSSIBLE = -1e300  # logarithm of a likelihood that is 0, of which differences are numbers


@dataclass(frozen=True, eq=False)
class Prior:
    """A Gaussian prior of the parameters θ (q,): mean, and information (q, q) in the units of the weights."""

    mean: FloatArray
    information: FloatArray


@dataclass(frozen=True, eq=False)
class Parameters:
    """The parameters for one member: theta (q,), and their covariance (q, q) in the units of the weights.

    Without the prior: information (q, q) and gradient (q,) of half the cost there. squares: weighted sum of squared
    innovations; log_determinant of the innovations' covariance and of the parameters' information.
    """

    theta: FloatArray
    covariance: FloatArray
    information: FloatArray
    gradient: FloatArray
    squares: float
    log_determinant: float


def parameters_of(forward: Forward, member: int, prior: Prior) -> Parameters:
    """The parameters that minimise the quadratic cost of a member.

    Directions whose information is lost in rounding, as that of an offset that generous noise of the path hides, have
    that of the prior alone.

    Raises:
        ComputationError: the cost has overflown or is lost in rounding, or in a direction without a prior.
    """
    cost = forward.cost[member]
    matrix = cost[1:, 1:] + prior.information
    if not (np.isfinite(cost).all() and np.abs(cost).max() < LARGEST and np.diag(matrix).min() > 0):
        raise diverged()
    scale = 1 / np.sqrt(np.diag(matrix))
    values, axes = eigen(matrix * np.outer(scale, scale))
    rounding = MARGIN * float(np.max(forward.rounding[member, 1:, 1:] * np.outer(scale, scale)))
    known = values > rounding
    own = scale[:, None] * axes[:, ~known]
    of_prior = own.T @ prior.information @ own
    least = np.linalg.eigvalsh(of_prior)
    if rounding > INDISTINCT or least.min(initial=1.0) <= 0:
        raise diverged()
    axes = scale[:, None] * axes[:, known]
    theta = axes @ ((axes.T @ (prior.information @ prior.mean - cost[1:, 0])) / values[known])
    try:
        theta += own @ np.linalg.solve(of_prior, own.T @ prior.information @ (prior.mean - theta))
        of_own = own @ np.linalg.inv(of_prior) @ own.T
    except np.linalg.LinAlgError as error:  # positive, but by so little that it is none
        raise diverged() from error
    off = theta - prior.mean
    squares = cost[0, 0] + 2 * cost[1:, 0] @ theta + theta @ cost[1:, 1:] @ theta + off @ prior.information @ off
    if squares < -LOST * abs(cost[0, 0]):
        raise diverged()
    determinant = float(np.log(values[known]).sum() + np.log(least).sum() - 2 * np.log(scale).sum())
    covariance = (axes / values[known]) @ axes.T + of_own
    determinant += float(forward.log_determinant[member])
    gradient = cost[1:, 0] + cost[1:, 1:] @ theta
    return Parameters(theta, covariance, cost[1:, 1:], gradient, float(squares), determinant)


def log_likelihoods(
    system: Linearised, noise: ProcessNoise, prior: Prior, dof: float, variance: float | None
) -> FloatArray:
    """The restricted log-likelihoods (k,) of the members, for a known or an unknown variance of an observation.

    dof: values less parameters without a prior, of which a proper one counts as an observation. `IMPOSSIBLE` where the
    cost has overflown.
    """
    forward = filtered(system, noise)
    likelihood = np.full(len(noise.density), IMPOSSIBLE)
    for member in range(len(likelihood)):
        try:
            found = parameters_of(forward, member, prior)
        except ComputationError:
            continue
        squares = max(found.squares, 1e-300)
        misfit = dof * np.log(squares) if variance is None else squares / variance
        likelihood[member] = -0.5 * (found.log_determinant + misfit)
    return likelihood


def diverged() -> ComputationError:
    """The error to raise where the linearised system has lost the motion."""
    return ComputationError(
        "the filter diverges with any process noise: the features do not move as one body", Reason.DIVERGED
    )


@dataclass(frozen=True, eq=False)
class Solution:
    """Means and covariances of parameters and states, covariances in the units of the weights, or in SI from `mixed`.

    theta (q,), of_theta (q, q); state (n, d), of_state (n, d, d), and crossed (n, d, q), their covariance with θ;
    spread (2, n, 3, 3): covariance of the deviation of the attitude, as it is seen, from its mean over time, by θ, and
    by the noise of the states without what that does to the mean.
    """

    theta: FloatArray
    of_theta: FloatArray
    state: FloatArray
    of_state: FloatArray
    crossed: FloatArray
    spread: FloatArray


def solve(
    system: Linearised, noise: ProcessNoise, prior: Prior, added: FloatArray | float = 0.0
) -> list[tuple[Solution, Parameters]]:
    """The solutions of all members; added (q, q): to the covariance of the parameters, in the units of the weights."""
    n, (d, c), k = len(system.observed), system.first.shape, len(noise.density)
    parts = max(1, ceil(8.0 * k * n * (d + 6) * (c + d) / MEMORY))
    at_once = ceil(k / parts)
    room, found = FilterHistory.room(system, at_once), []
    for begin in range(0, k, at_once):
        part = noise.of(slice(begin, begin + at_once))
        history = room.of(slice(len(part.density)))
        forward = filtered(system, part, history)
        state, covariance = smoothed(system, history)
        for member in range(len(part.density)):
            parameters = parameters_of(forward, member, prior)
            theta, of_theta = parameters.theta, parameters.covariance + added
            by_theta, own = state[:, member, :, 1:], covariance[:, member]
            crossed = by_theta @ of_theta
            mean = state[:, member, :, 0] + by_theta @ theta
            turns = system.turns_seen(by_theta[:, TURN], np.eye(len(theta)))
            off = turns - turns[system.seen].mean(axis=0)
            spread = np.stack([off @ of_theta @ np.swapaxes(off, 1, 2), own[:, TURN, TURN]])
            own = own + crossed @ np.swapaxes(by_theta, 1, 2)
            found.append((Solution(theta, of_theta, mean, own, crossed, spread), parameters))
    return found


def mixed(solutions: list[Solution], weight: FloatArray, variance: FloatArray) -> Solution:
    """The mean and covariance of a mixture with probabilities weight (k,); variance (k,): factors on covariances."""
    theta = np.einsum("k,kq->q", weight, np.array([one.theta for one in solutions]))
    state = sum((w * one.state for w, one in zip(weight, solutions, strict=True)), np.zeros_like(solutions[0].state))
    of_theta, of_state = np.zeros_like(solutions[0].of_theta), np.zeros_like(solutions[0].of_state)
    crossed, spread = np.zeros_like(solutions[0].crossed), np.zeros_like(solutions[0].spread)
    for w, factor, one in zip(weight, variance, solutions, strict=True):
        off, off_state = one.theta - theta, one.state - state
        of_theta += w * (factor * one.of_theta + np.outer(off, off))
        of_state += w * (factor * one.of_state + off_state[:, :, None] * off_state[:, None])
        crossed += w * (factor * one.crossed + off_state[:, :, None] * off)
        spread += w * factor * one.spread
    return Solution(theta, of_theta, state, of_state, crossed, spread)

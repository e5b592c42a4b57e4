"""Further nodes of the smoother of `ekf`, at any times and on the way to them.

A node without observations changes nothing for the others. So the smoothed state there, with the process noise since
the last observation, is a prediction, in gaps and ahead alike. The parameters are those of the first frame's node.
So the states before it follow from that one, backwards: s_k = F⁻¹ (s_{k+1} − w_k), with noise that nothing tells.
"""

from dataclasses import dataclass, replace

import numpy as np

from baryscope.estimator.dynamics.rotation import too_long
from baryscope.estimator.ekf.linearised import Linearised, Nodes, Reference, linearised
from baryscope.estimator.ekf.motion import mean_gradient_axis, rotated
from baryscope.estimator.ekf.passes import Passes
from baryscope.estimator.ekf.solution import Solution, mixed, solve
from baryscope.estimator.ekf.start import MAX_NODES, NODE_ANGLE
from baryscope.estimator.tracks import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class FurtherNodes:
    """The states at nodes that include further ones: rows (n,) are the indices of those asked for."""

    rows: IntArray
    reference: Reference
    system: Linearised
    solution: Solution


def further_nodes(found: Passes, time: FloatArray) -> FurtherNodes:
    """The last pass with nodes at ascending times (n,) in s, too, the mean over the members.

    Raises:
        ComputationError: too many nodes.
    """
    own, about, last, problem = found.problem.start.nodes, found.about, found.last, found.problem
    back = _way(float(own.time[0]), min(float(time[0] - own.time[0]), 0.0), about.rate[0])
    ahead = _way(float(own.time[-1]), max(float(time[-1] - own.time[-1]), 0.0), about.rate[-1])
    nodes = Nodes(np.unique(np.concatenate([back, own.time, ahead, time])), np.zeros(0, dtype=np.intp))
    known = np.searchsorted(nodes.time, own.time)
    nodes, first = replace(nodes, frames=known[own.frames]), int(known[0])
    reference = _followed(found, nodes.time, known)
    system = linearised(reference, nodes, last.observations)
    units = problem.noise_units_at(nodes.time)
    noise = problem.noise(found.members, last.noise_variance)
    solved = solve(system.since(first), replace(noise, units=units[first:]), last.prior, found.added)
    solution = mixed([one for one, _ in solved], found.probability, found.variance)
    density = (found.probability * found.variance) @ noise.density
    before = np.tensordot(units[:first], density, axes=(1, 0))
    return FurtherNodes(np.searchsorted(nodes.time, time), reference, system, _backwards(solution, system, before))


def _way(origin: float, span: float, rate: FloatArray) -> FloatArray:
    """Times from the origin over a span in s, of either sign, NODE_ANGLE apart at a rate (3,) in rad/s.

    Raises:
        ComputationError: too many.
    """
    speed = float(np.linalg.norm(rate))
    longest = NODE_ANGLE / max(speed, 1e-9)
    if abs(span) > MAX_NODES * longest:
        raise too_long(speed, abs(span))
    return np.asarray(origin + np.sign(span) * longest * np.arange(1, int(abs(span) / longest) + 1))


def _followed(found: Passes, time: FloatArray, known: IntArray) -> Reference:
    """The reference at times (n,), of which those at the indices known (k,) are the nodes of the passes."""
    about, first = found.about, int(known[0])
    axis = mean_gradient_axis(found.problem.start.rotation.orbit, time)
    path = found.problem.process(found.shift, time)
    deviation, attitude, rate = (
        np.empty((len(time), *values.shape[1:])) for values in (about.deviation, about.attitude, about.rate)
    )
    deviation[known], attitude[known], rate[known] = about.deviation, about.attitude, about.rate
    after = np.setdiff1d(np.arange(first, len(time)), known)
    for k, by in [*((k, 1) for k in range(first - 1, -1, -1)), *((int(k), -1) for k in after)]:
        here, step = slice(k + by, k + by + 1), min(k, k + by)
        F, drive = path.transition[step], path.drive[step] @ about.x
        there = deviation[k + by]
        deviation[k] = F @ there + drive if by < 0 else np.linalg.solve(F, there - drive)
        span = time[k : k + 1] - time[here]
        turned = rotated(attitude[here], rate[here], about.inertia, axis[step : step + 1], span)
        attitude[k], rate[k] = turned[0][0], turned[1][0]
    return replace(about, path=path, deviation=deviation, attitude=attitude, rate=rate, axis=axis)


def _backwards(solution: Solution, system: Linearised, noise: FloatArray) -> Solution:
    """The solution with the system's k nodes before its first one; noise (k, d, d): of the steps from each of them."""
    k, (n, d), q = len(noise), solution.state.shape, len(solution.theta)
    state, of_state, crossed = np.empty((k + n, d)), np.empty((k + n, d, d)), np.empty((k + n, d, q))
    state[k:], of_state[k:], crossed[k:] = solution.state, solution.of_state, solution.crossed
    spread = np.concatenate([np.zeros((2, k, 3, 3)), solution.spread], axis=1)
    own = slice(system.drive.shape[2] - 1)  # the parameters that drive: inertia and path
    theta, of_theta = solution.theta[own], solution.of_theta[own]
    for at in range(k - 1, -1, -1):
        back, drive = np.linalg.inv(system.transition[at]), system.drive[at]
        by_theta = -back @ drive[:, 1:]
        state[at] = back @ (state[at + 1] - drive[:, 0]) + by_theta @ theta
        crossed[at] = back @ crossed[at + 1] + by_theta @ of_theta
        with_theta = back @ crossed[at + 1][:, own] @ by_theta.T
        of_state[at] = back @ (of_state[at + 1] + noise[at]) @ back.T + by_theta @ of_theta[:, own] @ by_theta.T
        of_state[at] += with_theta + with_theta.T
    return replace(solution, state=state, of_state=of_state, crossed=crossed, spread=spread)

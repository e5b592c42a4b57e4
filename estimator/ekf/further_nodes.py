"""Further nodes of the smoother of `ekf`, at any times within the tracks.

A node without observations changes nothing for the others, so that the smoothed state there is a prediction in a gap.
"""

from dataclasses import dataclass, replace

import numpy as np

from baryscope.estimator.ekf.linearised import Linearised, Nodes, Reference, linearised
from baryscope.estimator.ekf.motion import mean_gradient_axis, rotated
from baryscope.estimator.ekf.passes import Passes
from baryscope.estimator.ekf.solution import Solution, mixed, solve
from baryscope.estimator.tracks import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class FurtherNodes:
    """The states at nodes that include further ones: rows (n,) are the indices of those asked for."""

    rows: IntArray
    reference: Reference
    system: Linearised
    solution: Solution


def further_nodes(found: Passes, time: FloatArray) -> FurtherNodes:
    """The last pass with nodes at ascending times (n,) in s within the tracks, too, the mean over the members."""
    own, last, problem = found.problem.start.nodes, found.last, found.problem
    nodes = Nodes(np.union1d(own.time, time), np.zeros(0, dtype=np.intp))
    known = np.searchsorted(nodes.time, own.time)
    nodes = replace(nodes, frames=known[own.frames])
    reference = _followed(found, nodes.time, known)
    system = linearised(reference, nodes, last.observations, problem.frame_noise(last.noise_variance))
    noise = replace(problem.noise(found.members, last.noise_variance), units=problem.noise_units_at(nodes.time))
    solved = solve(system, noise, last.prior, found.added)
    solution = mixed([one for one, _ in solved], found.probability, found.variance)
    return FurtherNodes(np.searchsorted(nodes.time, time), reference, system, solution)


def _followed(found: Passes, time: FloatArray, known: IntArray) -> Reference:
    """The reference at times (n,), of which those at the indices known (k,), the first among them, are the nodes of the
    passes.
    """
    about = found.about
    axis = mean_gradient_axis(found.problem.start.rotation.orbit, time)
    path = found.problem.process(found.shift, time)
    deviation, attitude, rate = (
        np.empty((len(time), *values.shape[1:])) for values in (about.deviation, about.attitude, about.rate)
    )
    deviation[known], attitude[known], rate[known] = about.deviation, about.attitude, about.rate
    for k in np.setdiff1d(np.arange(len(time)), known):
        step = slice(k - 1, k)
        deviation[k] = path.transition[k - 1] @ deviation[k - 1] + path.drive[k - 1] @ about.x
        span = time[k : k + 1] - time[step]
        turned = rotated(attitude[step], rate[step], about.inertia, axis[step], span)
        attitude[k], rate[k] = turned[0][0], turned[1][0]
    return replace(about, path=path, deviation=deviation, attitude=attitude, rate=rate, axis=axis)

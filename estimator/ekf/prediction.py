"""Predictions of `ekf`: the smoother at further nodes, at the times that are asked for and on the way to them.

A node without observations changes nothing for the others. So the smoothed state there, with the process noise since
the last observation, is the prediction, in gaps and ahead alike.
"""

from dataclasses import dataclass, replace

import numpy as np

from baryscope.estimator.dynamics.rotation import too_long
from baryscope.estimator.ekf.linearised import Linearised, Nodes, Reference, linearised, moved, points_from
from baryscope.estimator.ekf.motion import gravity_gradient_axis, rotated
from baryscope.estimator.ekf.passes import Passes
from baryscope.estimator.ekf.solution import Gaussian, Solution, mixed, solve
from baryscope.estimator.ekf.spurious import attached_offset, spurious_growth
from baryscope.estimator.ekf.start import MAX_NODES, NODE_ANGLE
from baryscope.estimator.prediction import UNCHANGED, Point, Prediction, Widening, carried, point_in_body
from baryscope.estimator.tracks import FloatArray, IntArray

AT_ONCE = 5000  # times, at each of which is a node of the smoother


@dataclass(frozen=True, eq=False)
class PredictedTumble:
    """The passes for k orders of the path with their probabilities (k,), and the features' labels.

    features: those that are seen, whose axes and centroid body coordinates refer to; wider: what a misfit adds.
    """

    orders: tuple[Passes, ...]
    probability: FloatArray
    labels: tuple[str, ...]
    features: IntArray
    wider: Widening = UNCHANGED

    def widened(self, by: Widening) -> "PredictedTumble":
        """See `Predictor`."""
        return replace(self, wider=self.wider.then(by))

    def at(self, time: FloatArray, point: Point) -> Prediction:
        """See `Predictor`.

        Raises:
            InputError: no such feature.
            ComputationError: the rotation cannot be followed so far.
        """
        ascending, index = np.unique(time, return_inverse=True)
        parts = (self._in_parts(one, ascending, point) for one in self.orders)
        state = Gaussian.mixture(parts, self.probability)
        end = float(self.orders[0].problem.start.nodes.time[-1])
        return Prediction.of(time, state.mean[index], self.wider.of_both(state.covariance[index], time - end))

    def _in_parts(self, found: Passes, time: FloatArray, point: Point) -> Gaussian:
        """The same as `_of_order`, with a bounded memory."""
        parts = [self._of_order(found, time[k : k + AT_ONCE], point) for k in range(0, len(time), AT_ONCE)]
        return Gaussian(np.concatenate([p.mean for p in parts]), np.concatenate([p.covariance for p in parts]))

    def _of_order(self, found: Passes, time: FloatArray, point: Point) -> Gaussian:
        """Position and velocity (n, 6) at ascending times (n,)."""
        nodes, rows, reference = _extended(found, time)
        system, solution = _solved(found, nodes, reference)
        _, attached, least = attached_offset(found, self.features)
        of_offset, growth = spurious_growth(solution, system, found.last.variance, attached, least)
        p = reference.deviation.shape[1]
        state, path = solution.state[rows], reference.path
        observed = np.concatenate([path.observed, path.observed_rate], axis=1)[rows]
        nominal = np.concatenate([path.nominal, path.nominal_rate], axis=1)[rows]
        mean = nominal + (observed @ (reference.deviation[rows] + state[:, :p])[:, :, None])[:, :, 0]
        if point is None:
            of_path, columns = solution.of_state[rows, :p, :p], observed @ growth[rows, :p]
            own = observed @ of_path @ np.swapaxes(observed, 1, 2)
            return Gaussian(mean, own + columns @ np.swapaxes(columns, 1, 2))
        after = moved(reference, solution.state, solution.theta)
        seen = np.isin(np.arange(len(after.points)), self.features)
        b, by_points = point_in_body(point, self.labels, after.points, seen, self.features)
        arm, by_motion, by_b = carried(after.attitude[rows], after.rate[rows], b)
        by_both = np.concatenate([observed, by_motion, by_b], axis=2)
        points = slice(points_from(p) - 1, None)
        crossed = solution.crossed[rows][:, :, points] @ by_points.T
        of_b = np.broadcast_to(by_points @ solution.of_theta[points, points] @ by_points.T, (len(rows), 3, 3))
        of_both = np.block([[solution.of_state[rows], crossed], [np.swapaxes(crossed, 1, 2), of_b]])
        grown = by_points @ np.tile(np.eye(3), (len(after.points), 1)) @ of_offset
        columns = by_both[:, :, : p + 6] @ growth[rows] + by_b @ grown
        covariance = by_both @ of_both @ np.swapaxes(by_both, 1, 2) + columns @ np.swapaxes(columns, 1, 2)
        return Gaussian(mean + arm, covariance)


def _extended(found: Passes, time: FloatArray) -> tuple[Nodes, IntArray, Reference]:
    """Nodes that include ascending times (n,), their indices (n,) among them, and the reference there.

    Raises:
        ComputationError: too many nodes.
    """
    own, about = found.problem.start.nodes, found.about
    speed = float(np.linalg.norm(about.rate[-1]))
    longest, last = NODE_ANGLE / max(speed, 1e-9), float(own.time[-1])
    ahead = max(float(time[-1]) - last, 0.0)
    if ahead > MAX_NODES * longest:
        raise too_long(speed, ahead)
    way = last + longest * np.arange(1, int(ahead / longest) + 1)
    every = np.union1d(np.union1d(own.time, way), time)
    known = np.searchsorted(every, own.time)
    before = np.full(len(every), -1)
    before[known] = np.arange(len(own.time))
    axis = gravity_gradient_axis(found.problem.start.rotation.orbit, every)
    path = found.problem.process(found.shift, every)
    deviation, attitude, rate = (
        np.empty((len(every), *values.shape[1:])) for values in (about.deviation, about.attitude, about.rate)
    )
    deviation[known], attitude[known], rate[known] = about.deviation, about.attitude, about.rate
    for k in np.nonzero(before < 0)[0]:
        deviation[k] = path.transition[k - 1] @ deviation[k - 1]
        step = every[k : k + 1] - every[k - 1 : k]
        turned = rotated(attitude[k - 1 : k], rate[k - 1 : k], about.inertia, axis[k - 1 : k], step)
        attitude[k], rate[k] = turned[0][0], turned[1][0]
    reference = replace(about, path=path, deviation=deviation, attitude=attitude, rate=rate, axis=axis)
    return Nodes(every, known[own.frames]), np.searchsorted(every, time), reference


def _solved(found: Passes, nodes: Nodes, reference: Reference) -> tuple[Linearised, Solution]:
    """The system at the nodes, and its solution, the mean over the members."""
    last, problem = found.last, found.problem
    system = linearised(reference, nodes, last.observations)
    noise = replace(problem.noise(found.members, last.noise_variance), units=problem.noise_units_at(nodes.time))
    solved = solve(system, noise, last.prior)
    return system, mixed([one for one, _ in solved], found.probability, found.variance)

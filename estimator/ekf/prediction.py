"""Predictions of `ekf`: the smoother at further nodes, at the times that are asked for and on the way to them.

A node without observations changes nothing for the others. So the smoothed state there, with the process noise since
the last observation, is the prediction, in gaps and ahead alike.
"""

from dataclasses import dataclass, replace

import numpy as np

from baryscope.estimator.dynamics.rotation import too_long
from baryscope.estimator.ekf.linearised import Linearised, Nodes, Reference, linearised, points_from
from baryscope.estimator.ekf.motion import gravity_gradient_axis, rotated
from baryscope.estimator.ekf.passes import Passes
from baryscope.estimator.ekf.solution import Solution, mixed, solve
from baryscope.estimator.ekf.spurious import attached_offset, spurious_growth
from baryscope.estimator.ekf.start import MAX_NODES, NODE_ANGLE
from baryscope.estimator.geometry.so3 import cross_matrices, exp_rotation
from baryscope.estimator.prediction import UNCHANGED, Point, Prediction, Widening, by_state, point_in_body
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
        means, covariances = (
            np.array(each) for each in zip(*(self._in_parts(one, ascending, point) for one in self.orders), strict=True)
        )
        mean = np.tensordot(self.probability, means, 1)
        off = means - mean
        covariance = np.tensordot(self.probability, covariances + off[..., :, None] * off[..., None, :], 1)
        end = float(self.orders[0].problem.start.nodes.time[-1])
        return Prediction(time, mean[index, :3], mean[index, 3:], self.wider.of_both(covariance[index], time - end))

    def _in_parts(self, found: Passes, time: FloatArray, point: Point) -> tuple[FloatArray, FloatArray]:
        """The same as `_of_order`, with a bounded memory."""
        parts = [self._of_order(found, time[k : k + AT_ONCE], point) for k in range(0, len(time), AT_ONCE)]
        return np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])

    def _of_order(self, found: Passes, time: FloatArray, point: Point) -> tuple[FloatArray, FloatArray]:
        """Position and velocity (n, 6) at ascending times (n,), and their covariance (n, 6, 6)."""
        nodes, rows, reference = _extended(found, time)
        system, solution = _solved(found, nodes, reference)
        _, attached, least = attached_offset(found, self.features)
        of_offset, growth = spurious_growth(solution, system, found.last.variance, attached, least)
        p = reference.deviation.shape[1]
        state, path = solution.state[rows], reference.path
        observed = np.concatenate([path.observed, path.observed_rate], axis=1)[rows]
        nominal = np.concatenate([path.nominal, path.nominal_rate], axis=1)[rows]
        mean = nominal + (observed @ (reference.deviation[rows] + state[:, :p])[:, :, None])[:, :, 0]
        by_all = np.zeros((len(rows), 6, state.shape[1]))
        by_all[:, :, :p] = observed
        by_b, of_b, crossed, grown = (
            np.zeros((len(rows), 6, 3)),
            np.zeros((3, 3)),
            np.zeros((len(rows), 6 + p, 3)),
            None,
        )
        if point is not None:
            R, rate = (
                reference.attitude[rows] @ exp_rotation(state[:, p : p + 3]),
                reference.rate[rows] + state[:, p + 3 :],
            )
            moved = reference.points + solution.theta[points_from(p) - 1 :].reshape(-1, 3)
            seen = np.isin(np.arange(len(moved)), self.features)
            b, by_points = point_in_body(point, self.labels, moved, seen, self.features)
            own = slice(points_from(p) - 1, None)
            of_b = by_points @ solution.of_theta[own, own] @ by_points.T
            crossed = solution.crossed[rows][:, :, own] @ by_points.T
            by_all[:, :, p:] = by_state(R, rate, b)
            by_b = np.concatenate([R, R @ cross_matrices(rate)], axis=1)
            mean = mean + np.concatenate([R @ b, np.einsum("nij,nj->ni", R, np.cross(rate, b))], axis=1)
            grown = by_points @ np.tile(np.eye(3), (len(moved), 1)) @ of_offset
        both = by_all @ crossed @ np.swapaxes(by_b, 1, 2)
        covariance = by_all @ solution.of_state[rows] @ np.swapaxes(by_all, 1, 2) + both + np.swapaxes(both, 1, 2)
        columns = by_all @ growth[rows] + (0.0 if grown is None else by_b @ grown)
        return mean, covariance + by_b @ of_b @ np.swapaxes(by_b, 1, 2) + columns @ np.swapaxes(columns, 1, 2)


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
    orbit = found.problem.start.rotation.orbit
    axis = np.zeros((len(every) - 1, 3))
    if orbit is not None:
        axis = gravity_gradient_axis(orbit, (every[1:] + every[:-1]) / 2)
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

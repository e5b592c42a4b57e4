"""Predictions of `ekf`: the smoother at further nodes, at the times that are asked for and on the way to them.

A node without observations changes nothing for the others. So the smoothed state there, with the process noise since
the last observation, is the prediction, in gaps and ahead alike.
"""

from dataclasses import dataclass, replace

import numpy as np

from baryscope.estimator.dynamics.rotation import too_long
from baryscope.estimator.ekf.linearised import PATH, STATE, Linearised, Nodes, Reference, linearised, moved
from baryscope.estimator.ekf.motion import gravity_gradient_axis, rotated
from baryscope.estimator.ekf.passes import Passes
from baryscope.estimator.ekf.solution import Solution, mixed, solve
from baryscope.estimator.ekf.spurious import attached_offset, spurious_growth
from baryscope.estimator.ekf.start import MAX_NODES, NODE_ANGLE
from baryscope.estimator.prediction import UNCHANGED, Point, Prediction, Widening, carried, point_in_body
from baryscope.estimator.tracks import FloatArray, IntArray

AT_ONCE = 5000  # times, at each of which is a node of the smoother


@dataclass(frozen=True, eq=False)
class PredictedTumble:
    """The passes, and the features' labels.

    features: those that are seen, whose axes and centroid body coordinates refer to; wider: what a misfit adds.
    """

    found: Passes
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
        parts = [self._part(ascending[k : k + AT_ONCE], point) for k in range(0, len(ascending), AT_ONCE)]
        mean, covariance = (np.concatenate(values)[index] for values in zip(*parts, strict=True))
        end = float(self.found.problem.start.nodes.time[-1])
        return Prediction.of(time, mean, self.wider.of_both(covariance, time - end))

    def _part(self, time: FloatArray, point: Point) -> tuple[FloatArray, FloatArray]:
        """Position and velocity (n, 6) at ascending times (n,), and their covariance (n, 6, 6)."""
        found = self.found
        nodes, rows, reference = _extended(found, time)
        system, solution = _solved(found, nodes, reference)
        _, attached, least = attached_offset(found, self.features)
        of_offset, growth = spurious_growth(solution, system, found.last.variance, attached, least)
        after = moved(reference, solution.state, solution.theta)
        u, to_si = after.deviation, np.repeat([1.0, 1 / after.path.span], 3)
        mean = np.concatenate([after.path.position(u), after.path.velocity(u)], axis=1)[rows]
        if point is None:
            own, columns = solution.of_state[rows, PATH, PATH], growth[rows, PATH]
            return mean, (own + columns @ np.swapaxes(columns, 1, 2)) * np.outer(to_si, to_si)
        seen = np.isin(np.arange(len(after.points)), self.features)
        b, by_points = point_in_body(point, self.labels, after.points, seen, self.features)
        arm, by_motion, by_b = carried(after.attitude[rows], after.rate[rows], b)
        by_path = np.broadcast_to(np.diag(to_si), by_motion.shape)
        by_both = np.concatenate([by_path, by_motion, by_b], axis=2)
        points = system.points
        crossed = solution.crossed[rows][:, :, points] @ by_points.T
        of_b = np.broadcast_to(by_points @ solution.of_theta[points, points] @ by_points.T, (len(rows), 3, 3))
        of_both = np.block([[solution.of_state[rows], crossed], [np.swapaxes(crossed, 1, 2), of_b]])
        grown = by_points @ np.tile(np.eye(3), (len(after.points), 1)) @ of_offset
        columns = by_both[:, :, :STATE] @ growth[rows] + by_b @ grown
        covariance = by_both @ of_both @ np.swapaxes(by_both, 1, 2) + columns @ np.swapaxes(columns, 1, 2)
        return mean + arm, covariance


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
        deviation[k] = path.transition[k - 1] @ deviation[k - 1] + path.drive[k - 1] @ about.x
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

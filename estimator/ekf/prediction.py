"""Predictions of `ekf`: the smoothed states at the times that are asked for, see `further_nodes`."""

from dataclasses import dataclass

import numpy as np

from baryscope.estimator.ekf.further_nodes import further_nodes
from baryscope.estimator.ekf.linearised import PATH, STATE, TURN, moved
from baryscope.estimator.ekf.passes import Passes
from baryscope.estimator.ekf.spurious import growth
from baryscope.estimator.prediction import Point, Prediction, carried, curved, point_in_body
from baryscope.estimator.tracks import FloatArray, IntArray

AT_ONCE = 5000  # times, at each of which is a node of the smoother


@dataclass(frozen=True, eq=False)
class PredictedTumble:
    """The passes, and the features' labels.

    features: those that are seen, whose axes and centroid body coordinates refer to; products (q, k): of errors, see
    `products`.
    """

    found: Passes
    labels: tuple[str, ...]
    features: IntArray
    products: FloatArray

    def at(self, time: FloatArray, point: Point) -> Prediction:
        """See `Predictor`.

        Raises:
            InputError: no such feature.
            ComputationError: the rotation cannot be followed so far.
        """
        ascending, index = np.unique(time, return_inverse=True)
        parts = [self._part(ascending[k : k + AT_ONCE], point) for k in range(0, len(ascending), AT_ONCE)]
        mean, covariance = (np.concatenate(values)[index] for values in zip(*parts, strict=True))
        return Prediction.of(time, mean, covariance)

    def _part(self, time: FloatArray, point: Point) -> tuple[FloatArray, FloatArray]:
        """Position and velocity (n, 6) at ascending times (n,), and their covariance (n, 6, 6)."""
        found = self.found
        further = further_nodes(found, time)
        rows, reference, system, solution = further.rows, further.reference, further.system, further.solution
        of_offset, of_states = growth(found, solution, system, self.features, self.products)
        after = moved(reference, solution.state, solution.theta)
        u, to_si = after.deviation, np.repeat([1.0, 1 / after.path.span], 3)
        mean = np.concatenate([after.path.position(u), after.path.velocity(u)], axis=1)[rows]
        if point is None:
            own, columns = solution.of_state[rows, PATH, PATH], of_states[rows, PATH]
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
        columns = by_both[:, :, :STATE] @ of_states[rows] + by_b @ grown
        covariance = by_both @ of_both @ np.swapaxes(by_both, 1, 2) + columns @ np.swapaxes(columns, 1, 2)
        shift, arc = curved(after.attitude[rows], after.rate[rows], b, solution.of_state[rows, TURN, TURN])
        return mean + arm + shift, covariance + arc

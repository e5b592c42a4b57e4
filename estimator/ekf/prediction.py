"""Predictions of `ekf`: smoothed states within the tracks, see `further_nodes`, and from their ends on outside."""

from dataclasses import dataclass, replace

import numpy as np

from baryscope.estimator.dynamics.rotation import Rotation
from baryscope.estimator.dynamics.torque import LastingTorque
from baryscope.estimator.ekf.further_nodes import further_nodes
from baryscope.estimator.ekf.linearised import INERTIA, PATH, RATE, STATE, TURN, moved, points_in
from baryscope.estimator.ekf.motion import PathProcess, changed_inertia, rotated
from baryscope.estimator.ekf.passes import Passes
from baryscope.estimator.ekf.spurious import growth
from baryscope.estimator.geometry.so3 import exp_rotation
from baryscope.estimator.paths.extrapolated_path import extrapolated
from baryscope.estimator.paths.nonlinear_path import End, nonlinear_in
from baryscope.estimator.paths.process_noise import MIDDLE, lasting_variance
from baryscope.estimator.prediction import Point, Prediction, grown_outside, point_in_body
from baryscope.estimator.tracks import BoolArray, FloatArray, IntArray
from baryscope.estimator.turning import OF_MOTION, TurningPoint, carried, curved
from baryscope.estimator.widening import beyond

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
        frames = self.found.problem.start.nodes.frames
        away = beyond(ascending, *self._ends)
        parts = [
            *(self._away(int(frames[0]), some, point) for some in _by(AT_ONCE, ascending[away < 0])),
            *(self._within(some, point) for some in _by(AT_ONCE, ascending[away == 0])),
            *(self._away(int(frames[-1]), some, point) for some in _by(AT_ONCE, ascending[away > 0])),
        ]
        mean, covariance = (np.concatenate(values)[index] for values in zip(*parts, strict=True))
        return Prediction.of(time, mean, covariance)

    @property
    def _ends(self) -> tuple[float, float]:
        """The first and the last time of the tracks, s."""
        time = self.found.problem.tracks.time
        return float(time[0]), float(time[-1])

    def _seen(self, count: int) -> BoolArray:
        """Which of the points (count,) are seen."""
        return np.isin(np.arange(count), self.features)

    def _within(self, time: FloatArray, point: Point) -> tuple[FloatArray, FloatArray]:
        """Position and velocity (n, 6) at ascending times (n,) within the tracks, and their covariance (n, 6, 6)."""
        found = self.found
        further = further_nodes(found, time)
        rows, reference, system, solution = further.rows, further.reference, further.system, further.solution
        of_offset, of_states, _ = growth(found, solution, system, self.features, self.products)
        after = moved(reference, solution.state, solution.theta)
        u, to_si = after.deviation, np.repeat([1.0, 1 / after.path.span], 3)
        mean = np.concatenate([after.path.position(u), after.path.velocity(u)], axis=1)[rows]
        if point is None:
            own, columns = solution.of_state[rows, PATH, PATH], of_states[rows, PATH]
            return mean, (own + columns @ np.swapaxes(columns, 1, 2)) * np.outer(to_si, to_si)
        seen = self._seen(len(after.points))
        b, by_points = point_in_body(point, self.labels, after.points, seen, self.features)
        arm, by_motion, by_b = carried(after.attitude[rows], after.rate[rows], b)
        by_path = np.broadcast_to(np.diag(to_si), by_motion.shape)
        by_both = np.concatenate([by_path, by_motion, by_b], axis=2)
        points = system.points
        crossed = solution.crossed[rows][:, :, points] @ by_points.T
        of_b = np.broadcast_to(by_points @ solution.of_theta[points, points] @ by_points.T, (len(rows), 3, 3))
        of_both = np.block([[solution.of_state[rows], crossed], [np.swapaxes(crossed, 1, 2), of_b]])
        columns = by_both[:, :, :STATE] @ of_states[rows] + by_b @ _of_point(by_points, of_offset)
        covariance = by_both @ of_both @ np.swapaxes(by_both, 1, 2) + columns @ np.swapaxes(columns, 1, 2)
        shift, arc = curved(after.attitude[rows], after.rate[rows], b, solution.of_state[rows, TURN, TURN])
        return mean + arm + shift, covariance + arc

    def _away(self, node: int, time: FloatArray, point: Point) -> tuple[FloatArray, FloatArray]:
        """The same at ascending times (n,) on that side of the tracks on which the node is the last."""
        found, at = self.found, self.found.reference
        of_path = slice(INERTIA, INERTIA + len(at.x))
        onward = extrapolated(found.problem.path, at.x, found.solution.of_theta[of_path, of_path])
        problem = replace(found.problem, path=onward)
        origin = float(problem.start.nodes.time[node])
        nodes = np.unique(np.concatenate([problem.start.nodes.time[[0, node]], time]))
        path = problem.process(found.shift, nodes)
        by_path, to_si = _by_state(path, int(np.searchsorted(nodes, origin))), np.repeat([1.0, 1 / path.span], 3)
        u = by_path @ np.concatenate([at.deviation[node], at.x])
        rows = np.searchsorted(nodes, time)
        every = np.concatenate([path.position(u), path.velocity(u)], axis=1)
        state, by_path = every[rows], to_si[:, None] * by_path[rows]
        density = 0.0 if problem.slips else found.mean_density.path
        lasts = self._lasting_variance(density)
        added = grown_outside(problem.path, (density, lasts), *self._ends, time)
        b, by_points = np.zeros(3), np.zeros((3, 3 * len(at.points)))
        if point is not None:
            b, by_points = point_in_body(point, self.labels, at.points, self._seen(len(at.points)), self.features)
        joint = self._joint(node, by_points)
        own, part = joint[OF_MOTION:-3, OF_MOTION:-3], nonlinear_in(problem.path)
        if part is not None:
            by_own = np.eye(6, len(own)) * to_si[:, None]
            end = End(origin, every[np.searchsorted(nodes, origin)], by_own, found.shift + at.x, own)
            bent = end.curvature(part, time)
            state, by_path, added = state + bent.mean, by_path + bent.slope, added + bent.covariance
        if point is None:
            return state, by_path @ own @ np.swapaxes(by_path, 1, 2) + added
        start = Rotation(origin, at.attitude[node], at.rate[node], at.inertia, problem.start.rotation.orbit)
        about, theta = found.about.inertia, found.solution.theta[:INERTIA]

        def changed(turn: FloatArray, rate: FloatArray, inertia: FloatArray) -> Rotation:
            of_it = changed_inertia(about, theta + inertia, np.inf)
            return Rotation(origin, start.attitude @ exp_rotation(turn), start.rate + rate, of_it, start.orbit)

        torque = found.mean_density.turn
        there = TurningPoint(start, changed, b, joint, torque, self._lasting_torque(torque))
        mean, covariance = there.away(time, state, by_path)
        return mean, covariance + added

    def _lasting_variance(self, density: float) -> float:
        """The variance of a coordinate of an acceleration that lasts, (m/s²)², see `lasting_variance`."""
        at, time = self.found.reference, self.found.problem.start.nodes.time
        begin, end = time[0] + MIDDLE * (time[-1] - time[0])
        amid = (time[:-1] >= begin) & (time[1:] <= end)
        if not density > 0 or not amid.any():
            return 0.0
        by_noise = at.deviation[1:] - at.path.drive @ at.x
        by_noise -= np.einsum("kij,kj->ki", at.path.transition, at.deviation[:-1])
        change = by_noise[amid, 3:].sum(axis=0) / at.path.span
        return lasting_variance(change, density, float(np.diff(time)[amid].sum()))

    def _lasting_torque(self, density: float) -> LastingTorque | None:
        """The torque that goes on before and after the tracks, if they show one beyond white noise of a density."""
        at, time = self.found.reference, self.found.problem.start.nodes.time
        if len(time) < 2:
            return None
        _, rate, _ = rotated(at.attitude[:-1], at.rate[:-1], at.inertia, at.axis, np.diff(time))
        of_rate = self.found.solution.of_state[[0, -1], RATE, RATE].sum(axis=0)
        return LastingTorque.of((at.rate[1:] - rate).sum(axis=0), of_rate, density, float(time[-1] - time[0]))

    def _joint(self, node: int, by_points: FloatArray) -> FloatArray:
        """The covariance of attitude, rate, inertia, the path's u and x, and a point by_points (3, 3 m), at a node."""
        found, solution = self.found, self.found.solution
        of_offset, of_states, of_theta = growth(found, solution, found.last.system, self.features, self.products)
        count, q = len(found.reference.x), len(solution.theta)
        own, crossed = solution.of_state[node], solution.crossed[node]
        whole = np.block([[own, crossed], [crossed.T, solution.of_theta]])
        order = np.r_[TURN, RATE, STATE : STATE + INERTIA, PATH, STATE + INERTIA : STATE + INERTIA + count]
        chosen = np.zeros((len(order) + 3, STATE + q))
        chosen[np.arange(len(order)), order] = 1.0
        chosen[-3:, STATE:][:, points_in(count)] = by_points
        columns = chosen @ np.concatenate([of_states[node], of_theta])
        columns[-3:] = _of_point(by_points, of_offset)
        return np.asarray(chosen @ whole @ chosen.T + columns @ columns.T)


def _of_point(by_points: FloatArray, of_offset: FloatArray) -> FloatArray:
    """The columns (3, k) of a point, by_points (3, 3 m), where those of all points are of_offset (3, k)."""
    return np.asarray(by_points @ np.tile(np.eye(3), (by_points.shape[1] // 3, 1)) @ of_offset)


def _by(size: int, time: FloatArray) -> list[FloatArray]:
    """Times (n,) in parts of a size, none of them empty."""
    return [time[k : k + size] for k in range(0, len(time), size)]


def _by_state(path: PathProcess, origin: int) -> FloatArray:
    """The Jacobian (n, 6, 6 + s) of a process at n times by its u at one of them and its unknowns x."""
    n = len(path.nominal)
    moved_by = np.empty((n, 6, 6))
    moved_by[origin] = np.eye(6)
    for k in range(origin, n - 1):
        moved_by[k + 1] = path.transition[k] @ moved_by[k]
    for k in range(origin, 0, -1):
        moved_by[k - 1] = np.linalg.solve(path.transition[k - 1], moved_by[k])
    return np.concatenate([moved_by, path.columns - moved_by @ path.columns[origin]], axis=2)

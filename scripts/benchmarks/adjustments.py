"""The least squares of `pivot` by general programs: GTSAM's factor graphs, and scipy's least_squares.

Unknown are the attitude of the body in every frame, the positions of its features in it, and the path: the six unknowns
of the relative orbit, or with process noise a chain of states with known noise. Features are seen with white noise of
known deviation. All start from the same approximate solution. Each gives the path with its covariance in some frames,
and the seconds that took, the building of its problem included.
"""

import time as clock
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.sparse import csc_array, csr_array, diags_array
from scipy.sparse.linalg import LinearOperator, SuperLU, splu
from scipy.spatial.transform import Rotation

from baryscope.estimator.geometry.so3 import cross_matrices
from baryscope.estimator.registration.body import Body
from baryscope.scripts.benchmarks.near_path import NearPath

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]
Residuals = Callable[[FloatArray], FloatArray]
Derivative = Callable[[FloatArray], csr_array]

RIGID = 1e-4  # m, with which GTSAM's graph ties the path to the poses: more would cost its Cholesky factors digits
GAUGE = 1e-3  # rad, of the first attitude: the axes of the body are arbitrary
FAR = 1e6  # m
WIDE = 1e6  # of scipy's first trust region, in standard deviations
FIRM = 1e-6  # m, of the centre of mass in its own axes, which are arbitrary: less would cost digits, too
GAUGE_WEIGHT = 1e-3  # added to the information on that attitude in scipy's covariance
ASKED = 12  # frames in which peers give the covariance


@dataclass(frozen=True, eq=False)
class Problem:
    """What is seen, position (n, m, 3) in C, m, of deviation sigma; and from where all start: body and path."""

    position: FloatArray
    sigma: float
    body: Body
    path: NearPath

    @property
    def asked(self) -> IntArray:
        """The frames in which the covariance is asked for."""
        return asked_of(len(self.position))


def asked_of(frames: int) -> IntArray:
    """ASKED of the frames, from the first to the last."""
    return np.linspace(0, frames - 1, ASKED).astype(np.intp)


@dataclass(frozen=True, eq=False)
class Adjusted:
    """A peer's solution: the path (n, 3) in C, m, its covariance (ASKED, 3, 3), and the seconds it took."""

    peer: str
    path: FloatArray
    covariance: FloatArray
    seconds: float

    @property
    def predicted(self) -> float:
        """The rms error of the path that the covariance predicts, m."""
        return float(np.sqrt(np.trace(self.covariance, axis1=1, axis2=2).mean()))


def timed(peer: str, solve: Callable[[Problem], tuple[FloatArray, FloatArray]], problem: Problem) -> Adjusted:
    """The solution of a function that gives the path and its covariance."""
    begin = clock.perf_counter()
    path, covariance = solve(problem)
    return Adjusted(peer, path, covariance, clock.perf_counter() - begin)


def by_gtsam(problem: Problem) -> tuple[FloatArray, FloatArray]:
    """GTSAM: a map of landmarks, seen by a camera that moves around the body; all factors are its own, in C++.

    A pose is that of the camera in the body's axes; the centre of mass, their origin, is seen from there at the path's
    position. A feature's position is given as bearing and range, without the range's bias of second order.
    """
    import gtsam

    n, m, _ = problem.position.shape
    near = problem.path
    pose, seen, landmark, unknown, centre = (gtsam.symbol(letter, 0) for letter in "xgbuc")
    turned = np.swapaxes(problem.body.attitude, 1, 2)
    graph, values, noise = gtsam.NonlinearFactorGraph(), gtsam.Values(), gtsam.noiseModel
    distance = np.linalg.norm(problem.position, axis=2)
    bearing = problem.position / distance[:, :, None]
    unbiased = distance - problem.sigma**2 / distance
    for b in range(near.blocks):
        values.insert(unknown + b, np.zeros(6))
    values.insert(centre, np.zeros(3))
    graph.add(gtsam.PriorFactorPoint3(centre, np.zeros(3), noise.Isotropic.Sigma(3, FIRM)))
    for i, point in enumerate(problem.body.points):
        values.insert(landmark + i, point)

    def add_linear(terms: list[tuple[int, FloatArray]]) -> None:
        """A factor of unit noise whose residual is zero at the start."""
        parts = [part for term in terms for part in term]
        rows = len(terms[0][1])
        linear = gtsam.JacobianFactor(*parts, np.zeros(rows), noise.Unit.Create(rows))
        graph.add(gtsam.LinearContainerFactor(linear, values))

    tie = noise.Isotropic.Sigma(3, RIGID)
    for k in range(n):
        values.insert(pose + k, gtsam.Pose3(gtsam.Rot3(turned[k]), -turned[k] @ near.start[k]))
        values.insert(seen + k, near.start[k])
        for i in range(m):
            sigmas = np.array([problem.sigma / distance[k, i]] * 2 + [problem.sigma])
            graph.add(
                gtsam.BearingRangeFactor3D(
                    pose + k, landmark + i, gtsam.Unit3(bearing[k, i]), unbiased[k, i], noise.Diagonal.Sigmas(sigmas)
                )
            )
        graph.add(gtsam.ReferenceFrameFactorPoint3Pose3(seen + k, pose + k, centre, tie))
        by_block = np.split(-near.jacobian[k] / RIGID, near.block.shape[1], axis=1)
        places = unknown + near.block[k]
        add_linear([(seen + k, np.eye(3) / RIGID), *zip(places.tolist(), by_block, strict=True)])
    for b, increment in enumerate(near.increment):
        add_linear([(unknown + b, increment[:, :6]), (unknown + b + 1, increment[:, 6:])])
    gauge = noise.Diagonal.Sigmas(np.array([GAUGE] * 3 + [FAR] * 3))
    graph.add(gtsam.PriorFactorPose3(pose, values.atPose3(pose), gauge))
    by_frame = [key for k in range(n) for key in (pose + k, seen + k)]
    order = gtsam.Ordering()  # GTSAM's own take twice as long, and more than linear time
    for key in (*by_frame, *range(unknown, unknown + near.blocks), *range(landmark, landmark + m), centre):
        order.push_back(key)
    options = gtsam.GaussNewtonParams()
    options.setOrdering(order)
    found = gtsam.GaussNewtonOptimizer(graph, values, options).optimize()
    solved = graph.linearize(found).eliminateMultifrontal(order)
    covariance = []
    for k in problem.asked.tolist():
        of_states = solved.jointMarginalCovariance((unknown + near.block[k]).tolist()).fullMatrix()
        covariance.append(near.jacobian[k] @ of_states @ near.jacobian[k].T)
    u = np.array([found.atVector(unknown + b) for b in range(near.blocks)])
    return near.position(u), np.array(covariance)


def by_scipy(problem: Problem) -> tuple[FloatArray, FloatArray]:
    """scipy: trust regions with LSMR, with a sparse analytic Jacobian and its scaling; the covariance by SuperLU."""
    n, m, _ = problem.position.shape
    attitude, near = problem.body.attitude, problem.path
    turns, states = slice(0, 3 * n), slice(3 * n, 3 * n + 6 * near.blocks)
    columns, rows = _places(n, m, near)

    def parts(u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The attitudes (n, 3, 3), the path (n, 3) and the points (m, 3)."""
        R = attitude @ Rotation.from_rotvec(u[turns].reshape(n, 3)).as_matrix()
        return R, near.position(u[states].reshape(-1, 6)), u[states.stop :].reshape(m, 3)

    def residuals(u: FloatArray) -> FloatArray:
        R, path, points = parts(u)
        seen = path[:, None] + points @ np.swapaxes(R, 1, 2)
        return np.concatenate(
            [(seen - problem.position).ravel() / problem.sigma, near.increments(u[states].reshape(-1, 6))]
        )

    def derivative(u: FloatArray) -> csr_array:
        R, _, points = parts(u)
        by_turn = -R[:, None] @ cross_matrices(points) @ _right_jacobian(u[turns].reshape(n, 3))[:, None]
        by_state = np.broadcast_to(near.jacobian[:, None], (n, m, *near.jacobian.shape[1:]))
        by_point = np.broadcast_to(R[:, None], (n, m, 3, 3))
        entries = np.concatenate([by_turn, by_state, by_point], axis=3) / problem.sigma
        values = np.concatenate([entries.ravel(), near.increment.ravel()])
        return csr_array((values, columns, rows), shape=(len(rows) - 1, len(u)))

    start = np.concatenate([np.zeros(states.stop), problem.body.points.ravel()])
    u = (_minimum if near.blocks == 1 else _preconditioned)(residuals, derivative, start)
    by_path = np.zeros((ASKED, 3, len(start)))
    for row, k in zip(by_path, problem.asked, strict=True):
        row[:, states.start + _six(near.block[k])] = near.jacobian[k]
    gain = _factor(derivative(u)).solve(by_path.reshape(-1, len(start)).T).T.reshape(by_path.shape)
    return near.position(u[states].reshape(-1, 6)), gain @ by_path.swapaxes(1, 2)


def _minimum(residuals: Residuals, derivative: Derivative, start: FloatArray) -> FloatArray:
    """By trust regions with LSMR in the scale of the Jacobian's columns."""
    return np.asarray(least_squares(residuals, start, derivative, x_scale="jac", tr_solver="lsmr").x)


def _preconditioned(residuals: Residuals, derivative: Derivative, start: FloatArray) -> FloatArray:
    """The same for unknowns of which LSMR would need thousands of steps: in units in which they are independent.

    These are C (u − start), with the root C of the normal matrix at the start, a triangle of SuperLU.
    """
    factor = _factor(derivative(start))
    triangle = diags_array(factor.U.diagonal() ** -0.5) @ factor.U
    root = splu(csc_array(triangle), permc_spec="NATURAL", diag_pivot_thresh=0.0)

    def scaled(y: FloatArray) -> LinearOperator:
        J = derivative(start + root.solve(y))
        return LinearOperator(J.shape, lambda v: J @ root.solve(v.ravel()), lambda r: root.solve(J.T @ r.ravel(), "T"))

    def misfit(y: FloatArray) -> FloatArray:
        return residuals(start + root.solve(y))

    found = least_squares(misfit, np.zeros(len(start)), scaled, x_scale=WIDE, tr_solver="lsmr")
    return np.asarray(start + root.solve(found.x))


def _factor(J: csr_array) -> SuperLU:
    """The factor L D Lᵀ of the normal matrix, with information on the first attitude, as the body's axes are arbitrary.

    In the order of the unknowns, attitudes first, it fills in little.
    """
    normal = csc_array(J.T @ J)
    normal.setdiag(normal.diagonal() * np.where(np.arange(J.shape[1]) < 3, 1 + GAUGE_WEIGHT, 1.0))
    factor = splu(normal, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    assert np.array_equal(factor.perm_r, np.arange(J.shape[1]))  # noqa: S101  so that U = D Lᵀ
    return factor


def _six(block: IntArray) -> IntArray:
    """The places (..., 6 k) of the unknowns of blocks (..., k)."""
    return np.asarray((6 * block[..., None] + np.arange(6)).reshape(*block.shape[:-1], 6 * block.shape[-1]))


def _places(n: int, m: int, near: NearPath) -> tuple[IntArray, IntArray]:
    """Columns, and starts of rows, of the nonzeros of scipy's Jacobian: by attitude, path and point; and increments."""
    frame, point = np.divmod(np.arange(n * m), m)
    of_turn = 3 * frame[:, None] + np.arange(3)
    of_state = 3 * n + _six(near.block)[frame]
    of_point = 3 * n + 6 * near.blocks + 3 * point[:, None] + np.arange(3)
    seen = np.repeat(np.concatenate([of_turn, of_state, of_point], axis=1), 3, axis=0)
    b = np.arange(len(near.increment))
    chained = np.repeat(3 * n + _six(np.stack([b, b + 1], axis=1)), 6, axis=0)
    lengths = np.repeat([seen.shape[1], chained.shape[1]], [len(seen), len(chained)])
    return np.concatenate([seen.ravel(), chained.ravel()]), np.append(0, np.cumsum(lengths))


def _right_jacobian(turn: FloatArray) -> FloatArray:
    """The derivative (n, 3, 3) of a rotation, as a rotation vector in its axes, by its rotation vector (n, 3)."""
    angle2 = np.sum(turn**2, axis=1)[:, None, None]
    angle = np.sqrt(angle2)
    small = angle2 < 1e-6
    safe = np.where(small, 1.0, angle)
    first = np.where(small, 0.5 - angle2 / 24, (1 - np.cos(safe)) / safe**2)
    second = np.where(small, 1 / 6 - angle2 / 120, (safe - np.sin(safe)) / safe**3)
    K = cross_matrices(turn)
    return np.asarray(np.eye(3) - first * K + second * K @ K)

"""The least squares of `pivot` by general programs: GTSAM's factor graphs, and scipy's least_squares.

Unknown are the attitude of the body in every frame, the positions of its features in it, and the six unknowns of the
relative orbit, from features seen with white noise of known deviation. All start from the same approximate solution.
Each gives the path with its covariance, and the seconds that took, the building of its problem included.
"""

import time as clock
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.sparse import csc_array, csr_array
from scipy.sparse.linalg import splu
from scipy.spatial.transform import Rotation

from baryscope.estimator.dynamics.paths import SampledPath
from baryscope.estimator.geometry.so3 import cross_matrices
from baryscope.estimator.registration.body import Body

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

RIGID = 1e-5  # m, with which GTSAM's graph ties the path to the poses: more would cost its Cholesky factors digits
GAUGE = 1e-3  # rad, of the first attitude: the axes of the body are arbitrary
FAR = 1e6  # m
GAUGE_WEIGHT = 1e-3  # added to the information on that attitude in scipy's covariance


@dataclass(frozen=True, eq=False)
class Problem:
    """What is seen, position (n, m, 3) in C, m, of deviation sigma; and where all start: body and path's x (6,)."""

    position: FloatArray
    sigma: float
    path: SampledPath
    body: Body
    x: FloatArray


@dataclass(frozen=True, eq=False)
class Adjusted:
    """A peer's solution: the path (n, 3) in C, m, its covariance (n, 3, 3), and the seconds it took."""

    peer: str
    path: FloatArray
    covariance: FloatArray
    seconds: float

    @property
    def predicted(self) -> float:
        """The rms error of the path that the covariance predicts, m."""
        return float(np.sqrt(np.trace(self.covariance, axis1=1, axis2=2).mean()))


def timed(peer: str, solve: Callable[[Problem], tuple[FloatArray, FloatArray]], problem: Problem) -> Adjusted:
    """The solution of a function that gives x (6,) and its covariance."""
    begin = clock.perf_counter()
    x, of_x = solve(problem)
    path, covariance = problem.path.position(x), problem.path.covariance(of_x)
    return Adjusted(peer, path, covariance, clock.perf_counter() - begin)


def by_gtsam(problem: Problem) -> tuple[FloatArray, FloatArray]:
    """GTSAM: a map of landmarks, seen by a camera that moves around the body; all factors are its own, in C++.

    A pose is that of the camera in the body's axes; the centre of mass, their origin, is seen from there at the path's
    position, which is linear in x about its start. A feature's position is given as bearing and range, without the
    range's bias of second order.
    """
    import gtsam

    n, m, _ = problem.position.shape
    pose, seen, landmark, unknown, centre = (gtsam.symbol(letter, 0) for letter in "xgbuc")
    turned, start = np.swapaxes(problem.body.attitude, 1, 2), problem.path.position(problem.x)
    graph, values, noise = gtsam.NonlinearFactorGraph(), gtsam.Values(), gtsam.noiseModel
    distance = np.linalg.norm(problem.position, axis=2)
    bearing = problem.position / distance[:, :, None]
    unbiased = distance - problem.sigma**2 / distance
    values.insert(unknown, np.zeros(6))
    values.insert(centre, np.zeros(3))
    graph.add(gtsam.PriorFactorPoint3(centre, np.zeros(3), noise.Isotropic.Sigma(3, RIGID)))
    for i, point in enumerate(problem.body.points):
        values.insert(landmark + i, point)
    tie, known = noise.Isotropic.Sigma(3, RIGID), noise.Unit.Create(3)
    for k in range(n):
        values.insert(pose + k, gtsam.Pose3(gtsam.Rot3(turned[k]), -turned[k] @ start[k]))
        values.insert(seen + k, start[k])
        for i in range(m):
            sigmas = np.array([problem.sigma / distance[k, i]] * 2 + [problem.sigma])
            graph.add(
                gtsam.BearingRangeFactor3D(
                    pose + k, landmark + i, gtsam.Unit3(bearing[k, i]), unbiased[k, i], noise.Diagonal.Sigmas(sigmas)
                )
            )
        graph.add(gtsam.ReferenceFrameFactorPoint3Pose3(seen + k, pose + k, centre, tie))
        linear = gtsam.JacobianFactor(
            seen + k, np.eye(3) / RIGID, unknown, -problem.path.jacobian[k] / RIGID, np.zeros(3), known
        )
        fixed = gtsam.Values()
        fixed.insert(seen + k, start[k])
        fixed.insert(unknown, np.zeros(6))
        graph.add(gtsam.LinearContainerFactor(linear, fixed))
    gauge = noise.Diagonal.Sigmas(np.array([GAUGE] * 3 + [FAR] * 3))
    graph.add(gtsam.PriorFactorPose3(pose, values.atPose3(pose), gauge))
    found = gtsam.GaussNewtonOptimizer(graph, values).optimize()
    of_x = gtsam.Marginals(graph, found).marginalCovariance(unknown)
    return problem.x + found.atVector(unknown), of_x


def by_scipy(problem: Problem) -> tuple[FloatArray, FloatArray]:
    """scipy: trust regions with LSMR, with a sparse analytic Jacobian and its scaling; the covariance by SuperLU."""
    n, m, _ = problem.position.shape
    attitude, jacobian = problem.body.attitude, problem.path.jacobian
    rows, columns = _places(n, m)

    def parts(u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The attitudes (n, 3, 3) and points (m, 3)."""
        return attitude @ Rotation.from_rotvec(u[: 3 * n].reshape(n, 3)).as_matrix(), u[3 * n + 6 :].reshape(m, 3)

    def residuals(u: FloatArray) -> FloatArray:
        R, points = parts(u)
        seen = problem.path.position(u[3 * n : 3 * n + 6])[:, None] + points @ np.swapaxes(R, 1, 2)
        return np.asarray((seen - problem.position).ravel() / problem.sigma)

    def derivative(u: FloatArray) -> csr_array:
        R, points = parts(u)
        by_turn = -R[:, None] @ cross_matrices(points) @ _right_jacobian(u[: 3 * n].reshape(n, 3))[:, None]
        by_x = np.broadcast_to(jacobian[:, None], (n, m, 3, 6))
        by_point = np.broadcast_to(R[:, None], (n, m, 3, 3))
        values = np.concatenate([by_turn, by_x, by_point], axis=3) / problem.sigma
        return csr_array((values.ravel(), columns, rows), shape=(3 * n * m, 3 * n + 6 + 3 * m))

    start = np.concatenate([np.zeros(3 * n), problem.x, problem.body.points.ravel()])
    found = least_squares(residuals, start, derivative, x_scale="jac", tr_solver="lsmr")
    normal, of_x = csc_array(found.jac.T @ found.jac), slice(3 * n, 3 * n + 6)
    normal.setdiag(normal.diagonal() * np.where(np.arange(len(start)) < 3, 1 + GAUGE_WEIGHT, 1.0))
    unit = np.zeros((len(start), 6))
    unit[of_x] = np.eye(6)
    return found.x[of_x], splu(normal).solve(unit)[of_x]


def _places(n: int, m: int) -> tuple[IntArray, IntArray]:
    """The starts of rows, and the columns, of the nonzeros of scipy's Jacobian: by attitude, x and point."""
    frame, point = np.divmod(np.arange(n * m), m)
    of_turn = 3 * frame[:, None] + np.arange(3)
    of_x = np.broadcast_to(3 * n + np.arange(6), (n * m, 6))
    of_point = 3 * n + 6 + 3 * point[:, None] + np.arange(3)
    columns = np.repeat(np.concatenate([of_turn, of_x, of_point], axis=1), 3, axis=0)
    return 12 * np.arange(3 * n * m + 1), columns.ravel()


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

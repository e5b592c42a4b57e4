"""The process models of `ekf`: linear processes for the path, and the target's rotation."""

from dataclasses import dataclass
from functools import cache, cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.dynamics.inertia import inertia_of, mass_of, of_a_body
from baryscope.estimator.geometry.alignment import matrix_from_quaternion, quaternion_from_matrix
from baryscope.estimator.paths.path import Path
from baryscope.models.attitude import INERTIA_BASIS, angular_acceleration, gravity_gradient_torque, symmetric_inverse
from baryscope.models.columns import ColumnFunction
from baryscope.models.frames import quaternion_rate, rotation_from_quaternion
from baryscope.models.lvlh import gravity_gradient_axis
from baryscope.models.orbit import Orbit

FloatArray = NDArray[np.float64]

STEP_ANGLE = 0.1  # rad in a step of the integration: its error is 1e-7 rad, and as little of the errors' transition
MAX_INERTIA_CHANGE = 1.0  # of the inertia's logarithm in one correction
MOTION = 6  # unknowns of a motion on an orbit
ROTATION = 11  # errors of a rotation: turn (3), rate (3), both in B, and five of the inertia


@dataclass(frozen=True, eq=False)
class PathProcess:
    """A path of the centre of mass as a linear process with s unknowns x, and a state u = (δg, T δġ) in m.

    T is the span in s, δg the deviation from nominal (n, 3), m in C, with a velocity nominal_rate (n, 3), m/s. Without
    noise u is columns (n, 6, s) times x; what noise adds goes on by the transition (n - 1, 6, 6).
    """

    nominal: FloatArray
    nominal_rate: FloatArray
    columns: FloatArray
    transition: FloatArray
    span: float

    @cached_property
    def drive(self) -> FloatArray:
        """What a step adds to u beside its transition, (n - 1, 6, s) times x."""
        return np.asarray(self.columns[1:] - self.transition @ self.columns[:-1])

    def position(self, u: FloatArray) -> FloatArray:
        """The position (n, 3) in C, m, of states u (n, 6)."""
        return np.asarray(self.nominal + u[:, :3])

    def velocity(self, u: FloatArray) -> FloatArray:
        """The velocity (n, 3) in C, m/s, of states u (n, 6)."""
        return np.asarray(self.nominal_rate + u[:, 3:] / self.span)


def at_rest(motion: Path, time: FloatArray, origin: FloatArray, shift: FloatArray) -> FloatArray:
    """The unknowns x (s,) of a motion at rest in LVLH axes with the origin (3,) in C, m, at the middle of times (n,).

    shift (s,): of the deviation u at the first time, see `relative_motion`, and of unknowns beside the motion's own.
    """
    span, ends = span_of(time), time[[0, len(time) // 2]]
    place, rate = (one.jacobian[:, :, :MOTION] for one in (motion.at(ends), motion.rate_at(ends)))
    x = shift.copy()
    x[:MOTION] = np.linalg.solve(np.concatenate([place[0], span * rate[0]]), shift[:MOTION])
    x[:3] += np.linalg.solve(place[1, :, :3], origin)
    return x


def relative_motion(motion: Path, time: FloatArray, x: FloatArray, span: float, first: int = 0) -> PathProcess:
    """Relative motion on an orbit, linearised about an exact one with unknowns x (s,), its own six and others.

    The first unknowns of the process are the deviation u at one of the times, of the index `first`, as far as the
    others, such as those of burns, do not cause it; its transition follows from the Jacobians of `motion`.
    """
    place, rate = motion.at(time), motion.rate_at(time)
    whole = np.concatenate([place.jacobian, span * rate.jacobian], axis=1)
    own, others = whole[:, :, :MOTION], whole[:, :, MOTION:]
    columns, transition = own @ np.linalg.inv(own[first]), own[1:] @ np.linalg.inv(own[:-1])
    return PathProcess(place.position(x), rate.position(x), np.concatenate([columns, others], axis=2), transition, span)


def free_motion(path: Path, time: FloatArray, origin: FloatArray, span: float) -> PathProcess:
    """A path that is linear in its unknowns, beside which noise moves it as in free flight; x is zero at the origin.

    origin (3,) in C, m: of a path whose constant term is the first three of its unknowns.
    """
    place, rate = path.at(time), path.rate_at(time)
    step = np.tile(np.eye(2), (len(time) - 1, 1, 1))
    step[:, 0, 1] = np.diff(time) / span
    columns = np.concatenate([place.jacobian, span * rate.jacobian], axis=1)
    transition = np.asarray(np.kron(step, np.eye(3)), dtype=np.float64)
    return PathProcess(place.offset + origin, rate.offset, columns, transition, span)


def span_of(time: FloatArray) -> float:
    """The span T of times (n,) in s; 1 for a single time."""
    return float(time[-1] - time[0]) or 1.0


def integrated_noise(time: FloatArray, span: float = 1.0) -> FloatArray:
    """Covariance (n - 1, 6, 6), from time to time in s, of (a, T ȧ) by white noise ä of density 1, T the span in s."""
    dt = np.diff(time)[:, None, None]
    top, bottom = np.concatenate([dt**3 / 3, span * dt**2 / 2], 2), np.concatenate([dt**2 / 2, span * dt], 2)
    return np.asarray(np.kron(np.concatenate([top, span * bottom], 1), np.eye(3)))


def mean_gradient_axis(orbit: Orbit | None, time: FloatArray) -> FloatArray:
    """The `gravity_gradient_axis` amid the steps between times (n,) in s, (n - 1, 3), 1/s; zero without an orbit."""
    if orbit is None:
        return np.zeros((len(time) - 1, 3))
    return gravity_gradient_axis(orbit, (time[1:] + time[:-1]) / 2)


def rotated(
    attitude: FloatArray, rate: FloatArray, inertia: FloatArray, gravity_gradient: FloatArray, steps: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Rotation of one body from k initial states, each over its step, under the gravity gradient alone.

    Args:
        attitude: (k, 3, 3) R_C_B.
        rate: (k, 3), rad/s in B.
        inertia: (3, 3), in any unit.
        gravity_gradient: (k, 3), axis of the gravity gradient, 1/s in C, constant over the step; 0 for no torque.
        steps: (k,) s, of either sign.

    Returns:
        attitude and rate after the steps, and the transition (k, 6, 11) to the errors of attitude and rate from those
        of attitude, rate and inertia: the attitude error is a rotation vector in B; for those of the inertia see
        `changed_inertia`.
    """
    k = len(attitude)
    fastest = float(np.max(np.linalg.norm(rate, axis=1) * np.abs(steps), initial=0.0))
    count = max(1, int(np.ceil(fastest / STEP_ANGLE)))
    quaternion = quaternion_from_matrix(attitude).T
    w, change, constants = rate.T, None, np.vstack([np.tile(inertia.reshape(9, 1), k), gravity_gradient.T])
    for _ in range(count):
        values = _advance()(quaternion, w, constants, steps[None] / count)
        quaternion, w = values[:, :4].T, values[:, 4:7].T
        step = values[:, 7:].reshape(k, 6, ROTATION)
        if change is not None:
            by_inertia = step[:, :, :6] @ change[:, :, 6:] + step[:, :, 6:]
            step = np.concatenate([step[:, :, :6] @ change[:, :, :6], by_inertia], axis=2)
        change = step
    assert change is not None  # noqa: S101  there is at least one step
    return matrix_from_quaternion(quaternion.T), w.T, change


@cache
def _advance() -> ColumnFunction:
    """One Runge–Kutta step: (q, ω, (J, gravity gradient), h) → q, ω, transition (6, 11) of the errors."""
    q, w, c, h = ca.SX.sym("q", 4), ca.SX.sym("w", 3), ca.SX.sym("c", 12), ca.SX.sym("h")
    J, gradient_C = ca.reshape(c[:9], 3, 3), c[9:]
    inverse = symmetric_inverse(J)

    def acceleration(x: ca.SX) -> ca.SX:
        torque = gravity_gradient_torque(J, rotation_from_quaternion(x[:4]).T @ gradient_C, ca.SX(1 / 3))
        return angular_acceleration(J, inverse, x[4:], torque)

    def slope(x: ca.SX) -> ca.SX:
        return ca.vertcat(quaternion_rate(x[:4], x[4:]), acceleration(x))

    x = ca.vertcat(q, w)
    k1 = slope(x)
    k2 = slope(x + h / 2 * k1)
    k3 = slope(x + h / 2 * k2)
    k4 = slope(x + h * k3)
    after = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    between = ca.SX.sym("between", 7)
    spin = acceleration(between)
    by_rate, by_inertia = ca.jacobian(spin, between[4:]), ca.jacobian(spin, c[:9])
    root = ca.chol(ca.trace(J) / 2 * ca.SX.eye(3) - J).T
    mass_changes = [root @ ca.DM(matrix) @ root.T for matrix in INERTIA_BASIS]
    inertia_changes = ca.horzcat(*(ca.vec(ca.trace(change) * ca.SX.eye(3) - change) for change in mass_changes))
    turning = ca.horzcat(-ca.skew(between[4:]), ca.SX.eye(3), ca.SX(3, 5))
    slopes = ca.vertcat(turning, ca.horzcat(ca.SX(3, 3), by_rate, by_inertia @ inertia_changes), ca.SX(5, ROTATION))
    of_errors = ca.Function("slopes", [between, c], [slopes])
    # The same Runge-Kutta step of the errors, at the same states.
    one, states = ca.SX.eye(ROTATION), (x, x + h / 2 * k1, x + h / 2 * k2, x + h * k3)
    A1, A2, A3, A4 = (of_errors(state, c) for state in states)
    m2 = A2 @ (one + h / 2 * A1)
    m3 = A3 @ (one + h / 2 * m2)
    m4 = A4 @ (one + h * m3)
    change = one + h / 6 * (A1 + 2 * m2 + 2 * m3 + m4)
    found = ca.vertcat(after[:4] / ca.norm_2(after[:4]), after[4:], ca.vec(change[:6, :].T))
    return ColumnFunction("rotated", [q, w, c, h], ca.densify(found))


def changed_inertia(inertia: FloatArray, error: FloatArray, most: float = MAX_INERTIA_CHANGE) -> FloatArray:
    """The inertia (3, 3) of trace 1 for errors δ (5,), at most so long, which is always that of a body.

    The second moments of the mass, M = ½ tr J − J, become A exp(Σ δ_i E_i) Aᵀ, with A Aᵀ = M and E the INERTIA_BASIS.
    """
    root = np.linalg.cholesky(mass_of(inertia))
    error = error * min(1.0, most / (float(np.linalg.norm(error)) + 1e-300))
    values, vectors = np.linalg.eigh(np.tensordot(error, INERTIA_BASIS, 1))
    half = root @ vectors * np.exp((values - values[-1]) / 2)  # of any size, as only its shape counts
    return of_a_body(inertia_of(half @ half.T))


def logarithm_of_inertia(inertia: FloatArray) -> FloatArray:
    """The negative errors (5,), see `changed_inertia`, that make an inertia that of a sphere.

    With M = A Aᵀ and its symmetric root, A = √M Q, these are the coefficients of Qᵀ ln M Q.
    """
    mass = mass_of(inertia)
    values, vectors = np.linalg.eigh(mass)
    turned = vectors.T @ np.linalg.cholesky(mass) / np.sqrt(values)[:, None]
    return np.asarray(np.tensordot(INERTIA_BASIS, turned.T @ np.diag(np.log(values)) @ turned))

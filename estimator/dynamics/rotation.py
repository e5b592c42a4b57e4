"""Rigid-body rotation by Euler's equation, and its sensitivity to the rate, the inertia and a torque.

The motion is integrated from the epoch to evenly spaced nodes by the steps of `euler`. Only the state is integrated
sequentially; the sensitivities of the steps are evaluated for all steps at once and multiplied. Between nodes the
attitude is a quintic, whose slope is the rate, and its sensitivity a cubic Hermite polynomial, so that the cost of the
integration does not depend on the sampling.

Only the ratios of the inertia's elements are observable, so J has trace 1. Its five degrees of freedom are the
coefficients of INERTIA_BASIS, a basis of the traceless symmetric matrices.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.dynamics.euler import (
    CHUNK,
    FORCED,
    MULTIPLE,
    advance,
    anomaly_function,
    rate_columns,
    sensitivity_step,
    turn_of_step,
)
from baryscope.estimator.dynamics.torque import GAUSS, Torque
from baryscope.estimator.geometry.alignment import (
    matrix_from_quaternion,
    quaternion_from_matrix,
    quaternion_times_vector,
    rate_of_quaternion,
    running_products,
)
from baryscope.estimator.geometry.so3 import exp_rotation
from baryscope.estimator.paths.polynomials import cubic_slope_weights, cubic_weights, quintic
from baryscope.models.attitude import INERTIA_BASIS
from baryscope.models.columns import evaluate
from baryscope.models.errors import ComputationError, Reason
from baryscope.models.orbit import Orbit

FloatArray = NDArray[np.float64]

# rad from node to node: the interpolation's error is 1e-8 to 1e-7 rad, that of the steps is less, and in the rate it is
# up to 1e-6 of it; with the shorter one a thirtieth of that, for who asks for rates.
NODE_ANGLE, SHORT_NODE_ANGLE = 0.5, 0.25
NODE_PHASE = 1.0  # rad of the torque's last mode from node to node, at most
MAX_NODES = 200_000  # of an integration: 600 MB, and 10 s
MIN_PRINCIPAL_MOMENT = 1e-3  # over the trace: bound on the inertia of an estimate
RATE_AND_INERTIA = 8  # unknowns of a free rotation: three of the rate at the epoch, five of the inertia
INERTIA = slice(3, RATE_AND_INERTIA)  # the latter


@dataclass(frozen=True, eq=False)
class Rotation:
    """The rotational state at an epoch: attitude R_C_B (3, 3), rate (3,) in rad/s in B, inertia (3, 3) of trace 1.

    epoch in s; orbit: the target's, if a gravity-gradient torque acts on it; torque: a further one. None: none.
    """

    epoch: float
    attitude: FloatArray
    rate: FloatArray
    inertia: FloatArray
    orbit: Orbit | None = None
    torque: Torque | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "inertia", self.inertia / np.trace(self.inertia))

    @property
    def size(self) -> int:
        """The number of unknowns: rate, inertia and the torque's coefficients."""
        return RATE_AND_INERTIA + (0 if self.torque is None else self.torque.size)

    def changed(self, turn: FloatArray, change: FloatArray) -> "Rotation":
        """The rotation with a changed state.

        turn (3,): rotation vector in B, rad, applied to the attitude; change (size,): of the rate in rad/s, of the
        coefficients of INERTIA_BASIS, and of those of the torque, three of each mode.
        """
        return replace(
            self,
            attitude=self.attitude @ exp_rotation(turn),
            rate=self.rate + change[:3],
            inertia=self.inertia + np.tensordot(change[3:RATE_AND_INERTIA], INERTIA_BASIS, 1),
            torque=None if self.torque is None else self.torque.changed(change[RATE_AND_INERTIA:]),
        )

    @property
    def constants(self) -> FloatArray:
        """The parameters of the equations: the inertia by columns (9,), then the orbit's elements if there is one."""
        of_inertia = self.inertia.T.ravel()
        return of_inertia if self.orbit is None else np.concatenate([of_inertia, self.orbit.elements])

    def true_anomaly(self, time: FloatArray) -> FloatArray:
        """At times (n,) in s, rad; zero without an orbit."""
        if self.orbit is None:
            return np.zeros(len(time))
        return np.asarray(anomaly_function()(time[None], self.orbit.elements)).ravel()

    @property
    def possible(self) -> bool:
        """Whether the inertia is positive definite, with least moment not below a rod's 27 times as long as thick."""
        return bool(np.linalg.eigvalsh(self.inertia)[0] > MIN_PRINCIPAL_MOMENT)

    def reaches(self, time: FloatArray, nodes: float = MAX_NODES) -> bool:
        """Whether the integration from the epoch over times (n,) in s needs at most `nodes` nodes."""
        return _span(self.epoch, time) <= self.longest_step * nodes

    @property
    def longest_step(self) -> float:
        """The longest time in s from node to node."""
        return self._longest_step(NODE_ANGLE)

    def _longest_step(self, node_angle: float) -> float:
        highest = _highest_rate(self) / node_angle
        if self.torque is not None:
            highest = max(highest, self.torque.highest_frequency / NODE_PHASE)
        return 1 / highest if highest > 0 else np.inf

    def at(self, time: FloatArray, node_angle: float = NODE_ANGLE) -> "Attitudes":
        """Attitude, rate and sensitivities at times (n,) in s, in any order; node_angle: from node to node, rad.

        Raises:
            ComputationError: the integration needs more than MAX_NODES nodes, or diverges.
        """
        if not self.reaches(time):
            raise too_long(float(np.linalg.norm(self.rate)), _span(self.epoch, time))
        found = self.try_at(time, node_angle)
        if found is None:
            raise diverged()
        return found

    def try_at(self, time: FloatArray, node_angle: float = NODE_ANGLE) -> "Attitudes | None":
        """The same as `at`; None instead of an error."""
        if not self.reaches(time):
            return None
        span = float(min(time.min(initial=np.inf), self.epoch)), float(max(time.max(), self.epoch))
        nodes = _nodes(self, *span, self._longest_step(node_angle))
        return nodes.between(time) if nodes.finite else None

    def transition(self, start: "Attitudes", end: "Attitudes") -> FloatArray:
        """Φ (n, 6, 6) of attitude (a rotation vector) and rate, both in B, from n states to later or earlier ones.

        By one step each, of at most `longest_step`. A torque of modes is not among what changes.
        """
        anomaly = self.true_anomaly(start.time)
        states = np.vstack([quaternion_from_matrix(start.attitude).T, start.rate.T, anomaly])
        step = sensitivity_step(self.orbit is not None, forced=False)
        found = step(states, (end.time - start.time)[None], self.constants)[:, :, :6]
        found[:, :, :3] = found[:, :, :3] @ start.attitude
        found[:, :3] = np.swapaxes(end.attitude, 1, 2) @ found[:, :3]
        return found


def too_long(rate: float, span: float) -> ComputationError:
    """The error to raise if the integration of a rate in rad/s over a span in s needs too many nodes."""
    turns = rate * span / (2 * np.pi)
    return ComputationError(
        f"the target turns at {rate:.3g} rad/s, {turns:.2g} times in the {span:.3g} s of the tracks: too often for its "
        "motion to be followed in so few frames; use a shorter part of the tracks, or the method pivot",
        Reason.TOO_LONG,
    )


def diverged() -> ComputationError:
    """The error to raise if a rotation cannot be integrated."""
    why = "about the axis of middle inertia, or by the gravity gradient, small changes of it grow without bound"
    return ComputationError(f"the integration of the rotation diverges over so long a time: {why}", Reason.DIVERGED)


def _span(epoch: float, time: FloatArray) -> float:
    """The span in s of times (n,) and an epoch."""
    return float(max(time.max(initial=epoch), epoch) - min(time.min(initial=epoch), epoch))


@dataclass(frozen=True, eq=False)
class Attitudes:
    """The rotation at n times in s: attitude (n, 3, 3) R_C_B, rate (n, 3) rad/s in B; size: number of its unknowns."""

    time: FloatArray
    attitude: FloatArray
    rate: FloatArray
    size: int
    _nodes: "_Nodes"

    def at(self, time: FloatArray) -> "Attitudes":
        """The same motion at other times (n,) in the span of those it was computed for."""
        return self._nodes.between(time)

    @cached_property
    def turn(self) -> FloatArray:
        """Jacobian (n, 3, size) of the attitude, as a rotation vector in B, by the rotation's unknowns.

        The attitude at the epoch is none of them; a rotation by φ there rotates the attitude at t by R(t)ᵀ R(epoch) φ.
        """
        return self.turn_of(slice(None))

    def turn_of(self, part: slice) -> FloatArray:
        """The derivatives `turn`, (k, 3, size), at a part of the times."""
        return np.asarray(np.swapaxes(self.attitude[part], 1, 2) @ self._nodes.turn_at(self.time[part]))

    @cached_property
    def rate_sensitivity(self) -> FloatArray:
        """Jacobian (n, 3, size) of the rate in B by the unknowns."""
        return np.asarray(np.swapaxes(self.attitude, 1, 2) @ self.rate_sensitivity_in_C(self.time))

    def turn_in_C(self, time: FloatArray) -> FloatArray:
        """The Jacobian (k, 3, size) of a rotation vector in C by the unknowns, at other times (k,) in the same span."""
        return self._nodes.turn_at(time)

    def rate_sensitivity_in_C(self, time: FloatArray) -> FloatArray:
        """The Jacobian (k, 3, size) of the rate by the unknowns, turned from B into C, at such times.

        A rotation vector φ changes ω by φ̇ + ω × φ = Rᵀ d(R φ)/dt, here the slope of the cubic R φ.
        """
        return self._nodes.turn_rate_at(time)


@dataclass(frozen=True, eq=False)
class _Nodes:
    time: FloatArray  # (k,) in s, evenly spaced, ascending
    states: FloatArray  # (k, 7), see `motion_between`
    acceleration: FloatArray  # (k, 3)
    size: int  # number of unknowns
    sensing: Callable[[], FloatArray]  # what makes `sensitivity`

    @cached_property
    def sensitivity(self) -> FloatArray:
        """(2 k, 3 size), in turn: the rotation vector in C by the unknowns, and its change at that slope in a step."""
        return self.sensing()

    @property
    def finite(self) -> bool:
        """Whether the integration of the motion, which begins within, has not diverged, nor the sensitivity."""
        ends = np.isfinite(self.states[[0, -1]]).all()
        return bool(ends and np.isfinite(self.sensitivity[[0, 1, -2, -1]]).all())

    def between(self, time: FloatArray) -> Attitudes:
        return Attitudes(time, *motion_between(self.time, self.states, self.acceleration, time), self.size, self)

    def turn_at(self, time: FloatArray) -> FloatArray:
        """The rotation's Jacobian (n, 3, size) in C."""
        left, s = _located(self.time, time)
        return self._combined(left, cubic_weights(s))

    def turn_rate_at(self, time: FloatArray) -> FloatArray:
        """The derivative (n, 3, size) of that by time."""
        left, s = _located(self.time, time)
        return self._combined(left, cubic_slope_weights(s) / (self.time[1] - self.time[0]))

    def _combined(self, left: NDArray[np.intp], weights: FloatArray) -> FloatArray:
        """The Jacobian (n, 3, size) by weights (n, 4) of the sensitivities at the nodes `left` and the next ones."""
        from scipy.sparse import csr_array  # slow to load, and few commands need it

        n, places = len(left), 2 * left[:, None] + np.arange(4)
        sparse = csr_array((weights.ravel(), places.ravel(), np.arange(0, 4 * n + 1, 4)), (n, len(self.sensitivity)))
        return np.asarray(sparse @ self.sensitivity).reshape(n, 3, -1)


def motion_between(
    nodes: FloatArray, states: FloatArray, acceleration: FloatArray, time: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Attitudes (n, ..., 3, 3) R_C_B and rates (n, ..., 3) at times (n,) in s, from those at nodes.

    nodes (k,) in s, evenly spaced; states (k, ..., 7): quaternions R_C_B, scalar first, without jumps of sign, and
    rates in rad/s in B, of any bodies; acceleration (k, ..., 3): ω̇, rad/s².
    """
    h, bodies = nodes[1] - nodes[0], states.shape[1:-1]
    left, s = _located(nodes, time)
    q, rate, change = states[..., :4].reshape(-1, 4), states[..., 4:].reshape(-1, 3), acceleration.reshape(-1, 3)
    # q̇ = ½ q ⊗ ω and q̈ = ½ q ⊗ ω̇ − ¼ |ω|² q.
    first, pull = 0.5 * quaternion_times_vector(q, rate), 0.25 * np.sum(rate**2, axis=1)[:, None] * q
    second = 0.5 * quaternion_times_vector(q, change) - pull
    q, first, second = (one.reshape(len(nodes), -1) for one in (q, first, second))
    quaternion, slope = (one.reshape(-1, 4) for one in quintic(s, left, q, h * first, h * h * second))
    length = np.linalg.norm(quaternion, axis=1, keepdims=True)
    quaternion /= length
    rates = rate_of_quaternion(quaternion, slope / (h * length))
    return matrix_from_quaternion(quaternion).reshape(len(time), *bodies, 3, 3), rates.reshape(len(time), *bodies, 3)


def _located(nodes: FloatArray, time: FloatArray) -> tuple[NDArray[np.intp], FloatArray]:
    """The index of the node before each time, and the fraction of the interval from there, 0 to 1."""
    h = nodes[1] - nodes[0]
    left = np.clip(((time - nodes[0]) / h).astype(np.intp), 0, len(nodes) - 2)
    return left, (time - nodes[left]) / h


@np.errstate(over="ignore", invalid="ignore")
def _nodes(start: Rotation, begin: float, end: float, longest: float) -> _Nodes:
    """The motion and its sensitivities at nodes that span begin … end in s, integrated from the epoch.

    longest: time in s from node to node.
    """
    h = longest
    before = max(int(np.ceil((start.epoch - begin) / h)), 0)
    after = max(int(np.ceil((end - start.epoch) / h)), 1)
    h = float(np.max([(start.epoch - begin) / max(before, 1), (end - start.epoch) / after, 1e-9]))
    time = start.epoch + h * np.arange(-before, after + 1, dtype=np.float64)
    constants, gravity_gradient, torque = start.constants, start.orbit is not None, start.torque
    # Of the steps in the direction of integration, those back in time first.
    begins = np.concatenate([time[before:0:-1], time[before:-1]])
    sizes = np.repeat([-h, h], [before, after])
    modes = None if torque is None else torque.modes(begins[:, None] + sizes[:, None] * GAUSS)
    inputs = [sizes[None]]
    if torque is not None and modes is not None:
        inputs.append((modes @ torque.coefficients).reshape(-1, FORCED).T)
    back, forth = _integrate(start, constants, inputs, before)
    starts, states = np.hstack([back[:, :-1], forth[:, :-1]]), np.hstack([back[:, :0:-1], forth])
    states[:4] /= np.linalg.norm(states[:4], axis=0)
    acceleration = rate_columns(gravity_gradient)(states, constants)[:, 4:7]
    if torque is not None:
        acceleration += torque.at(time)

    @np.errstate(over="ignore", invalid="ignore")  # sensitivities of a chaotic motion grow without bound: see `finite`
    def sensing() -> FloatArray:
        steps = sensitivity_step(gravity_gradient, torque is not None)(starts, *inputs, constants)
        sensitivity = np.zeros((len(time), 6, start.size))
        sensitivity[before, 3:, :3] = np.eye(3)
        _chain(sensitivity[before::-1], steps[:before], None if modes is None else modes[:before])
        _chain(sensitivity[before:], steps[before:], None if modes is None else modes[before:])
        sensitivity[:, 3:] = h * matrix_from_quaternion(states[:4].T) @ sensitivity[:, 3:]
        return sensitivity.reshape(2 * len(time), 3 * start.size)

    return _Nodes(time, states[:7].T, acceleration, start.size, sensing)


def _highest_rate(start: Rotation) -> float:
    """An upper bound in rad/s of ‖ω‖ from the kinetic energy, plus what a torque adds to it, and the orbit's rate.

    The gravity gradient swings a slender body at up to √(3 (λ₃ − λ₁)/λ₁) times the orbit's rate. A quarter of that
    keeps the integration stable.
    """
    J, w, moments = start.inertia, start.rate, np.linalg.eigvalsh(start.inertia)
    lowest = max(float(moments[0]), 1e-6)
    rate = float(np.sqrt(max(float(w @ J @ w), 0.0) / lowest))
    if start.torque is not None:
        rate += float(np.sqrt(moments[-1] / lowest)) * start.torque.impulse()
    if start.orbit is None:
        return rate
    swing = float(np.sqrt(3 * (moments[-1] - moments[0]) / lowest)) * start.orbit.periapsis_rate
    return max(rate + 2 * start.orbit.periapsis_rate, float(np.hypot(rate, swing)) / 4)


def _integrate(
    start: Rotation, constants: FloatArray, inputs: list[FloatArray], before: int
) -> tuple[FloatArray, FloatArray]:
    """The states (8, k + 1) at the epoch and after each step, for those back in time and those forth.

    inputs: sizes (1, steps) in s and, with a torque, accelerations (FORCED, steps); the first `before` go back in time.
    """
    forced, parts = len(inputs) > 1, (slice(0, before), slice(before, None))
    attitude, anomaly = quaternion_from_matrix(start.attitude[None])[0], start.true_anomaly(np.array([start.epoch]))
    if start.orbit is not None:
        first = np.concatenate([attitude, start.rate, anomaly])
        back, forth = (_walk((True, forced), first, [one[:, p] for one in inputs], constants) for p in parts)
        return back, forth
    rates = [_walk((False, forced), start.rate, [one[:, p] for one in inputs], constants) for p in parts]
    turns = turn_of_step(forced)(np.hstack([one[:, :-1] for one in rates]), *inputs, constants).T
    back, forth = (
        np.vstack([running_products(np.column_stack([attitude, turns[:, p]])), rate, np.zeros(rate.shape[1])])
        for p, rate in zip(parts, rates, strict=True)
    )
    return back, forth


def _walk(kind: tuple[bool, bool], first: FloatArray, inputs: list[FloatArray], constants: FloatArray) -> FloatArray:
    """The states (size, k + 1) of `advance`, of that kind: the first one, and those after each of k steps."""
    count = inputs[0].shape[1]
    padded = [np.hstack([one, np.zeros((len(one), -count % MULTIPLE))]) for one in inputs]  # with steps of no length
    states = np.empty((len(first), 1 + padded[0].shape[1]))
    states[:, 0] = first
    for begin in range(0, count, CHUNK):
        chunk = slice(begin, min(begin + CHUNK, padded[0].shape[1]))
        many = chunk.stop - begin
        own = [states[None, :, begin], *(one[:, chunk].T for one in padded), np.tile(constants, (many, 1))]
        found = np.empty((many, len(first)))
        evaluate(advance(*kind, many), own, found)
        states[:, begin + 1 : chunk.stop + 1] = found.T
    return states[:, : count + 1]


def _chain(sensitivity: FloatArray, steps: FloatArray, modes: FloatArray | None) -> None:
    """Write the sensitivities (k + 1, 6, size) after each step to those before the first one.

    steps (k, 6, 11 or more): by attitude, rate and inertia, and by the values of a torque of modes (k, POINTS, j).
    """
    moved, by_values = np.ascontiguousarray(steps[:, :, :6]), steps[:, :, 11:]
    sensitivity[1:, :, 3:RATE_AND_INERTIA] = steps[:, :, 6:11]
    if modes is not None:
        for axis in range(3):
            np.matmul(by_values[:, :, axis::3], modes, out=sensitivity[1:, :, RATE_AND_INERTIA + axis :: 3])
    more = np.empty(sensitivity.shape[1:])
    for before, step, after in zip(sensitivity, moved, sensitivity[1:], strict=False):
        np.matmul(step, before, out=more)
        after += more

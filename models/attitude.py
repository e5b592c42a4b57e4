"""Rotation of a rigid target: Euler's equation, (1) of the paper, for a full inertia tensor; energy and momentum."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import casadi as ca
import numpy as np

from baryscope.models.frames import (
    Symbol,
    cross_matrix,
    quaternion_about,
    quaternion_product,
    quaternion_rate,
    rotation_about,
    rotation_from_quaternion,
)
from baryscope.models.variables import AXES, UPPER

SWEEPS = 5  # of Jacobi's method

_HALF, _SIXTH = np.sqrt(0.5), np.sqrt(1 / 6)
INERTIA_BASIS = np.array(
    [
        np.diag([_HALF, -_HALF, 0.0]),
        np.diag([_SIXTH, _SIXTH, -2 * _SIXTH]),
        [[0, _HALF, 0], [_HALF, 0, 0], [0, 0, 0]],
        [[0, 0, _HALF], [0, 0, 0], [_HALF, 0, 0]],
        [[0, 0, 0], [0, 0, _HALF], [0, _HALF, 0]],
    ]
)
"""An orthonormal basis (5, 3, 3) of the symmetric matrices without a trace: changes of an inertia of trace 1."""


def inertia_tensor(parameters: Mapping[str, Symbol]) -> Symbol:
    """J in B from its six elements, kg m²."""
    return symmetric_tensor(parameters, "target.inertia")


def symmetric_tensor(parameters: Mapping[str, Symbol], name: str) -> Symbol:
    """A symmetric tensor from the six parameters `name`.xx to `name`.yz."""
    return symmetric_matrix([parameters[f"{name}.{axes}"] for axes in AXES])


def symmetric_matrix(elements: Sequence[Symbol]) -> Symbol:
    """A symmetric 3 × 3 matrix from its six elements in the order of AXES."""
    xx, yy, zz, xy, xz, yz = elements
    return ca.vertcat(ca.horzcat(xx, xy, xz), ca.horzcat(xy, yy, yz), ca.horzcat(xz, yz, zz))


def upper_elements(matrix: Symbol) -> Symbol:
    """The six elements of a symmetric 3 × 3 matrix in the order of UPPER."""
    return ca.vertcat(*(matrix["xyz".index(axes[0]), "xyz".index(axes[1])] for axes in UPPER))


def from_upper_elements(upper: Symbol) -> Symbol:
    """The symmetric 3 × 3 matrix of six elements in the order of UPPER."""
    elements = dict(zip(UPPER, ca.vertsplit(upper), strict=True))
    return symmetric_matrix([elements[axes] for axes in AXES])


@dataclass(frozen=True)
class Form:
    """How the equations of a turned body are written: the same values, in different operations.

    Attributes:
        to_body: turns a vector from I to B.
        turned: J, v → v × J v.
        gradient: J, û in I, stiffness → gravity_gradient_torque.
    """

    to_body: Callable[[Symbol], Symbol]
    turned: Callable[[Symbol, Symbol], Symbol]
    gradient: Callable[[Symbol, Symbol, Symbol], Symbol]

    @classmethod
    def plain(cls, R_I_B: Symbol) -> Self:
        """As the equations are printed."""

        def to_B(v: Symbol) -> Symbol:
            return R_I_B.T @ v

        def gradient(J: Symbol, up_I: Symbol, stiffness: Symbol) -> Symbol:
            return gravity_gradient_torque(J, to_B(up_I), stiffness)

        return cls(to_B, turned_by, gradient)

    @classmethod
    def of_products(cls, scaled_R_I_B: Symbol, scale: Symbol) -> Self:
        """By as few products of what changes fast as can be, for the recurrence of a Taylor series.

        Args:
            scaled_R_I_B: R_I_B over the scale, quadratic in the quaternion.
            scale: one over the square of the quaternion's length.
        """

        def to_B(v: Symbol) -> Symbol:
            return scaled_R_I_B.T @ (scale * v)

        def gradient(J: Symbol, up_I: Symbol, stiffness: Symbol) -> Symbol:
            return turned_by_products(J, to_B(ca.sqrt(3 * stiffness) * up_I))

        return cls(to_B, turned_by_products, gradient)


def turned_by(J: Symbol, v: Symbol) -> Symbol:
    """v × J v."""
    return ca.cross(v, J @ v)


def turned_by_products(J: Symbol, v: Symbol) -> Symbol:
    """v × J v for a symmetric J by the products of v's components: for the recurrence of a Taylor series."""
    rows = []
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        equal = J[j, k] * (v[j] * v[j] - v[k] * v[k]) + (J[k, k] - J[j, j]) * (v[j] * v[k])
        rows.append(equal + J[i, k] * (v[i] * v[j]) - J[i, j] * (v[i] * v[k]))
    return ca.vertcat(*rows)


def angular_acceleration(
    inertia_B: Symbol,
    inverse_inertia_B: Symbol,
    angular_rate_B: Symbol,
    torque_B: Symbol,
    turned: Callable[[Symbol, Symbol], Symbol] | None = None,
) -> Symbol:
    """ω̇ from Euler's equation J ω̇ + ω × J ω = τ; J kg m², ω rad/s, τ N m, all in B.

    `turned` gives v × J v; `turned_by` unless given.
    """
    return inverse_inertia_B @ (torque_B - (turned or turned_by)(inertia_B, angular_rate_B))


def symmetric_inverse(J: Symbol) -> Symbol:
    """J⁻¹ of a symmetric 3 × 3 matrix by its cofactors, which are the cross products of its columns."""
    columns = ca.horzsplit(J)
    cofactors = ca.horzcat(*(ca.cross(columns[(i + 1) % 3], columns[(i + 2) % 3]) for i in range(3)))
    return cofactors / ca.dot(columns[0], cofactors[:, 0])


def principal_axes(J: Symbol) -> Symbol:
    """q_B_D of the principal axes D of a symmetric J in B, by Jacobi's cyclic method.

    Each turn takes an element beside the diagonal to zero; three sweeps already leave nothing but rounding (Golub, Van
    Loan, Matrix Computations, §8.5). It never turns by more than 45°, so that equal moments do no harm.
    """
    q_B_D = ca.SX([1, 0, 0, 0])
    for axis in (0, 1, 2) * SWEEPS:
        j, k = (axis + 1) % 3, (axis + 2) % 3
        difference = J[j, j] - J[k, k]
        beside = ca.if_else(difference < 0, -2, 2) * J[j, k]
        angle = ca.atan2(beside, ca.fabs(difference)) / 2
        R = rotation_about(axis, angle)
        J = R.T @ J @ R
        q_B_D = quaternion_product(q_B_D, quaternion_about(axis, angle))
    return q_B_D


def moments_about(J: Symbol, R_B_D: Symbol) -> Symbol:
    """The moments (3,) of a symmetric J in B about the axes D: its eigenvalues if these are the principal ones."""
    return ca.diag(R_B_D.T @ J @ R_B_D)


def gravity_gradient_torque(inertia_B: Symbol, up_B: Symbol, stiffness: Symbol) -> Symbol:
    """3 μ/r³ û × J û, N m in B: û the unit vector from the Earth's centre to the target, in B; stiffness μ/r³, 1/s²."""
    return 3 * stiffness * ca.cross(up_B, inertia_B @ up_B)


def rotational_energy(inertia_B: Symbol, angular_rate_B: Symbol) -> Symbol:
    """½ ω·Jω, J."""
    return 0.5 * ca.dot(angular_rate_B, inertia_B @ angular_rate_B)


def angular_momentum(inertia_B: Symbol, angular_rate_B: Symbol, R_I_B: Symbol) -> Symbol:
    """R_I_B J ω, kg m²/s in I: constant without torque."""
    return R_I_B @ (inertia_B @ angular_rate_B)


def tumble_step(gravity_gradient: bool) -> ca.Function:
    """The function (q, ω, J, h, g) → (q, ω, G) of a tumble over h s, by the classical Runge–Kutta formula.

    q is q_I_B (w, x, y, z), ω in B, rad/s; J (9,) by columns; g (3,) the axis of the gravity gradient in I, see
    `gravity_gradient_axis`, which a free tumble does without: its step costs half as much. G (6, 11) maps changes of
    attitude (a rotation vector in I), rate and inertia (coefficients of INERTIA_BASIS) before the step to those of
    attitude and rate after it.
    """
    q, w, inertia, h = ca.SX.sym("q", 4), ca.SX.sym("w", 3), ca.SX.sym("J", 9), ca.SX.sym("h")
    axis_I = ca.SX.sym("g", 3) if gravity_gradient else ca.SX(3, 1)
    J = ca.reshape(inertia, 3, 3)
    inverse = symmetric_inverse(J)

    def slopes(x: Symbol, change: Symbol) -> tuple[Symbol, Symbol]:
        """The rates of q and ω, and of their changes (6, 11) to first order: less than the formula differentiated."""
        v, R = x[4:], rotation_from_quaternion(x[:4]) / ca.sumsqr(x[:4])
        axis = R.T @ axis_I
        acceleration = angular_acceleration(J, inverse, v, gravity_gradient_torque(J, axis, ca.SX(1 / 3)))
        by_rate = _by_vector(J, v)
        by_turn = _by_vector(J, axis) @ R.T @ cross_matrix(axis_I)
        bases = map(Symbol, INERTIA_BASIS)
        by_inertia = ca.horzcat(*(turned_by(E, axis) - turned_by(E, v) - E @ acceleration for E in bases))
        pull = by_turn @ change[:3, :] - by_rate @ change[3:, :] + ca.horzcat(ca.SX(3, 6), by_inertia)
        return ca.vertcat(quaternion_rate(x[:4], v), acceleration), ca.vertcat(R @ change[3:, :], inverse @ pull)

    x, G = ca.vertcat(q, w), ca.horzcat(ca.SX.eye(6), ca.SX(6, 5))
    one = slopes(x, G)
    two = slopes(x + h / 2 * one[0], G + h / 2 * one[1])
    three = slopes(x + h / 2 * two[0], G + h / 2 * two[1])
    four = slopes(x + h * three[0], G + h * three[1])
    after, change = (
        start + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        for start, k1, k2, k3, k4 in zip((x, G), one, two, three, four, strict=True)
    )
    found = [after[:4] / ca.norm_2(after[:4]), after[4:], ca.densify(change)]
    if gravity_gradient:
        return ca.Function("tumble", [q, w, inertia, h, axis_I], found, {"cse": True})
    return ca.Function("free_tumble", [q, w, inertia, h], found, {"cse": True})


def _by_vector(J: Symbol, v: Symbol) -> Symbol:
    """The derivative (3, 3) of v × J v by v."""
    return cross_matrix(v) @ J - cross_matrix(J @ v)

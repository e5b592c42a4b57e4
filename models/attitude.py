"""Rotation of a rigid target: Euler's equation, (1) of the paper, for a full inertia tensor; energy and momentum."""

from collections.abc import Mapping

import casadi as ca

from baryscope.models.frames import Symbol
from baryscope.models.variables import AXES


def inertia_tensor(parameters: Mapping[str, Symbol]) -> Symbol:
    """J in B from its six elements, kg m²."""
    return symmetric_tensor(parameters, "target.inertia")


def symmetric_tensor(parameters: Mapping[str, Symbol], name: str) -> Symbol:
    """A symmetric tensor from the six parameters `name`.xx to `name`.yz."""
    xx, yy, zz, xy, xz, yz = (parameters[f"{name}.{axes}"] for axes in AXES)
    return ca.vertcat(ca.horzcat(xx, xy, xz), ca.horzcat(xy, yy, yz), ca.horzcat(xz, yz, zz))


def angular_acceleration(
    inertia_B: Symbol, inverse_inertia_B: Symbol, angular_rate_B: Symbol, torque_B: Symbol
) -> Symbol:
    """ω̇ from Euler's equation J ω̇ + ω × J ω = τ; J kg m², ω rad/s, τ N m, all in B."""
    return inverse_inertia_B @ (torque_B - ca.cross(angular_rate_B, inertia_B @ angular_rate_B))


def symmetric_inverse(J: Symbol) -> Symbol:
    """J⁻¹ of a symmetric 3 × 3 matrix by its cofactors, which are the cross products of its columns."""
    columns = ca.horzsplit(J)
    cofactors = ca.horzcat(*(ca.cross(columns[(i + 1) % 3], columns[(i + 2) % 3]) for i in range(3)))
    return cofactors / ca.dot(columns[0], cofactors[:, 0])


def gravity_gradient_torque(inertia_B: Symbol, up_B: Symbol, stiffness: Symbol) -> Symbol:
    """3 μ/r³ û × J û, N m in B: û the unit vector from the Earth's centre to the target, in B; stiffness μ/r³, 1/s²."""
    return 3 * stiffness * ca.cross(up_B, inertia_B @ up_B)


def rotational_energy(inertia_B: Symbol, angular_rate_B: Symbol) -> Symbol:
    """½ ω·Jω, J."""
    return 0.5 * ca.dot(angular_rate_B, inertia_B @ angular_rate_B)


def angular_momentum(inertia_B: Symbol, angular_rate_B: Symbol, R_I_B: Symbol) -> Symbol:
    """R_I_B J ω, kg m²/s in I: constant without torque."""
    return R_I_B @ (inertia_B @ angular_rate_B)

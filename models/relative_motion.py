"""Motion of the chaser relative to the target's CoM in LVLH: the paper's (4)–(6), with (4) corrected."""

import casadi as ca

from baryscope.models.frames import Symbol
from baryscope.models.keplerian import Conic


def relative_acceleration(position_L: Symbol, velocity_L: Symbol, acceleration_L: Symbol, orbit: Conic) -> Symbol:
    """ρ̈ of the chaser in L, m/s²: the nonlinear equations (4)(5), where the paper's θ̇ρ must read θ̇²ρ.

    The difference between the gravity at the target and at the chaser is taken by Battin's form of
    Encke's method (Battin 1999, §8.7): with q = (2 r·x + ρ²)/r² no two large numbers are subtracted.

    Args:
        position_L: ρ = (x, y, z), m, from the target's CoM to the chaser.
        velocity_L: ρ̇ in L, m/s.
        acceleration_L: the chaser's commanded acceleration in L, m/s².
        orbit: where the target is.
    """
    x, y = position_L[0], position_L[1]
    rate, rate_dot, r = orbit.anomaly_rate, orbit.anomaly_acceleration, orbit.radius

    q = (2 * x + ca.dot(position_L, position_L) / r) / r
    s = (1 + q) * ca.sqrt(1 + q)
    f = q * (3 + q * (3 + q)) / (1 + s)  # s (1 − (1+q)^(−3/2))
    gravity = orbit.stiffness / s * ca.vertcat(f * r - x, -y, -position_L[2])

    rotating = ca.vertcat(
        2 * rate * velocity_L[1] + rate_dot * y + rate**2 * x,
        -2 * rate * velocity_L[0] - rate_dot * x + rate**2 * y,
        0,
    )
    return rotating + gravity + acceleration_L


def target_from_chaser(position_L: Symbol, velocity_L: Symbol, orbit: Conic, R_I_L: Symbol) -> tuple[Symbol, Symbol]:
    """(6): the target's CoM in C and its velocity there, ρ_g = −R_I_L ρ and v_g = −R_I_L (ρ̇ + θ̇ e_z × ρ)."""
    spin = ca.vertcat(0, 0, orbit.anomaly_rate)
    return -R_I_L @ position_L, -R_I_L @ (velocity_L + ca.cross(spin, position_L))

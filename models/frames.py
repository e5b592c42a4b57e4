"""Frames and rotations as CasADi expressions.

I inertial (Earth-centred axes); L target LVLH (x radial outward, y along-track, z orbit normal);
B target body, origin at the centre of mass (CoM); C chaser, origin at the chaser, axes parallel to I.
`R_A_B` turns coordinates in B into coordinates in A: `p_A = R_A_B @ p_B`.
Quaternions are scalar first (w, x, y, z), Hamilton, unit; `q_I_B` stands for `R_I_B`.
"""

from dataclasses import dataclass

import casadi as ca

Symbol = ca.SX
SMALLEST_TURN = 1e-9  # rad, keeps its direction from a division by zero


def cross_matrix(v: Symbol) -> Symbol:
    """[v]×, such that `cross_matrix(v) @ w` is v × w (the matrix printed in the paper's (3) is minus this)."""
    return ca.skew(v)


def normalised(v: Symbol) -> Symbol:
    """A vector or quaternion over its length."""
    return v / ca.norm_2(v)


def rotation_from_quaternion(q: Symbol) -> Symbol:
    """R of a unit quaternion (w, x, y, z)."""
    w, v = q[0], q[1:]
    return (w * w - ca.dot(v, v)) * ca.SX.eye(3) + 2 * (v @ v.T) + 2 * (w * cross_matrix(v))


def quaternion_rate(q: Symbol, angular_rate_B: Symbol) -> Symbol:
    """q̇ = ½ q ⊗ (0, ω) for q_I_B (w, x, y, z) and ω in B, rad/s."""
    w, v = q[0], q[1:]
    return 0.5 * ca.vertcat(-ca.dot(v, angular_rate_B), w * angular_rate_B + ca.cross(v, angular_rate_B))


def quaternion_product(p: Symbol, q: Symbol) -> Symbol:
    """p ⊗ q of quaternions (w, x, y, z): q_A_C = q_A_B ⊗ q_B_C."""
    w, v = p[0], p[1:]
    return ca.vertcat(w * q[0] - ca.dot(v, q[1:]), w * q[1:] + q[0] * v + ca.cross(v, q[1:]))


def conjugate(q: Symbol) -> Symbol:
    """The quaternion (w, x, y, z) of the opposite turn: q_B_A of q_A_B."""
    return ca.vertcat(q[0], -q[1:])


def quaternion_from_rotation(R: Symbol) -> Symbol:
    """The unit quaternion (w, x, y, z) of R, from the largest of its elements (Shepperd, J. Guidance 1, 1978)."""
    sums = (R[2, 1] + R[1, 2], R[0, 2] + R[2, 0], R[1, 0] + R[0, 1])
    turn = (R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1])
    squares = [1 + ca.trace(R), *(1 + 2 * R[k, k] - ca.trace(R) for k in range(3))]
    found = ca.vertcat(squares[0], *turn)
    others = (
        ca.vertcat(turn[0], squares[1], sums[2], sums[1]),
        ca.vertcat(turn[1], sums[2], squares[2], sums[0]),
        ca.vertcat(turn[2], sums[1], sums[0], squares[3]),
    )
    largest = squares[0]
    for square, other in zip(squares[1:], others, strict=True):
        found = ca.if_else(square > largest, other, found)
        largest = ca.fmax(largest, square)
    return found / ca.norm_2(found)


def quaternion_about(axis: int, angle: Symbol) -> Symbol:
    """The quaternion of `rotation_about`."""
    q = ca.SX.zeros(4)
    q[0], q[1 + axis] = ca.cos(angle / 2), ca.sin(angle / 2)
    return q


def rotation_about(axis: int, angle: Symbol) -> Symbol:
    """R that turns vectors by `angle` (rad) about coordinate axis 0, 1 or 2."""
    c, s = ca.cos(angle), ca.sin(angle)
    R = ca.SX.eye(3)
    j, k = (axis + 1) % 3, (axis + 2) % 3
    R[j, j], R[j, k], R[k, j], R[k, k] = c, -s, s, c
    return R


def turned(vector: Symbol, by: Symbol) -> Symbol:
    """A vector turned by a rotation vector, rad (Rodrigues)."""
    angle = ca.sqrt(ca.dot(by, by) + SMALLEST_TURN**2)
    across = ca.cross(by, vector)
    return vector + ca.sin(angle) / angle * across + 2 * (ca.sin(angle / 2) / angle) ** 2 * ca.cross(by, across)


def rotation_I_P(raan: Symbol, inclination: Symbol, argument_of_periapsis: Symbol) -> Symbol:
    """R_I_P = R3(Ω) R1(i) R3(ω), P perifocal (x to the periapsis, z orbit normal); all angles in rad."""
    return rotation_about(2, raan) @ rotation_about(0, inclination) @ rotation_about(2, argument_of_periapsis)


def quaternion_I_P(raan: Symbol, inclination: Symbol, argument_of_periapsis: Symbol) -> Symbol:
    """The quaternion of `rotation_I_P`."""
    tilted = quaternion_product(quaternion_about(2, raan), quaternion_about(0, inclination))
    return quaternion_product(tilted, quaternion_about(2, argument_of_periapsis))


def rotation_I_L(R_I_P: Symbol, true_anomaly: Symbol) -> Symbol:
    """R_I_L = R_I_P R3(θ), the true anomaly θ in rad."""
    return R_I_P @ rotation_about(2, true_anomaly)


def moved(position: Symbol, R: Symbol, points: Symbol, directions: Symbol) -> tuple[Symbol, Symbol]:
    """Points and directions of a body, both (n, 3), in the axes in which it stands at a position, turned by R."""
    return ca.repmat(position.T, points.shape[0], 1) + points @ R.T, directions @ R.T


def pose(position: Symbol, R: Symbol) -> Symbol:
    """A position and a rotation in one column, (12,), as `Sight` takes them."""
    return ca.vertcat(position, ca.vec(R))


@dataclass(frozen=True)
class Sight:
    """`moved` for one point and its direction, (6,), and its derivatives.

    Attributes:
        function: pose, body → seen.
        forward: pose, body, seed of both → its image in what is seen.
        reverse: pose, body, seed of what is seen → its image in (pose, body).
    """

    function: ca.Function
    forward: ca.Function
    reverse: ca.Function


def sights(name: str) -> Sight:
    """The functions by their common name."""
    z, body = ca.SX.sym("z", 12), ca.SX.sym("body", 6)
    place, direction = moved(z[:3], ca.reshape(z[3:], 3, 3), body[:3].T, body[3:].T)
    seen, knowns = ca.vertcat(place.T, direction.T), ca.vertcat(z, body)
    forth, back = ca.SX.sym("seed", knowns.numel()), ca.SX.sym("seed", seen.numel())
    return Sight(
        ca.Function(name, [z, body], [seen]),
        ca.Function(f"{name}_forward", [z, body, forth], [ca.jtimes(seen, knowns, forth)]),
        ca.Function(f"{name}_reverse", [z, body, back], [ca.jtimes(seen, knowns, back, True)]),
    )

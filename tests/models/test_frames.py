"""Rotations against scipy and pytransform3d."""

import casadi as ca
import numpy as np
import pytest
import pytransform3d.rotations as pr
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from baryscope.models.frames import (
    conjugate,
    cross_matrix,
    quaternion_about,
    quaternion_from_rotation,
    quaternion_I_P,
    quaternion_product,
    quaternion_rate,
    rotation_about,
    rotation_from_quaternion,
    rotation_I_L,
    rotation_I_P,
)

ROUNDING = 1e-14  # of matrix elements up to 1
ANGLES = st.floats(-20, 20)
VECTORS = st.tuples(*[st.floats(-10, 10)] * 3)


def numeric(expression):
    return np.array(ca.evalf(expression))


@st.composite
def unit_quaternions(draw):
    q = np.array(draw(st.tuples(*[st.floats(-1, 1)] * 4)))
    assume(np.linalg.norm(q) > 0.01)
    return q / np.linalg.norm(q)


@given(q=unit_quaternions())
def test_rotation_of_a_quaternion(q):
    R = numeric(rotation_from_quaternion(ca.DM(q)))
    np.testing.assert_allclose(R, Rotation.from_quat(q, scalar_first=True).as_matrix(), atol=ROUNDING)
    np.testing.assert_allclose(R, pr.matrix_from_quaternion(q), atol=ROUNDING)


@given(p=unit_quaternions(), q=unit_quaternions())
def test_products_and_conjugates_of_quaternions(p, q):
    found = numeric(quaternion_product(ca.DM(p), ca.DM(q))).ravel()
    np.testing.assert_allclose(found, pr.concatenate_quaternions(p, q), atol=ROUNDING)
    np.testing.assert_allclose(numeric(conjugate(ca.DM(q))).ravel(), pr.q_conj(q), atol=ROUNDING)


@given(q=unit_quaternions())
def test_quaternion_from_rotation(q):
    """Up to its sign, by scipy's matrix."""
    found = numeric(quaternion_from_rotation(ca.DM(Rotation.from_quat(q, scalar_first=True).as_matrix()))).ravel()
    np.testing.assert_allclose(found * np.sign(found @ q), q, atol=ROUNDING)


@pytest.mark.parametrize("axis", range(3))
def test_quaternion_from_a_half_turn(axis):
    found = numeric(quaternion_from_rotation(ca.DM(2 * np.outer(np.eye(3)[axis], np.eye(3)[axis]) - np.eye(3)))).ravel()
    np.testing.assert_allclose(np.abs(found), [0, *np.eye(3)[axis]], atol=ROUNDING)


@given(angles=st.tuples(ANGLES, ANGLES, ANGLES))
def test_quaternions_of_rotations_by_angles(angles):
    for axis in range(3):
        R = numeric(rotation_from_quaternion(quaternion_about(axis, ca.DM(angles[axis]))))
        np.testing.assert_allclose(R, numeric(rotation_about(axis, ca.DM(angles[axis]))), atol=ROUNDING)
    R = numeric(rotation_from_quaternion(quaternion_I_P(*map(ca.DM, angles))))
    np.testing.assert_allclose(R, numeric(rotation_I_P(*map(ca.DM, angles))), atol=ROUNDING)


@given(v=VECTORS, w=VECTORS)
def test_cross_matrix(v, w):
    np.testing.assert_allclose(numeric(cross_matrix(ca.DM(v))) @ w, np.cross(v, w), atol=100 * ROUNDING)


@pytest.mark.parametrize("axis, name", list(enumerate("xyz")))
@given(angle=ANGLES)
def test_rotation_about_an_axis(axis, name, angle):
    expected = Rotation.from_euler(name, angle).as_matrix()
    np.testing.assert_allclose(numeric(rotation_about(axis, ca.DM(angle))), expected, atol=ROUNDING)


@given(raan=ANGLES, inclination=st.floats(0, np.pi), periapsis=ANGLES, anomaly=ANGLES)
def test_rotation_of_lvlh(raan, inclination, periapsis, anomaly):
    """R3(Ω) R1(i) R3(u) is scipy's intrinsic ZXZ sequence, or its extrinsic zxz read backwards."""
    R_I_P = rotation_I_P(ca.DM(raan), ca.DM(inclination), ca.DM(periapsis))
    R, latitude = numeric(rotation_I_L(R_I_P, ca.DM(anomaly))), periapsis + anomaly
    intrinsic = Rotation.from_euler("ZXZ", [raan, inclination, latitude]).as_matrix()
    extrinsic = Rotation.from_euler("zxz", [latitude, inclination, raan]).as_matrix()
    np.testing.assert_allclose(R, intrinsic, atol=ROUNDING)
    np.testing.assert_allclose(R, extrinsic, atol=ROUNDING)


@given(q=unit_quaternions(), rate=VECTORS)
def test_quaternion_rate(q, rate):
    """Against the central difference of q ⊗ exp(ω h): it errs by h² |ω|³ / 48 < 1e-8 at |ω| < 18 rad/s."""
    step = 1e-5
    turned = [
        (Rotation.from_quat(q, scalar_first=True) * Rotation.from_rotvec(np.array(rate) * h)).as_quat(scalar_first=True)
        for h in (-step, step)
    ]
    before, after = (p * np.sign(p @ q) for p in turned)
    np.testing.assert_allclose(
        numeric(quaternion_rate(ca.DM(q), ca.DM(rate))).ravel(), (after - before) / (2 * step), atol=1e-7
    )
    half_product = 0.5 * pr.concatenate_quaternions(q, [0, *rate])
    np.testing.assert_allclose(
        numeric(quaternion_rate(ca.DM(q), ca.DM(rate))).ravel(), half_product, atol=100 * ROUNDING
    )


def test_the_papers_cross_matrix_is_minus_the_usual_one():
    """(2) reads Ȧ = −[ω]× A for A = R_B_I: against a small turn of a body that starts along I."""
    omega, step = np.array([0.1, -0.2, 0.3]), 1e-6
    R_I_B = Rotation.from_rotvec(omega * step).as_matrix()
    A_dot = (R_I_B.T - np.eye(3)) / step
    np.testing.assert_allclose(A_dot, -numeric(cross_matrix(ca.DM(omega))), atol=1e-6)

"""Rotations by rotation vectors, and back, in C, against scipy's: the series of small angles meet the closed forms."""

import ctypes

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from compiling import ONLY_WHAT_IS_CALLED, online_core_of

ROUNDING = 2e-15  # of sums of a few terms of 1
ANGLES = [0.0, 1e-12, 1e-6, 1e-3, 0.0316, 0.0317, 0.0632, 0.0633, 0.5, 2.0, 3.1]  # about the ends of the series, too

TURNED = """#include "library.c"
void turned_by_vector(const double turn[3], double R[3][3], double back[3])
{
    rotation(turn, R);
    rotation_vector(R, back);
}"""


@pytest.fixture(scope="module")
def core(tmp_path_factory):
    """The core with `turned_by_vector`."""
    return online_core_of(tmp_path_factory.mktemp("rotations"), TURNED, *ONLY_WHAT_IS_CALLED)


@pytest.mark.parametrize("angle", ANGLES)
def test_rotations_are_those_of_scipy(core, angle):
    axis = np.random.default_rng(11).standard_normal(3)
    turn = angle * axis / np.linalg.norm(axis)
    R, back = np.empty((3, 3)), np.empty(3)
    core.turned_by_vector(*(each.ctypes.data_as(ctypes.c_void_p) for each in (turn, R, back)))
    np.testing.assert_allclose(R, Rotation.from_rotvec(turn).as_matrix(), rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(back, turn, rtol=ROUNDING, atol=ROUNDING)

"""Forces that an estimate leaves out, on paths with more or fewer modes of process noise than it had."""

import numpy as np
import pytest

from baryscope.estimator.paths.doubtful_path import DoubtfulPath, left_out
from baryscope.estimator.paths.forces import constant_of
from baryscope.estimator.paths.process_noise import ProcessNoisePath
from baryscope.estimator.paths.relative_motion import RelativeOrbit
from synthetic import Orbit

ORBIT, END = Orbit(semi_major_axis=7.3e6, eccentricity=0.01).model(), 900.0
OWN, MODES, MORE = 8, 16, 32


@pytest.mark.parametrize("count", [OWN, MORE])
def test_modes_that_take_on_nothing_of_a_force_change_nothing(count):
    """`ml` begins with few modes of the path of `pivot`, and adds those that the tumble tells."""
    rng, base = np.random.default_rng(1), RelativeOrbit(ORBIT, END / 2)
    follows = 0.1 * rng.standard_normal((base.size + 3 * MODES, 3))
    follows[base.size + 3 * OWN :] = 0.0
    square = np.diag([4.0, 1.0, 9.0])
    doubtful = DoubtfulPath(base, constant_of("lvlh", ORBIT, 0.0, END), 0.0, END, square, follows)
    time = np.array([-300.0, 450.0, 1100.0])
    asked, other = (ProcessNoisePath(doubtful, 0.0, END, modes) for modes in (MODES, count))
    told = left_out(asked, 0.0, END, time)
    assert np.trace(told[[0, 2]], axis1=1, axis2=2).min() > 0
    assert not told[1].any()
    np.testing.assert_allclose(left_out(other, 0.0, END, time), told, rtol=1e-9, atol=1e-12 * told.max())

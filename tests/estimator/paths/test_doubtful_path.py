"""Forces that an estimate leaves out, on paths with more or fewer modes of process noise than it had, or none."""

import numpy as np
import pytest

from baryscope.estimator.paths.doubtful_path import DoubtfulPath, left_out
from baryscope.estimator.paths.forces import ForcedPath, constant_of
from baryscope.estimator.paths.process_noise import ProcessNoisePath
from baryscope.estimator.paths.relative_motion import RelativeOrbit
from synthetic import Orbit

ORBIT, END = Orbit(semi_major_axis=7.3e6, eccentricity=0.01).model(), 900.0
MODES = 16


@pytest.mark.parametrize("count", [None, 8, 32])
def test_what_is_left_out_moves_the_path_of_its_own_estimate(count):
    """`ml` begins with few modes of the path of `pivot`, and adds those that the tumble tells; `ekf` has none.

    To first order: gravity beyond its gradient adds metres over the orbit's radius.
    """
    rng, base = np.random.default_rng(1), RelativeOrbit(ORBIT, END / 2)
    estimated = ProcessNoisePath(base, 0.0, END, MODES)
    follows, deviations = 0.1 * rng.standard_normal((estimated.size, 3)), np.array([2.0, 1.0, 3.0])
    force = constant_of("lvlh", ORBIT, 0.0, END)
    doubtful = DoubtfulPath(base, estimated, force, 0.0, END, np.diag(deviations**2), follows)
    asked = doubtful if count is None else ProcessNoisePath(doubtful, 0.0, END, count)
    time = np.array([-300.0, 450.0, 1100.0])
    found = left_out(asked, 0.0, END, time)
    assert not found[1].any()
    forced, expected = ForcedPath(estimated, force, 0.0, END), np.zeros((2, 6, 6))
    for z in np.diag(deviations):
        x, ends = np.concatenate([follows @ z, z]), time[[0, 2]]
        moved = np.concatenate(
            [(path.position(x) - path.position(0 * x)) for path in (forced.at(ends), forced.rate_at(ends))], 1
        )
        expected += moved[:, :, None] * moved[:, None, :]
    np.testing.assert_allclose(found[[0, 2]], expected, rtol=1e-6, atol=1e-6 * expected.max())

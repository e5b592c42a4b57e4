"""What is said of a path's process noise: the departure that its model cannot explain."""

import numpy as np
import pytest

from baryscope.estimator.adjustment.path_noise import process_noise_of
from baryscope.estimator.adjustment.position_noise import Slip
from baryscope.estimator.hyperparameters.integration import Posterior
from baryscope.estimator.paths.path import Polynomial
from baryscope.estimator.paths.process_noise import ProcessNoisePath
from baryscope.estimator.paths.relative_motion import RelativeOrbit
from baryscope.estimator.paths.sampled_path import SampledPath
from baryscope.models.orbit import Orbit

TIME = np.linspace(0.0, 6000.0, 2001)
NOTHING = np.zeros(0)
POSTERIOR = Posterior(NOTHING, np.zeros((0, 2)), NOTHING, NOTHING, NOTHING, np.zeros((0, 0)), NOTHING, NOTHING)


def displacement(path, sampled, x):
    found = process_noise_of(path, sampled, x, path.prior, POSTERIOR, "auto", Slip()).displacement
    assert found is not None
    return found


def test_modes_beside_a_straight_line_are_all_departure():
    """They are orthogonal to it, of mean square 1 on each axis."""
    path = ProcessNoisePath(Polynomial(1, 0.0, 6000.0), 0.0, 6000.0, 4, density=1e-12)
    x = np.random.default_rng(0).normal(size=path.size)
    assert displacement(path, path.at(TIME), x) == pytest.approx(np.linalg.norm(x[6:]), rel=2e-3)


def test_what_the_model_could_do_as_well_is_no_departure():
    """Motions of the model added to the modes change nothing; on an orbit they would be most of it."""
    path = ProcessNoisePath(RelativeOrbit(Orbit(7.15e6, 0.01, 1.7), 3000.0), 0.0, 6000.0, 4, density=1e-12)
    sampled, rng = path.at(TIME), np.random.default_rng(1)
    x = rng.normal(size=path.size)
    jacobian = sampled.jacobian.copy()
    jacobian[:, :, 6:] += jacobian[:, :, :6] @ rng.normal(size=(6, 12))
    alone, _, _, _ = np.linalg.lstsq(jacobian[:, :, :6].reshape(-1, 6), (jacobian[:, :, 6:] @ x[6:]).ravel())
    left = jacobian[:, :, 6:] @ x[6:] - jacobian[:, :, :6] @ alone
    found = displacement(path, SampledPath(jacobian, sampled.position), x)
    assert found == pytest.approx(np.sqrt(np.mean(np.sum(left**2, axis=1))), rel=1e-9)
    assert found == pytest.approx(displacement(path, sampled, x), rel=1e-9)

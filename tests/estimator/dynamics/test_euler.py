"""The Jacobians of a step of a tumble, by one expression and by arrays; test_rotation has the independent oracles."""

import numpy as np
import pytest

from baryscope.estimator.dynamics.euler import FORCED, MANY, sensitivity_step
from synthetic import ENVISAT, Orbit


@pytest.mark.parametrize("gravity_gradient", [True, False])
@pytest.mark.parametrize("forced", [True, False])
def test_jacobians_are_the_same_however_many_are_asked_for(gravity_gradient, forced):
    """Each sum of a step rounds by ε times its greatest term."""
    count, rng = MANY, np.random.default_rng(1)
    quaternion = rng.normal(size=(4, count))
    quaternion /= np.linalg.norm(quaternion, axis=0)
    varying = [
        np.vstack([quaternion, 0.05 * rng.normal(size=(3, count)), rng.uniform(0, 6, (1, count))]),
        rng.uniform(-3, 3, (1, count)),  # s
    ]
    varying += [1e-4 * rng.normal(size=(FORCED, count))] if forced else []
    constants = (ENVISAT / np.trace(ENVISAT)).ravel()
    if gravity_gradient:
        constants = np.concatenate([constants, Orbit().model().elements])
    step = sensitivity_step(gravity_gradient, forced)
    expression = step(*varying, constants)
    half = count // 2
    arrays = [step(*(one[:, part] for one in varying), constants) for part in (slice(half), slice(half, None))]
    np.testing.assert_allclose(np.concatenate(arrays), expression, rtol=0, atol=1e-13)

"""White acceleration of a density that nobody told: what of it the bank takes for what."""

import ctypes

import numpy as np
import pytest

from baryscope.estimator.online import OnlineEstimator
from compiling import ONLY_WHAT_IS_CALLED, online_core_of
from tops import SIGMA, run, straight, tracks

FUNCTIONS = """#include "library.c"
double part(double density, double T, double variance)
{
    Measurement measurement = {.span = T, .noise = {{variance, 0.0, 0.0}, {0.0, variance, 0.0}, {0.0, 0.0, variance}}};
    const double R[3][3] = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}};
    find_seeming(R, &measurement);
    return 1.0 / unseen_factor(&measurement, density);
}"""


@pytest.fixture(scope="module")
def core(tmp_path_factory):
    core = online_core_of(tmp_path_factory.mktemp("core"), FUNCTIONS, *ONLY_WHAT_IS_CALLED)
    core.part.restype, core.part.argtypes = ctypes.c_double, [ctypes.c_double] * 3
    return core


@pytest.mark.parametrize("density", [0.0, 1e-12, 1e-9, 1e-7, 1e-6, 1e-5, 1e-3])
def test_a_path_with_noise_leaves_the_part_of_a_node_that_all_others_do_not_tell(core, density):
    """The precision of the middle one of 401 nodes, given all others, over that of its own noise: dense."""
    count, T, variance = 401, 2.5, 1.6e-5
    k = np.arange(count)
    early, late = np.minimum.outer(k, k) * T, np.maximum.outer(k, k) * T
    of_path = density * early**2 * (3 * late - early) / 6  # of the second integral of white noise from 0 on
    free = np.stack([np.ones(count), k / count], axis=1)  # where it begins, and how fast, is not known
    precision = np.linalg.inv(of_path + variance * np.eye(count))
    precision -= precision @ free @ np.linalg.solve(free.T @ precision @ free, free.T @ precision)
    assert core.part(density, T, variance) == pytest.approx(variance * precision[count // 2, count // 2], rel=0.06)


def test_a_claim_holds_between_what_the_bank_had_for_densities():
    """White acceleration of 1e-8 m²/s³: the mean NEES was 5.2 with no density up to 1e-7."""
    density, found = 1e-8, []
    for seed in range(16):
        rng, time = np.random.default_rng([seed, 5]), np.arange(360.0)
        v, r = rng.standard_normal((2, len(time), 3))  # in each second, of covariance [[1, 1/2], [1/2, 1/3]]
        speed = np.sqrt(density) * v
        path = straight(time) + np.cumsum(
            speed / 2 + np.sqrt(density / 12) * r + np.cumsum(speed, axis=0) - speed, axis=0
        )
        states = run(OnlineEstimator(SIGMA), time, tracks(rng, time, path))[180:]
        off = np.array([state.position for state in states]) - path[180:]
        claimed = np.array([state.covariance[:3, :3] for state in states])
        found.append(np.mean(np.einsum("ni,ni->n", off, np.linalg.solve(claimed, off[..., None])[..., 0])))
    assert 2.2 < np.mean(found) < 4.0

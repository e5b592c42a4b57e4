"""The online estimator on thrusters whose every push is wrong by an error of its own (Gates 1963)."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from baryscope.estimator.online import OnlineEstimator
from baryscope.models.orbit import Orbit
from tops import DRIFT, SIGMA, START, flown_through, tracks

STD = 0.02  # told, of what thrusters are wrong by
WIDE = Orbit(1e9, 0.0, 0.0, 0.0, 0.0, 0.0)  # gravity moves what is 100 m away by 12 µm in 500 s
PUSH, ON, EVERY = 0.02, 30, 100  # m/s², in directions at random, for ON s of EVERY s
DRAWS = 12  # so that a claim that is too small by 39 % in each direction is beyond the 99.9 % quantile of χ² of 36
TIMES = (215, 228, 290, 315, 328, 390, 415, 428, 490)  # s: amid pushes, at their end, and before the next
LAST = 499  # s


def judged(seed, deviation):
    """A flight on thrusters of which each push is wrong by deviates of `deviation`, (scale, rad about each axis).

    Motion between frames, under a constant acceleration, is exact. Returns the squares of the errors of the CoM over
    what is claimed (3 degrees of freedom), at TIMES, and the last state.
    """
    rng = np.random.default_rng(seed)
    time = np.arange(LAST + 1.0)
    push = (
        PUSH * rng.standard_normal((500, 3)) * (time % EVERY < ON)[:, None] * (time > 0)[:, None]
    )  # since the frame before
    wrong = deviation * rng.standard_normal((500, 4))
    pushed = (1 + wrong[:, :1]) * Rotation.from_rotvec(wrong[:, 1:]).apply(push)
    speed = DRIFT - np.cumsum(pushed, axis=0)
    path = START + np.concatenate([np.zeros((1, 3)), np.cumsum(speed[1:] + 0.5 * pushed[1:], axis=0)])
    filter = OnlineEstimator(SIGMA, WIDE, thrust_std=STD)
    seen = tracks(rng, time, path)
    frames = (((t, seen[k]), {"acceleration": push[k]}) for k, t in enumerate(time.tolist()))
    states = flown_through(filter, frames, {*TIMES, LAST})
    squares = []
    for k in TIMES:
        error, covariance = states[k].position - path[k], states[k].covariance[:3, :3]
        squares.append(error @ np.linalg.solve(covariance, error))
    return squares, states[LAST]


def claimed(state):
    return np.sqrt(np.trace(state.covariance[:3, :3]))


@pytest.fixture(scope="module", params=[0.007, 0.02])
def executed(request):
    """The deviation of pushes, squares (DRAWS, times), and last states: between two sizes of the bank, and at one."""
    squares, states = zip(*(judged(seed, request.param) for seed in range(DRAWS)), strict=True)
    return request.param, np.array(squares), states


def test_claims_are_true_where_each_push_has_an_error_of_its_own(executed):
    """They were process noise of one density, whether there were pushes or not: claims amid pushes were too small."""
    assert (executed[1].mean(axis=0) < chi2.ppf(0.999, 3 * DRAWS) / DRAWS).all()


def test_the_size_of_such_errors_is_told(executed):
    """To the next ones of the bank's sizes, which are apart by a factor of 2."""
    found = np.array([state.execution for state in executed[2]]) / executed[0]
    assert ((found > 0.5) & (found < 2.0)).all()


def test_exact_pushes_are_found_to_be_exact():
    """Their errors are told to be less than a tenth of those of others, and the CoM is claimed to be better known."""
    (_, exact), (_, wrong) = judged(0, 0.0), judged(0, 0.02)
    assert exact.execution < 0.1 * wrong.execution
    assert claimed(exact) < claimed(wrong)

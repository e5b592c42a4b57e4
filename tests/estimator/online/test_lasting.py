"""Errors of features that last, in the online estimator: symmetric tops whose features' errors are Markov processes."""

import ctypes

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import chi2

from baryscope.estimator.online import OnlineEstimator, OnlineStatus
from compiling import ONLY_WHAT_IS_CALLED, online_core_of
from tops import POINTS, SIGMA, errors, run, straight, tracks

DRAWS = 8
ALPHA = 1e-4
FRAMES = 400


def lasting_tracks(rng, time, path, keep):
    """Points with errors of SIGMA, of which a part `keep` is left in the next frame."""
    shocks = rng.standard_normal((len(time) + 1000, len(POINTS), 3)) * SIGMA * np.sqrt(1 - keep**2)
    still = tracks(rng, time, path, sigma=0.0)
    return still + lfilter([1.0], [1.0, -keep], shocks, axis=0)[1000:]


@pytest.mark.parametrize(
    ("rate", "memory", "draws"),
    [(1.0, 2.0, DRAWS), (1.0, 10.0, DRAWS), (10.0, 5.0, 2)],
    ids=["2 s", "10 s", "5 s at 10 Hz"],
)
def test_they_are_found_and_counted(rate, memory, draws):
    """2 draws at 10 Hz have 10 times the frames of one at 1 Hz each."""
    time = np.arange(FRAMES * rate) / rate
    path, keep = straight(time), np.exp(-1 / (rate * memory))
    nees, found = [], []
    for draw in range(draws):
        rng = np.random.default_rng([21, draw])
        states = run(OnlineEstimator(SIGMA), time, lasting_tracks(rng, time, path, keep))
        assert states[-1].status is OnlineStatus.TRACKING
        nees.append(errors(states, path)[1][[len(time) // 2, -1]])
        found.append(states[-1].lasting)
    true = (1 + keep) / (1 - keep)
    # Blocks as long as the recording allows show a part of it, and what is left is extrapolated.
    assert true / 2 < np.exp(np.mean(np.log(found))) < 2 * true
    assert (np.sum(nees, axis=0) < chi2.ppf(1 - ALPHA, 3 * draws)).all()


@pytest.mark.parametrize(("rate", "draws"), [(0.5, DRAWS), (1.0, DRAWS), (20.0, 2)])
def test_white_errors_do_not_last(rate, draws):
    """Not even for the map's own errors, which are the same in all frames; 2 draws at 20 Hz have 5 times the frames."""
    time = np.arange(200 * max(rate, 1.0)) / rate
    for draw in range(draws):
        states = run(OnlineEstimator(SIGMA), time, tracks(np.random.default_rng([22, draw]), time, straight(time)))
        assert max(state.lasting for state in states) < 2
        assert states[-1].lasting < 1.5


def test_what_is_told_too_large_counts_once():
    """Whoever tells √lasting times the deviation, as it had to be before, gets no wider claim."""
    keep = np.exp(-1 / 5)
    time, large = np.arange(float(FRAMES)), np.sqrt((1 + keep) / (1 - keep))
    path = straight(time)
    for draw in range(3):
        position = lasting_tracks(np.random.default_rng([23, draw]), time, path, keep)
        alone, told = (run(OnlineEstimator(sigma), time, position)[-1] for sigma in (SIGMA, large * SIGMA))
        assert told.lasting == pytest.approx(1, abs=0.7)
        claims = [np.sqrt(np.trace(state.covariance[:3, :3])) for state in (told, alone)]
        assert 0.6 < claims[0] / claims[1] < 1.6


def test_a_filter_that_starts_again_still_knows():
    keep = np.exp(-1 / 5)
    time = np.arange(float(FRAMES))
    filter = OnlineEstimator(SIGMA)
    before = run(filter, time, lasting_tracks(np.random.default_rng(24), time, straight(time), keep))[-1].lasting
    other = POINTS[::-1] * [1.0, -1.0, 1.0]
    later = time[-1] + 1 + np.arange(30.0)
    states = run(filter, later, tracks(np.random.default_rng(25), later, straight(later), other))
    assert OnlineStatus.LOST in {state.status for state in states}
    assert before > 5
    assert states[-1].lasting > 3


ROUNDING = 1e-9  # of an inverse by cofactors, at condition numbers of some thousand
KEPT = """#include "library.c"
double kept(const Online *filter, double information[][3][3], double spread[][3][3])
{
    for (int f = 0; f < (int)filter->used; f++)
        copy(filter->feature[f].information, information[f]), copy(filter->feature[f].spread, spread[f]);
    return filter->frames_per_error;
}"""


def test_the_covariance_of_a_feature_stays_the_inverse_of_its_information(tmp_path):
    """Also where errors are found to last, by which both are put right."""
    core = online_core_of(tmp_path, KEPT, *ONLY_WHAT_IS_CALLED)
    core.kept.restype = ctypes.c_double
    time = np.arange(FRAMES, dtype=float)
    filter = OnlineEstimator(SIGMA)
    run(filter, time, lasting_tracks(np.random.default_rng(12), time, straight(time), 0.9))
    information, spread = np.empty((2, len(POINTS), 3, 3))
    found = core.kept(filter._memory, *(each.ctypes.data_as(ctypes.c_void_p) for each in (information, spread)))
    assert found > 2.0
    for one, other in zip(information, spread, strict=True):
        assert other[0, 0] > 0.0
        np.testing.assert_allclose(one @ other, np.eye(3), rtol=0, atol=ROUNDING)

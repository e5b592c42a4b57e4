"""Frames that show two features: what they tell once path and offset are known."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from baryscope.estimator.tracks import FeatureTracks
from free_paths import NOISE, at_rest, found_by, in_orbit, turning
from synthetic import box_features, make_case

FRAMES, WHOLE, DRAWS = 120, 50, 12
FIVE = box_features(5, (2, 2, 2), 3)


def with_two_features(tracks, after):
    """The same tracks, with features 0 and 1 alone after some frames."""
    position = tracks.position.copy()
    position[after:, 2:] = np.nan
    return FeatureTracks(tracks.time, position, tracks.labels)


def without(tracks, after):
    """The same tracks, without anything after some frames but their times."""
    position = tracks.position.copy()
    position[after:] = np.nan
    return FeatureTracks(tracks.time, position, tracks.labels)


@pytest.fixture(scope="module")
def draws():
    time, R = turning(FRAMES)
    com = in_orbit(time)
    cases = [make_case(time, R, com, FIVE, noise=NOISE, seed=seed) for seed in range(DRAWS)]
    return cases, [
        [
            found_by("pivot", change(case.tracks, WHOLE), "relative-orbit", process_noise="none")
            for change in (with_two_features, without)
        ]
        for case in cases
    ]


def test_they_tell_what_they_claim_to(draws):
    """The path is followed where it would else be predicted; the mean NEES is in its 99 % band at the last time."""
    cases, found = draws
    claims = np.array([[np.sqrt(np.trace(one.covariance[-1])) for one in both] for both in found])
    assert (claims[:, 0] < 0.5 * claims[:, 1]).all()
    error = [case.com[-1] - both[0].position[-1] for case, both in zip(cases, found, strict=True)]
    squares = [e @ np.linalg.solve(both[0].covariance[-1], e) for e, both in zip(error, found, strict=True)]
    low, high = chi2.ppf([0.005, 0.995], 3 * DRAWS) / DRAWS
    assert low < np.mean(squares) < high


def test_their_attitudes_are_estimated(draws):
    _, found = draws
    assert np.mean([np.isfinite(two.motion.attitude[WHOLE:]).all(axis=(1, 2)).mean() for two, _ in found]) > 0.99
    assert all(np.isnan(none.motion.attitude[WHOLE:]).all() for _, none in found)


def test_they_tell_nothing_where_the_offset_is_not_told():
    """Along the axis of a spin the path would be wrong, and so would be the attitudes that it gives."""
    time = np.arange(float(FRAMES))
    R = Rotation.from_rotvec(np.outer(time, [0.0, 0.0, 0.1])).as_matrix()
    case = make_case(time, R, at_rest(time), FIVE, noise=NOISE)
    found = found_by("pivot", with_two_features(case.tracks, WHOLE), "fixed", process_noise="none")
    assert np.isnan(found.motion.attitude[WHOLE:]).all()
    assert found.predicted_rmse > 1

"""Outliers in the tracks: `pivot` and `ml` reject and report them, and lose little accuracy."""

import numpy as np
import pytest

from baryscope.estimator.document.document import rejected_intervals
from free_paths import BOTH, NOISE, assert_good, fixed_case, found_by, squared_error, with_positions


@pytest.mark.parametrize("share", [0.1, 0.3])
@BOTH
def test_blunders_are_rejected(method, share):
    case, rng = fixed_case(300, seed=8), np.random.default_rng(8)
    wrong = rng.random((300, 8)) < share
    position = case.tracks.position + np.where(wrong[..., None], 2 / np.sqrt(3) * rng.normal(size=(300, 8, 3)), 0)
    found = found_by(method, with_positions(case, position))
    assert_good(found, case)
    assert found.rejected_share == pytest.approx(wrong.mean(), abs=0.03)
    assert list(found.rejected_features) == []
    # The noise is that of the inliers, and of the few outliers that lie within 4.5 standard deviations by chance.
    assert found.noise.a_posteriori == pytest.approx(NOISE, rel=0.05)
    clean = found_by(method, case.tracks)
    assert found.predicted_rmse < 1.35 * clean.predicted_rmse


@BOTH
def test_swapped_labels_are_rejected_while_they_are_swapped(method):
    case = fixed_case(300, seed=9)
    position = case.tracks.position.copy()
    for begin, (one, two) in ((40, (0, 1)), (120, (2, 6)), (200, (3, 4))):
        position[begin : begin + 40, [one, two]] = position[begin : begin + 40, [two, one]]
    found = found_by(method, with_positions(case, position))
    assert_good(found, case)
    intervals = rejected_intervals(found)
    expected = {"F0": 40, "F1": 40, "F2": 120, "F6": 120, "F3": 200, "F4": 200}
    assert set(intervals) >= set(expected)
    for label, begin in expected.items():
        assert (float(begin), begin + 39.0) in intervals[label]
    assert found.rejected_share == pytest.approx(240 / 2400, abs=0.002)


@BOTH
def test_a_drifting_feature_is_rejected(method):
    """At 2 cm/s along the body from 100 s on, and at 5 mm/s from the beginning."""
    case = fixed_case(300, seed=10)
    for start, speed in ((100, 0.02), (0, 0.005)):
        displacement = speed * np.maximum(case.tracks.time - start, 0)
        position = case.tracks.position.copy()
        position[:, 3] += displacement[:, None] * (case.R_I_B @ [0, 0.6, 0.8])
        found = found_by(method, with_positions(case, position))
        assert list(found.rejected_features) == ["F3"]
        assert squared_error(found, case) < 4.5**2
        # Of the 2,100 other observations, χ²₃ puts 0.4 beyond the gate.
        others = {label: times for label, times in rejected_intervals(found).items() if label != "F3"}
        assert sum(map(len, others.values())) <= 4
        begin, end = max(rejected_intervals(found)["F3"], key=lambda stretch: stretch[1] - stretch[0])
        if start:
            assert 100 <= begin <= 115
            assert end == 299


FOREIGN_FEATURES = {
    "anywhere": lambda case, rng: case.com + 4 * rng.normal(size=case.com.shape),
    "at rest in C": lambda case, rng: np.array([3.0, -17.0, 1.0]) + NOISE * rng.normal(size=case.com.shape),
    "of another body": lambda case, rng: case.com + np.swapaxes(case.R_I_B, 1, 2) @ [3.0, 1.0, 2.0],
}


@pytest.mark.parametrize("kind", FOREIGN_FEATURES)
@BOTH
def test_a_feature_that_is_not_on_the_body_is_rejected(method, kind):
    """It is wrong in all frames, so it has no constant distance to any other feature."""
    case = fixed_case(300, seed=10)
    position = case.tracks.position.copy()
    position[:, 3] = FOREIGN_FEATURES[kind](case, np.random.default_rng(0))
    found = found_by(method, with_positions(case, position))
    assert_good(found, case)
    assert list(found.rejected_features) == ["F3"]

"""When passes of `ekf` come to rest, and when they do not."""

import numpy as np
import pytest

from baryscope.estimator.ekf.passes import refuse_lost, squared_length
from baryscope.estimator.ekf.problem import FAR
from baryscope.estimator.methods import estimate
from baryscope.estimator.options import PathOptions
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import ComputationError
from synthetic import ENVISAT, attitude, box_features, first_order, make_case


@pytest.mark.parametrize("away", [1.1 * FAR, np.nan, np.inf])
def test_a_path_that_is_lost_is_refused(away):
    """Further than the standard deviation of its weak prior from features that are a metre away."""
    seen = np.ones((2, 4, 3))
    refuse_lost(0.9 * FAR * np.ones((2, 3)), seen)
    with pytest.raises(ComputationError, match="diverges"):
        refuse_lost(np.array([[1.0, 0.0, 0.0], [away, 0.0, 0.0]]), seen)


def test_a_step_is_measured_by_a_covariance_that_rounding_has_made_singular():
    """Of inertia that is told to sixteen digits along an axis, as without noise: it was an internal error."""
    regular = np.array([[2.0, 0.5], [0.5, 1.0]])
    step = np.array([0.3, -0.2])
    assert squared_length(step, regular) == pytest.approx(step @ np.linalg.inv(regular) @ step, rel=1e-12)
    singular = np.ones((2, 2))  # nothing moves against its null space but by rounding
    assert squared_length(np.array([0.3, 0.3]), singular) == pytest.approx(0.09, rel=1e-9)
    assert squared_length(np.array([0.3, -0.3]), singular) > 1e13
    assert squared_length(np.zeros(2), np.zeros((2, 2))) == 0


def test_the_members_of_a_bank_are_scored_alike():
    """As many frames share an error in each: those of the posterior were scored with more of them than the best one."""
    time = np.arange(600.0)
    com = np.tile([4.0, -19.0, 3.0], (len(time), 1))
    points = box_features(8, (10, 5, 5), seed=3, centre=(1, 0.5, 0))
    tracks = make_case(time, attitude(ENVISAT, np.deg2rad([1.2, 2.2, 2.4]), time), com, points).tracks
    errors = 0.02 * first_order(np.random.default_rng(1), tracks.position.shape, 0.8)
    found = estimate(
        FeatureTracks(time, tracks.position + errors, tracks.labels),
        method="ekf",
        options=PathOptions(trajectory="polynomial:1"),
    )
    assert found.noise.lasting > 5
    bank = found.predictor.found.last.bank
    assert len(bank.scores) > 10
    np.testing.assert_allclose(bank.evaluate(list(bank.scores)), list(bank.scores.values()), rtol=1e-9)

"""`ekf` between two models of the torque, free and under the gravity gradient, where tracks do not tell which acts."""

import numpy as np
import pytest

from baryscope.estimator.methods import estimate
from baryscope.estimator.ml.two_models import PredictedMixture
from baryscope.estimator.options import PathOptions
from baryscope.study.population.ahead import asked_of, missed, predicted
from baryscope.study.population.cases import drawn
from baryscope.study.population.sensing import sampled
from synthetic import Orbit, tracks_of_a_slow_tumble


def test_tracks_that_do_not_tell_of_a_gradient_predict_for_both():
    """The torque moves the attitude by less than is seen, an hour later by more: the covariance has one probability."""
    orbit, tracks = Orbit().model(), tracks_of_a_slow_tumble()
    free, pulled, either = (
        estimate(tracks, method="ekf", orbit=orbit, options=PathOptions(trajectory="fixed", torque=torque))
        for torque in ("none", "gravity-gradient", None)
    )
    assert isinstance(either.predictor, PredictedMixture)
    own, other, both = (one.predict([310.0, 2000.0, 4500.0], "F1") for one in (free, pulled, either))
    if either.options.torque == "gravity-gradient":
        own, other = other, own
    apart = np.concatenate([other.position - own.position, other.velocity - own.velocity], axis=1)
    assert np.linalg.norm(apart[2, :3]) > 0.1  # m
    wider = other.covariance + apart[:, :, None] * apart[:, None, :] - own.covariance
    more = both.covariance - own.covariance
    probability = np.einsum("nii->n", more)[1:] / np.einsum("nii->n", wider)[1:]
    assert 0.02 < probability[1] < 0.5
    assert probability[0] == pytest.approx(probability[1], rel=0.2)
    np.testing.assert_allclose(both.position, own.position, atol=0.1 * free.predicted_rmse)


@pytest.mark.parametrize("draw", [0, 1])
def test_by_all_observations_it_is_told_which_one_acts(draw):
    """Of a free body in a transfer orbit attitudes alone chose the gradient: of a feature one span ahead the NEES was
    717 and 661, of six degrees of freedom.
    """
    case = drawn(177, 11)
    sample = sampled(case, draw)
    found = estimate(sample.tracks, method="ekf", orbit=case.orbit, options=PathOptions(sigma=case.told))
    made = predicted(found, asked_of(case, sample))
    assert not any(missed(one) for one in made.values())

"""Errors of features that last: how many frames have the same one, and what every method then claims."""

from dataclasses import replace

import numpy as np
import pytest

from baryscope.estimator import PathOptions, estimate
from baryscope.estimator.adjustment import lasting_errors
from baryscope.estimator.adjustment.lasting_errors import frames_per_error
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.registration.body import Body
from baryscope.estimator.tracks import FeatureTracks
from free_paths import FEATURES, at_rest, turning
from synthetic import first_order, make_case

NOISE = 0.01
FRAMES = 400


def true_growth(keep):
    """1 + 2 Σ keep^k."""
    return (1 + keep) / (1 - keep)


def body_and_observations(errors, points=FEATURES, in_body=False):
    """A body at its true attitudes and place, and observations with errors (n, m, 3) along axes of C or of the body."""
    time, R = turning(len(errors), 1.0)
    moved = errors @ np.swapaxes(R, 1, 2) if in_body else errors
    position = at_rest(time)[:, None] + points @ np.swapaxes(R, 1, 2) + moved
    body = Body(np.arange(len(points)), np.arange(len(time)), points, R)
    return body, Observations(position, np.ones(position.shape[:2])), at_rest(time)


@pytest.mark.parametrize("in_body", [False, True])
@pytest.mark.parametrize("keep", [0.5, 0.8, 0.95])
def test_the_frames_of_an_error_are_those_of_its_process(keep, in_body):
    rng = np.random.default_rng(5)
    body, observations, origin = body_and_observations(NOISE * first_order(rng, (2000, 8, 3), keep), in_body=in_body)
    found = frames_per_error([body], observations, origin)
    # That of 24 series of n frames is known to a share of √(2 (2 L + 1)/(24 n)), L some five times as long as it.
    length = 5 * true_growth(keep)
    assert found == pytest.approx(true_growth(keep), rel=4 * np.sqrt(2 * (2 * length + 1) / (24 * 2000)))


@pytest.mark.parametrize("seed", range(5))
def test_white_errors_do_not_last(seed):
    errors = NOISE * np.random.default_rng(seed).standard_normal((FRAMES, 8, 3))
    body, observations, origin = body_and_observations(errors)
    assert frames_per_error([body], observations, origin) == pytest.approx(1.0, abs=0.1)


def test_points_that_are_a_little_off_are_no_errors_that_last():
    """Those of a registration: off by 0.5 mm, which many frames of 1 cm tell from zero."""
    rng = np.random.default_rng(7)
    body, observations, origin = body_and_observations(NOISE * rng.standard_normal((8000, 8, 3)))
    moved = replace(body, points=body.points + 0.05 * NOISE * rng.standard_normal((8, 3)))
    assert frames_per_error([moved], observations, origin) == pytest.approx(1.0, abs=0.02)


def test_errors_that_are_long_along_the_line_of_sight_do_not_last():
    """Their mean along it is far from zero in the deviations of the other axes, into which the target turns it."""
    deviations = NOISE * np.array([10.0, 1.0, 1.0])
    errors = deviations * np.random.default_rng(8).standard_normal((FRAMES, 8, 3))
    body, observations, origin = body_and_observations(errors)
    precision = np.broadcast_to(np.diag(deviations**-2), (FRAMES, 8, 3, 3))
    weighted = Observations(observations.position, observations.weight, precision)
    assert frames_per_error([body], weighted, origin) == pytest.approx(1.0, abs=0.1)


def test_what_moves_all_features_together_is_no_error_of_theirs():
    """As a pivot that slips, or a camera that sways: each frame's pose is its own."""
    rng = np.random.default_rng(2)
    sway = 0.1 * first_order(rng, (FRAMES, 1, 3), 0.95)
    body, observations, origin = body_and_observations(NOISE * rng.standard_normal((FRAMES, 8, 3)) + sway)
    assert frames_per_error([body], observations, origin) == pytest.approx(1.0, abs=0.1)


def test_outliers_of_little_weight_do_not_count():
    errors = NOISE * np.random.default_rng(3).standard_normal((FRAMES, 8, 3))
    body, observations, origin = body_and_observations(errors)
    position, weight = observations.position.copy(), observations.weight.copy()
    position[100:150, 3] += 5.0
    weight[100:150, 3] = 1e-9
    assert frames_per_error([body], Observations(position, weight), origin) == pytest.approx(1.0, abs=0.1)


def test_precisions_whiten_the_errors():
    """Ten times as much along one axis of C, that of white errors: those of the other two last."""
    rng, keep, frames = np.random.default_rng(4), 0.8, 2000
    errors = NOISE * first_order(rng, (frames, 8, 3), keep)
    errors[:, :, 0] = 10 * NOISE * rng.standard_normal((frames, 8))
    body, observations, origin = body_and_observations(errors)
    precision = np.broadcast_to(np.diag([0.01, 1.0, 1.0]) / NOISE**2, (frames, 8, 3, 3))
    weighted = Observations(observations.position, observations.weight, precision)
    expected = 1 + 2 / 3 * (true_growth(keep) - 1)
    assert frames_per_error([body], weighted, origin) == pytest.approx(expected, rel=0.25)
    assert frames_per_error([body], observations, origin) < 2


def test_the_middle_of_long_tracks_tells_as_well(monkeypatch):
    rng = np.random.default_rng(6)
    errors = NOISE * first_order(rng, (2000, 8, 3), 0.8)
    errors[:500] = errors[1500:] = 0.0
    body, observations, origin = body_and_observations(errors)
    monkeypatch.setattr(lasting_errors, "MOST_FRAMES", 1000)
    assert frames_per_error([body], observations, origin) == pytest.approx(true_growth(0.8), rel=0.25)


def test_no_frames_tell_nothing():
    body = Body(np.arange(3), np.arange(0), FEATURES[:3], np.zeros((0, 3, 3)))
    assert frames_per_error([body], Observations(np.zeros((0, 3, 3)), np.zeros((0, 3))), np.zeros((0, 3))) == 1.0


def nees_and_findings(method, keep, draws, in_body=False, seen=None):
    squares, lasting, options = [], [], PathOptions(trajectory="fixed")
    time, R = turning(FRAMES, 1.0)
    for seed in range(draws):
        errors = NOISE * first_order(np.random.default_rng([seed, 7]), (FRAMES, len(FEATURES), 3), keep)
        case = make_case(time, R, at_rest(time), FEATURES)
        position = case.tracks.position + (errors @ np.swapaxes(R, 1, 2) if in_body else errors)
        if seen is not None:
            position = np.where(seen[:, :, None], position, np.nan)
        found = estimate(FeatureTracks(time, position, case.tracks.labels), method=method, options=options)
        assert found.status.trustworthy
        error = found.position[FRAMES // 2] - case.com[FRAMES // 2]
        squares.append(error @ np.linalg.solve(found.covariance[FRAMES // 2], error))
        lasting.append(found.noise.lasting)
    return np.array(squares), np.array(lasting)


@pytest.mark.parametrize(("method", "draws"), [("pivot", 8), ("ml", 5), ("score", 8), ("ekf", 3)])
def test_claims_are_true_where_errors_last(method, draws):
    squares, lasting = nees_and_findings(method, 0.8, draws)
    assert np.median(lasting) == pytest.approx(true_growth(0.8), rel=0.2)
    # The mean of n values of χ²₃ has a standard deviation of √(6/n).
    assert abs(squares.mean() - 3) < 4 * np.sqrt(6 / draws)


def test_claims_are_true_where_errors_last_on_the_body():
    squares, _ = nees_and_findings("pivot", 0.8, 12, in_body=True)
    assert abs(squares.mean() - 3) < 4 * np.sqrt(6 / 12)


def test_claims_are_true_where_features_come_and_go():
    """Half of them are seen at a time: what is alike is only what is seen in both frames."""
    visible = np.arange(FRAMES)[:, None] // 40 % 2 == np.arange(len(FEATURES)) % 2
    visible[:, :3] = True
    squares, _ = nees_and_findings("pivot", 0.8, 12, seen=visible)
    assert abs(squares.mean() - 3) < 4 * np.sqrt(6 / 12)

"""What a result claims: departures are named, and covariances of models that do not fit hold the error."""

from dataclasses import replace

import numpy as np
import pytest

from baryscope.estimator import FeatureTracks, PathOptions, estimate
from baryscope.estimator.claims import claimed
from baryscope.estimator.findings import (
    Departure,
    DisagreeingClusters,
    ExcessResiduals,
    Extrapolated,
    FramesLeftOut,
    LackOfFit,
    UnknownBurn,
)
from baryscope.estimator.prediction import Prediction
from baryscope.estimator.result import Motion, Noise, ProcessNoise, Status
from free_paths import FEATURES, NOISE, on_parabola, turning
from results import an_estimate
from synthetic import make_case

SEEN = ProcessNoise("estimated", 2e-9, (1e-9, 4e-9), 28.0, 0.01)  # by chance in 6e-8


def claim_of(result):
    """What it claims of features that are seen where the estimate has them."""
    return claimed(result, FeatureTracks(result.time, result.position[:, None] + result.residuals, result.labels))


def test_a_departure_of_a_path_with_a_model_is_named():
    found = claim_of(an_estimate(path="relative-orbit", process_noise=SEEN))
    assert found.findings == (Departure("relative-orbit", 0.01, 2e-9, 28.0),)
    assert found.status is Status.GOOD
    for path, significance in (("polynomial", 28.0), ("relative-orbit", 26.0)):
        noise = ProcessNoise("estimated", 2e-9, (1e-9, 4e-9), significance, 0.01)
        assert claim_of(an_estimate(path=path, process_noise=noise)).findings == ()


def test_chance_is_half_of_chi_square():
    """At the boundary of the range; χ²₁ exceeds 6.635 in 1 %."""
    assert ProcessNoise("estimated", 1.0, None, 6.635, 0.1).by_chance == pytest.approx(0.005, rel=1e-3)


def test_what_fits_claims_what_it_did():
    plain = an_estimate()
    assert claim_of(plain).covariance is plain.covariance


def test_misfits_widen_by_what_they_show():
    """Residuals are 1 cm in every coordinate; 1 − 1/2² of their square is misfit. Ten frames span 9 s."""
    motion = Motion(velocity_covariance=np.tile(1e-6 * np.eye(3), (10, 1, 1)))
    plain = an_estimate(findings=(ExcessResiduals("fixed", 2.0),), noise=Noise(0.01, 0.03), motion=motion)
    found = claim_of(plain)
    np.testing.assert_allclose(found.covariance, 9 * plain.covariance + 0.75e-4 * np.eye(3))
    np.testing.assert_allclose(found.clusters[0].covariance, 9 * plain.clusters[0].covariance + 0.75e-4 * np.eye(3))
    speed = 0.75e-4 * (2 * np.pi / 9) ** 2
    np.testing.assert_allclose(found.motion.velocity_covariance[0], (9e-6 + speed) * np.eye(3))
    np.testing.assert_allclose(found.observability.body.deviations[-1] ** 2, 9 * 9e-4 + 0.75e-4)
    apart = claim_of(an_estimate(findings=(DisagreeingClusters(("a",), (0, 1), 4.0),)))
    np.testing.assert_allclose(apart.covariance, 16 * plain.covariance)
    bent = claim_of(an_estimate(findings=(LackOfFit("fixed", 0.3, 90.0, 3),)))
    np.testing.assert_allclose(bent.covariance, plain.covariance + 0.03 * np.eye(3))


@pytest.mark.parametrize(("share", "announced"), [(0.97, False), (1.03, True)])
def test_a_burn_beyond_counts_as_its_mean_square_over_the_times_when_it_may_be(share, announced):
    """Of one at a time that is uniform in the τ beyond the frames: ∫ (Δv t)² dt/τ = Δv² τ²/3, drawn here 10⁶ times to
    0.1 %. It is named from where the variance is 3² times that within.
    """
    change, tau = np.array([1e-3, -2e-3, 2e-3]), 40.0
    left = np.random.default_rng(0).uniform(0.0, tau, 1_000_000)
    variance = float(np.mean(left**2)) * (change @ change)
    frames, sigma = 50, np.sqrt(variance / share / 8 / 3)  # of what is within, which is there beyond, too
    time = np.concatenate([np.linspace(0.0, 60.0, frames - 1), [60.0 + tau]])
    used = np.tile(time[:, None] <= 60.0, (1, 4))
    burn = UnknownBurn(30.0, 0.1, 31.0, 0.1, tuple(change), (1e-5, 1e-5, 1e-5))
    covariance = np.tile(sigma**2 * np.eye(3), (frames, 1, 1))
    plain = an_estimate(frames=frames, time=time, used=used, covariance=covariance, findings=(burn,))
    plain = replace(plain, path="relative-orbit", residuals=np.where(used[..., None], 0.01, np.nan))
    claim = claim_of(plain)
    found = [one for one in claim.findings if isinstance(one, Extrapolated)]
    assert [(one.begin, one.end) for one in found] == [(0.0, 60.0)] * announced
    np.testing.assert_allclose(claim.covariance[:-1], covariance[:-1])
    doubled = 1 + 3 * (1 - 1 / (1 + 8 * share)) if announced else 1.0  # of the variance over that within
    expected = doubled * (covariance[-1] + variance / 3 * np.eye(3))
    np.testing.assert_allclose(claim.covariance[-1], expected, rtol=2e-3, atol=1e-9)


def test_burns_beyond_move_and_speed_what_is_predicted():
    """Of three burns in 60 s one may be within 20 s beyond, and six are in 120 s: Campbell's theorem, drawn here."""
    changes = np.random.default_rng(3).normal(0.0, 1e-3, (3, 3))
    burns = tuple(
        UnknownBurn(at, 0.1, at + 1, 0.1, tuple(v), (1e-5,) * 3) for at, v in zip((5, 30, 50), changes, strict=True)
    )
    time = np.linspace(0.0, 60.0, 61)
    claim = claim_of(replace(an_estimate(frames=61, time=time, findings=burns), predictor=_AtRest()))
    assert claim.findings[: len(burns)] == burns
    found = claim.predict([30.0, 80.0, 180.0, -20.0]).covariance
    np.testing.assert_array_equal(found[0], 0.0)
    rng, draws = np.random.default_rng(4), 200_000
    for covariance, tau, count, side in ((found[1], 20.0, 1, 1), (found[2], 120.0, 6, 1), (found[3], 20.0, 1, -1)):
        left = rng.uniform(0.0, tau, (draws, count))
        sign = rng.choice([-1.0, 1.0], (draws, count, 1))
        change = sign * changes[rng.integers(0, 3, (draws, count))]
        state = np.concatenate([(change * side * left[..., None]).sum(axis=1), change.sum(axis=1)], axis=1)
        drawn = np.einsum("na,nb->ab", state, state) / draws
        for k, m in ((0, 0), (0, 1), (1, 1)):
            one = drawn[3 * k : 3 * k + 3, 3 * m : 3 * m + 3]
            own = covariance[3 * k : 3 * k + 3, 3 * m : 3 * m + 3]
            assert np.trace(own) == pytest.approx(np.trace(one), rel=0.02)  # five deviations of so many draws
            np.testing.assert_allclose(own, np.trace(own) / 3 * np.eye(3), atol=1e-15)


class _AtRest:
    """A predictor of what is known to be at rest."""

    def at(self, time, point):
        return Prediction.of(time, np.zeros((len(time), 6)), np.zeros((len(time), 6, 6)))


@pytest.mark.parametrize("trajectory", ["fixed", "polynomial:1"])
def test_a_path_that_is_told_wrongly_claims_no_less_than_its_error(trajectory):
    """A parabola taken for a point, or a line: the covariance alone is too small by a factor of 20 and more."""
    time, R = turning(200)
    case = make_case(time, R, on_parabola(time), FEATURES, noise=NOISE)
    found = estimate(case.tracks, options=PathOptions(trajectory=trajectory, process_noise="none"))
    assert found.status is Status.MODEL_DOES_NOT_FIT
    error = found.position - case.com
    squares = np.einsum("ki,kij,kj->k", error, np.linalg.inv(found.covariance), error)
    assert 0.3 < squares.mean() < 6.0
    assert found.predict([200.0]).covariance[0, 0, 0] > found.covariance[-1, 0, 0]


def test_with_process_noise_the_same_path_is_named_and_calibrated():
    time, R = turning(200)
    case = make_case(time, R, on_parabola(time), FEATURES, noise=NOISE)
    found = estimate(case.tracks, options=PathOptions(trajectory="polynomial:1"))
    assert found.status is Status.GOOD
    assert [type(finding) for finding in found.findings] == [Departure]
    assert found.findings[0].path == "polynomial:1"
    error = found.position[100] - case.com[100]
    assert error @ np.linalg.solve(found.covariance[100], error) < 20


def test_a_run_of_frames_that_nothing_fits_is_named():
    """The body jumps aside by 30 m for 20 of 200 frames, which no smooth path does."""
    time, R = turning(200)
    com = on_parabola(time)
    com[60:80] += [30.0, 0.0, 0.0]
    case = make_case(time, R, com, FEATURES, noise=NOISE)
    found = estimate(case.tracks, options=PathOptions(trajectory="polynomial:2", process_noise="none"))
    assert [type(finding) for finding in found.findings] == [FramesLeftOut]
    left_out = found.findings[0]
    assert (left_out.begin, left_out.end, left_out.frames) == (time[60], time[79], 20)
    # Attitudes give way to what does not fit: single frames are off by 0.6 m, the median of 20 by 0.17.
    assert left_out.magnitude == pytest.approx(30.0, abs=4 * 0.17)
    assert found.status is Status.MODEL_DOES_NOT_FIT


@pytest.mark.parametrize(
    ("left_out", "named"),
    [
        (range(25, 30), (25, 29, 5)),  # by chance in 30 / 26^5
        ([*range(25, 30), 3], (25, 29, 5)),
        (range(0, 30, 6), None),
        ([*range(26, 30), 3, 9, 15], None),  # in 30 (4 / 27)^4, 1.4 %
        ([], None),
    ],
)
def test_frames_are_left_out_together_or_by_chance(left_out, named):
    """Of 30 frames; half a metre off."""
    rejected = np.zeros((30, 4), dtype=bool)
    rejected[list(left_out)] = True
    residuals = np.where(rejected[..., None], [0.3, 0.0, 0.4], 0.01)
    found = claim_of(an_estimate(frames=30, rejected=rejected, residuals=residuals))
    assert found.findings == (() if named is None else (FramesLeftOut(*named, pytest.approx(0.5)),))

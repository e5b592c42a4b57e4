"""What is told of the noise, and contradicted by the residuals."""

from dataclasses import replace

import numpy as np
import pytest

from baryscope.estimator import PathOptions, estimate
from baryscope.estimator.findings import ExcessResiduals, WrongSigma
from baryscope.estimator.noise.a_priori import with_credible_sigma
from baryscope.estimator.result import Noise, Status
from baryscope.models.errors import ComputationError, Reason
from free_paths import FEATURES, NOISE, at_rest, on_parabola, turning
from results import an_estimate
from synthetic import make_case


@pytest.mark.parametrize("method", ["pivot", "ml", "ekf"])
def test_a_wrong_sigma_is_named_and_a_small_one_left_out(method):
    """Half and twice the noise; a deviation from 200 × 8 × 3 values is known to a part in fifty."""
    time, R = turning(200)
    case = make_case(time, R, on_parabola(time), FEATURES, noise=NOISE, seed=3)
    chosen = PathOptions(trajectory="polynomial:2", process_noise="none")
    plain = estimate(case.tracks, method=method, options=chosen)
    for factor, scale in ((0.5, 1.0), (2.0, 2.0)):
        found = estimate(case.tracks, method=method, options=replace(chosen, sigma=factor * NOISE))
        assert found.status is Status.GOOD
        (wrong,) = found.findings
        assert isinstance(wrong, WrongSigma)
        assert (wrong.given, found.noise.a_priori, found.options.sigma) == (factor * NOISE,) * 3
        assert wrong.found == pytest.approx(NOISE, rel=0.08)
        assert found.predicted_rmse == pytest.approx(scale * plain.predicted_rmse, rel=0.15)


def test_a_path_that_does_not_fit_says_nothing_of_sigma():
    time, R = turning(200)
    case = make_case(time, R, on_parabola(time), FEATURES, noise=NOISE)
    options = PathOptions(trajectory="fixed", process_noise="none", sigma=NOISE)
    found = estimate(case.tracks, options=options)
    assert [type(finding) for finding in found.findings] == [ExcessResiduals]


def test_a_right_sigma_is_kept():
    time, R = turning(300)
    case = make_case(time, R, at_rest(time), FEATURES, noise=NOISE)
    found = estimate(case.tracks, options=PathOptions(trajectory="fixed", sigma=1.005 * NOISE))
    assert found.findings == ()
    assert found.noise.a_priori == 1.005 * NOISE


def fits(told, free):
    """A fit that gives one result with a sigma, and another one without; and the sigmas it was called with."""
    calls = []

    def fit(options):
        calls.append(options.sigma)
        result = free if options.sigma is None else told
        if isinstance(result, Exception):
            raise result
        return result

    return fit, calls


def kept(sigma, **changes):
    """A result with the residuals of 1 cm of `an_estimate`, of a method that uses sigma."""
    used = np.ones((10, 4), dtype=bool)
    return an_estimate(noise=Noise(sigma, 0.01), used=used, rejected=~used, wall_time=1.0, **changes)


def test_a_fit_that_does_not_come_to_rest_is_tried_without_sigma():
    for told in (kept(0.01, converged=False), ComputationError("diverges", Reason.DIVERGED)):
        fit, calls = fits(told, kept(None))
        found = with_credible_sigma(fit, PathOptions(sigma=0.01))
        assert calls == [0.01, None]
        assert found.converged
        assert found.findings == ()
        assert found.noise.a_priori == 0.01
    fit, calls = fits(ComputationError("diverges", Reason.DIVERGED), ComputationError("too few", Reason.TOO_FEW_FRAMES))
    with pytest.raises(ComputationError, match="too few"):
        with_credible_sigma(fit, PathOptions(sigma=0.01))


def test_what_chance_explains_is_no_contradiction():
    """Ten frames of four features have 60 residuals of their own: five deviations are a factor of e^0.46."""
    for ratio, named in ((1.4, False), (1.7, True), (1 / 1.4, False), (1 / 1.7, True)):
        fit, calls = fits(kept(ratio * 0.01), kept(None))
        found = with_credible_sigma(fit, PathOptions(sigma=ratio * 0.01))
        assert bool(found.findings) == named
        assert calls == [ratio * 0.01] + [None] * (named and ratio < 1)


def test_a_method_that_makes_no_use_of_sigma_is_asked_once():
    fit, calls = fits(kept(None), kept(None))
    assert with_credible_sigma(fit, PathOptions(sigma=1.0)).findings == ()
    assert calls == [1.0]

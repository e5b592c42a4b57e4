"""What cannot be computed is a value that a caller can ask for its reason."""

import pickle

import numpy as np
import pytest

from baryscope.estimator import METHODS, Estimate, Failure, FeatureTracks, attempt, estimate
from baryscope.estimator.adjustment.diagnostics import observability_of
from baryscope.models.errors import ComputationError, InputError, Reason
from results import a_cluster

TIME = np.arange(40.0)


def tracks_of(position):
    return FeatureTracks(TIME[: len(position)], position, [f"F{k}" for k in range(position.shape[1])])


def line():
    return np.tile(np.outer(np.arange(4.0), [1.0, 2, 3]), (40, 1, 1))


CASES = {
    "two features": (line()[:, :2], Reason.TOO_FEW_FEATURES),
    "a line": (line(), Reason.COLLINEAR_FEATURES),
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("case", CASES)
def test_every_method_gives_the_reason(method, case):
    position, reason = CASES[case]
    failure = attempt(tracks_of(position), method=method)
    assert isinstance(failure, Failure)
    assert (failure.method, failure.reason) == (method, reason)
    with pytest.raises(ComputationError) as raised:
        estimate(tracks_of(position), method=method)
    assert (str(raised.value), raised.value.reason) == (failure.message, reason)


@pytest.mark.parametrize("method", [name for name in METHODS if name.startswith("screw")])
def test_a_body_that_does_not_turn(method):
    points = np.random.default_rng(0).normal(size=(6, 3))
    noise = 0.01 * np.random.default_rng(1).normal(size=(40, 6, 3))
    failure = attempt(tracks_of(points + noise), method=method)
    assert isinstance(failure, Failure)
    assert failure.reason in (Reason.TOO_LITTLE_ROTATION, Reason.DEGENERATE_SCREWS, Reason.PURE_SPIN)


def test_what_can_be_computed_is_an_estimate(case_of, at_rest):
    found = attempt(case_of(at_rest, noise=0.02).tracks, method="pivot")
    assert isinstance(found, Estimate)


def test_wrong_input_is_still_an_error():
    with pytest.raises(InputError, match="method is 'magic'"):
        attempt(tracks_of(line()), method="magic")


def test_the_reason_survives_a_process_boundary():
    error = pickle.loads(pickle.dumps(ComputationError("too dark", Reason.NO_NOISE)))  # noqa: S301  our own bytes
    assert (str(error), error.reason) == ("too dark", Reason.NO_NOISE)
    assert ComputationError("why").reason is Reason.OTHER


def test_a_covariance_that_is_lost_in_rounding_is_no_result():
    lost = np.tile(np.diag([1e-4, 1e-4, -1.0]), (10, 1, 1))
    with pytest.raises(ComputationError, match="lost in rounding") as raised:
        observability_of([a_cluster([0.1, 0.2, 0.3])], lost)
    assert raised.value.reason is Reason.DIVERGED

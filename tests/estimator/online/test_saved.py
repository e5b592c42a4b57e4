"""Filters that are saved as bytes."""

import copy
import pickle

import numpy as np
import pytest

from baryscope.estimator.online import OnlineEstimator
from baryscope.models.errors import InputError
from tops import SIGMA, run, straight, tracks


def test_a_saved_filter_goes_on_to_the_last_bit():
    time = np.arange(100.0)
    seen = tracks(np.random.default_rng(12), time, straight(time))
    one = OnlineEstimator(SIGMA, attitude_noise=1e-5)
    run(one, time[:50], seen[:50])
    content = one.save()
    other = OnlineEstimator.restored(content)
    run(one, time[50:], seen[50:])
    run(other, time[50:], seen[50:])
    assert one.save() == other.save()
    assert one.save() != content
    assert len(content) <= 256 * 1024


@pytest.mark.parametrize(
    "copied",
    [
        copy.deepcopy,
        lambda filter: pickle.loads(pickle.dumps(filter)),  # noqa: S301
        lambda filter: OnlineEstimator.restored(bytearray(filter.save())),
    ],
    ids=["deepcopy", "pickle", "bytearray"],
)
def test_copies_are_filters_of_their_own(copied):
    """They failed with messages of ctypes."""
    time = np.arange(10.0)
    seen = tracks(np.random.default_rng(13), time, straight(time))
    one = OnlineEstimator(SIGMA)
    run(one, time[:5], seen[:5])
    content = one.save()
    other = copied(one)
    run(one, time[5:], seen[5:])
    assert other.save() == content
    run(other, time[5:], seen[5:])
    assert other.save() == one.save()


@pytest.mark.parametrize("change, message", [
    (lambda content: b"", "found 0 bytes"),
    (lambda content: "x", "found str, expected bytes"),
    (lambda content: content[:-1], r"expected \d+ that begin with"),
    (lambda content: b"x" + content[1:], r"expected \d+ that begin with"),
    (lambda content: content[:20] + bytes(byte ^ 1 for byte in content[20:21]) + content[21:], "of another version"),
    (lambda content: content[:-9] + bytes(byte ^ 1 for byte in content[-9:]), "found damaged bytes"),
])  # fmt: skip
def test_what_is_no_saved_filter_is_refused(change, message):
    """Damaged numbers of features led the core out of its memory."""
    content = OnlineEstimator(SIGMA).save()
    assert OnlineEstimator.restored(content).save() == content
    with pytest.raises(InputError, match=f"^a saved filter: .*{message}"):
        OnlineEstimator.restored(change(content))


def test_a_longer_gap_is_one_that_was_asked_for():
    """A saved filter keeps it."""
    time = np.array([0.0, 1.0, 2e5])
    seen = tracks(np.random.default_rng(14), time, straight(time))
    filter = OnlineEstimator(SIGMA, longest_gap=3e5)
    run(filter, time[:2], seen[:2])
    filter = OnlineEstimator.restored(filter.save())
    with pytest.raises(InputError, match="at most 300000 s, longest_gap"):
        filter.update(4e5, seen[2])
    assert filter.update(time[2], seen[2]).time == time[2]

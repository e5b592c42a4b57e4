"""What judging asks of a case of a population, of whichever it is."""

import json
from dataclasses import asdict

import numpy as np

from baryscope.study.population.judging import bounds_of


def assert_it_can_be_judged(case, sample):
    """Its arrays have their shapes, its sensor is data, and its bounds are finite and in their order."""
    frames, labels = len(case.time), len(case.points)
    assert case.path_jacobian.shape == (frames, 3, 6)
    assert case.turn.shape == (frames, 3, 8)
    assert case.attitude.shape == (frames, 3, 3)
    assert sample.right.shape == (frames, labels)
    assert sample.precision.shape == (frames, labels, 3, 3)
    assert not (sample.right & ~sample.tracks.seen).any()
    assert case.radius > 0
    json.dumps(asdict(case.sensor))
    bounds = bounds_of(case, sample)
    assert all(np.isfinite(value) and value >= 0 for value in bounds.values())
    assert bounds["tumble orbit"] <= bounds["free orbit"] * (1 + 1e-6)


def assert_it_is_drawn_and_sampled_alone(drawn, sampled, seed, index):
    """A case is of its seed and index alone, and a sample of it of its draw."""
    case, again = drawn(seed, index), drawn(seed, index)
    np.testing.assert_array_equal(again.path, case.path)
    assert again.kind == case.kind
    one, same, other = sampled(case), sampled(again), sampled(again, 1)
    np.testing.assert_array_equal(same.tracks.position, one.tracks.position)
    np.testing.assert_array_equal(same.tracks.seen, other.tracks.seen)
    seen = same.tracks.seen
    assert (same.tracks.position[seen] != other.tracks.position[seen]).all()
    assert drawn(seed + 1, index).kind != again.kind

"""Cases as a whole."""

from functools import cache

import numpy as np
import pytest

from baryscope.study.population.third.cases import CLEAN, drawn, sampled
from baryscope.study.population.third.mismatches import KINDS, planned
from judged import assert_it_can_be_judged, assert_it_is_drawn_and_sampled_alone

SEED, COUNT = 1, 40
WORDS = {  # that name a mismatch in the kind of a case, where they are not its name
    "body torque": "body torque",
    "Student noise": "Student noise",
    "drifting templates": "AR noise",
    "wrong sigma": "sigma told times",
    "wrong rig": "rig's covariances times",
    "slipping pivot": "pivot slips",
    "limited joint": "joint limited",
}


@cache
def case_of(index):
    return drawn(SEED, index)


@cache
def sample_of(index):
    return sampled(case_of(index))


@pytest.mark.parametrize("index", range(COUNT))
def test_a_kind_names_each_mismatch_and_no_other(index):
    plan, kind = planned(SEED, index), case_of(index).kind
    said = kind.partition(": ")[2].split("; ")
    for name in KINDS:
        assert any(part.startswith(WORDS.get(name, name)) for part in said) == (name in plan.mismatches), name
    assert case_of(index).orbital == plan.orbital
    assert kind.startswith(plan.place)


@pytest.mark.parametrize("index", [0, 5, 13, 21])
def test_a_case_is_of_its_seed_and_index_alone_and_a_sample_of_its_draw(index):
    assert_it_is_drawn_and_sampled_alone(drawn, sampled, SEED, index)


@pytest.mark.parametrize("index", range(0, COUNT, 2))
def test_a_clean_case_is_its_truth(index):
    case = drawn(SEED, index, clean=True)
    tracks = sampled(case).tracks
    rigid = case.path[:, None] + np.einsum("nij,mj->nmi", case.attitude, case.points)
    assert tracks.seen.all()
    assert np.abs(tracks.position - rigid).max() < 8 * CLEAN
    assert case.told == CLEAN
    for name in ("time", "path", "attitude", "turn", "points"):
        np.testing.assert_array_equal(getattr(case, name), getattr(case_of(index), name))


def test_the_precision_is_that_of_the_noise_of_what_is_right():
    """The mean square of all, whitened, against 3; what is common to a frame leaves fewer numbers than there are."""
    for case, sample in ((case_of(index), sample_of(index)) for index in range(COUNT)):
        if case.blunders.words() or case.sensor.dof:
            continue
        error = (sample.tracks.position - case.watch.ideal)[sample.right]
        squares = np.einsum("ki,kij,kj->k", error, sample.precision[sample.right], error)
        share = min(1, 1 / case.sensor.drift[1] / 2) if case.sensor.drift[0] else 1.0
        common = case.sensor.common or case.sensor.jitter or case.sensor.tissue[0]
        count = (len(case.time) / (2 * case.sensor.tissue[1]) if common else len(squares)) * share
        assert squares.mean() == pytest.approx(3, abs=5 * np.sqrt(6 / count)), case.kind


def test_what_judging_asks_for_is_there_and_finite():
    for case, sample in ((case_of(index), sample_of(index)) for index in range(COUNT)):
        assert_it_can_be_judged(case, sample)


def test_rotations_are_the_turns_of_a_steady_spin():
    for case in map(case_of, range(COUNT)):
        if case.kind.startswith("hand"):
            continue
        steps = np.swapaxes(case.attitude[:-1], 1, 2) @ case.attitude[1:]
        angle = np.arccos(np.clip((np.trace(steps, axis1=1, axis2=2) - 1) / 2, -1, 1))
        if angle.max() < 1.5:  # a step of more than half a turn would count the other way
            # The way is longer than its chords: by (step angle)² / 24 where the axis moves with the body.
            assert case.rotations == pytest.approx(angle.sum() / (2 * np.pi), rel=0.1)

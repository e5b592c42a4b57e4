"""Truths carried on, against Kepler's orbits, conservation and differences; and how predictions are judged by them."""

import json

import numpy as np
import pytest

from baryscope.estimator import estimate
from baryscope.study.population.__main__ import main
from baryscope.study.population.ahead import FEATURE, WHEN, asked_of, predicted
from baryscope.study.population.judging import prepared
from baryscope.study.population.populations import POPULATIONS
from oracles import inertial_states, propagate_kepler

SOME = (0, 2)
STEP = 0.05  # s


@pytest.fixture(scope="module", params=POPULATIONS)
def cases(request):
    return [POPULATIONS[request.param](5, index)[0] for index in SOME]


def beyond(case):
    """Times before, at and after one span after the end, STEP s from each other."""
    return 2 * case.time[-1] - case.time[0] + STEP * np.array([-1.0, 0.0, 1.0])


def test_at_the_tracks_times_it_is_the_truth_of_the_tracks(cases):
    """To the integrators' tolerances of 1e-11 or less a step, over thousands of steps."""
    for case in cases:
        some = slice(1, None, 7)
        there = case.at(case.time[some])
        np.testing.assert_allclose(there.path, case.path[some], atol=1e-6)
        np.testing.assert_allclose(there.attitude, case.attitude[some], atol=1e-6)
        np.testing.assert_allclose(there.rate, case.rate[some], atol=1e-8)


def test_what_is_carried_on_moves_at_its_velocity_and_turns_at_its_rate(cases):
    """Central differences: STEP² of a motion's third derivative, below that of a turn at 2 rad/s."""
    for case in cases:
        there = case.at(beyond(case))
        speed = (there.path[2] - there.path[0]) / (2 * STEP)
        np.testing.assert_allclose(speed, there.velocity[1], atol=1e-5 + 1e-3 * np.linalg.norm(speed))
        change = there.attitude[0].T @ there.attitude[2] / 2
        turn = np.array([change[2, 1] - change[1, 2], change[0, 2] - change[2, 0], change[1, 0] - change[0, 1]])
        turn *= np.arcsin(np.linalg.norm(turn)) / np.linalg.norm(turn)
        np.testing.assert_allclose(turn / (2 * STEP), there.rate[1], atol=1e-5 + 0.02 * np.linalg.norm(there.rate[1]))


@pytest.mark.parametrize("population", ["first", "second"])
def test_exact_worlds_go_on_by_kepler_and_keep_their_angular_momentum(population):
    for index in SOME:
        case, _ = POPULATIONS[population](5, index)
        time = np.append(case.time[-1], beyond(case)[1])
        there, mu = case.at(time), case.orbit.gravitational_parameter
        momentum = np.einsum("kij,jl,kl->ki", there.attitude, case.start.inertia, there.rate)
        np.testing.assert_allclose(momentum[1], momentum[0], atol=1e-8 * np.linalg.norm(momentum[0]))
        at_zero, _ = inertial_states(case.orbit, np.zeros(3), np.zeros(3))
        target = propagate_kepler(*at_zero, mu, time[0])
        chaser = (target[0] - there.path[0], target[1] - there.velocity[0])
        ends = [propagate_kepler(*one, mu, time[1] - time[0])[0] for one in (target, chaser)]
        span = time[1] - time[0]
        # rounding of two positions of 1e7 m and of velocities, which a span turns into places
        np.testing.assert_allclose(there.path[1], np.float64(ends[0] - ends[1]), atol=1e-5 + 1e-9 * span)


def test_what_is_asked_lies_in_the_longest_gap_and_ahead():
    case, sample, _ = prepared(5, 1)
    found = asked_of(case, sample)
    span = case.time[-1] - case.time[0]
    np.testing.assert_allclose(found.time[1:] - case.time[-1], [span / 4, span])
    seen = case.time[sample.tracks.seen.any(axis=1)]
    before, after = seen[seen < found.time[0]].max(), seen[seen > found.time[0]].min()
    assert after - before == pytest.approx(np.diff(seen).max())
    counts = sample.right.sum(axis=0)
    assert counts[sample.tracks.labels.index(found.label)] == counts.max()


def test_predictions_are_judged_in_position_and_velocity():
    """The same NEES from the truth and the covariance by `solve`, of a feature that turns with the body."""
    case, sample, _ = prepared(5, 1)
    asked = asked_of(case, sample)
    found = estimate(sample.tracks, method="ml", orbit=case.orbit)
    line = predicted(found, asked)
    there, truth = found.predict(asked.time, asked.label), asked.truth
    for k, when in enumerate(WHEN):
        place = truth.path[k] + truth.attitude[k] @ asked.point
        speed = truth.velocity[k] + truth.attitude[k] @ np.cross(truth.rate[k], asked.point)
        error = np.concatenate([there.position[k] - place, there.velocity[k] - speed])
        one = line[f"{FEATURE} {when}"]
        assert one["nees"] == pytest.approx(error @ np.linalg.solve(there.covariance[k], error), rel=1e-6)
        assert one["error"] == pytest.approx(np.linalg.norm(error[:3]))
    assert "expected ml or ekf" in predicted(estimate(sample.tracks, orbit=case.orbit), asked)[FEATURE]


def test_a_run_with_predictions_is_none_without_and_is_resumed(in_process, tmp_path, capsys):
    output = tmp_path / "results.jsonl"
    run = ["run", "--seed", "5", "--first", "3", "--cases", "1", "--methods", "pivot", "-o", str(output)]
    for more in ([], ["--ahead"], ["--ahead"]):
        main([*run, *more])
    lines = [json.loads(line) for line in output.read_text(encoding="utf-8").splitlines()]
    assert [("ahead" in line, "predicted" in line) for line in lines] == [(False, False)] * 2 + [(True, True)] * 2
    assert main(["report", str(output)]) == 0
    assert "| pivot | yes | centre | span | 1 | 0 (0.0 %) |" in capsys.readouterr().out

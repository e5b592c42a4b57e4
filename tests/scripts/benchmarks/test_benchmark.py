"""The benchmark says by its exit code whether results are right; how long they took is no matter of it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import oracles
from baryscope.estimator.tracks import FeatureTracks
from baryscope.scripts.benchmarks import adjusting, benchmark, estimating, flying, orbit, setting, stepping
from baryscope.scripts.benchmarks.report import Part, Row, differs, exceeds

STEPS = 100  # of 0.1 s


@pytest.fixture(autouse=True)
def once(monkeypatch):
    """What is timed is done once: of several runs only the times differ."""
    usual = setting.best_of
    monkeypatch.setattr(setting, "best_of", lambda work, _: usual(work, 1))


@pytest.fixture
def short(envisat, envisat_fmu, tmp_path):
    return setting.Setting(envisat, envisat_fmu, tmp_path, steps=STEPS, frames=50, rows=400)


# ---- the program ----


def run(part, *arguments):
    return benchmark.main(arguments, {"a part": lambda setting: part})


def test_right_results_are_no_fault_however_slow(capsys):
    assert run(Part((Row("doStep", measured=100.0, wanted=1e-6),))) == 0
    printed = capsys.readouterr()
    assert "100 s" in printed.out
    assert "wrong" not in printed.err


def test_a_wrong_result_is_a_fault(capsys):
    assert run(Part(faults=("the unit: found 1, expected 2",))) == 1
    assert "wrong: the unit: found 1, expected 2" in capsys.readouterr().err


@pytest.mark.parametrize("asked, code", [((), 0), (("--peers", "heyoka"), 1), (("--peers", "all"), 1)])
def test_a_missing_peer_is_a_fault_only_if_it_was_asked_for(monkeypatch, capsys, asked, code):
    monkeypatch.setattr(setting, "find_spec", lambda name: None)
    assert run(Part(), *asked) == code
    assert capsys.readouterr().err.count("wrong: heyoka: is not installed, expected it by --peers") == code


def test_of_the_peers_that_are_there_those_that_were_asked_for_are_measured(monkeypatch):
    monkeypatch.setattr(setting, "find_spec", lambda name: object())
    seen = []
    for arguments in ((), ("--peers", "heyoka,pythonfmu")):
        benchmark.main(arguments, {"a part": lambda setting: seen.append(set(setting.peers)) or Part()})
    assert seen == [{"heyoka", "basilisk", "pythonfmu", "gtsam"}, {"heyoka", "pythonfmu"}]


def test_an_unknown_peer_is_named(capsys):
    with pytest.raises(SystemExit) as raised:
        run(Part(), "--peers", "heyoka,simulink")
    assert raised.value.code == 2
    assert "found simulink, expected all or some of heyoka, basilisk, pythonfmu, gtsam" in capsys.readouterr().err


# ---- the judgements ----


@pytest.mark.parametrize("error, wrong", [(0.0, False), (1e-8, False), (1.1e-8, True), (np.nan, True), (np.inf, True)])
def test_errors_above_a_tolerance_and_no_numbers_are_faults(error, wrong):
    assert bool(exceeds("attitude", error, 1e-8, "rad")) == wrong


@pytest.mark.parametrize("found, words", [
    ([1.0, 20.0], None), ([1.0 + 1e-9, 20.0], None), ([1.0, 21.0], "found 21 at place 1, expected 20"),
    ([np.nan, 20.0], "found nan at place 0"), ([1.0], "found 1 values, expected 2"),
])  # fmt: skip
def test_values_that_differ_are_faults(found, words):
    faults = differs("outputs", found, [1.0, 20.0], 1e-8)
    assert bool(faults) == (words is not None)
    assert not faults or words in faults[0]


# ---- the parts, with the real unit and with one that is broken ----


def test_steps_of_the_unit_are_right(short):
    part = stepping.stepping(short)
    assert part.faults == ()
    assert [row.what for row in part.rows][:2] == ["doStep of 0.1 s, from C", "doStep and all outputs, from C"]
    assert all(row.measured > 0 for row in part.rows)


@pytest.mark.parametrize("name, fault", [
    ("c_steps", "outputs read from C"), ("session_steps", "outputs of a session"), ("fmpy_run", "outputs by fmpy"),
])  # fmt: skip
def test_ways_to_step_that_disagree_are_faults(short, monkeypatch, name, fault):
    usual = getattr(stepping, name)

    def broken(setting):
        found = usual(setting)
        if name == "c_steps":
            return replace(found, outputs=found.outputs + 1e-6)
        return found[0], found[1] + 1e-6

    monkeypatch.setattr(stepping, name, broken)
    assert any(line.startswith(fault) for line in stepping.stepping(short).faults)


def test_a_unit_off_its_closed_form_is_a_fault(short, monkeypatch):
    later = setting.ClosedForm.of(short.scenario, short.duration + 1)
    monkeypatch.setattr(setting.ClosedForm, "of", lambda scenario, duration: later)
    faults = stepping.stepping(short).faults
    assert [fault.split(" after")[0] for fault in faults] == ["the unit's attitude", "the unit's position"]


def test_an_orbit_in_one_step_is_right(short):
    part = orbit.whole_orbit(short)
    assert part.faults == ()
    assert [table.row_count for table in part.tables] == [4, 2]  # the unit, with gravity gradient, cvodes, scipy; J2


def test_a_wrong_unit_is_a_fault_over_an_orbit(short, monkeypatch):
    usual = orbit.unit_flight

    def broken(*arguments):
        flight = usual(*arguments)
        return replace(flight, state=flight.state + 1e-4)

    monkeypatch.setattr(orbit, "unit_flight", broken)
    faults = orbit.whole_orbit(short).faults
    assert any(fault.startswith("the unit with gravity gradient, against scipy: found") for fault in faults)
    assert any(fault.startswith("the unit (Taylor, tolerance 1e-13) over 10 s: attitude: found") for fault in faults)
    assert not any(fault.startswith(("CasADi", "scipy")) for fault in faults)


def test_a_peer_that_disagrees_is_a_fault(short, monkeypatch):
    usual = orbit.cvodes_flights

    def broken(*arguments):
        for flight in usual(*arguments):
            yield replace(flight, state=flight.state + 0.01)

    monkeypatch.setattr(orbit, "cvodes_flights", broken)
    faults = orbit.whole_orbit(short).faults
    assert faults
    assert all(fault.startswith("CasADi cvodes") for fault in faults)


@pytest.mark.parametrize("rmse, wrong", [(1e-3, False), (100.0, True), (np.nan, True)])
def test_a_path_that_is_not_the_true_one_is_a_fault(short, monkeypatch, rmse, wrong):
    monkeypatch.setattr(estimating, "cost_of", lambda *arguments: estimating.Cost(1.0, 1.0, rmse))
    part = estimating.estimating(short)
    assert len(part.faults) == (8 if wrong else 0)
    assert len(part.rows) == 13


def test_the_cost_of_a_method_comes_with_its_error(short, monkeypatch):
    seen = estimating.tracks_of(short, np.arange(50.0), 8)
    moved = estimating.Seen(seen.tracks, seen.path + np.array([3.0, 4.0, 0.0]))
    assert estimating.cost_of(short, "pivot", seen).rmse < 0.1
    assert estimating.cost_of(short, "pivot", moved).rmse == pytest.approx(5.0, abs=0.1)


@pytest.mark.parametrize("density", [0.0, 1e-8])  # m²/s³: 8 cm in two minutes
def test_other_programs_find_the_same_path(short, density):
    part = adjusting.adjusting(short, ((120, 8, 1.0),), density)
    assert part.faults == ()
    assert part.tables[0].row_count == 3  # pivot, with and without process noise, and scipy


@pytest.mark.parametrize("peer", ["scipy", "gtsam"])
def test_another_program_that_disagrees_is_a_fault(short, monkeypatch, peer):
    usual = adjusting.by_scipy

    def broken(problem):
        path, covariance = usual(problem)
        return path + np.array([0.01, 0, 0]), 2 * covariance

    monkeypatch.setattr(adjusting, f"by_{peer}", broken)
    faults = adjusting.adjusting(replace(short, peers=frozenset({"gtsam"} & {peer})), ((120, 8, 1.0),)).faults
    assert [fault.split(":")[1].strip() for fault in faults] == [
        "path, against pivot",
        "predicted error, against pivot's",
    ]


def test_another_density_of_process_noise_is_another_problem(short, monkeypatch):
    usual = adjusting.problem_of
    monkeypatch.setattr(adjusting, "problem_of", lambda *given: usual(*given[:3], 100 * given[3]))
    faults = adjusting.adjusting(short, ((120, 8, 1.0),), 1e-8).faults
    assert any("predicted error, against pivot's" in fault for fault in faults)


def test_tables_that_are_not_read_as_written_are_a_fault(short, monkeypatch):
    assert estimating.reading(short).faults == ()
    usual = FeatureTracks.read_csv

    def broken(path):
        tracks = usual(path)
        return FeatureTracks(tracks.time, tracks.position + 1e-12, tracks.labels, tracks.covariance)

    monkeypatch.setattr(FeatureTracks, "read_csv", broken)
    assert len(estimating.reading(short).faults) == 2


def test_frames_are_timed_and_the_end_is_judged(short, monkeypatch):
    found = flying.flying(short, frames=20)
    assert [row.what.split(",")[0] for row in found.rows] == ["online", "its slowest in a hundred"] * 4 + ["its memory"]
    assert [row.what.endswith("with thrust") for row in found.rows[:-1:2]] == [False, True] * 2
    assert found.rows[-1].measured <= 256 * 1024
    assert found.faults == ()
    monkeypatch.setattr(flying, "SHORT", 20)  # twenty frames show no centre of mass to a centimetre
    (fault,) = flying.flying(short, frames=20).faults
    assert "online, at the end: path" in fault


def test_the_pivot_stage_ends_where_the_tumble_is_known(short):
    """After a turn of Envisat, of some 100 s, and for good."""
    seen = estimating.tracks_of(short, np.arange(150.0), 10)
    still = np.zeros((150, 3))
    taken, known = flying.in_c(short.folder, seen, short.scenario.sensor.noise, short.scenario.orbit, still)
    begin = int(np.argmax(known))
    assert 60 < begin < 130
    assert known[begin:].all()
    assert (taken > 0).all()


def test_what_is_seen_under_thrust_is_where_the_thrust_has_moved_it(envisat):
    """Against both orbits by scipy's DOP853, with thrust that is held from frame to frame.

    An impulse halfway differs by what gravity does to PUSH T²/2 within a step, and so by less than a micrometre a step.
    """
    time = np.arange(60.0)
    still = estimating.Seen(FeatureTracks(time, np.zeros((60, 3, 3)), ("a", "b", "c")), np.zeros((60, 3)))
    seen, push = flying.pushed(still, envisat.orbit)
    r0, v0 = oracles.inertial_states(envisat.orbit, np.zeros(3), np.zeros(3))[0]
    mu, ends = envisat.orbit.gravitational_parameter, []
    for told in (push, np.zeros_like(push)):
        y = np.concatenate([r0, v0]).astype(float)
        for k in range(1, 60):
            step = solve_ivp(
                lambda _, y, a=told[k]: np.concatenate([y[3:], a - mu * y[:3] / np.linalg.norm(y[:3]) ** 3]),
                (0.0, 1.0), y, method="DOP853", rtol=1e-13, atol=1e-9,
            )  # fmt: skip
            y = step.y[:, -1]
        ends.append(y[:3])
    np.testing.assert_allclose(seen.path[-1], ends[1] - ends[0], rtol=0, atol=6e-5)
    np.testing.assert_array_equal(seen.tracks.position[-1], np.tile(seen.path[-1], (3, 1)))

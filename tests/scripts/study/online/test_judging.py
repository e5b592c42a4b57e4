"""Lines and tables of the online study."""

import itertools
import re
from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest

from baryscope.estimator.online import OnlineStatus
from baryscope.models.orbit import EARTH_J2, EARTH_RADIUS
from baryscope.study.online.__main__ import main
from baryscope.study.online.flights import ANY_WHITE, POPULATION, POSSIBLE, flight, world_of
from baryscope.study.online.judging import END, judged
from baryscope.study.online.report import ends, table
from baryscope.study.population.consistency import WRONG, nees
from baryscope.study.world.judging import prepared


@pytest.fixture(scope="module")
def line():
    return judged("as modelled", 3, 0)


def test_a_line_is_beside_its_bound(line):
    assert list(line["marks"]) == ["0.25", "0.5", "1.0", "2.0", "4.0", END]
    bounds = [at["bounds"]["free"] for at in line["marks"].values()]
    assert all(a > b for a, b in itertools.pairwise(bounds))
    for at in line["marks"].values():
        assert at["bounds"]["tumble"] <= at["bounds"]["free"]
    at = line["marks"][END]
    assert at["status"] == "tracking"
    assert at["error"] < 5 * at["bounds"]["free"]
    assert at["nees"] < 25
    assert not line["stray"]


def test_densities_are_those_that_the_bank_holds_possible():
    """One is as likely as what is nearer to it than to others, in the logarithm, is wide."""
    text = (files("baryscope.fmu") / "csrc" / "online" / "bank.c").read_text("utf-8")
    least = re.search(r"#define LEAST_DENSITY (\S+)", text)[1]
    bank = np.log10([float(one) for one in (least, *re.findall(r"\{\.white = ([\d.e-]+)\}", text))])
    assert len(bank) == 12
    ends = (1.5 * bank[0] - 0.5 * bank[1], 1.5 * bank[-1] - 0.5 * bank[-2])
    assert pytest.approx(ends) == POSSIBLE
    found = np.array([np.log10(world_of(ANY_WHITE, 1, draw).white) for draw in range(400)])
    width = POSSIBLE[1] - POSSIBLE[0]
    assert found.mean() == pytest.approx(sum(POSSIBLE) / 2, abs=4 * width / np.sqrt(12 * 400))
    assert POSSIBLE[0] < found.min() < POSSIBLE[0] + 0.02 * width
    assert POSSIBLE[1] > found.max() > POSSIBLE[1] - 0.02 * width


@pytest.mark.parametrize("draw", [135, 161, 209])
def test_a_feature_that_leaves_the_map_takes_nothing_of_the_offset_along(draw):
    """The offset then was that of a part of the map, and grew with the next node: answers were metres off."""
    made = flight(POPULATION, 1, draw)
    last = list(made.states())[-1]
    assert last.status is OnlineStatus.TRACKING
    assert nees(last.position - made.path[-1], last.covariance[:3, :3]) < WRONG


def test_the_causal_bound_at_the_end_is_that_of_all_observations():
    made = flight("as modelled", 3, 0)
    _, bounds = prepared("as modelled", 3, 0)  # rms over the path; the end is less certain than the mean
    assert bounds["free"] < made.causal_bound(len(made.path) - 1, False) < 3 * bounds["free"]


@pytest.mark.parametrize("draw", range(3))
def test_thrust_that_is_logged_is_told(draw):
    """By the path of the same draw without burns: so far the told pushes have moved the chaser, and the target is seen
    to move the other way.

    A push is a mean over a second: of each of up to six edges of burns of up to 3 mm/s² the place is wrong by up to an
    eighth of that. Gravity's gradient, of up to 2 n², makes less than n² T² = 0.4 % of the way in T = 60 s.
    """
    made, free = flight("thrust logged", 3, draw), flight("as modelled", 3, draw)
    time, pushes = made.tracks.time, made.pushes()
    begin = int(np.argmax(pushes.any(axis=1)))
    end = begin + 60
    step = np.diff(time)[:, None]
    speed = np.cumsum(pushes[1:] * step, axis=0)
    way = np.cumsum((np.concatenate([np.zeros((1, 3)), speed[:-1]]) + pushes[1:] * step / 2) * step, axis=0)
    moved = (made.path - free.path)[1:]
    assert np.abs(moved[end - 1]).max() > 0.02
    assert moved[begin : end + 1] == pytest.approx(
        -way[begin : end + 1], abs=6 * 3e-3 / 8 + 0.004 * np.abs(way[end]).max()
    )
    assert not flight("thrust not logged", 3, draw).pushes().any()


def test_j2_that_is_told_is_that_of_the_same_draw():
    told, untold = flight("J2, J2 told", 3, 1), flight("J2", 3, 1)
    assert told.orbit == replace(untold.orbit, j2=EARTH_J2, equatorial_radius=EARTH_RADIUS, accuracy=0.0)
    np.testing.assert_array_equal(told.path, untold.path)
    np.testing.assert_array_equal(told.tracks.position, untold.tracks.position)


def test_methods_beside_the_filter_are_told_logged_thrust():
    """Thrust of up to 90 mm/s that is not told makes of a path centimetres at least; told, a few mm as the filter."""
    end = judged("thrust logged", 3, 0, beside=["pivot"])["marks"][END]
    assert end["beside"]["pivot"] < 4 * end["bounds"]["free"]


def test_a_case_of_the_population_has_its_rotations_and_bounds():
    made = flight(POPULATION, 1, 0)
    assert (np.diff(made.rotations) >= 0).all()
    assert len(made.rotations) == len(made.path)
    line = judged(POPULATION, 1, 0)
    assert line["marks"][END]["bounds"]["tumble"] > 0


@pytest.mark.parametrize(
    "suite, draw, told",
    [("population second, no orbit", 7, False), ("population third", 7, True), ("population third", 1, False)],
)
def test_a_case_of_another_population_is_flown_as_its_suite_says(suite, draw, told):
    """Draw 1 of the third is in a laboratory."""
    assert (flight(suite, 2, draw).orbit is not None) == told
    line = judged(suite, 2, draw)
    assert 0 < line["marks"][END]["bounds"]["free"] < line["marks"]["0.25"]["bounds"]["free"]
    assert table([line]).rows[0][0] == suite


def test_tables_have_a_row_for_each_mark(line, tmp_path, in_process, capsys):
    again = line | {"draw": 1}
    assert len(table([line, again]).rows) == 6
    (row,) = ends([line, again]).rows
    assert row[:4] == ("as modelled", "2", "2", "0")
    path = str(tmp_path / "online.jsonl")
    assert main(["run", "--draws", "1", "--suites", "as modelled", "--beside", "pivot", "-o", path]) == 0
    assert main(["report", path]) == 0
    printed = capsys.readouterr().out
    assert printed.count("| as modelled |") >= 4
    assert "error/pivot" in printed


@pytest.mark.parametrize("draw", [98, 178, 222, 319, 334, 336, 348, 387, 398])
def test_a_case_that_was_confidently_wrong_is_right_or_says_so(draw):
    """Stereo, spins, features that come and go within a node."""
    made = flight("population", 1, draw)
    *_, state = made.states()
    if state.status is OnlineStatus.TRACKING:
        assert nees(state.position - made.path[-1], state.covariance[:3, :3]) < WRONG


def test_where_rounding_leaves_a_small_filter_indefinite_nothing_is_claimed():
    made = flight("population", 11, 387)
    tracking = [state.covariance for state in made.states() if state.status is OnlineStatus.TRACKING]
    size = np.sqrt(np.diagonal(tracking, axis1=1, axis2=2))
    assert (np.linalg.eigvalsh(np.array(tracking) / size[:, :, None] / size[:, None])[:, 0] > 0).all()


def test_an_hour_of_frames_has_a_row(capsys):
    """Six minutes, three and a half rotations."""
    assert main(["endure", "--hours", "0.1", "--rate", "2"]) == 0
    (row,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("| 1 |")]
    _, status, error, claimed, nees, *_ = (cell.strip() for cell in row.strip("|").split("|"))
    assert status == "tracking"
    assert float(error) < 5 * float(claimed) < 50  # mm
    assert float(nees) < 16.3
    with pytest.raises(SystemExit):
        main(["endure", "--hours", "0"])


def test_five_nodes_of_three_features_are_no_claim():
    """Five attitudes, then one or two features for a turn: 1.7 m off at a claim of 0.2 m, and called tracking."""
    made = flight(POPULATION, 31, 21)
    for state, true in zip(made.states(), made.path, strict=True):
        tracking = state.status is OnlineStatus.TRACKING
        assert not tracking or nees(state.position - true, state.covariance[:3, :3]) < WRONG


def test_features_near_a_line_do_not_seem_to_show_the_offset():
    """Of a spin three features near a line are left. About it their attitude is known to 0.15 rad, by which the centre
    of mass, metres away, moves on an arc; taken for a tangent, it was 12 m off at a claim of 0.7 m.
    """
    assert judged("population, no orbit", 31, 56)["wrong"] == 0.0


def test_pulses_that_show_late_do_not_pass_for_an_offset_of_the_map():
    """Of pulses that nobody tells the first turn shows nothing: the map was learnt along a smooth path, and frames up
    to the last, after four turns, were wrong by several times their claim.
    """
    assert judged("population third", 2, 41)["wrong"] == 0.0

"""Draws that a campaign's report flies again: within its seconds, within its bytes, and never its end."""

import json
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from baryscope.models.errors import ComputationError
from baryscope.report import html_of
from baryscope.report.document import Chart, Ghost, Scene, Series, Tabs, Words, data_of
from baryscope.study.campaign import CampaignSummary, begin, flown, plan_of, read_runs, report_of_campaign
from baryscope.study.campaign.flown import usual_seconds, with_draws
from baryscope.study.campaign.folder import RUNS

METHODS = ["screw-gpa", "pivot", "ml"]
FRAMES, FEATURES = 601, 10  # of the suite reach
SIX_MB = 6_000_000


@pytest.fixture(scope="module")
def reach():
    return plan_of(suite="reach", methods=METHODS, draws=3)


@pytest.fixture(scope="module")
def ran(reach, tmp_path_factory):
    return summary_of(tmp_path_factory.mktemp("ran"), reach)


@pytest.fixture(scope="module")
def report(ran):
    """Without draws."""
    return report_of_campaign(ran)


@pytest.fixture(scope="module")
def only_middle(ran):
    """With a single draw of each scenario."""
    return replace(ran, runs=ran.runs.filter(pl.col("case") == 1))


def summary_of(folder, plan, numbers=(0, 1, 2)):
    """Runs whose middle draw is number 1, and the worst for its claim number 2."""
    begin(folder, plan)
    lines = []
    for entry in plan.entries:
        for number in numbers:
            good = {"rmse": 0.001 * (1 + number), "max_error": 0.01, "predicted_rmse": 0.001, "nees": [1.0, 2.0, 3.0]}
            head = {"plan": plan.identity, "seed": plan.seed, "scenario": entry.name, "case": number, "varied": {}}
            walls = {"flight": 0.0, "bound": 0.0, **dict.fromkeys(plan.methods, 1.0)}
            line = {"bound": {"path_rmse": 0.001, "path_rmse_clean": 0.001}, "wall": walls}
            lines.append(json.dumps(head | line | {"methods": dict.fromkeys(plan.methods, good)}) + "\n")
    (folder / RUNS).write_text("".join(lines), encoding="utf-8")
    return CampaignSummary(plan, read_runs(folder, plan))


def parts_like(frames, features, ghosts=4, seed=1):
    """As many numbers as the parts of a flight have: scene, a chart of all errors, and residuals."""
    rng, time = np.random.default_rng(seed), np.arange(float(frames))
    names = tuple(f"feature {k}" for k in range(features))
    curves = tuple(Series(f"method {k}", time, y := rng.random(frames), k, low=y, high=y) for k in range(ghosts))
    places = rng.integers(0, features, 3000)
    residuals = Series("used", rng.uniform(0, frames, 3000), rng.random(3000), style="points", of=places)
    scene = Scene(
        time=time,
        path=rng.random((frames, 3)),
        path_label="truth",
        labels=names,
        features=rng.random((frames, features, 3)),
        state=("1" * features,) * frames,
        faces=np.empty((0, 3), dtype=np.intp),
        ghosts=tuple(Ghost(f"method {k}", k, rng.random((frames, 3)), rng.random((frames, 6))) for k in range(ghosts)),
        attitude=rng.random((frames, 4)),
        orbit=rng.random((frames, 4)),
    )
    each = Tabs("Each", tuple((f"method {k}", (Chart("Axes", "", "mm", curves[:3]),)) for k in range(ghosts)))
    return scene, Chart("Error", "", "mm", curves), Chart("Residuals", "", "mm", (residuals,)), each


class Flights:
    """Stands for the flights: what is asked for, by a clock that only they move on."""

    def __init__(self, patch, parts, took=1.0, fails=()):
        self.flown, self.now, self.took, self.fails = [], 0.0, took, fails
        patch.setattr(flown, "perf_counter", lambda: self.now)
        patch.setattr(flown, "compare", self.compare)
        patch.setattr(flown, "parts_of_comparison", lambda *_: (parts, ("a note",)))
        patch.setattr(flown, "at_hand", lambda: True)
        patch.setattr(flown.Units, "of", lambda *_: "unit.fmu")

    def compare(self, scenario, methods, unit):
        self.now += self.took
        self.flown.append(scenario.name)
        if scenario.name in self.fails:
            raise self.fails[scenario.name]
        return dict.fromkeys(["screw-gpa", "screw-gpa-lvlh", "pivot", "ml"], Outcome())


class Outcome:
    rmse = 0.002


def looks_of(report):
    """The part on the draws of each scenario."""
    (tabs,) = (part for part in report.parts if isinstance(part, Tabs))
    return {name: parts[-1] for name, parts in tabs.choices}


def words_of(look):
    """All that is said of a scenario's draws."""
    some = [look] if isinstance(look, Words) else [parts[0] for _, parts in look.choices]
    return " ".join(line for part in some for line in part.lines)


SMALL = parts_like(20, 4)


def test_all_draws_of_all_scenarios_if_there_is_time(reach, ran, report, monkeypatch):
    """First those in the middle, in the order of the plan; each tab says which draw it is, and how to see others."""
    flights = Flights(monkeypatch, SMALL)
    told = []
    report = with_draws(report, ran, 1000.0, lambda *one: told.append(one))
    names = [entry.name for entry in reach.entries]
    assert flights.flown == names * 2
    for look in looks_of(report).values():
        assert look.title == "A draw of it"
        assert [name for name, _ in look.choices] == ["draw 1, in the middle", "draw 2, the worst for its claim"]
        for number, (_, (words, *parts, code)) in enumerate(look.choices, start=1):
            assert f"SeedSequence([1, {number}])" in " ".join(words.lines)
            assert "a note" in words.lines
            assert [part.title for part in parts] == ["Scene", "Error", "Residuals", "Each"]
            assert f", {number}))" in code.code[4]
    assert "came out otherwise than in the campaign: here screw-gpa" not in words_of(looks_of(report)[names[0]])[:200]
    (work,) = {work for work, _ in told}
    assert [share for _, share in told][:2] == [0.0, pytest.approx(1 / 24)]
    assert told[-1] == (work, 1.0)


@pytest.mark.parametrize(
    ("seconds", "took", "expected"), [(20.0, 3.0, 6), (20.0, 6.0, 3), (5.0, 1.0, 2), (0.0, 1.0, 0)]
)
def test_no_more_is_begun_than_the_time_allows(reach, ran, report, monkeypatch, seconds, took, expected):
    """A draw will take 4 s; if they take longer than that here, the next one will, too."""
    flights = Flights(monkeypatch, SMALL, took)
    wall = (4.0 - 0.5 - 3e-4 * FRAMES) / 4  # of each method
    slow = replace(ran, runs=ran.runs.with_columns(pl.lit(wall).alias("time")))
    report = with_draws(report, slow, seconds)
    looks = list(looks_of(report).values())
    assert len(flights.flown) == expected
    assert flights.now <= max(seconds, took)
    assert [isinstance(look, Tabs) for look in looks] == [True] * expected + [False] * (len(looks) - expected)
    for look in looks[expected:]:
        assert "draw 1 is in the middle" in words_of(look).lower()
        assert "that takes about 4.0 s" in words_of(look)
        assert "baryscope campaign --report --flights " in words_of(look)
        assert "drawn(plan.case(" in look.code[4]
    (tabs,) = (part for part in report.parts if isinstance(part, Tabs))
    assert f"as their tabs say: {reach.entries[expected].name}, " in tabs.about
    assert tabs.about.endswith(f"{reach.entries[-1].name}.")


def test_the_usual_time_grows_with_the_scenarios_up_to_a_minute(reach, monkeypatch):
    monkeypatch.undo()
    one = replace(reach, entries=reach.entries[:1])
    many = replace(reach, entries=reach.entries * 10)
    monkeypatch.setattr(flown, "SECONDS", 6.0)
    monkeypatch.setattr(flown, "FURTHER", 3.0)
    assert [usual_seconds(plan) for plan in (one, reach, many)] == [6.0, 39.0, 60.0]


@pytest.mark.parametrize(
    ("most", "frames", "features", "all_of_them"),
    [(flown.MOST_BYTES, FRAMES, FEATURES, True), (2_000_000, 150, 200, False)],
)
def test_a_page_is_not_larger_than_it_may_be(only_middle, report, monkeypatch, most, frames, features, all_of_them):
    """Less than 6 MB with the shapes of reach; of scenarios with very many features as many as fit."""
    assert flown.MOST_BYTES < SIX_MB
    flights = Flights(monkeypatch, parts_like(frames, features))
    monkeypatch.setattr(flown, "MOST_BYTES", most)
    whole = with_draws(report, only_middle, 1000.0)
    size = len(html_of(whole).encode())
    assert 0.75 * most < size < most
    looks = looks_of(whole)
    seen = {name for name, look in looks.items() if isinstance(look, Tabs)}
    assert (len(seen) == len(looks)) == all_of_them
    assert len(seen) >= 3
    for name, look in looks.items():
        assert name in seen or "has no room for it" in words_of(look)
    assert len(flights.flown) >= len(seen)


def test_a_draw_that_fails_leaves_the_report_whole(reach, only_middle, report, monkeypatch):
    """By its flight, or by what nobody has thought of; the other scenarios have theirs."""
    names = [entry.name for entry in reach.entries]
    Flights(monkeypatch, SMALL, fails={names[0]: ComputationError("no compiler"), names[2]: ZeroDivisionError("oh")})
    looks = looks_of(with_draws(report, only_middle, 1000.0))
    assert "It could not be flown again here: no compiler." in words_of(looks[names[0]])
    assert "It could not be flown again here: internal error, ZeroDivisionError: oh." in words_of(looks[names[2]])
    assert sum(isinstance(look, Tabs) for look in looks.values()) == len(names) - 2


def test_the_online_estimator_is_not_compiled_for_it(only_middle, report, monkeypatch):
    """That takes a minute."""
    told = []
    Flights(monkeypatch, SMALL)
    monkeypatch.setattr(flown, "parts_of_comparison", lambda _, no_online: told.append(no_online) or (SMALL, ()))
    with_draws(report, only_middle, 5.0)
    monkeypatch.setattr(flown, "at_hand", lambda: False)
    with_draws(report, only_middle, 5.0)
    assert [bool(one) for one in told] == [False, True]
    assert "not compiled yet" in told[1]


def test_a_unit_that_cannot_be_built_leaves_the_report_whole(ran, report, monkeypatch):
    flights = Flights(monkeypatch, SMALL)

    def broken(*_):
        raise ComputationError("cc: not found")

    monkeypatch.setattr(flown.Units, "of", broken)
    looks = looks_of(with_draws(report, ran, 1000.0))
    assert all("It could not be flown again here: cc: not found." in words_of(look) for look in looks.values())
    assert flights.flown == []


def test_an_interrupt_is_one(reach, ran, report, monkeypatch):
    Flights(monkeypatch, SMALL, fails={reach.entries[1].name: KeyboardInterrupt()})
    with pytest.raises(KeyboardInterrupt):
        with_draws(report, ran, 1000.0)


def test_runs_of_another_program_are_not_flown_by_this_one(reach, ran, report, monkeypatch):
    flights = Flights(monkeypatch, SMALL)
    older = replace(ran, plan=replace(reach, program="of yesterday"))
    looks = looks_of(with_draws(report, older, 1000.0))
    assert flights.flown == []
    for look in looks.values():
        assert "Draw 1 is in the middle" in words_of(look)
        assert "of another program (baryscope " in words_of(look)
        assert ", of yesterday) than this one (" in words_of(look)


def test_a_draw_that_comes_out_otherwise_says_so(only_middle, report, monkeypatch):
    """Its error in the campaign is 2 mm; here it is 2.1 mm."""
    Flights(monkeypatch, SMALL)
    same = looks_of(with_draws(report, only_middle, 1000.0))
    monkeypatch.setattr(Outcome, "rmse", 0.0021)
    other = looks_of(with_draws(report, only_middle, 1000.0))
    words = "It came out otherwise than in the campaign: here screw-gpa has an RMSE of 2.1 mm."
    assert not any(words[:43] in words_of(look) for look in same.values())
    assert all(words in words_of(look) for look in other.values())


def test_a_campaign_that_goes_on_has_the_draws_so_far(ran, monkeypatch):
    """A scenario without runs has no tab."""
    flights = Flights(monkeypatch, SMALL)
    few = replace(ran, runs=ran.runs.filter((pl.col("scenario") == "slow-vbar") & (pl.col("case") < 2)))
    report = with_draws(report_of_campaign(few), few, 1000.0)
    assert flights.flown == ["slow-vbar"] * 2
    ((_, parts),) = next(part for part in data_of(report)["parts"] if part["kind"] == "tabs")["choices"]
    assert [name for name, _ in parts[-1]["choices"]] == ["draw 0, in the middle", "draw 1, the worst for its claim"]

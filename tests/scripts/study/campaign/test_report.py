"""The numbers of a campaign's tables, from runs with errors that are known."""

import json
from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from scipy.stats import chi2

from baryscope.report.document import data_of
from baryscope.scripts.cli import app
from baryscope.study.campaign import CampaignSummary, begin, plan_of, read_runs, report_of_campaign
from baryscope.study.campaign.folder import RUNS
from baryscope.study.campaign.statistics import bound_of, nees_band, remarks, rows_of
from malformed import GOOD_SCENARIO


@pytest.fixture
def plan(tmp_path):
    path = tmp_path / "small.toml"
    path.write_text(GOOD_SCENARIO, encoding="utf-8")
    return plan_of([str(path)], methods=["screw-gpa", "pivot"], draws=4, seed=3)


def synthetic(folder, plan, errors):
    """Runs of errors (m) at a bound of 1, 2, 3, … mm; NEES 1, 2, 3 times the number of the draw."""
    begin(folder, plan, restart=False)
    lines = []
    for number, error in enumerate(errors):
        path = 0.001 * (number + 1)
        good = {"rmse": error, "max_error": 0.1, "predicted_rmse": 0.002, "trustworthy": number != 2}
        nees = {"nees": [number + 1.0, 2 * number + 2.0, 3 * number + 3.0], "body_error": 0.1, "body_nees": 4.0}
        lossy = {"path_rmse": 2 * path, "path_rmse_clean": path, "verdict": "observable: ±1 m"}
        pivot = {"failure": "too little turns"} if error is None else good | nees
        gpa = good | {"rmse": 1.0, "predicted_rmse": None, "nees": None, "trustworthy": None}
        methods = {"screw-gpa": gpa, "screw-gpa-lvlh": gpa, "pivot": pivot}
        wall = {"flight": 0.1, "bound": 0.1, **dict.fromkeys(methods, number + 1.0)}
        head = {"plan": plan.identity, "seed": plan.seed, "scenario": "small", "case": number, "varied": {}}
        lines.append(head | {"bound": lossy, "methods": methods, "wall": wall})
    (folder / RUNS).write_text("".join(json.dumps(line) + "\n" for line in lines), encoding="utf-8")
    return read_runs(folder, plan)


@pytest.fixture
def targeted(plan):
    return replace(plan, entries=(replace(plan.entries[0], targets={"pivot": 1.25}),))


def test_the_rows_are_those_of_a_calculation_by_hand(targeted, tmp_path):
    """e² = 4, 9, 16 and b² = 1, 4, 9 mm²: r² = 29/14; e² − r² b² = 27/14, 10/14, −37/14, whose mean is 0."""
    runs = synthetic(tmp_path / "s", targeted, [0.002, 0.003, 0.004, None])
    gpa, _, pivot = rows_of(targeted.entries[0], targeted, runs)
    assert pivot.rmse == pytest.approx(np.sqrt(29 / 3) * 1e-3)
    assert pivot.predicted_rmse == pytest.approx(0.002)
    assert pivot.ratio == pytest.approx(np.sqrt(29 / 14))
    deviation = np.sqrt((27**2 + 10**2 + 37**2) / 14**2 / 2)  # sample standard deviation of the three
    assert pivot.ratio_error == pytest.approx(deviation / np.sqrt(3) / (14 / 3) / (2 * np.sqrt(29 / 14)))
    assert pivot.nees == pytest.approx((2, 4, 6))
    assert pivot.body_nees == pytest.approx(4)
    assert (pivot.draws, pivot.failed, pivot.announced, pivot.time) == (4, 1, 1, 2.0)
    assert (pivot.target, pivot.reached) == (1.25, False)
    assert gpa.ratio == pytest.approx(np.sqrt(4 / 30e-6))
    assert (gpa.predicted_rmse, gpa.nees, gpa.reached, gpa.announced) == (None, (None, None, None), None, 0)
    assert bound_of(targeted.entries[0], runs) == pytest.approx((np.sqrt(30 / 4) * 1e-3, np.sqrt(30) * 1e-3))


def test_the_standard_error_of_the_ratio_is_what_repeated_campaigns_scatter_by(plan, tmp_path):
    """Against 2000 campaigns of 50 draws with errors of known spread."""
    rng = np.random.default_rng(1)
    b = 1 + rng.random((2000, 50))
    e = 1.1 * b * np.sqrt(chi2.rvs(3, size=b.shape, random_state=rng) / 3)
    scatter = np.std(np.sqrt((e**2).mean(axis=1) / (b**2).mean(axis=1)))
    many = replace(plan, draws=50)
    runs = synthetic(tmp_path / "s", many, e[0])
    runs = runs.with_columns(pl.Series("bound", b[0])[pl.Series(range(50)).repeat_by(3).explode()].alias("bound"))
    row = rows_of(many.entries[0], many, runs)[2]
    assert row.ratio == pytest.approx(1.1, abs=4 * scatter)
    assert row.ratio_error == pytest.approx(scatter, rel=0.35)


def test_the_band_of_nees_is_the_published_one():
    """Bar-Shalom, Li and Kirubarajan 2001, section 5.4.2: for 50 runs of 2 degrees of freedom 1.5 to 2.6; here of 3."""
    assert nees_band(50) == pytest.approx((117.985 / 50, 185.800 / 50), abs=1e-4)  # χ²₁₅₀ of 2.5 and 97.5 %, tables


def test_draws_to_look_at_are_named(plan, tmp_path):
    runs = synthetic(tmp_path / "s", plan, [0.002, 0.010, 0.003, None])
    found = [(one.case, one.method, one.text) for one in remarks(runs)[1]]
    assert found == [
        (1, "pivot", "5.0 × CRB"),
        (2, "pivot", "was announced"),
        (3, "pivot", "failed: too little turns"),
    ]


def test_the_report_has_the_tables_and_the_distributions(targeted, tmp_path):
    """Of four draws of pivot one failed: three quarters have an error at most the largest."""
    runs = synthetic(tmp_path / "s", targeted, [0.002, 0.003, 0.004, None])
    data = data_of(report_of_campaign(CampaignSummary(targeted, runs)))
    sheet, tabs, words, options = data["parts"]
    assert [row[:3] for row in sheet["rows"]][2] == ["small", "pivot", "3.109"]
    assert words["lines"][-1] == "small 3, pivot: failed: too little turns"
    assert ["methods", "screw-gpa, screw-gpa-lvlh, pivot"] in options["items"]
    ((name, (_, errors, nees)),) = tabs["choices"]
    assert name == "small"
    pivot = next(one for one in errors["series"] if one["label"] == "pivot")
    assert pivot["x"] == [2, 2, 3, 3, 4, 4]
    assert pivot["y"] == [0, 0.25, 0.25, 0.5, 0.5, 0.75]
    pivot, expected = nees["series"]
    assert pivot["x"] == [2, 2, 4, 4, 6, 6]
    assert np.interp(2.366, expected["x"], expected["y"]) == pytest.approx(0.5, abs=1e-3)  # the median


def test_if_nothing_could_be_done_that_is_an_error(plan, tmp_path, capsys):
    few = replace(plan, methods=("pivot",))
    begin(tmp_path, few, restart=False)
    failed = {"plan": few.identity, "scenario": "small", "case": 1, "bound": {}, "wall": {}}
    failed |= {"methods": {"pivot": {"failure": "too dark"}}}
    (tmp_path / RUNS).write_text(json.dumps(failed) + "\n", encoding="utf-8")
    assert app.main(["campaign", "--report", "-o", str(tmp_path)]) == 1
    assert "no run gave a result; the first says: too dark" in capsys.readouterr().err
    assert "pivot: failed: too dark" in (tmp_path / "summary.md").read_text(encoding="utf-8")


def test_the_tables_fit_and_mark_what_is_out_of_bounds(targeted, tmp_path, capsys):
    synthetic(tmp_path / "s", targeted, [0.002, 0.003, 0.004, None])
    assert app.main(["campaign", "--report", "-o", str(tmp_path / "s")]) == 0
    printed = capsys.readouterr().out
    table, notes = printed.split("NEES should be 3")
    assert max(map(len, table.splitlines())) <= 80
    assert "remarks on single draws: 2, see summary.md" in notes
    assert "CRB in mm, time in s" in table
    assert "fail: draws without a result, + those announced" in table
    line = next(line for line in printed.splitlines() if line.lstrip().startswith("pivot"))
    assert " ".join(line.split()) == "pivot 3.109 2.000 1.439 0.102 1.25 no 2.00 4.00 6.00 4.00 1+1 2.00"
    text = (tmp_path / "s" / "summary.md").read_text(encoding="utf-8")
    assert "| pivot | 3.109 | 2.000 | 1.439 | 0.102 | 1.25 no | 2.00 |" in text
    assert f"{targeted.command}\n" in text
    assert "- small 3, pivot: failed: too little turns" in text

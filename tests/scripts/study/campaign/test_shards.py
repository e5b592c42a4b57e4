"""Shards: which draws they have, how they come together, and when they refuse to. The lines are written as runs are."""

import json
from dataclasses import replace
from pathlib import Path
from shutil import copytree

import numpy as np
import pandas as pd
import polars as pl
import pytest

from baryscope.models.errors import InputError
from baryscope.report.document import data_of
from baryscope.report.page import html_of
from baryscope.scripts.cli import app
from baryscope.study.campaign import (
    CampaignSummary,
    begin,
    mended,
    merge,
    plan_of,
    read_plan,
    read_runs,
    report_of_campaign,
    shard_of,
)
from baryscope.study.campaign.folder import RUNS, RunFile
from malformed import GOOD_SCENARIO

DRAWS, SHARDS = 400, 3
LOW, HIGH = 0.01, 0.1  # of the noise


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    path = tmp_path_factory.mktemp("shards") / "small.toml"
    path.write_text(GOOD_SCENARIO, encoding="utf-8")
    return plan_of([str(path)], methods=["pivot", "ml"], draws=DRAWS, vary=[f"sensor.noise={LOW}:{HIGH}:log"])


def line_of(plan, number):
    """A run whose error is 0.1 of the noise, up to a tenth more for later draws; ml fails for large noise."""
    ((field, noise),) = plan.case("small", number).values
    rmse = 0.1 * noise * (1 + 0.1 * number / DRAWS)
    good = {"rmse": rmse, "max_error": 2 * rmse, "predicted_rmse": rmse, "nees": [2.0, 3.0, 4.0], "trustworthy": True}
    good |= {"rejected_share": 0.0, "body_error": rmse, "body_nees": 3.0}
    bad = {"failure": "too dark"} if noise > 0.05 else good
    bound = {"path_rmse": 0.09 * noise, "path_rmse_clean": 0.09 * noise, "body_rmse": 0.09, "verdict": "observable"}
    head = {"plan": plan.identity, "seed": plan.seed, "scenario": "small", "case": number, "varied": {field: noise}}
    wall = {"flight": 0.1, "bound": 0.1, "pivot": 0.2, "ml": 0.4}
    return head | {"bound": bound, "methods": {"pivot": good, "ml": bad}, "wall": wall}


def written(folder, plan, numbers):
    begin(folder, plan)
    with RunFile(folder) as file:
        for number in numbers:
            file.append(line_of(plan, number))
    return folder


@pytest.fixture(scope="module")
def shards(plan, tmp_path_factory):
    """The folders of all shards."""
    folder = tmp_path_factory.mktemp("folders")
    none = np.zeros(DRAWS, dtype=bool)
    parts = [shard_of(f"{k}/{SHARDS}").numbers(DRAWS, none) for k in range(1, SHARDS + 1)]
    assert sorted(number for part in parts for number in part) == list(range(DRAWS))
    return [written(folder / str(k), plan, numbers) for k, numbers in enumerate(parts)]


@pytest.fixture(scope="module")
def merged(shards, tmp_path_factory):
    """All shards in a folder, the runs of the second one twice."""
    folder = tmp_path_factory.mktemp("merged") / "all"
    again = copytree(shards[1], folder.parent / "again")
    assert app.main(["campaign", "merge", *map(str, [*shards, again]), "-o", str(folder), "-q"]) == 0
    return folder


def test_merged_shards_are_the_campaign(merged, plan):
    lines = [json.loads(line) for line in (merged / RUNS).read_text(encoding="utf-8").splitlines()]
    assert sorted(lines, key=lambda line: line["case"]) == [line_of(plan, number) for number in range(DRAWS)]
    assert read_plan(merged) == plan
    assert mended(merged, plan).of("small").all()


def test_pandas_and_polars_read_what_is_written(merged, plan):
    """The lines as they are, and the table, in which a method that failed has no numbers."""
    lines = pd.read_json(merged / RUNS, lines=True)
    assert len(lines) == DRAWS
    noise = pd.json_normalize(lines["varied"])["sensor.noise"]
    errors = pd.json_normalize(lines["methods"])["pivot.rmse"]
    np.testing.assert_allclose(errors, 0.1 * noise * (1 + 0.1 * lines["case"] / DRAWS))
    table = read_runs(merged, plan)
    assert table.columns[:4] == ["scenario", "case", "method", "rmse"]
    assert len(table) == 2 * DRAWS
    failed = table.filter(pl.col("failure").is_not_null())
    assert set(failed["method"]) == {"ml"}
    assert failed["sensor.noise"].min() > 0.05
    assert failed["rmse"].is_null().all()
    stored = pl.read_parquet(merged / "runs.parquet")
    assert stored.rows() == table.with_columns(pl.col("scenario", "method").cast(pl.String)).rows()


def test_the_report_shows_the_error_over_what_varies(merged, plan):
    """Quantiles of errors that are known, in equal parts; a file that does not grow with the draws."""
    report = report_of_campaign(CampaignSummary(plan, read_runs(merged, plan)))
    ((_, parts),) = data_of(report)["parts"][1]["choices"]
    ((field, charts),) = parts[-1]["choices"]
    assert field == "sensor.noise"
    charts = {part["title"]: part for part in charts}
    error = charts["Error against sensor.noise"]
    assert (error["log"], error["log_x"], error["x_label"]) == (True, True, "sensor.noise in m")
    series = {one["label"]: one for one in error["series"]}
    assert set(series) == {"pivot", "pivot, draws", "ml", "ml, draws", "Cramér–Rao bound"}
    pivot = series["pivot"]
    assert len(pivot["x"]) == DRAWS // 20
    assert all(np.diff(pivot["x"]) > 0)
    step = (HIGH / LOW) ** (20 / DRAWS)  # of the noise over a part
    for x, y, low, high in zip(*(pivot[name] for name in ("x", "y", "low", "high")), strict=True):
        assert 100 * x / 1.001 < y < 110 * x * 1.001
        assert 100 * x / step < low < y < high < 110 * x * step
    np.testing.assert_allclose(series["Cramér–Rao bound"]["y"], 90 * np.array(pivot["x"]), rtol=1e-3)
    assert charts["NEES against sensor.noise"]["series"][0]["y"] == [3] * len(pivot["x"])
    lost = {one["label"]: one for one in charts["Without a trusted result, against sensor.noise"]["series"]}
    assert set(lost["pivot"]["y"]) == {0}
    assert [y for x, y in zip(lost["ml"]["x"], lost["ml"]["y"], strict=True) if x > 0.056] == [1] * 5
    assert len(html_of(report)) < 250_000


def changed(folder, target, change):
    """A copy of a shard's folder with another header."""
    target.mkdir()
    header = json.loads((folder / "campaign.json").read_text(encoding="utf-8"))
    (target / "campaign.json").write_text(json.dumps(header | change), encoding="utf-8")
    (target / RUNS).write_bytes((folder / RUNS).read_bytes())
    return target


@pytest.mark.parametrize("change, words", [
    ({"seed": 2}, "holds a campaign with seed 2, expected 1 as in"),
    ({"program": "of yesterday"}, "holds a campaign with program of yesterday, expected"),
    ({"methods": ["pivot"]}, "holds a campaign with methods pivot, expected pivot,ml as in"),
    ({"draws": 200}, "holds a campaign with draws 200, expected 400 as in"),
])  # fmt: skip
def test_shards_of_other_plans_refuse_to_merge(shards, tmp_path, capsys, change, words):
    other = changed(shards[1], tmp_path / "other", change)
    assert app.main(["campaign", "merge", str(shards[0]), str(other), "-o", str(tmp_path / "all")]) == 2
    error = capsys.readouterr().err
    assert f"{other}: {words}" in error
    assert error.count("\n") == 1
    assert not (tmp_path / "all").exists()


def test_files_of_different_seeds_refuse_to_be_joined_by_hand(shards, plan, tmp_path):
    """Nothing of it is dropped silently: the line says of which seed it is."""
    other = written(tmp_path / "other", replace(plan, seed=2), range(3))
    joined = changed(shards[0], tmp_path / "joined", {})
    count = (joined / RUNS).read_bytes().count(b"\n")
    with (joined / RUNS).open("ab") as stream:
        stream.write((other / RUNS).read_bytes())
    with pytest.raises(InputError, match=rf"line {count + 1} is of another plan \(\w+, seed 2\), expected .*seed 1"):
        read_runs(joined)


def test_a_folder_that_is_named_twice_is_refused(shards, tmp_path, capsys, monkeypatch):
    """Whoever names shard 1 twice means shard 2, whose runs would be missing. By any of its names."""
    monkeypatch.chdir(shards[0].parent)
    for again in (str(shards[0]), f"./{shards[0].name}"):
        folders = [str(shards[0]), str(shards[1]), again]
        assert app.main(["campaign", "merge", *folders, "-o", str(tmp_path / "all")]) == 2
        assert f"merge: found {Path(again)} twice, expected each folder once" in capsys.readouterr().err
    assert not (tmp_path / "all").exists()


def test_a_draw_that_came_out_twice_differently_is_refused(shards, plan, tmp_path):
    """But for wall times, equal draws have equal lines; those that differ are of different machines or programs."""
    run = line_of(plan, 0)
    for number, (part, value) in enumerate((("wall", {"pivot": 9.0}), ("bound", {"path_rmse": 9.0}))):
        other = changed(shards[0], tmp_path / f"other{number}", {})
        with RunFile(other) as file:
            file.append(run | {part: run[part] | value})
        if part == "wall":
            assert len(read_runs(other, plan)) == 2 * len(shard_of(f"1/{SHARDS}").numbers(DRAWS, np.zeros(DRAWS, bool)))
        else:
            with pytest.raises(InputError, match="is of small, draw 0, and differs from a line above; expected each"):
                read_runs(other, plan)


def test_merging_needs_a_new_folder_and_two_others(shards, merged, tmp_path):
    with pytest.raises(InputError, match="is there already, expected a new folder"):
        merge(shards, merged)
    with pytest.raises(InputError, match="found 1 folder, expected at least two"):
        merge(shards[:1], tmp_path / "all")
    with pytest.raises(InputError, match="expected the header of a campaign"):
        merge([shards[0], tmp_path], tmp_path / "all")


@pytest.mark.parametrize("text", ["0/3", "4/3", "3", "a/b", "1/0", "-1/3"])
def test_what_is_no_shard(text, tmp_path, capsys):
    assert app.main(["campaign", f"--shard={text}", "-o", str(tmp_path / "none")]) == 2
    assert f"shard: found {text!r}, expected K/N with K from 1 to N, such as 3/8" in capsys.readouterr().err

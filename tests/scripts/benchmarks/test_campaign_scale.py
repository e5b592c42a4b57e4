"""The campaign of many lines on which the report is measured has the runs that it was made of."""

import json

import pytest

from baryscope.models.errors import InputError
from baryscope.scripts.benchmarks.campaign_scale import Cost, multiplied, table_of
from baryscope.study.campaign import begin, plan_of, read_runs
from baryscope.study.campaign.folder import RUNS


def test_runs_are_written_again_as_those_of_other_draws(tmp_path):
    plan = begin(tmp_path / "few", plan_of(["envisat"], methods=["pivot"], draws=2, vary=["sensor.noise=0.01:0.02"]))
    (tmp_path / "few" / RUNS).touch()
    with pytest.raises(InputError, match="found 1 scenarios and 0 runs"):
        multiplied(tmp_path / "few", tmp_path / "none", 5)
    for number, failure in enumerate(("too dark", "too bright")):
        run = {"plan": plan.identity, "seed": 1, "scenario": "envisat", "case": number, "varied": {}, "bound": {}}
        run |= {"methods": {"pivot": {"failure": failure}}, "wall": {}}
        with (tmp_path / "few" / RUNS).open("a") as stream:
            stream.write(json.dumps(run) + "\n")
    assert multiplied(tmp_path / "few", tmp_path / "many", 5) > 0
    table = read_runs(tmp_path / "many")
    assert table["failure"].to_list() == ["too dark", "too bright", "too dark", "too bright", "too dark"]
    assert table["sensor.noise"].is_between(0.01, 0.02).all()
    assert table["sensor.noise"].n_unique() == 5


def test_the_table_has_a_row_for_each_number_of_lines():
    table = table_of([Cost(1000, 0.0005, 1.25, 2.5, 300_000_000, (12_000_000, 3_000_000, 290_000))])
    assert table.rows == (("1000", "0.50", "1.2", "2.5", "300", "12.00", "3.00", "0.29"),)

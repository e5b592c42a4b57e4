"""What a campaign is to run: options, suites, headers."""

import json

import numpy as np
import pytest

from baryscope.models.errors import InputError
from baryscope.models.scenario import Scenario
from baryscope.scripts.cli import app
from baryscope.study.campaign import Plan, plan_of
from baryscope.study.campaign.suite import read_suite
from malformed import GOOD_SCENARIO


@pytest.fixture
def plan(tmp_path):
    path = tmp_path / "small.toml"
    path.write_text(GOOD_SCENARIO, encoding="utf-8")
    return plan_of([str(path)], methods=["screw-gpa", "pivot"], draws=4, seed=3)


@pytest.mark.parametrize("arguments, words", [
    (["--draws", "0"], "draws: found 0, expected at least 1"),
    (["--workers", "0"], "--workers: found 0, expected at least 1"),
    (["--seed", "-1"], "seed: found -1, expected at least 0"),
    (["--vary", "colour"], "vary: found 'colour', expected none or some of attitude, anomaly"),
    (["--methods", "magic"], "methods: found 'magic'"),
    (["--scenario", "mir"], "'mir': not a preset"),
    (["--scenario", "envisat", "envisat"], "'envisat': stands 2 times"),
    (["--suite", "grasp"], "suite 'grasp': not known, expected one of ranges, reach or a FILE.toml"),
    (["--suite", "reach", "--scenario", "envisat"], "'envisat', expected some of the suite's fast-vbar, fast-ellipse"),
    (["--suite", "reach", "--scenario", "fast-vbar", "fast-vbar"], "'fast-vbar': stands 2 times"),
    (["--report", "--restart"], "--report: found beside --restart"),
    (["--workers", "2", "--scheduler", "tcp://a:1"], "--workers: found beside --scheduler, expected one of them"),
    (["--report", "-o", "nowhere"], "expected the header of a campaign"),
])  # fmt: skip
def test_wrong_arguments(tmp_path, monkeypatch, capsys, arguments, words):
    monkeypatch.chdir(tmp_path)
    assert app.main(["campaign", *arguments]) == 2
    assert words in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_the_reach_suite_is_what_it_says():
    suite = read_suite("reach")
    assert suite.methods == ("screw-gpa", "pivot", "ml")
    assert (suite.draws, suite.seed, suite.vary) == (None, None, None)
    scenarios = {entry.name: Scenario.parse(entry.data, entry.name) for entry in suite.entries}
    assert len(scenarios) == 12
    for name, scenario in scenarios.items():
        rate = np.linalg.norm(scenario.target.angular_rate_deg)
        assert rate == pytest.approx(3.5 if name.startswith("fast") else 1.2, rel=2e-3)
        assert (scenario.duration, len(scenario.features.points)) == (600, 10)
        assert np.linalg.norm([point.position for point in scenario.features.points], axis=1).max() < 8
        assert np.linalg.norm(scenario.chaser.position) == 20
    assert scenarios["fast-stereo"].sensor.stereo is not None
    assert scenarios["slow-outliers-30"].sensor.outliers.share == 0.3
    assert all(entry.targets["ml"] in (1.05, 1.08, 1.2, 2.0) for entry in suite.entries)


@pytest.mark.parametrize("text, words", [
    ("scenarios = []\nbase = {}", "scenarios: found a list of 0"),
    ("base = {}\n[[scenarios]]\nname = 'a b'", "scenarios[0].name"),
    ("base = {}\n[[scenarios]]\nname = 'a'", "scenario a: target: missing"),
    ("[[scenarios]]\nname = 'a'", "base: missing"),
    ("base = 1", "base: found 1, expected the tables of a scenario, a preset's name or a FILE.toml"),
    ("base = 'mir'", "base: scenario 'mir': not a preset"),
    ("base = 'envisat'\ndraws = 0", "draws: found 0, expected a value of at least 1"),
    ("base = 'envisat'\nvary = { sensor = { noise = 0.1 } }", "vary.sensor.noise: found 0.1, expected [LOW, HIGH] or"),
    ("base = 'envisat'\nvary = { sensor.noise = [0.1, 'far'] }", "vary.sensor.noise: found [0.1, far], expected two"),
    ("base = 'envisat'\nvary = { attitude = 1 }", "vary.attitude: found 1, expected true or false"),
    ("x = [", "expected a suite of scenarios in TOML"),
])  # fmt: skip
def test_a_suite_that_is_wrong(tmp_path, text, words):
    path = tmp_path / "mine.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as refusal:
        read_suite(str(path))
    assert words in str(refusal.value)
    assert str(path) in str(refusal.value)


def test_some_of_a_suite():
    plan = plan_of(["slow-vbar", "fast-stereo"], "reach", draws=2, vary=["attitude"])
    assert [entry.name for entry in plan.entries] == ["slow-vbar", "fast-stereo"]
    command = "baryscope campaign --suite reach --scenario slow-vbar fast-stereo --methods screw-gpa,pivot,ml"
    assert plan.command == f"{command} --draws 2 --seed 1 --vary attitude"


def test_a_plan_survives_its_header(plan, tmp_path):
    header = json.loads(json.dumps(plan.header()))
    assert Plan.of_header(header, tmp_path) == plan

"""A small campaign: four draws of a body that is seen for 60 s."""

import pytest

from baryscope.fmu import build_fmu
from baryscope.models.scenario import load_scenario
from baryscope.study.campaign import plan_of
from malformed import GOOD_SCENARIO


@pytest.fixture(scope="module")
def scenario_file(tmp_path_factory):
    """A small body whose features are all seen for 60 s, a tenth of them wrong."""
    head, rest = GOOD_SCENARIO.split("[tracking]")
    sensor = rest[rest.index("[sensor]") :].replace("duration = 100.0", "duration = 60.0")
    text = head + sensor.replace("noise = 0.02", "noise = 0.02\noutliers = { share = 0.1 }")
    path = tmp_path_factory.mktemp("scenario") / "small.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def unit(scenario_file, tmp_path_factory):
    return build_fmu(load_scenario(str(scenario_file)), tmp_path_factory.mktemp("unit") / "unit.fmu")


@pytest.fixture(scope="module")
def plan(scenario_file):
    return plan_of([str(scenario_file)], methods=["screw-gpa", "pivot"], draws=4, seed=3)

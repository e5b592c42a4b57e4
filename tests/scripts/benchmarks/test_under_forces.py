"""The unit under all forces against a flight that Basilisk flew, recorded in basilisk.json."""

from pathlib import Path

import pytest

from baryscope.models.scenario import load_scenario
from baryscope.scripts.benchmarks import under_forces
from baryscope.scripts.benchmarks.report import Part
from baryscope.scripts.benchmarks.setting import Setting
from baryscope.scripts.benchmarks.under_forces import DURATION, OFF, State

RECORDED = Path(__file__).parent / "basilisk.json"  # by under_forces.py, as it says


@pytest.fixture
def setting(tmp_path):
    return Setting(load_scenario("envisat"), tmp_path / "unused.fmu", tmp_path, peers=frozenset({"basilisk"}))


@pytest.fixture
def recorded(monkeypatch):
    """The end of Basilisk's flight, which stands in for Basilisk."""
    end = State.parsed(RECORDED.read_text())
    monkeypatch.setattr(under_forces, "basilisk_flight", lambda scenario, start: end)
    return end


def test_the_unit_ends_where_basilisk_does_and_only_with_every_force(setting, recorded):
    """Within 1 mm and 1e-7 rad; a force that is left out moves or turns by over a hundred times as much."""
    found = under_forces.under_forces(setting)
    assert found.faults == ()
    assert found.tables[0].row_count == 1 + len(OFF)
    assert f'"duration": {DURATION}' in RECORDED.read_text()


def test_another_end_is_a_fault(setting, recorded):
    recorded.place[0, 0] += 2e-3
    faults = under_forces.under_forces(setting).faults
    assert [fault.split(":")[0] for fault in faults] == ["the unit under forces, against Basilisk"]


def test_without_basilisk_there_is_nothing_to_compare(tmp_path):
    assert under_forces.under_forces(Setting(load_scenario("envisat"), tmp_path / "unused.fmu", tmp_path)) == Part()

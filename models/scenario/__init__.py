"""Scenario and orbit files: their tables, presets and error messages.

Start with `load_scenario("envisat")`. Angles in files are in degrees; `Scenario.orbit` is in SI units.
"""

from baryscope.models.scenario.forces import Drag, EddyCurrents, Light
from baryscope.models.scenario.loading import load_scenario, preset_names, scenario_path
from baryscope.models.scenario.orbit import OrbitTable, load_orbit, orbit_text, write_orbit
from baryscope.models.scenario.scenario import Scenario
from baryscope.models.scenario.schema import FileModel, read_toml
from baryscope.models.scenario.tables import (
    Chaser,
    FeaturePoint,
    Features,
    Interval,
    Outliers,
    Run,
    Sensor,
    StereoRig,
    Target,
    Tracking,
)

__all__ = [
    "Chaser",
    "Drag",
    "EddyCurrents",
    "FeaturePoint",
    "Features",
    "FileModel",
    "Interval",
    "Light",
    "OrbitTable",
    "Outliers",
    "Run",
    "Scenario",
    "Sensor",
    "StereoRig",
    "Target",
    "Tracking",
    "load_orbit",
    "load_scenario",
    "orbit_text",
    "preset_names",
    "read_toml",
    "scenario_path",
    "write_orbit",
]

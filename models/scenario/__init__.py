"""What is flown: scenario and orbit files as pydantic reads them, the presets that come along, and their messages.

`load_scenario("envisat")` is where a user starts. The files hold the units that people write, degrees among them.
"""

from baryscope.models.scenario.loading import load_scenario, preset_names
from baryscope.models.scenario.orbit import OrbitTable, load_orbit, write_orbit
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
    "FeaturePoint",
    "Features",
    "FileModel",
    "Interval",
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
    "preset_names",
    "read_toml",
    "write_orbit",
]

"""The units that fly the scenarios of a campaign."""

from pathlib import Path

from baryscope.models.scenario import Scenario
from baryscope.progress import Progress
from baryscope.study.campaign.suite import Entry
from baryscope.study.flight import build_unit


class Units:
    """Units in a folder, each built when it is asked for; scenarios that differ in numbers alone share one."""

    def __init__(self, folder: Path, progress: Progress | None = None) -> None:
        self._folder, self._progress = folder, progress
        self._built: dict[object, Path] = {}

    def of(self, entry: Entry) -> str:
        """The unit for a scenario and for its draws.

        Raises:
            ComputationError: it cannot be built.
        """
        scenario = Scenario.parse(entry.data, entry.name)  # not a draw: its numbers are compiled into the unit
        kind = (len(scenario.features.points), scenario.forces)
        if kind not in self._built:
            self._built[kind] = build_unit(scenario, self._folder / f"{len(self._built)}.fmu", self._progress)
        return str(self._built[kind])

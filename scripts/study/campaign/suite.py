"""Suites: files of scenarios that have most in common, and what their methods should reach."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

from pydantic import Field

from baryscope.models.errors import InputError
from baryscope.models.files import AnyPath
from baryscope.models.scenario import FileModel, Scenario, read_toml
from baryscope.study.flight import scenario_of

USUAL_METHODS = ("screw-gpa", "pivot", "ml")


class SuiteScenario(FileModel):
    """[[scenarios]]: one of a suite: the base with some fields changed; targets are RMSE/CRB at most, by method."""

    name: str = Field(pattern=r"^[\w.-]+$")
    description: str = ""
    targets: dict[str, float] = Field(default_factory=dict)
    change: dict[str, Any] = Field(default_factory=dict)


class Suite(FileModel):
    """A file of scenarios that have most in common."""

    description: str = ""
    methods: tuple[str, ...] = USUAL_METHODS
    base: dict[str, Any]
    scenarios: tuple[SuiteScenario, ...] = Field(min_length=1)


@dataclass(frozen=True)
class Entry:
    """A scenario of a campaign: its data as a scenario file has them, and what its methods should reach."""

    name: str
    data: dict[str, Any]
    targets: dict[str, float]

    @property
    def digest(self) -> str:
        """A hash of the scenario's data, short."""
        text = json.dumps(self.data, sort_keys=True, ensure_ascii=False)
        return hashlib.sha256(text.encode()).hexdigest()[:12]

    @property
    def description(self) -> str:
        """The scenario in a line; may be empty."""
        return str(self.data.get("description", ""))

    @property
    def features(self) -> int:
        """How many features the target has, for which a unit is built."""
        return len(self.data["features"]["points"])


def entry_of(scenario: Scenario | AnyPath, targets: Mapping[str, float] | None = None) -> Entry:
    """The entry of a scenario, of a preset's name or of a scenario file, FILE.toml.

    Raises:
        InputError: there is no such scenario.
    """
    drawn = scenario_of(scenario)
    # Only what is set: a rig stands in a file without the noise that it replaces.
    return Entry(drawn.name, drawn.model_dump(mode="json", exclude_unset=True), dict(targets or {}))


def read_suite(name_or_path: str) -> tuple[tuple[str, ...], tuple[Entry, ...]]:
    """The methods and scenarios of a suite that comes along, or of a FILE.toml.

    Raises:
        InputError: one line that says where, what was found, what was expected.
    """
    path = suite_path(name_or_path)
    suite = Suite.parse(read_toml(path, "a suite of scenarios in TOML"), str(path))
    entries = []
    for item in suite.scenarios:
        data = _merged(suite.base, item.change) | {"name": item.name, "description": item.description}
        entries.append(entry_of(Scenario.parse(data, f"{path}: scenario {item.name}"), item.targets))
    return suite.methods, tuple(entries)


def suite_path(name_or_path: str) -> Path:
    """The file that `read_suite` reads.

    Raises:
        InputError: a name that is not one of a suite that comes along.
    """
    path = Path(name_or_path)
    if path.suffix != ".toml" and len(path.parts) <= 1:
        folder = files("baryscope.study.campaign") / "suites"
        known = sorted(item.name.removesuffix(".toml") for item in folder.iterdir() if item.name.endswith(".toml"))
        if name_or_path not in known:
            raise InputError(f"suite {name_or_path!r}: not known, expected one of {', '.join(known)} or a FILE.toml")
        path = Path(str(folder / f"{name_or_path}.toml"))
    return path


def _merged(base: Mapping[str, Any], change: Mapping[str, Any]) -> dict[str, Any]:
    """Tables merged field by field; everything else is replaced."""
    merged = dict(base)
    for name, value in change.items():
        old = merged.get(name)
        merged[name] = _merged(old, value) if isinstance(old, Mapping) and isinstance(value, Mapping) else value
    return merged

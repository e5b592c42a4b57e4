"""Suites: files of scenarios that have most in common, and what their methods should reach."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.resources import files
from pathlib import Path
from typing import Any

from pydantic import Field, field_validator

from baryscope.models.errors import InputError
from baryscope.models.files import AnyPath
from baryscope.models.scenario import FileModel, Scenario, read_toml, scenario_path
from baryscope.study.campaign.vary import items_of_table
from baryscope.study.flight import scenario_of

USUAL_METHODS = ("screw-gpa", "pivot", "ml")


class SuiteScenario(FileModel):
    """[[scenarios]]: one of a suite: the base with some fields changed; targets are RMSE/CRB at most, by method."""

    name: str = Field(pattern=r"^[\w.-]+$")
    description: str = ""
    targets: dict[str, float] = Field(default_factory=dict)
    change: dict[str, Any] = Field(default_factory=dict)


class SuiteFile(FileModel):
    """A file of scenarios that have most in common, and of how they are drawn.

    base: the tables of a scenario, or the name of a preset or a scenario file, seen from this file's folder; scenarios:
    the base alone unless given; draws, seed, vary: as the options of `baryscope campaign`, which go before them.
    """

    description: str = ""
    methods: tuple[str, ...] = USUAL_METHODS
    draws: int | None = Field(default=None, ge=1)
    seed: int | None = Field(default=None, ge=0)
    vary: dict[str, Any] | None = None
    base: Any
    scenarios: tuple[SuiteScenario, ...] | None = Field(default=None, min_length=1)

    @field_validator("base")
    @classmethod
    def _tables_or_name(cls, base: Any) -> Any:
        if not isinstance(base, dict | str):
            raise ValueError(f"found {base!r}, expected the tables of a scenario, a preset's name or a FILE.toml")
        return base


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


@dataclass(frozen=True)
class Suite:
    """Scenarios that are drawn together; None is what a file leaves open. files: what was read for it."""

    methods: tuple[str, ...]
    entries: tuple[Entry, ...]
    draws: int | None = None
    seed: int | None = None
    vary: tuple[str, ...] | None = None
    files: tuple[Path, ...] = ()

    def only(self, names: Sequence[str]) -> "Suite":
        """With some of its scenarios, in the order of their names; all if there are none."""
        known = {entry.name: entry for entry in self.entries}
        return replace(self, entries=tuple(known[name] for name in names) or self.entries)


def entry_of(scenario: Scenario | AnyPath, targets: Mapping[str, float] | None = None) -> Entry:
    """The entry of a scenario, of a preset's name or of a scenario file, FILE.toml.

    Raises:
        InputError: there is no such scenario.
    """
    drawn = scenario_of(scenario)
    # Only what is set: a rig stands in a file without the noise that it replaces.
    return Entry(drawn.name, drawn.model_dump(mode="json", exclude_unset=True), dict(targets or {}))


def read_suite(name_or_path: str) -> Suite:
    """A suite that comes along, or of a FILE.toml.

    Raises:
        InputError: one line that says where, what was found, what was expected.
    """
    path = suite_path(name_or_path)
    suite = SuiteFile.parse(read_toml(path, "a suite of scenarios in TOML"), str(path))
    files, base = _base(suite, path)
    entries = []
    for item in suite.scenarios or (SuiteScenario(name=base.get("name", path.stem), description=suite.description),):
        named = {"name": item.name, "description": item.description or base.get("description", "")}
        data = _merged(base, item.change) | named
        entries.append(entry_of(Scenario.parse(data, f"{path}: scenario {item.name}"), item.targets))
    vary = None if suite.vary is None else items_of_table(suite.vary, str(path))
    return Suite(suite.methods, tuple(entries), suite.draws, suite.seed, vary, files)


def _base(suite: SuiteFile, path: Path) -> tuple[tuple[Path, ...], dict[str, Any]]:
    """The files of a suite, and the tables of its base."""
    if isinstance(suite.base, dict):
        return (path,), suite.base
    named = Path(suite.base)
    try:
        other = path.parent / named if named.suffix == ".toml" or len(named.parts) > 1 else scenario_path(suite.base)
    except InputError as error:
        raise InputError(f"{path}: base: {error}") from error
    return (path, other), {"name": other.stem} | read_toml(other, "a scenario in TOML")


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

"""What a campaign is to run: its scenarios as plain data, from the command line, a suite, or a campaign's header."""

import hashlib
import json
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any

from pydantic import Field

from baryscope.estimator.methods import METHODS
from baryscope.estimator.options import ScrewOptions
from baryscope.models.errors import InputError
from baryscope.models.scenario import FileModel, Scenario, load_scenario, read_toml
from baryscope.scripts.cli.console import VERSION
from baryscope.study.campaign.program import program_hash

VARIED = ("attitude", "anomaly")  # what a draw can vary besides the noise
LVLH = "-lvlh"  # ends the label of a screw method that registers in LVLH axes
USUAL_METHODS = ("screw-gpa", "pivot", "ml")


class SuiteScenario(FileModel):
    """[[scenarios]]: one of a suite: the base with some fields changed; targets are ratios to the bound, by method."""

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


@dataclass(frozen=True)
class Plan:
    """A campaign: every scenario drawn `draws` times and estimated by every method.

    source: the options of the command line that name the scenarios; methods: labels, see `labels_of`; vary: what is
    drawn besides noise, some of VARIED; version and program: what runs or ran it, the latter a hash of its sources.
    """

    source: str
    entries: tuple[Entry, ...]
    methods: tuple[str, ...]
    seed: int
    vary: tuple[str, ...]
    draws: int
    version: str = VERSION
    program: str = field(default_factory=program_hash)

    @property
    def command(self) -> str:
        """What to type for it, but for the folder."""
        varied = "" if self.vary == VARIED else f" --vary {','.join(self.vary) or 'none'}"
        chosen = ",".join(dict.fromkeys(label.removesuffix(LVLH) for label in self.methods))
        return f"baryscope campaign {self.source} --methods {chosen} --draws {self.draws} --seed {self.seed}{varied}"

    def header(self) -> dict[str, Any]:
        """The plan as data for JSON."""
        entries = [asdict(entry) | {"hash": entry.digest} for entry in self.entries]
        return asdict(self) | {"entries": entries}

    @classmethod
    def of_header(cls, header: Mapping[str, Any], where: Path) -> "Plan":
        """The plan that a header was made of.

        Raises:
            InputError: it is none.
        """
        try:
            entries = tuple(Entry(item["name"], item["data"], item["targets"]) for item in header["entries"])
            return cls(
                source=str(header["source"]),
                entries=entries,
                methods=tuple(header["methods"]),
                seed=int(header["seed"]),
                vary=tuple(header["vary"]),
                draws=int(header["draws"]),
                version=str(header["version"]),
                program=str(header["program"]),
            )
        except (KeyError, TypeError, ValueError) as error:
            reason = f"found no {error}" if isinstance(error, KeyError) else str(error)
            raise InputError(f"{where}: {reason}, expected the header of a campaign") from error

    def difference(self, other: "Plan") -> str | None:
        """The first thing for which the runs of another plan are no runs of this one; None if they are.

        The number of draws is none of these: a draw doesn't depend on how many others there are.
        """
        for name in ("version", "program", "seed", "methods", "vary"):
            mine, its = getattr(self, name), getattr(other, name)
            if mine != its:
                return f"{name} {_shown(its)}, expected {_shown(mine)}"
        if [entry.name for entry in self.entries] != [entry.name for entry in other.entries]:
            its, mine = (", ".join(entry.name for entry in plan.entries) for plan in (other, self))
            return f"scenarios {its}, expected {mine}"
        for mine, its in zip(self.entries, other.entries, strict=True):
            if mine.digest != its.digest:
                return f"another scenario {its.name} (hash {its.digest}, expected {mine.digest})"
        return None


def _shown(value: object) -> str:
    return ",".join(value) or "none" if isinstance(value, tuple) else str(value)


def plan_of(
    scenarios: Sequence[str], suite: str | None, methods: str | None, *, draws: int, seed: int, vary: str
) -> Plan:
    """The plan that the options of the command line ask for.

    Raises:
        InputError: an option makes no sense, or a file is wrong.
    """
    for name, value, least in (("draws", draws, 1), ("seed", seed, 0)):
        if value < least:
            raise InputError(f"--{name}: found {value}, expected at least {least}")
    if suite is not None:
        usual, entries = read_suite(suite)
        known = {entry.name: entry for entry in entries}
        unknown = next((name for name in scenarios if name not in known), None)
        if unknown is not None:
            raise InputError(f"--scenario: found {unknown!r}, expected some of the suite's {', '.join(known)}")
        entries = tuple(known[name] for name in scenarios) or entries
        source = shlex.join(["--suite", suite, *(["--scenario", *scenarios] if scenarios else [])])
    else:
        named = scenarios or ("envisat",)
        usual, entries = USUAL_METHODS, tuple(_entry(load_scenario(name), {}) for name in named)
        source = shlex.join(["--scenario", *named])
    names = [entry.name for entry in entries]
    repeated = next((name for name in names if names.count(name) > 1), None)
    if repeated is not None:
        raise InputError(f"scenario {repeated!r}: stands {names.count(repeated)} times, expected each name once")
    labels = labels_of(usual if methods is None else methods.split(","))
    return Plan(source, entries, labels, seed, _varied(vary), draws)


def _varied(text: str) -> tuple[str, ...]:
    """What --vary names, in the order of VARIED."""
    if text == "none":
        return ()
    chosen = [item.strip() for item in text.split(",") if item.strip()]
    unknown = next((item for item in chosen if item not in VARIED), None)
    if unknown is not None or not chosen:
        raise InputError(f"--vary: found {unknown or text!r}, expected none or some of {', '.join(VARIED)}")
    return tuple(item for item in VARIED if item in chosen)


def read_suite(name_or_path: str) -> tuple[tuple[str, ...], tuple[Entry, ...]]:
    """The methods and scenarios of a suite that comes along, or of a FILE.toml.

    Raises:
        InputError: one line that says where, what was found, what was expected.
    """
    path = Path(name_or_path)
    if path.suffix != ".toml" and len(path.parts) <= 1:
        folder = files("baryscope.study.campaign") / "suites"
        known = sorted(item.name.removesuffix(".toml") for item in folder.iterdir() if item.name.endswith(".toml"))
        if name_or_path not in known:
            raise InputError(f"suite {name_or_path!r}: not known, expected one of {', '.join(known)} or a FILE.toml")
        path = Path(str(folder / f"{name_or_path}.toml"))
    suite = Suite.parse(read_toml(path, "a suite of scenarios in TOML"), str(path))
    entries = []
    for item in suite.scenarios:
        data = _merged(suite.base, item.change) | {"name": item.name, "description": item.description}
        entries.append(_entry(Scenario.parse(data, f"{path}: scenario {item.name}"), item.targets))
    return suite.methods, tuple(entries)


def _merged(base: Mapping[str, Any], change: Mapping[str, Any]) -> dict[str, Any]:
    """Tables merged field by field; everything else is replaced."""
    merged = dict(base)
    for name, value in change.items():
        old = merged.get(name)
        merged[name] = _merged(old, value) if isinstance(old, Mapping) and isinstance(value, Mapping) else value
    return merged


def _entry(scenario: Scenario, targets: dict[str, float]) -> Entry:
    # Only what is set: a rig stands in a file without the noise that it replaces.
    return Entry(scenario.name, scenario.model_dump(mode="json", exclude_unset=True), targets)


def labels_of(methods: Sequence[str]) -> tuple[str, ...]:
    """What to run, by label: a method's name, with LVLH at its end if in LVLH axes; screw-gpa runs in both.

    Raises:
        InputError: there is no such method, or none.
    """
    names = [name.strip() for name in methods if name.strip()]
    unknown = [name for name in names if name not in METHODS]
    if unknown or not names:
        found = repr(unknown[0]) if unknown else "none"
        raise InputError(f"--methods: found {found}, expected some of {', '.join(METHODS)}")
    return tuple(
        label for name in dict.fromkeys(names) for label in ((name, name + LVLH) if name == "screw-gpa" else (name,))
    )


def options_of(label: str) -> tuple[str, ScrewOptions | None]:
    """The method of a label, and its options where they are not the usual ones."""
    if label.endswith(LVLH):
        return label.removesuffix(LVLH), ScrewOptions(axes="lvlh")
    return label, None

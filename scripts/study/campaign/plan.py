"""What a campaign is to run: its scenarios as plain data, from options, a suite, or a campaign's header."""

import hashlib
import json
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from baryscope import __version__
from baryscope.models.errors import InputError
from baryscope.study.campaign.case import Case
from baryscope.study.campaign.program import program_hash
from baryscope.study.campaign.suite import USUAL_METHODS, Entry, Suite, entry_of, read_suite
from baryscope.study.campaign.vary import VARIED, Range, hypercube, items_of, prepared, ranges_of, values_at
from baryscope.study.methods import LVLH, labels_of

DRAWS, SEED = 100, 1  # unless told


@dataclass(frozen=True)
class Plan:
    """A campaign: every scenario drawn `draws` times and estimated by every method.

    source: the options of the command line that name the scenarios; methods: labels, see `labels_of`; vary: what is
    drawn besides noise, see `items_of`; version and program: what runs or ran it, the latter a hash of its sources.
    """

    source: str
    entries: tuple[Entry, ...]
    methods: tuple[str, ...]
    seed: int
    vary: tuple[str, ...]
    draws: int
    version: str = __version__
    program: str = field(default_factory=program_hash)

    @property
    def total(self) -> int:
        """How many runs there are."""
        return len(self.entries) * self.draws

    @property
    def command(self) -> str:
        """What to type for it, but for the folder."""
        varied = "" if self.vary == VARIED else f" --vary {' '.join(self.vary) or 'none'}"
        chosen = f"--methods {','.join(self.names)} --draws {self.draws} --seed {self.seed}"
        return f"baryscope campaign {self.source} {chosen}{varied}"

    @property
    def names(self) -> tuple[str, ...]:
        """The methods as they are asked for: `labels_of` makes their labels of them."""
        return tuple(dict.fromkeys(label.removesuffix(LVLH) for label in self.methods))

    @property
    def name(self) -> str:
        """A name for its folder, out of those of suite and scenarios."""
        words = shlex.split(self.source)
        names = [Path(words[1]).stem] if words[:1] == ["--suite"] else []
        names += [entry.name for entry in self.entries] if "--scenario" in words else []
        return "-".join(["campaign", *names])

    @property
    def ranges(self) -> tuple[Range, ...]:
        """The fields that are drawn over ranges."""
        return ranges_of(self.vary)

    @cached_property
    def identity(self) -> str:
        """A hash of all that a run depends on but for the number of its draw, short: it stands in each line."""
        parts: dict[str, Any] = {
            name: getattr(self, name) for name in ("version", "program", "seed", "methods", "vary")
        }
        parts["scenarios"] = [(entry.name, entry.digest) for entry in self.entries]
        if self.ranges:
            parts["draws"] = self.draws
        return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:12]

    def case(self, scenario: str, number: int, unit: str = "") -> Case:
        """A draw of a scenario, by its name; unit: an FMU for it.

        Raises:
            InputError: the plan has no such draw.
        """
        if scenario not in self._prepared or not 0 <= number < self.draws:
            names = ", ".join(self._prepared)
            raise InputError(
                f"{scenario}, draw {number}: found no such draw, expected 0 to {self.draws - 1} of {names}"
            )
        values = values_at(self._shares[number], self.ranges)
        vary = tuple(item for item in self.vary if item in VARIED)
        return Case(self._prepared[scenario], number, self.seed, self.methods, vary, unit, values, self.identity)

    @cached_property
    def _prepared(self) -> dict[str, dict[str, Any]]:
        """The data of the scenarios by name, with the fields that are drawn over ranges."""
        return {entry.name: prepared(entry.data, self.ranges, entry.name) for entry in self.entries}

    @cached_property
    def _shares(self) -> NDArray[Any]:
        return hypercube(self.ranges, self.draws, self.seed)

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
                vary=items_of(header["vary"]),
                draws=int(header["draws"]),
                version=str(header["version"]),
                program=str(header["program"]),
            )
        except (KeyError, TypeError, ValueError) as error:
            reason = f"found no {error}" if isinstance(error, KeyError) else str(error)
            raise InputError(f"{where}: {reason}, expected the header of a campaign") from error

    def difference(self, other: "Plan") -> str | None:
        """The first thing for which the runs of another plan are no runs of this one; None if they are.

        The number of draws is none of these where no ranges are drawn: a draw doesn't depend on how many others there
        are. A Latin hypercube does.
        """
        for name in ("version", "program", "seed", "methods", "vary", *(["draws"] if self.ranges else [])):
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
    scenarios: Sequence[str] = (),
    suite: str | None = None,
    methods: Sequence[str] | None = None,
    *,
    draws: int | None = None,
    seed: int | None = None,
    vary: Sequence[str] | None = None,
) -> Plan:
    """The plan of a campaign. What is not given is as the suite says, or as here.

    Args:
        scenarios: presets or scenario files, envisat unless given; of a suite, the names of those to run, all unless
            given.
        suite: a suite that comes along, or its FILE.toml.
        methods: names out of `METHODS`, or USUAL_METHODS.
        draws: how often each scenario is drawn, or 100.
        seed: of everything random, or 1.
        vary: what a draw varies besides noise, dropout and outliers: some of VARIED, or these; and numbers of the
            scenarios over ranges, FIELD=LOW:HIGH or FIELD=LOW:HIGH:log.

    Raises:
        InputError: something of this makes no sense, or a file is wrong.
    """
    found, source = _of_suite(suite, scenarios) if suite is not None else _of_scenarios(scenarios)
    count = _first(draws, found.draws, DRAWS)
    start = _first(seed, found.seed, SEED)
    for name, value, least in (("draws", count, 1), ("seed", start, 0)):
        if value < least:
            raise InputError(f"{name}: found {value}, expected at least {least}")
    names = [entry.name for entry in found.entries]
    repeated = next((name for name in names if names.count(name) > 1), None)
    if repeated is not None:
        raise InputError(f"scenario {repeated!r}: stands {names.count(repeated)} times, expected each name once")
    labels = labels_of(found.methods if methods is None else methods)
    varied = found.vary if vary is None else items_of(vary)
    plan = Plan(source, found.entries, labels, start, VARIED if varied is None else varied, count)
    plan.case(names[0], 0)  # whatever is wrong with a range is said now
    return plan


def _first(*values: int | None) -> int:
    return next(value for value in values if value is not None)


def _of_suite(suite: str, scenarios: Sequence[str]) -> tuple[Suite, str]:
    """A suite with some of its scenarios, and the options that say so."""
    found = read_suite(suite)
    known = {entry.name: entry for entry in found.entries}
    unknown = next((name for name in scenarios if name not in known), None)
    if unknown is not None:
        raise InputError(f"scenario: found {unknown!r}, expected some of the suite's {', '.join(known)}")
    source = shlex.join(["--suite", suite, *(["--scenario", *scenarios] if scenarios else [])])
    return found.only(scenarios), source


def _of_scenarios(scenarios: Sequence[str]) -> tuple[Suite, str]:
    """Single scenarios, and the options that say so."""
    named = tuple(scenarios) or ("envisat",)
    return Suite(USUAL_METHODS, tuple(map(entry_of, named))), shlex.join(["--scenario", *named])

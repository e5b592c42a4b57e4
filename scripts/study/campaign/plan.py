"""What a campaign is to run: its scenarios as plain data, from options, a suite, or a campaign's header."""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from baryscope import __version__
from baryscope.models.errors import InputError
from baryscope.study.campaign.program import program_hash
from baryscope.study.campaign.suite import USUAL_METHODS, Entry, entry_of, read_suite
from baryscope.study.methods import LVLH, labels_of

VARIED = ("attitude", "anomaly")  # what a draw can vary besides the noise


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
    version: str = __version__
    program: str = field(default_factory=program_hash)

    @property
    def total(self) -> int:
        """How many runs there are."""
        return len(self.entries) * self.draws

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
    scenarios: Sequence[str] = (),
    suite: str | None = None,
    methods: Sequence[str] | None = None,
    *,
    draws: int = 100,
    seed: int = 1,
    vary: Sequence[str] = VARIED,
) -> Plan:
    """The plan of a campaign.

    Args:
        scenarios: presets or scenario files, envisat unless given; of a suite, the names of those to run, all unless
            given.
        suite: a suite that comes along, or its FILE.toml.
        methods: names out of `METHODS`; those of the suite, or USUAL_METHODS, unless given.
        draws: how often each scenario is drawn.
        seed: of everything random.
        vary: what a draw varies besides noise, dropout and outliers, some of VARIED.

    Raises:
        InputError: something of this makes no sense, or a file is wrong.
    """
    for name, value, least in (("draws", draws, 1), ("seed", seed, 0)):
        if value < least:
            raise InputError(f"{name}: found {value}, expected at least {least}")
    unknown = next((item for item in vary if item not in VARIED), None)
    if unknown is not None:
        raise InputError(f"vary: found {unknown!r}, expected none or some of {', '.join(VARIED)}")
    usual, entries, source = _of_suite(suite, scenarios) if suite is not None else _of_scenarios(scenarios)
    names = [entry.name for entry in entries]
    repeated = next((name for name in names if names.count(name) > 1), None)
    if repeated is not None:
        raise InputError(f"scenario {repeated!r}: stands {names.count(repeated)} times, expected each name once")
    labels = labels_of(usual if methods is None else methods)
    return Plan(source, entries, labels, seed, tuple(item for item in VARIED if item in vary), draws)


def _of_suite(suite: str, scenarios: Sequence[str]) -> tuple[tuple[str, ...], tuple[Entry, ...], str]:
    """Methods, entries and source of a suite, or of some of its scenarios."""
    usual, entries = read_suite(suite)
    known = {entry.name: entry for entry in entries}
    unknown = next((name for name in scenarios if name not in known), None)
    if unknown is not None:
        raise InputError(f"scenario: found {unknown!r}, expected some of the suite's {', '.join(known)}")
    source = shlex.join(["--suite", suite, *(["--scenario", *scenarios] if scenarios else [])])
    return usual, tuple(known[name] for name in scenarios) or entries, source


def _of_scenarios(scenarios: Sequence[str]) -> tuple[tuple[str, ...], tuple[Entry, ...], str]:
    """Methods, entries and source of single scenarios."""
    named = tuple(scenarios) or ("envisat",)
    return USUAL_METHODS, tuple(map(entry_of, named)), shlex.join(["--scenario", *named])

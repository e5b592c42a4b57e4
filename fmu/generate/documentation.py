"""What people see of a unit: documentation/index.html, made from the table of variables, and the icon."""

from collections.abc import Iterable, Sequence
from html import escape
from importlib.metadata import version
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from baryscope.fmu.generate.identity import AUTHOR, COPYRIGHT, LICENCE
from baryscope.fmu.layout.platforms import FmiVersion
from baryscope.fmu.units import Blueprint
from baryscope.fmu.units.blueprint import Section
from baryscope.models.variables import DISPLAY_UNITS, NO_LIMITS, Kind, Variable

_STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #1c2733; max-width: 62rem; margin: 2rem auto; padding: 0 1rem; }
header { display: flex; align-items: center; gap: 1rem; }
header img { width: 72px; height: 72px; }
h1, p.lead { margin: 0; }
h2 { margin-top: 2rem; border-bottom: 1px solid #cfdfea; }
table { border-collapse: collapse; width: 100%; font-size: 0.9rem; }
th, td { text-align: left; vertical-align: top; padding: 0.2rem 0.6rem 0.2rem 0; border-bottom: 1px solid #e4ecf2; }
code { font-size: 0.92em; }
"""

_INPUTS: dict[FmiVersion, str] = {
    2: "Inputs are held over a communication step, or change by the first derivatives that the importer sets.",
    3: "Inputs are held over a communication step.",
}


def documents(unit: Blueprint, fmi: FmiVersion, *, scalar: bool = False) -> dict[str, bytes]:
    """The members of the archive that document a unit, by name: documentation/index.html and the icon.

    The icon is where the version of FMI looks for it: model.png in 2.0, terminalsAndIcons/icon.png (and .svg) in 3.0.
    """
    icons = files("baryscope.fmu") / "icon"
    members = {"documentation/index.html": _page(unit, fmi, scalar=scalar).encode()}
    if fmi == 2:
        return members | {"model.png": (icons / "icon.png").read_bytes()}
    return members | {f"terminalsAndIcons/{name}": (icons / name).read_bytes() for name in ("icon.png", "icon.svg")}


def _page(unit: Blueprint, fmi: FmiVersion, *, scalar: bool) -> str:
    icon = "../model.png" if fmi == 2 else "../terminalsAndIcons/icon.png"
    arrays = "arrays" if fmi == 3 and not scalar else "scalars, with indices from 1, matrices row by row"
    offered = "Co-Simulation" if unit.is_sampled else "Co-Simulation and Model Exchange"
    facts = [
        *unit.setting.facts,
        ("interfaces", f"FMI {fmi}.0, {offered}; variables are {arrays}"),
        *_features(unit),
        ("default run", f"{unit.setting.stop_time:.9g} s in steps of {unit.setting.step_size:.9g} s"),
        ("made by", f"baryscope {version('baryscope')}"),
    ]
    inputs = _INPUTS[3 if unit.is_sampled else fmi]
    body = [
        f'<header><img src="{icon}" alt=""><div><h1>{unit.name}</h1><p class="lead">{unit.summary}.</p></div></header>',
        _table((), facts),
        *(_section(section) for section in unit.sections if not section.last),
        _section(Section("Use", items=(*unit.use, inputs))),
        "<h2>Variables</h2>",
        _table(("name", "kind", "unit", "shown in", "start", "limits", "description"), _rows(unit)),
        *(_section(section) for section in unit.sections if section.last),
        "<h2>Licence</h2>",
        f"<p>{LICENCE}. {COPYRIGHT.replace('(c)', '©')}. Written by {AUTHOR}. "
        'The texts are in <a href="licenses/license.txt">licenses</a>.</p>',
    ]
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f"<title>{unit.name}: {escape(unit.setting.facts[0][1])}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n"
        + "\n".join(body)
        + "\n</body>\n</html>\n"
    )


def _features(unit: Blueprint) -> list[tuple[str, str]]:
    """How many rows arrays have, and their labels if no section has them; nothing for a unit without such arrays."""
    if not any(variable.is_of_features for variable in unit.variables):
        return []
    text = f"{len(unit.setting.labels)}; their number is built in"
    if any("label" in section.head for section in unit.sections):
        return [("features", text)]
    return [("features", f"{text}; rows: {', '.join(unit.setting.labels)}")]


def _section(section: Section) -> str:
    parts = [f"<h2>{escape(section.title)}</h2>"]
    if section.text:
        parts.append(f"<p>{escape(section.text)}</p>")
    if section.items:
        parts.append("\n".join(["<ul>", *(f"<li>{escape(item)}</li>" for item in section.items), "</ul>"]))
    if section.rows:
        parts.append(_table(section.head, section.rows))
    return "\n".join(parts)


def _rows(unit: Blueprint) -> Iterable[Sequence[str]]:
    """A row of the table of variables for each, arrays whole."""
    for variable in unit.variables:
        display = variable.display_unit
        yield (
            f"{variable.name}{list(variable.shape) if variable.shape else ''}",
            f"tunable {variable.kind}" if variable.tunable else str(variable.kind),
            "Boolean" if variable.boolean else variable.unit,
            display if display != variable.unit else "",
            _start(variable, unit.starts[variable.name]) if variable.kind == Kind.PARAMETER else "",
            _limits(variable),
            variable.whole_description(()),
        )


def _start(variable: Variable, value: NDArray[np.float64]) -> str:
    """A start value in the variable's display unit; those of the features have a table of their own."""
    if variable.is_of_features:
        return "see below"
    if variable.boolean:
        return str(bool(value)).lower()
    factor = DISPLAY_UNITS.get(variable.unit, {}).get(variable.display_unit, 1.0)
    numbers = ", ".join(f"{number:.10g}" for number in np.atleast_1d(value * factor))
    return numbers if factor == 1.0 else f"{numbers} {variable.display_unit}"


def _limits(variable: Variable) -> str:
    if variable.limits == NO_LIMITS:
        return ""
    smallest, largest = variable.limits
    if largest == NO_LIMITS[1]:
        return f"≥ {smallest:g}"
    return f"{smallest:g} to {'below ' if float(f'{largest:g}') > largest else ''}{largest:g}"


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """An HTML table of texts; without a head, the first cell of a row is its heading."""

    def cell(text: str, place: int) -> str:
        tag = "th" if not head and place == 0 else "td"
        return f"<{tag}>{escape(text)}</{tag}>"

    lines = ["<table>"]
    if head:
        lines.append("<tr>" + "".join(f"<th>{escape(text)}</th>" for text in head) + "</tr>")
    lines += ["<tr>" + "".join(cell(text, place) for place, text in enumerate(row)) + "</tr>" for row in rows]
    return "\n".join([*lines, "</table>"])

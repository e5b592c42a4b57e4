"""What people see of a unit: documentation/index.html, made from the table of variables, and the icon."""

from collections.abc import Iterable, Sequence
from html import escape
from importlib.metadata import version
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from baryscope.fmu.generate.identity import AUTHOR, COPYRIGHT, DESCRIPTION, LICENCE, labels_of
from baryscope.fmu.layout.archive import MODEL_NAME
from baryscope.fmu.layout.platforms import FmiVersion
from baryscope.models.scenario import Scenario
from baryscope.models.variables import DISPLAY_UNITS, NO_LIMITS, Force, Kind, Variable

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

_FRAMES = (
    ("I, inertial", "Axes that do not rotate, through the centre of the body that the target circles."),
    (
        "L, LVLH",
        "Origin at the target's centre of mass; x radially outward, y along-track, z along the orbit's normal.",
    ),
    ("B, body", "Origin at the target's centre of mass; fixed in the target. The axes of inertia tensor and features."),
    ("C, chaser", "Origin at the chaser, axes parallel to I: the frame of the outputs features and normals."),
)
_EQUATIONS = (
    "The target is one rigid body. Its angular momentum changes by the torque input and, where gravityGradient is "
    "true, by the gravity gradient (Euler's equations with the full inertia tensor, the attitude as a quaternion).",
    "The chaser is a point. Its motion from the target's centre of mass is not linearised: the difference of the two "
    "bodies' gravity and the commanded acceleration, in the axes of LVLH, which turn as the target goes round.",
    "A feature is where the target's centre of mass is from the chaser, plus its place in the body turned by the "
    "attitude.",
)
_ORBITS = {
    False: "The target flies on a Kepler ellipse, given by its elements at time 0.",
    True: "The target's orbit is integrated under the forces below; the elements are those that osculate at time 0.",
}
_FORCES = {
    Force.J2: "the oblateness of the central body, by its second zonal coefficient",
    Force.DRAG: "drag of an exponential atmosphere that rotates, on target and chaser",
    Force.LIGHT: "pressure of sunlight on target and chaser, with umbra and penumbra",
    Force.EDDY_CURRENTS: "the torque of eddy currents in the field of a magnetic dipole",
}
_USE = (
    "Set parameters before or in Initialization Mode. Fixed ones can be changed again after a reset only; tunable ones "
    "between communication steps, in Model Exchange in Event Mode.",
    "The length of communication steps is free and does not change the results: the unit integrates with steps of its "
    "own (Taylor series of order 20, Dormand and Prince's method of order 8) to solver.tolerance.",
    "An importer's tolerance, if it is smaller, tightens solver.tolerance; it never loosens it.",
    "States can be saved and restored bitwise. Derivatives by time, inputs, states and parameters are exact.",
    "What cannot be (an inertia that no body has, an eccentricity of 1, a step of 0) is refused with a message, and "
    "changes nothing.",
)

_INPUTS: dict[FmiVersion, str] = {
    2: "Inputs are held over a communication step, or change by the first derivatives that the importer sets.",
    3: "Inputs are held over a communication step.",
}


def documents(scenario: Scenario, fmi: FmiVersion, *, scalar: bool = False) -> dict[str, bytes]:
    """The members of the archive that document a unit, by name: documentation/index.html and the icon.

    The icon is where the version of FMI looks for it: model.png in 2.0, terminalsAndIcons/icon.png (and .svg) in 3.0.
    """
    icons = files("baryscope.fmu") / "icon"
    members = {"documentation/index.html": _page(scenario, fmi, scalar=scalar).encode()}
    if fmi == 2:
        return members | {"model.png": (icons / "icon.png").read_bytes()}
    return members | {f"terminalsAndIcons/{name}": (icons / name).read_bytes() for name in ("icon.png", "icon.svg")}


def _page(scenario: Scenario, fmi: FmiVersion, *, scalar: bool) -> str:
    system, labels = scenario.system, labels_of(scenario)
    icon = "../model.png" if fmi == 2 else "../terminalsAndIcons/icon.png"
    arrays = "arrays" if fmi == 3 and not scalar else "scalars, with indices from 1, matrices row by row"
    facts = [
        ("scenario", f"{scenario.name}: {scenario.description}" if scenario.description else scenario.name),
        ("interfaces", f"FMI {fmi}.0, Co-Simulation and Model Exchange; variables are {arrays}"),
        ("features", f"{len(labels)}; their number is built in, their places are parameters"),
        ("default run", f"{scenario.duration:.9g} s in steps of {scenario.run.sample_time:.9g} s"),
        ("made by", f"baryscope {version('baryscope')}"),
    ]
    forces = [_FORCES[force] for force in Force if force in system.forces]
    body = [
        f'<header><img src="{icon}" alt=""><div><h1>{MODEL_NAME}</h1><p class="lead">{DESCRIPTION}.</p></div></header>',
        _table((), facts),
        "<h2>Frames</h2>",
        _table((), _FRAMES),
        "<p>Quaternions are (w, x, y, z) and turn body into inertial coordinates. Units are SI, angles in radians.</p>",
        "<h2>Equations</h2>",
        _list((_ORBITS[bool(forces)], *_EQUATIONS)),
        *(["<p>Forces that are built in:</p>", _list(forces)] if forces else []),
        "<h2>Use</h2>",
        _list((*_USE, _INPUTS[fmi])),
        "<h2>Variables</h2>",
        _table(("name", "kind", "unit", "shown in", "start", "limits", "description"), _rows(scenario)),
        "<h2>Features</h2>",
        "<p>The rows of <code>features</code>, <code>normals</code> and their parameters; positions from the centre of "
        "mass and outward normals in body axes, as they are at the start.</p>",
        _table(("row", "label", "position, m", "normal"), _features(scenario, labels)),
        "<h2>Licence</h2>",
        f"<p>{LICENCE}. {COPYRIGHT.replace('(c)', '©')}. Written by {AUTHOR}. "
        'The texts are in <a href="licenses/license.txt">licenses</a>.</p>',
    ]
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f"<title>{MODEL_NAME}: {escape(scenario.name)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n"
        + "\n".join(body)
        + "\n</body>\n</html>\n"
    )


def _rows(scenario: Scenario) -> Iterable[Sequence[str]]:
    """A row of the table of variables for each, arrays whole."""
    starts = scenario.parameters()
    for variable in scenario.system.variables:
        display = variable.display_unit
        yield (
            f"{variable.name}{list(variable.shape) if variable.shape else ''}",
            f"tunable {variable.kind}" if variable.tunable else str(variable.kind),
            "Boolean" if variable.boolean else variable.unit,
            display if display != variable.unit else "",
            _start(variable, starts[variable.name]) if variable.kind == Kind.PARAMETER else "",
            _limits(variable),
            variable.whole_description(()) if len(variable.shape) < 2 else variable.description,
        )


def _start(variable: Variable, value: NDArray[np.float64]) -> str:
    """A start value in the variable's display unit; those of the features have a table of their own."""
    if len(variable.shape) > 1:
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


def _features(scenario: Scenario, labels: Sequence[str]) -> Iterable[Sequence[str]]:
    for row, (label, point) in enumerate(zip(labels, scenario.features.points, strict=True), start=1):
        position, normal = (", ".join(f"{c:.6g}" for c in vector) for vector in (point.position, point.normal))
        yield str(row), label, position, normal


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


def _list(items: Iterable[str]) -> str:
    return "\n".join(["<ul>", *(f"<li>{escape(item)}</li>" for item in items), "</ul>"])

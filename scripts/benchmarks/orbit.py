"""A whole run in one call: the unit, and general integrators of the same equations at several tolerances."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from baryscope.fmu import Session, build_fmu
from baryscope.models.orbit import EARTH_J2, EARTH_RADIUS
from baryscope.models.scenario import Scenario
from baryscope.models.target import tumbling_target
from baryscope.models.variables import Kind
from baryscope.scripts.benchmarks.peers import (
    Flight,
    cvodes_flights,
    heyoka_flights,
    heyoka_under_torques,
    scipy_flights,
)
from baryscope.scripts.benchmarks.report import Part, differs, exceeds
from baryscope.scripts.benchmarks.setting import Setting
from baryscope.scripts.benchmarks.stepping import ATTITUDE, PEER_ATTITUDE, PEER_POSITION, POSITION

TOLERANCE = 1e-13
PARTS = ("target.attitude", "target.angularRate", "orbit.trueAnomaly", "chaser.position", "chaser.velocity")
GRAVITY_GRADIENT = 1e-6  # of the state's components, between the unit and scipy


def unit_flight(unit: Path, duration: float, variant: str, parameters: Mapping[str, float | bool]) -> Flight:
    """The unit, in one communication step."""
    with Session(unit, parameters) as session:
        times = []
        for _ in range(40):
            session.reset(parameters)
            begin = time.perf_counter()
            session.step(duration)
            times.append(time.perf_counter() - begin)
        state = np.concatenate([session[name].ravel() for name in PARTS])
    return Flight("the unit", variant, min(times), state)


def errors_of(setting: Setting, state: NDArray[np.float64]) -> tuple[float, float]:
    """Errors of a state of the equations against the closed forms: attitude, rad, and CoM in C, m."""
    system = tumbling_target(len(setting.scenario.features.points))
    outputs = np.asarray(system.outputs(state, setting.scenario.flat_parameters())).ravel()
    names = [name for v in system.of_kind(Kind.OUTPUT) for name in v.scalar_names]
    values = dict(zip(names, outputs, strict=True))
    attitude = [values[f"target.attitude[{k}]"] for k in range(1, 5)]
    position = [values[f"target.position[{k}]"] for k in range(1, 4)]
    return setting.closed_form.errors(attitude, position)


def whole_orbit(setting: Setting) -> Part:
    """Each peer in its fastest variant that is no less accurate than the unit, or its most accurate one.

    The unit must meet its tolerances and every peer's best variant must agree. With gravity gradient the attitude has
    no closed form; there the unit must agree with scipy.
    """
    peers = [scipy_flights, cvodes_flights] + ([heyoka_flights] if "heyoka" in setting.peers else [])
    flights = [flight for peer in peers for flight in peer(setting.scenario, setting.duration)]
    ours = unit_flight(
        setting.unit, setting.duration, f"Taylor, tolerance {TOLERANCE:g}", {"solver.tolerance": TOLERANCE}
    )
    parameters = {"solver.tolerance": TOLERANCE, "gravityGradient": True}
    attracted = unit_flight(setting.unit, setting.duration, "Taylor, with gravity gradient", parameters)
    shown = [ours, attracted, *(_shown(setting, group, ours) for group in _groups(flights))]
    target = setting.scenario.target.model_copy(update={"gravity_gradient": True})
    with_gradient = setting.scenario.model_copy(update={"target": target})
    *_, expected = scipy_flights(with_gradient, setting.duration)
    faults = differs("the unit with gravity gradient, against scipy", attracted.state, expected.state, GRAVITY_GRADIENT)
    for flight in shown:
        attitude, position = errors_of(setting, flight.state)
        own = flight.peer == ours.peer
        name = f"{flight.peer} ({flight.variant}) over {setting.duration:g} s"
        if flight is not attracted:
            faults += exceeds(f"{name}: attitude", attitude, ATTITUDE if own else PEER_ATTITUDE, "rad")
        faults += exceeds(f"{name}: position", position, POSITION if own else PEER_POSITION, "m")
    table, more = under_torques(setting, attracted, with_gradient)
    return Part(tables=(_table(setting, shown, attracted), table), faults=(*faults, *more))


def under_torques(setting: Setting, attracted: Flight, with_gradient: Scenario) -> tuple[Table, list[str]]:
    """The unit with gravity gradient, without and with J2, and heyoka with the same forces; they must agree."""
    orbit = replace(with_gradient.orbit, j2=EARTH_J2, equatorial_radius=EARTH_RADIUS)
    oblate = with_gradient.model_copy(update={"orbit": orbit})
    unit = build_fmu(oblate, setting.folder / "oblate.fmu")
    turned = unit_flight(unit, setting.duration, "J2, gravity gradient", {"solver.tolerance": TOLERANCE})
    table = Table(title=f"{setting.duration:.0f} s in one step, under torques", title_justify="left")
    for heading in ("who", "forces", "time", "its time / the unit's"):
        table.add_column(heading, justify="left" if heading in ("who", "forces") else "right")
    faults: list[str] = []
    for scenario, ours in ((with_gradient, attracted), (oblate, turned)):
        forces = "gravity gradient" + (", J2" if scenario.forces else "")
        table.add_row(ours.peer, forces, f"{1e3 * ours.seconds:.3g} ms", "1.00")
        if "heyoka" in setting.peers:
            theirs = heyoka_under_torques(scenario, setting.duration)
            ratio = f"{theirs.seconds / ours.seconds:.2f}"
            table.add_row(theirs.peer, forces, f"{1e3 * theirs.seconds:.3g} ms", ratio)
            expected = _as_outputs(scenario, theirs.state)
            faults += differs(f"the unit with {forces}, against heyoka", ours.state, expected, GRAVITY_GRADIENT)
    return table, faults


def _as_outputs(scenario: Scenario, state: NDArray[np.float64]) -> NDArray[np.float64]:
    """The outputs of a state that `unit_flight` gives."""
    outputs = np.asarray(scenario.system.outputs(state, scenario.flat_parameters())).ravel()
    places = np.cumsum([0, *(v.size for v in scenario.system.of_kind(Kind.OUTPUT))])
    names = [v.name for v in scenario.system.of_kind(Kind.OUTPUT)]
    return np.concatenate([outputs[places[names.index(part)] : places[names.index(part) + 1]] for part in PARTS])


def _groups(flights: Sequence[Flight]) -> list[list[Flight]]:
    """The flights of each peer; heyoka's split and coupled ones are two."""
    keys = sorted({(flight.peer, "split" in flight.variant) for flight in flights})
    return [[flight for flight in flights if (flight.peer, "split" in flight.variant) == key] for key in keys]


def _shown(setting: Setting, group: Sequence[Flight], ours: Flight) -> Flight:
    bound = errors_of(setting, ours.state)[0]
    good = [flight for flight in group if errors_of(setting, flight.state)[0] <= bound]
    if good:
        return min(good, key=lambda flight: flight.seconds)
    return min(group, key=lambda flight: errors_of(setting, flight.state)[0])


def _table(setting: Setting, flights: Sequence[Flight], attracted: Flight) -> Table:
    table = Table(title=f"{setting.duration:.0f} s in one step", title_justify="left")
    for heading in ("who", "variant", "time", "attitude error", "position error", "its time / the unit's"):
        table.add_column(heading, justify="left" if heading in ("who", "variant") else "right")
    for flight in flights:
        attitude, position = errors_of(setting, flight.state)
        errors = "" if flight is attracted else f"{attitude:.1e} rad", f"{position:.1e} m"
        ratio = f"{flight.seconds / flights[0].seconds:.2f}"
        table.add_row(flight.peer, flight.variant, f"{1e3 * flight.seconds:.3g} ms", *errors, ratio)
    return table

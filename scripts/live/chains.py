"""The chains of presets as the page has them: modules, connections, start values, and what is drawn of a body.

One set of modules serves all presets, that of the preset with the most features. Others connect as many rows as they
have features; the rig does not see what nobody connects.
"""

import base64
import gzip
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.special import chdtri

from baryscope import __version__
from baryscope.fmu.generate.wasm import wasm_module
from baryscope.fmu.system.chain import Chain, chain_of
from baryscope.models.errors import InputError
from baryscope.models.lvlh import lvlh_attitude
from baryscope.models.orbit import EARTH_RADIUS
from baryscope.models.scenario import Scenario
from baryscope.models.sensor.navigation import STATUSES
from baryscope.report.charts import TAIL
from baryscope.report.scene import hull_of, quaternions

FloatArray = NDArray[np.float64]
Tell = Callable[[str], None]


def chains_data(scenarios: Sequence[Scenario], first: str, tell: Tell | None = None) -> dict[str, Any]:
    """All that the page needs to know, as JSON has it: SI units, angles in rad.

    Args:
        scenarios: the presets.
        first: the name of the one that is shown at first.
        tell: told the name of each unit that has to be compiled.

    Raises:
        InputError: the scenarios do not have the same forces, which are built into the unit.
        ComputationError: ziglang is not installed, or fails.
    """
    widest = max(scenarios, key=lambda scenario: len(scenario.features.points))
    for other in scenarios:
        if other.forces != widest.forces:
            raise InputError(f"{other.name}: has other forces than {widest.name}, expected the same in all scenarios")
    degrees = np.linspace(1.0, 3.0, 41)
    low, high = (np.sqrt(chdtri(degrees, share)).tolist() for share in (1 - TAIL, TAIL))
    return {
        "version": __version__,
        "modules": _modules(chain_of(widest), tell),
        "presets": [preset_data(scenario) for scenario in scenarios],
        "first": [scenario.name for scenario in scenarios].index(first),
        "statuses": STATUSES,
        "band": {"degrees": degrees.tolist(), "low": low, "high": high},
        "ground": EARTH_RADIUS,
    }


def _modules(chain: Chain, tell: Tell | None) -> dict[str, Any]:
    """The units by their elements: model, table of variables, and the code, gzipped and in base 64."""
    found = {}
    for element, unit in chain.units.items():
        module = wasm_module(unit, partial(_tell, tell, unit.name))
        names = ("name", "kind", "shape", "boolean", "reference")
        variables = [{name: variable[name] for name in names} for variable in module.table["variables"]]
        code = base64.b64encode(gzip.compress(module.code, mtime=0)).decode()
        found[element] = {"code": code, "table": {"model": unit.name, "variables": variables}}
    return found


def _tell(tell: Tell | None, name: str, left: tuple[str, ...], done: float) -> None:
    if tell and left:
        tell(name)


def preset_data(scenario: Scenario) -> dict[str, Any]:
    """A scenario's chain.

    values: of all parameters, by element and name; connections: (element, output, element, input, number of scalars);
    moments, axes: of the principal axes, in the order of the body axes that they are near, as columns of a rotation;
    lvlh: the quaternion (w, x, y, z) that turns LVLH axes at time 0 into inertial ones.
    """
    chain = chain_of(scenario)
    moments, axes = _principal(np.array(scenario.target.inertia))
    points = np.array([point.position for point in scenario.features.points])
    return {
        "name": scenario.name,
        "description": scenario.description,
        "labels": [point.label for point in scenario.features.points],
        "faces": hull_of(points).ravel().tolist(),
        "reach": float(np.linalg.norm(points, axis=1).max()),
        "step": scenario.run.sample_time,
        "values": {
            element: {one.name: unit.starts[one.name].ravel().tolist() for one in chain.parameters(element)}
            for element, unit in chain.units.items()
        },
        "connections": [
            (*(one.start[0], one.start[1].name), *(one.end[0], one.end[1].name), len(one.scalars))
            for one in chain.connections
        ],
        "moments": moments.tolist(),
        "axes": axes.ravel().tolist(),
        "lvlh": quaternions(lvlh_attitude(scenario.orbit, np.zeros(1)))[0].tolist(),
    }


def _principal(inertia: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Principal moments (3,) and axes (3, 3), in columns, each in the place of the body axis that it is near."""
    moments, axes = np.linalg.eigh(inertia)
    _, order = linear_sum_assignment(-np.abs(axes))
    return moments[order], axes[:, order]

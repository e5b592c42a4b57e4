"""The tables of forces in scenario files: what the unit gets of them, and what is refused."""

import numpy as np
import pytest

import forces
from baryscope.models.errors import InputError
from baryscope.models.scenario import Scenario
from baryscope.models.variables import Force

DRAG = {"density": 1e-12, "target": 0.01, "chaser": 0.02}
LIGHT = {"sun": (0.0, 3.0, 4.0), "target": 0.02, "chaser": 0.01}
EDDY = {"tensor": ((2e6, 0.0, 1e5), (0.0, 1e6, 2e5), (1e5, 2e5, 3e6))}


def scenario(envisat, **tables):
    return Scenario.parse(envisat.model_dump(exclude_unset=True) | tables, "here")


def test_without_tables_there_are_no_forces(envisat):
    assert envisat.forces == frozenset()
    assert "drag" not in envisat.model_dump(exclude_unset=True)


def test_tables_become_parameters(envisat):
    flown = scenario(envisat, drag=DRAG, light=LIGHT, eddy_currents=EDDY)
    assert flown.forces == {Force.DRAG, Force.LIGHT, Force.EDDY_CURRENTS}
    values = flown.parameters()
    assert values["atmosphere.referenceRadius"] == envisat.orbit.semi_major_axis
    assert values["target.drag"] == 0.01
    assert values["sun.direction"] == pytest.approx([0.0, 0.6, 0.8])
    assert [float(values[f"target.magneticTensor.{axes}"]) for axes in ("xx", "xz", "yz")] == [2e6, 1e5, 2e5]
    assert values["magneticField.dipole"][2] < 0  # the Earth's points south
    assert flown.flat_parameters().size == flown.system.rhs.numel_in(2)


def test_j2_of_the_orbit_is_a_force(envisat):
    orbit = envisat.model_dump()["orbit"] | {"j2": forces.J2, "equatorial_radius": forces.RADIUS}
    flown = scenario(envisat, orbit=orbit)
    assert flown.forces == {Force.J2}
    assert np.isclose(flown.parameters()["orbit.j2"], forces.J2)


@pytest.mark.parametrize(
    "tables, message",
    [
        ({"drag": DRAG | {"density": -1e-12}}, "drag.density: found -1e-12, expected a value of at least 0 in kg/m³"),
        ({"drag": {"density": 1e-12, "target": 0.01}}, "drag.chaser: missing, expected a number in m²/kg"),
        ({"drag": DRAG | {"scale_height": 60.0}}, "drag.scale_height: found 60.0, expected a value of at least 100"),
        ({"light": LIGHT | {"sun": (0.0, 0.0, 0.0)}}, "light.sun: found [0.0, 0.0, 0.0], expected a direction"),
        ({"light": LIGHT | {"area": 2.0}}, "light.area: unknown"),
        (
            {"eddy_currents": {"tensor": ((-1e6, 0.0, 0.0), (0.0, 1e6, 0.0), (0.0, 0.0, 1e6))}},
            "eddy_currents.tensor: found smallest eigenvalue -1e+06, expected no eigenvalue below 0 S m⁴",
        ),
        (
            {"eddy_currents": {"tensor": ((1e6, 1.0, 0.0), (0.0, 1e6, 0.0), (0.0, 0.0, 1e6))}},
            "eddy_currents.tensor: found an asymmetric tensor",
        ),
    ],
)
def test_what_cannot_be_is_refused(envisat, tables, message):
    with pytest.raises(InputError) as error:
        scenario(envisat, **tables)
    assert message in str(error.value)

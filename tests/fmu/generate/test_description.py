"""What modelDescription.xml tells people: labels and axes, display units, limits, author and licence."""

import tomllib
import xml.etree.ElementTree as ET
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu

from baryscope.fmu import build_fmu
from baryscope.fmu.check.checker import check_unit
from baryscope.fmu.generate.build import describe_unit
from baryscope.fmu.units.target import target_blueprint

ROOT = Path(__file__).parents[3]
KINDS = [(2, False), (3, False), (3, True)]


def described(scenario, fmi, scalar):
    return ET.fromstring(describe_unit(target_blueprint(scenario), fmi, scalar=scalar)[0])  # noqa: S314  our own


@pytest.mark.parametrize("fmi, scalar", KINDS)
def test_descriptions_are_distinct_and_name_feature_and_axis(envisat, fmi, scalar):
    variables = {v.get("name"): v.get("description") for v in described(envisat, fmi, scalar).find("ModelVariables")}
    assert len(set(variables.values())) == len(variables)
    for row, label in enumerate(envisat.features.labels, start=1):
        for name in ("features", "normals", "target.features", "target.normals"):
            if name in variables:
                assert f"{label}," in f"{variables[name].partition('rows: ')[2]},"
            else:
                assert [variables[f"{name}[{row},{k}]"].partition(": ")[2] for k in (1, 2, 3)] == [
                    f"{label}, {axis}" for axis in "xyz"
                ]


def test_labels_that_xml_cannot_hold_are_written_without_what_does_not_show(small, tmp_path):
    """A file of TOML may have them by escapes."""
    names = ["a<b>&\"'", "bell\x07\u200b", "Ω, left"]
    points = tuple(p.model_copy(update={"label": n}) for p, n in zip(small.features.points, names, strict=True))
    odd = small.model_copy(update={"features": small.features.model_copy(update={"points": points})})
    unit = build_fmu(odd, tmp_path / "odd.fmu")
    assert validate_fmu(str(unit)) == []
    assert check_unit(unit, isolated=False) == []
    variables = {v.name: v.description for v in fmpy.read_model_description(str(unit)).modelVariables}
    texts = [variables[f"features[{row},1]"].partition(": ")[2] for row in (1, 2, 3)]
    assert texts == ["a<b>&\"', x", "bell??, x", "Ω, left, x"]


@pytest.mark.parametrize("fmi, name", [(2, "orbit.inclination"), (3, "orbit.inclination")])
def test_fmpy_sets_a_start_in_degrees_and_kilometres(envisat_fmu, envisat_fmu3_scalar, fmi, name):
    """By its own conversion, of the display units in the XML."""
    unit = str(envisat_fmu if fmi == 2 else envisat_fmu3_scalar)
    output = ["target.velocity[1]", "target.velocity[2]", "target.velocity[3]"]
    found, wanted = (
        fmpy.simulate_fmu(unit, stop_time=10.0, output_interval=10.0, start_values=starts, output=output)
        for starts in (
            {name: (51.6, "deg"), "orbit.semiMajorAxis": (6791.0, "km"), "target.angularRate0[1]": (2.0, "deg/s")},
            {name: np.deg2rad(51.6), "orbit.semiMajorAxis": 6.791e6, "target.angularRate0[1]": np.deg2rad(2.0)},
        )
    )
    for each in output:
        np.testing.assert_allclose(found[each], wanted[each], rtol=1e-12)


@pytest.mark.parametrize("fmi, scalar", KINDS)
@pytest.mark.parametrize("name", ["envisat", "pushed"])
def test_units_displayed_are_defined_and_used(request, fmi, scalar, name):
    root = described(request.getfixturevalue(name), fmi, scalar)
    defined = {(u.get("name"), d.get("name")) for u in root.iter("Unit") for d in u.iter("DisplayUnit")}
    floats = [e for e in root.find("ModelVariables").iter() if e.get("displayUnit")]
    assert {(e.get("unit"), e.get("displayUnit")) for e in floats} == defined
    assert {("rad", "deg"), ("rad/s", "deg/s"), ("m", "km"), ("m3/s2", "km3/s2")} <= defined


@pytest.mark.parametrize("fmi", [2, 3])
def test_who_made_it_and_under_what_licence(envisat, fmi):
    """As in LICENSE and pyproject.toml."""
    root = described(envisat, fmi, False)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert root.get("license") == project["license"]
    assert root.get("author") == project["authors"][0]["name"]
    assert root.get("version") == project["version"]
    assert root.get("copyright") in (ROOT / "LICENSE").read_text(encoding="utf-8").splitlines()


@pytest.mark.parametrize("fmi", [2, 3])
def test_limits_enclose_the_starts(envisat, fmi):
    limited = [e for e in described(envisat, fmi, False).find("ModelVariables").iter() if e.get("min")]
    assert {e.get("max") for e in limited if e.get("max")} == {"0.9999999999999999", "0.001"}
    starts = [e for e in limited if e.get("start")]
    assert len(starts) == 7
    for e in starts:
        assert float(e.get("min")) <= float(e.get("start")) <= float(e.get("max", "inf"))

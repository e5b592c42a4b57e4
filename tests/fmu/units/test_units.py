"""What every sampled unit must pass, in every version. TumblingTarget, which is continuous, has test_checker.py."""

import re
from importlib.resources import files

import pytest
from fmpy.validation import validate_fmu

from baryscope.fmu import build_fmu
from baryscope.fmu.check import check_unit
from baryscope.fmu.generate.codegen import place_constant
from baryscope.fmu.units import UNITS, blueprint_of
from baryscope.models.scenario import Sensor, StereoRig
from baryscope.models.variables import Kind


@pytest.fixture(scope="module")
def watched(small):
    """Three features, a rig."""
    sensor = Sensor(stereo=StereoRig(focal_length=900.0, baseline=0.8, pixel_noise=0.4))
    return small.model_copy(update={"sensor": sensor})


@pytest.mark.parametrize("fmi, scalar", [(2, False), (3, False), (3, True)])
@pytest.mark.parametrize("unit", [unit for unit in UNITS if unit != "target"])
def test_its_declarations_are_true(watched, tmp_path, monkeypatch, unit, fmi, scalar):
    monkeypatch.setenv("CFLAGS", "-O0 -g0")  # as it is: the checks take few steps, for which not even the filter's pays
    path = build_fmu(watched, tmp_path / "unit.fmu", unit=unit, fmi=fmi, scalar=scalar)
    assert validate_fmu(str(path)) == []
    assert check_unit(path, isolated=False) == []


@pytest.mark.parametrize("unit", ["rig", "estimator"])
def test_the_core_reads_every_input_and_writes_every_output(small, unit):
    """Those in whose C each has its line: an output that it forgets is 0 for ever, and true to all declarations."""
    blueprint = blueprint_of(unit, small)
    folder = files("baryscope.fmu") / "csrc"
    source = "".join((folder / name).read_text(encoding="utf-8") for name in blueprint.core.files)
    used = set(re.findall(r"\bAT_\w+", source))
    lacking = [v.name for v in blueprint.variables if v.kind != Kind.PARAMETER and place_constant(v) not in used]
    assert lacking == []

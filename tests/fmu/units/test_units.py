"""What every sampled unit must pass, in every version. TumblingTarget, which is continuous, has test_checker.py."""

import pytest
from fmpy.validation import validate_fmu

from baryscope.fmu import build_fmu
from baryscope.fmu.check import check_unit
from baryscope.fmu.units import UNITS
from baryscope.models.scenario import Sensor, StereoRig


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

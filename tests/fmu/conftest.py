import pytest
from fmpy.fmi3 import FMU3Model

from baryscope.models.scenario import load_scenario, preset_names
from importer3 import Importer3


@pytest.fixture(params=preset_names())
def preset(request):
    return load_scenario(request.param)


class Model3(Importer3):
    kind = FMU3Model


@pytest.fixture
def importer3(any_fmu3, tmp_path):
    """A Co-Simulation instance by FMI 3."""
    importer = Importer3(any_fmu3, tmp_path)
    yield importer
    importer.fmu.freeInstance()


@pytest.fixture
def model3(any_fmu3, tmp_path):
    """A Model Exchange instance by FMI 3."""
    model = Model3(any_fmu3, tmp_path / "model")
    yield model
    model.fmu.freeInstance()

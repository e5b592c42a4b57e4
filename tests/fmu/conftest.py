import pytest
from fmpy.fmi2 import FMU2Model
from fmpy.fmi3 import FMU3Model

import forces
from baryscope.fmu import build_fmu
from baryscope.models.scenario import load_scenario, preset_names
from importer import Importer
from importer3 import Importer3


@pytest.fixture(scope="session", params=preset_names())
def preset(request):
    return load_scenario(request.param)


@pytest.fixture(scope="session")
def preset_fmu(preset, tmp_path_factory):
    """The unit of `preset`."""
    return build_fmu(preset, tmp_path_factory.mktemp("preset") / "unit.fmu")


@pytest.fixture(scope="session")
def pushed(envisat):
    """Envisat in air and sunlight, with eddy currents."""
    return envisat.model_copy(update={"drag": forces.DRAG, "light": forces.LIGHT, "eddy_currents": forces.EDDY})


@pytest.fixture(scope="session")
def small(envisat):
    """Envisat with three features, the fewest that a unit can have: quick to compile and to check."""
    features = envisat.features.model_copy(update={"points": envisat.features.points[:3]})
    return envisat.model_copy(update={"features": features, "tracking": type(envisat.tracking)()})


@pytest.fixture(scope="session")
def small_fmu(small, tmp_path_factory):
    return build_fmu(small, tmp_path_factory.mktemp("small") / "small.fmu")


@pytest.fixture(scope="session")
def small_fmu3(small, tmp_path_factory):
    """The same unit for FMI 3, with arrays."""
    return build_fmu(small, tmp_path_factory.mktemp("small") / "small3.fmu", fmi=3)


class Model(Importer):
    kind = FMU2Model


@pytest.fixture
def model(envisat_fmu, tmp_path):
    """A Model Exchange instance by FMI 2."""
    model = Model(envisat_fmu, tmp_path / "model")
    yield model
    model.fmu.freeInstance()


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

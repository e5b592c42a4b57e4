import pytest

from baryscope.fmu import build_fmu


@pytest.fixture
def opened(tmp_path):
    """Open instances of units, each in a folder of its own; all are freed, however the test ends."""
    instances = []

    def open_one(kind, path, **parameters):
        instances.append(kind(path, tmp_path / f"instance{len(instances)}", **parameters))
        return instances[-1]

    yield open_one
    for one in instances:
        one.fmu.freeInstance()


@pytest.fixture(scope="module")
def controller_fmu(small, tmp_path_factory):
    return build_fmu(small, tmp_path_factory.mktemp("controller") / "controller.fmu", unit="controller")

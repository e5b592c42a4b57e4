"""Fixtures that several folders share: the units are built once a session."""

import pytest
from hypothesis import settings

from baryscope.fmu import build_fmu
from baryscope.models.scenario import load_scenario

settings.register_profile("baryscope", derandomize=True, deadline=None)
settings.load_profile("baryscope")


@pytest.fixture(scope="session")
def envisat():
    return load_scenario("envisat")


@pytest.fixture(scope="session")
def envisat_fmu(envisat, tmp_path_factory):
    return build_fmu(envisat, tmp_path_factory.mktemp("fmu") / "envisat.fmu")

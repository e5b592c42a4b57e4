import pytest

from baryscope.models.scenario import load_scenario, preset_names


@pytest.fixture(params=preset_names())
def preset(request):
    return load_scenario(request.param)

"""What the page is told of the presets, and the command that writes it."""

import json

import numpy as np
import pytest

import forces
from baryscope.live.__main__ import main
from baryscope.live.chains import chains_data, preset_data
from baryscope.models.errors import ComputationError, InputError
from baryscope.models.scenario import load_scenario, preset_names


@pytest.mark.parametrize("name", preset_names())
def test_principal_axes_and_moments_are_those_of_the_body(name):
    scenario = load_scenario(name)
    data = preset_data(scenario)
    R = np.reshape(data["axes"], (3, 3))
    J = np.array(scenario.target.inertia)
    np.testing.assert_allclose(R @ np.diag(data["moments"]) @ R.T, J, rtol=0, atol=1e-12 * np.trace(J))
    assert (np.abs(np.diag(R)) > 0.9).all()
    json.dumps(data, allow_nan=False)


def test_forces_are_built_in_so_all_must_have_the_same(envisat):
    pushed = envisat.model_copy(update={"name": "pushed", "drag": forces.DRAG})
    with pytest.raises(InputError, match="pushed: has other forces than envisat"):
        chains_data([envisat, pushed], "envisat")


def test_the_command_says_what_is_in_its_way(monkeypatch, tmp_path, capsys):
    """A path that cannot be written is bad input; no compiler for WebAssembly is a computation that cannot be done."""

    def without_compiler(tell):
        raise ComputationError("ziglang is not installed")

    monkeypatch.setattr("baryscope.live.page.live_page", lambda tell: "<!doctype html>")
    assert main([str(tmp_path / "index.html")]) == 0
    assert main([str(tmp_path / "index.html" / "other.html")]) == 2
    assert "index.html" in capsys.readouterr().err
    monkeypatch.setattr("baryscope.live.page.live_page", without_compiler)
    assert main([str(tmp_path / "index.html")]) == 1
    assert capsys.readouterr().err == "error: ziglang is not installed\n"

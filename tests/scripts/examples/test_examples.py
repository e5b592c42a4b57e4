"""The programs to copy run."""

import re
import runpy
from pathlib import Path

import numpy as np
import pytest

from baryscope.estimator import read_tracks
from baryscope.fmu.system import build_system
from baryscope.scripts.examples import walking
from baryscope.study import fly_loop

ROOT = Path(__file__).parents[3]
EXAMPLES = ROOT / "scripts" / "examples"


def test_every_example_is_run_by_a_test():
    """step_unit.mjs is run by the tests of the WebAssembly module."""
    programs = {path.name for path in EXAMPLES.iterdir() if path.is_file() and path.name != "__init__.py"}
    assert programs == {"step_unit.py", "step_unit.mjs", "close_loop.py", "own_controller.py", "walking.py"}


def test_the_loop_to_copy_runs_and_holds_its_station(capsys):
    runpy.run_path(str(EXAMPLES / "step_unit.py"))
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 10
    assert " 30.00 m from the centre of mass" in lines[-1]


def test_the_closed_loop_to_copy_arrives_on_estimates(capsys):
    """2 m before the grapple point within 3 cm, in step with 3.5 °/s; the centre of mass known to one."""
    runpy.run_path(str(EXAMPLES / "close_loop.py"))
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 10
    words = r"  900 s: +([0-9.]+) m from the grapple point; centre of mass known to +([0-9.]+) m, tumble known"
    away, error = map(float, re.fullmatch(words, lines[-1]).groups())
    assert abs(away - 2.0) <= 0.03
    assert error <= 0.01


def test_the_controller_to_copy_arrives_as_a_unit(envisat, tmp_path):
    """Packed by pythonfmu, in the place of ours: 2 m before the grapple point, in step with 3.5 °/s."""
    builder = pytest.importorskip("pythonfmu.builder", reason="pythonfmu, which packs it, is not installed")
    builder.FmuBuilder.build_FMU(EXAMPLES / "own_controller.py", dest=tmp_path)
    unit = tmp_path / "OwnController.fmu"
    loop = fly_loop(build_system(envisat, tmp_path / "own.ssp", controller=unit), duration=700.0, approach=True)
    assert loop.synchronised[-1]
    assert loop.miss[-100:].max() < 0.05
    assert np.linalg.norm(loop.chaser, axis=1).min() > 8.0
    assert np.nanmax(loop.error[-100:]) < 0.01


def test_the_walking_trial_of_the_tutorial_is_what_the_example_writes(tmp_path):
    """Byte for byte, in less than 100 kB, and as exact as it is written: to 0.05 mm."""
    walking.main(tmp_path / "walking.trc")
    written = (tmp_path / "walking.trc").read_bytes()
    assert written == (ROOT / "docs" / "walking.trc").read_bytes()
    assert len(written) < 100_000
    found, truth = read_tracks(tmp_path / "walking.trc"), walking.walk()
    assert found.labels == truth.labels
    np.testing.assert_allclose(found.position, truth.markers, atol=0.5001e-4)
    np.testing.assert_allclose(found.time, truth.time, atol=1e-9)

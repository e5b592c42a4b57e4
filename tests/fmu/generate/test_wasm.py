"""The unit in WebAssembly: it has no imports, and Node computes the same numbers."""

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from baryscope.fmu import Session
from baryscope.fmu.generate.wasm import build_wasm
from baryscope.models.errors import InputError
from baryscope.models.variables import Kind, variable_table
from baryscope.scripts.cli.build import build

STEPS, STEP = 600, 0.1  # s
AGREEMENT = 1e-9  # relative: WebAssembly has its own sine and cosine
EXAMPLE = Path(__file__).parents[3] / "scripts" / "examples" / "step_unit.mjs"


@pytest.fixture(scope="module")
def module(envisat, tmp_path_factory):
    return build_wasm(envisat, tmp_path_factory.mktemp("wasm") / "unit.wasm")


def node(*arguments):
    program = shutil.which("node") or shutil.which("nodejs")
    if program is None:
        pytest.skip("needs the package nodejs")
    return subprocess.run([program, *arguments], capture_output=True, text=True, check=False)


def test_node_steps_it_to_the_same_numbers(envisat, envisat_fmu, module):
    result = node(str(EXAMPLE), str(module), str(STEPS), str(STEP))
    assert result.returncode == 0, result.stderr
    rows = [line.split() for line in result.stdout.splitlines()]
    with Session(envisat_fmu) as session:
        for _ in range(STEPS):
            session.step(STEP)
        outputs = [v for v in variable_table(len(envisat.features.points)) if v.kind == Kind.OUTPUT]
        assert [(name, int(i)) for name, i, _ in rows] == [(v.name, i) for v in outputs for i in range(v.size)]
        found = np.array([value for _, _, value in rows], dtype=float)
        np.testing.assert_allclose(found, session.outputs, rtol=AGREEMENT, atol=AGREEMENT)


def test_the_module_has_no_imports(module):
    script = "const bytes = require('fs').readFileSync(process.argv[1]);"
    script += "console.log(WebAssembly.Module.imports(new WebAssembly.Module(bytes)))"
    result = node("-e", script, str(module))
    assert (result.stdout.strip(), result.stderr) == ("[]", "")


def test_a_refusal_reaches_the_reader(module):
    result = node(str(EXAMPLE), str(module), "1", "-1")
    assert result.returncode != 0
    assert "fmi2DoStep" in result.stderr
    assert "-1" in result.stderr


@pytest.mark.parametrize("arguments", [[], ["unit.fmu"]], ids=["none", "an FMU"])
def test_the_example_says_what_it_takes(arguments):
    """It ended with the stack of a TypeError, or of a file that was not found."""
    result = node(str(EXAMPLE), *arguments)
    assert result.returncode == 2
    assert result.stderr == "usage: node scripts/examples/step_unit.mjs UNIT.wasm [STEPS [SECONDS]]\n"


def test_its_table_is_the_table_of_variables(envisat, module):
    described = json.loads(module.with_suffix(".json").read_text(encoding="utf-8"))["variables"]
    table = variable_table(len(envisat.features.points))
    assert [row["name"] for row in described] == [variable.name for variable in table]
    sizes = [variable.size for variable in table]
    assert [row["reference"] for row in described] == [sum(sizes[:k]) for k in range(len(sizes))]
    for row, variable in zip(described, table, strict=True):
        assert (row["unit"], row["kind"], row["boolean"]) == (variable.unit, variable.kind, variable.boolean)


def test_the_command_line_builds_it(module, tmp_path, capsys):
    build(scenario="envisat", platforms="wasm", output=tmp_path / "unit.wasm")
    assert "unit.wasm: 12 features" in capsys.readouterr().out
    assert (tmp_path / "unit.wasm").read_bytes() == module.read_bytes()
    with pytest.raises(InputError, match=r"'\.fmu', expected \.wasm"):
        build(scenario="envisat", platforms="wasm", output=tmp_path / "unit.fmu")


def test_a_sampled_unit_is_a_module_too(small, tmp_path):
    module = build_wasm(small, tmp_path / "rig.wasm", unit="rig")
    assert module.read_bytes()[:4] == b"\0asm"
    described = json.loads((tmp_path / "rig.json").read_text())
    assert described["model"] == "StereoRig"
    assert [v["name"] for v in described["variables"] if v["kind"] == "input"][:2] == ["features", "normals"]

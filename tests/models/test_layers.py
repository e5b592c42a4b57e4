"""The equations and the estimators know nothing of scenario files: who imports whom."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FILES = "baryscope.models.scenario", "baryscope.models.sensor", "pydantic"
ABOVE = "baryscope.estimator", "baryscope.fmu", "baryscope.study", "baryscope.scripts"
DYNAMICS = sorted((ROOT / "models").glob("*.py"))
# The bound is that of a scenario; pydantic makes the schema of the file that an estimate is written to, and reads rigs.
FILED, FILES_OF_AN_ESTIMATE = {"bound.py", "lens.py", "rig.py"}, ROOT / "estimator" / "document"
# The online estimator is C, compiled as the units are.
COMPILED = ROOT / "estimator" / "online"
ESTIMATORS = sorted(
    path
    for path in (ROOT / "estimator").rglob("*.py")
    if path.name not in FILED and not {COMPILED, FILES_OF_AN_ESTIMATE} & set(path.parents)
)
SCENARIO, SENSOR = (sorted((ROOT / "models" / room).glob("*.py")) for room in ("scenario", "sensor"))


def imports(path):
    """The modules that a file imports, `from a import b` as `a`."""
    nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
    names = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    return names | {node.module for node in nodes if isinstance(node, ast.ImportFrom)}


@pytest.mark.parametrize(
    "paths, forbidden",
    [
        pytest.param(DYNAMICS, (*FILES, *ABOVE), id="dynamics"),
        pytest.param(ESTIMATORS, (*FILES, *ABOVE[1:]), id="estimators"),
        pytest.param(SCENARIO, ("baryscope.models.sensor", *ABOVE), id="scenario"),
        pytest.param(SENSOR, ("pydantic", *ABOVE), id="sensor"),
    ],
)
def test_imports_run_one_way(paths, forbidden):
    assert len(paths) > 3
    for path in paths:
        assert [name for name in imports(path) if name.startswith(forbidden)] == [], path

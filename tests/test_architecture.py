"""Which way imports run: between the packages, between their rooms, and inside a room; and how long lines are."""

import ast
import tomllib
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
BARYSCOPE = "baryscope"
LONGEST = 160  # characters of a line of C, JavaScript or CSS

# From the bottom up; a layer may import from those above it in this list. What shares a line stands side by side.
LAYERS = [
    ["models"],
    ["models.ephemeris"],
    ["models.scenario"],
    ["models.sensor", "models.approach"],
    ["fmu.layout", "estimator.limits", "estimator.progress", "estimator.geometry"],
    ["fmu.units", "estimator.thrust"],
    ["fmu.generate", "fmu.runtime", "estimator.options", "estimator.observability", "estimator.tables"],
    ["fmu.check", "fmu.system", "estimator.camera"],
    ["estimator.tracks", "estimator.online"],
    ["estimator.registration", "estimator.plausibility", "estimator.formats", "estimator.images"],
    ["estimator.details", "estimator.paths"],
    ["estimator.dynamics", "estimator.hyperparameters"],
    ["estimator.turning", "estimator.widening"],
    ["estimator.prediction"],
    ["estimator.findings", "estimator.distances"],
    ["estimator.result"],
    ["estimator.adjustment", "estimator.prose"],
    ["estimator.orbits"],
    ["estimator.screws", "estimator.pivot", "estimator.score", "estimator.document", "estimator.claims"],
    ["estimator.consider"],
    ["estimator.ml"],
    ["estimator.ekf"],
    ["estimator.noise"],
    ["estimator.methods", "estimator.bound"],
    ["estimator", "fmu"],
    ["report"],
    ["study", "live"],
    ["study.population"],
    ["study.world", "study.joints"],
    ["study.online", "study.approach", "study.images"],
    ["scripts.cli.options"],
    ["scripts.cli"],
    ["scripts.examples", "scripts.benchmarks"],
]


def packages():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]
    folders = settings["package-dir"]
    for package in settings["packages"]:
        base = max((name for name in folders if package == name or package.startswith(f"{name}.")), key=len)
        yield package, ROOT / folders[base] / package.removeprefix(base).replace(".", "/").lstrip("/")


def modules():
    """Every module of the project by its name."""
    for package, folder in packages():
        for path in folder.glob("*.py"):
            yield (package if path.stem == "__init__" else f"{package}.{path.stem}"), path


MODULES = dict(modules())


def imports_of(name):
    """Modules of the project that a module imports, in functions, too."""
    for node in ast.walk(ast.parse(MODULES[name].read_text(encoding="utf-8"))):
        names = []
        if isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        for found in names:
            target = found if found in MODULES else found.rpartition(".")[0]
            if target in MODULES and target not in (BARYSCOPE, name):
                yield target


@cache
def imports():
    """By the name of each module."""
    return {name: set(imports_of(name)) for name in MODULES}


def layer_of(module):
    """The number of the longest layer name that a module is, or is in."""
    short = module.removeprefix(f"{BARYSCOPE}.")
    fitting = [
        (len(room), number)
        for number, rooms in enumerate(LAYERS)
        for room in rooms
        if short == room or short.startswith(f"{room}.")
    ]
    return max(fitting)[1] if fitting else None


def room_of(module):
    short = module.removeprefix(f"{BARYSCOPE}.")
    return max((room for rooms in LAYERS for room in rooms if short == room or short.startswith(f"{room}.")), key=len)


PLACED = sorted(name for name in MODULES if layer_of(name) is not None)


def test_every_module_has_its_layer():
    roots = {
        BARYSCOPE,
        *(
            f"{BARYSCOPE}.{name}"
            for name in ("__main__", "progress", "streams", "table", "threads", "worker", "scripts")
        ),
    }
    assert set(MODULES) - set(PLACED) == roots
    rooms = {room for rooms in LAYERS for room in rooms}
    assert {room_of(name) for name in PLACED} == rooms


def test_no_module_imports_upwards_or_sideways():
    wrong = [
        f"{name} imports {other}"
        for name in PLACED
        for other in sorted(imports()[name])
        if layer_of(other) is not None and room_of(other) != room_of(name) and layer_of(other) >= layer_of(name)
    ]
    assert wrong == []


def test_estimators_know_nothing_of_units_and_commands():
    for name in PLACED:
        package = name.split(".")[1]
        reached = {other.split(".")[1] for other in imports()[name]}
        if package == "estimator":
            # The online estimator is C, which the units' compiler driver builds; nothing else of a unit is known there.
            also = {"fmu"} if name == "baryscope.estimator.online.core" else set()
            assert reached <= {"estimator", "models"} | also, name
        if package == "models":
            assert reached <= {"models"}, name
        if package == "fmu":
            assert reached <= {"fmu", "models"}, name
        if package == "study":
            assert "scripts" not in reached, name


@pytest.mark.parametrize("population", ["second", "third", "fourth"])
def test_the_populations_share_no_truth(population):
    """What one draws wrongly, another may show: of the others each knows only what judging asks of a case."""
    first = "baryscope.study.population"
    own = {name for name in imports() if name.startswith(f"{first}.{population}")}
    shared = {other for name in own for other in imports()[name] if other.startswith("baryscope")} - own
    assert shared == {f"{first}.interface", "baryscope.estimator", "baryscope.models.orbit"}
    assert own & {other for name in ("cases", "motion", "sensing") for other in imports()[f"{first}.{name}"]} == set()


def test_no_two_modules_import_each_other():
    """Not by a detour either: graphlib raises a CycleError with the modules of the cycle."""
    assert len(list(TopologicalSorter(imports()).static_order())) == len(MODULES)


def loaded_at_once(name):
    """Libraries, or rooms of them, that a module names outside its functions."""
    for node in ast.parse(MODULES[name].read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ImportFrom) and node.module:
            yield from (node.module, *(f"{node.module}.{alias.name}" for alias in node.names))
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


def test_what_is_slow_to_load_is_loaded_where_it_is_used():
    """Each takes some tenths of a second of every process; an example is a program that needs what it names."""
    slow = ("matplotlib", "pandas", "scipy.signal", "scipy.stats")
    found = [
        f"{name} loads {library}"
        for name in MODULES
        if not name.startswith("baryscope.scripts.examples.")
        for library in loaded_at_once(name)
        if any(f"{library}.".startswith(f"{one}.") for one in slow)
    ]
    assert found == []


MEASURING = ("baryscope.study.", "baryscope.scripts.benchmarks.")


def measuring_programs():
    """The modules that measure and can be run, but for the one that only writes a file for the tests."""
    for name, path in MODULES.items():
        can_be_run = 'if __name__ == "__main__":' in path.read_text(encoding="utf-8")
        if can_be_run and name.startswith(MEASURING) and not name.endswith("under_forces"):
            yield name


@pytest.mark.parametrize("name", list(measuring_programs()))
def test_what_measures_prefers_one_thread_before_numpy_is_loaded(name):
    _, first, second, *_ = ast.parse(MODULES[name].read_text(encoding="utf-8")).body
    assert ast.unparse(first) == "from baryscope.threads import prefer_one_thread"
    assert ast.unparse(second) == "prefer_one_thread()"


@pytest.mark.parametrize("package", [name for name, _ in packages()])
def test_a_room_says_what_lives_there_and_is_not_crowded(package):
    text = MODULES[package].read_text(encoding="utf-8")
    assert ast.get_docstring(ast.parse(text)), f"{package} does not say what it is"
    files = list(MODULES[package].parent.glob("*.py"))
    assert len(files) <= 21, f"{package} has {len(files)} files"
    for path in files:
        assert len(path.read_text(encoding="utf-8").splitlines()) <= 400, f"{path.name} is long"


@pytest.mark.parametrize("package", [name for name, _ in packages()])
def test_a_room_has_its_row_in_the_page_of_the_architecture(package):
    """By its folder, or by what it is called beside the room that it lies in."""
    folders = MODULES[package].parent.relative_to(ROOT).parts
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    rows = [line for line in page.splitlines() if line.startswith(f"| `{folders[0]}/")]
    names = {f"`{'/'.join(folders[first:])}/`" for first in range(len(folders))}
    assert any(name in row for row in rows for name in names), f"{package} has no row"


def test_no_line_is_too_long_to_read():
    """Those of Python are ruff's."""
    sources = [path for folder in ("fmu/csrc", "scripts") for path in (ROOT / folder).rglob("*")]
    read = [path for path in sources if path.suffix in {".c", ".h", ".js", ".css"}]
    assert read
    wrong = [
        f"{path.relative_to(ROOT)}:{number}: {len(line)}"
        for path in read
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if len(line) > LONGEST
    ]
    assert wrong == []

"""What is shipped: the sdist is the whole repository, and the wheel made from it runs where nothing else of it is."""

import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import venv
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
# Without what changes which modules are found, or what setuptools warns of.
ENVIRONMENT = {k: v for k, v in os.environ.items() if k not in {"PYTHONPATH", "PYTHONDONTWRITEBYTECODE"}}
# What a build prints on the way is kept: not every warning of setuptools is one of Python's.
BUILD = "import sys; from setuptools import build_meta; print(getattr(build_meta, sys.argv[1])(sys.argv[2]))"
IMPORT_ALL = """
import ast, importlib.util, pkgutil, baryscope
from pathlib import Path
names = [module.name for module in pkgutil.walk_packages(baryscope.__path__, "baryscope.")]
for name in names:
    if name.startswith("baryscope.scripts.examples."):  # which fly when they are imported: what they import
        text = ast.parse(Path(importlib.util.find_spec(name).origin).read_text(encoding="utf-8"))
        text.body = [part for part in text.body if isinstance(part, (ast.Import, ast.ImportFrom))]
        exec(compile(text, name, "exec"), {})
    elif not name.endswith("__main__"):
        importlib.import_module(name)
print("baryscope", *names)
"""


def built(kind, source, target):
    """Build by setuptools as pip would, in a process that turns warnings into errors; give the file."""
    command = [sys.executable, "-W", "error", "-c", BUILD, f"build_{kind}", str(target)]
    done = subprocess.run(command, cwd=source, env=ENVIRONMENT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    warnings = [line for line in (done.stdout + done.stderr).splitlines() if "warning" in line.lower()]
    # A clean copy has nothing of what MANIFEST.in keeps out.
    assert [line for line in warnings if "no previously-included files" not in line] == []
    return target / done.stdout.splitlines()[-1]


@pytest.fixture(scope="module")
def tracked():
    """The files of the repository."""
    git = shutil.which("git")
    if git is None or not (ROOT / ".git").exists():
        pytest.skip("the tests run outside a checkout")
    listed = subprocess.run([git, "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    return [name for name in listed.split("\0") if name and (ROOT / name).exists()]


@pytest.fixture(scope="module")
def unpacked(tracked, tmp_path_factory):
    """The sdist, made from a copy of the repository so that nothing is left there, and unpacked."""
    folder = tmp_path_factory.mktemp("sdist")
    for name in tracked:
        copy = folder / "repository" / name
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes((ROOT / name).read_bytes())
    with tarfile.open(built("sdist", folder / "repository", folder)) as archive:
        archive.extractall(folder, filter="data")
    (found,) = (path for path in folder.iterdir() if path.is_dir() and path.name != "repository")
    return found


@pytest.fixture(scope="module")
def python(unpacked, tmp_path_factory):
    """The interpreter of an environment that has the wheel, and our dependencies but not our editable install."""
    folder = tmp_path_factory.mktemp("wheel")
    wheel = built("wheel", unpacked, folder)
    venv.create(folder / "venv", symlinks=True)
    binary = folder / "venv/bin/python"
    query = [binary, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"]
    site = Path(subprocess.run(query, capture_output=True, text=True, check=True).stdout.strip())
    # Directories that a .pth file names don't have their own .pth files read: the editable install stays behind.
    borrowed = [path for path in sys.path if path.endswith("-packages")]
    (site / "borrowed.pth").write_text("\n".join(borrowed), encoding="utf-8")
    install = ["-m", "pip", "install", "--quiet", "--no-deps", "--no-index", "--ignore-installed", wheel]
    subprocess.run([binary, *install], check=True)
    return binary


@pytest.fixture
def run(python, tmp_path):
    def run(*arguments):
        done = subprocess.run(
            [python, *arguments], cwd=tmp_path, env=ENVIRONMENT, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


def test_the_sdist_is_the_repository(tracked, unpacked):
    files = {str(path.relative_to(unpacked)) for path in unpacked.rglob("*") if path.is_file()}
    made = {name for name in files if name.split("/")[0] in {"PKG-INFO", "setup.cfg", "baryscope.egg-info"}}
    assert files - made == set(tracked)


def installed_as(name):
    """Where the wheel has a file of the repository, from the folder of packages on; None for one that it hasn't."""
    folders = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]["package-dir"]
    parents = Path(name).parents
    above = [(len(folder), package, folder) for package, folder in folders.items() if Path(folder) in parents]
    if not above:
        return None
    _, package, folder = max(above)
    return Path(*package.split("."), Path(name).relative_to(folder))


def test_every_module_of_the_repository_is_in_the_wheel_and_can_be_imported(tracked, run):
    files = [installed_as(name) for name in tracked if name.endswith(".py")]
    expected = {".".join(path.with_suffix("").parts).removesuffix(".__init__") for path in files if path}
    assert len(expected) > 50
    assert set(run("-W", "error", "-c", IMPORT_ALL).splitlines()[-1].split()) == expected


def test_the_wheel_has_what_is_not_python(tracked, run):
    """Presets, campaigns, the C of the unit, and the mark that says that there are types."""
    site = Path(run("-c", "import baryscope; print(baryscope.__path__[0])").strip()).parent
    assert ROOT not in site.parents
    files = {name: installed_as(name) for name in tracked if not name.endswith(".py")}
    assert {".toml", ".c", ".h", ".typed"} <= {Path(name).suffix for name, target in files.items() if target}
    for name, target in files.items():
        if target:
            assert (site / target).read_bytes() == (ROOT / name).read_bytes()


def test_the_command_runs_from_the_wheel(python, run):
    version = run("-c", "import baryscope; print(baryscope.__version__)")
    assert version.split(".")[0].isdigit()
    assert run(python.parent / "baryscope", "--version") == version
    assert "envisat" in run("-m", "baryscope", "scenarios")


def test_one_version_everywhere():
    def found(name, pattern):
        (version,) = re.findall(pattern, (ROOT / name).read_text(encoding="utf-8"), re.MULTILINE)
        return version

    version = found("pyproject.toml", r'^version = "(.*)"$')
    assert found("CITATION.cff", r"^version: (.*)$") == version
    assert f"## {version}" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")

"""Which program made a campaign's runs: a hash of everything that a run passes through."""

import hashlib
from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable

from baryscope.fmu.layout.platforms import host_platform

STATIONS = ("baryscope.models", "baryscope.fmu", "baryscope.estimator")
SUFFIXES = (".py", ".c", ".h")
ITSELF = (
    ("baryscope.study.campaign", "case.py"),
    ("baryscope.study.campaign", "vary.py"),
    ("baryscope.study", "flight.py"),
    ("baryscope.study", "methods.py"),
)


@cache
def program_hash() -> str:
    """A hash of the sources of truth model, unit and estimators, short: equal ones give equal runs."""
    digest = hashlib.sha256()
    sources = [source for package in STATIONS for source in _sources(files(package))]
    sources += [files(package) / name for package, name in ITSELF]
    for source in sources:
        digest.update(source.name.encode() + b"\0" + source.read_bytes() + b"\0")
    return digest.hexdigest()[:12]


def program_here() -> str:
    """The program and the platform that this process runs on: a unit that is built for the same can be sent to it."""
    return f"{program_hash()} on {host_platform().name}"


def _sources(folder: Traversable) -> list[Traversable]:
    items = sorted(folder.iterdir(), key=lambda item: item.name)
    own = [item for item in items if item.is_file() and item.name.endswith(SUFFIXES)]
    return own + [source for item in items if item.is_dir() for source in _sources(item)]

"""Fixtures that several folders share: the units are built once a session."""

import gc
import os
import shutil
from importlib.metadata import version

import pytest
from hypothesis import settings

import baryscope.scripts.cli  # noqa: F401  first, since it says how many threads numpy may use
from baryscope.estimator.online.core import MAIN as ALONE
from baryscope.fmu import build_fmu
from baryscope.fmu.generate.compiler import Job
from baryscope.models.scenario import load_scenario

settings.register_profile("baryscope", derandomize=True, deadline=None)
settings.load_profile("baryscope")

SOONER, FILTER = "-O0", "online.h"  # an option of the compiler; a source of what holds the online filter
ZIG_SOONER = ("-O3", "-Xclang", SOONER)  # as above, but for zig, which adds checks and a time where it is told -O0

# Tests start many processes, and so does xdist. Without bytecode each would compile the package once more.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# Modules and tests stay for the session: what looks for reference cycles would look at them again and again.
gc.set_threshold(20_000, 10, 100)


def pytest_collection_finish():
    """Neither does it look at what is there when the first test begins, nor when the last one has ended."""
    gc.freeze()


def pytest_report_header():
    """On what the tests run, and which programs that some of them need are there."""
    packages = ("baryscope", "casadi", "fmpy", "numpy", "scipy")
    programs = ("cc", "wine64", "qemu-aarch64-static", "node", "chromium")
    return [
        "with: " + ", ".join(f"{name} {version(name)}" for name in packages),
        "programs: " + ", ".join(name if shutil.which(name) else f"no {name}" for name in programs),
        f"OPENBLAS_CORETYPE: {os.environ.get('OPENBLAS_CORETYPE', 'as the processor has it')}",
    ]


@pytest.fixture(scope="session", autouse=True)
def own_cache(tmp_path_factory, testrun_uid):
    """Libraries compiled by the tests are kept for the session, all its workers', and leave the user's cache alone.

    They are made sooner without optimisation; what users get is tested where units are built, without CFLAGS. The
    online filter runs for minutes: what holds it gets the optimisations that pay, most of all the library of it
    alone, which is built once, but for zig's, which run for seconds.
    """
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent / testrun_uid
    as_told = Job.steps.fget

    def steps(job):
        if os.environ.get("CFLAGS") != SOONER:
            return as_told(job)
        level = ("-O2" if job.main == ALONE else "-Og" if FILTER in job.sources else SOONER,)
        told = (SOONER,)
        if job.by_zig:
            told, level = ("-O3",), ZIG_SOONER
        return [[new for word in step for new in (level if word in told else (word,))] for step in as_told(job)]

    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("BARYSCOPE_CACHE", str(folder / "cache"))
        patch.setenv("CFLAGS", SOONER)
        patch.setattr(Job, "steps", property(steps))
        yield


@pytest.fixture(scope="session")
def envisat():
    return load_scenario("envisat")


@pytest.fixture(scope="session")
def envisat_fmu(envisat, tmp_path_factory):
    return build_fmu(envisat, tmp_path_factory.mktemp("fmu") / "envisat.fmu")


@pytest.fixture(scope="session")
def envisat_fmu3(envisat, tmp_path_factory):
    """The same unit for FMI 3, with arrays."""
    return build_fmu(envisat, tmp_path_factory.mktemp("fmu") / "envisat3.fmu", fmi=3)


@pytest.fixture(scope="session")
def envisat_fmu3_scalar(envisat, tmp_path_factory):
    """The same unit for FMI 3, without arrays."""
    return build_fmu(envisat, tmp_path_factory.mktemp("fmu") / "envisat3s.fmu", fmi=3, scalar=True)


@pytest.fixture(params=["envisat_fmu", "envisat_fmu3", "envisat_fmu3_scalar"], ids=["fmi2", "fmi3", "fmi3-scalar"])
def any_fmu(request):
    """The same unit in each of its forms."""
    return request.getfixturevalue(request.param)


@pytest.fixture(params=["envisat_fmu3", "envisat_fmu3_scalar"], ids=["arrays", "scalar"])
def any_fmu3(request):
    """The same unit in both of its forms for FMI 3."""
    return request.getfixturevalue(request.param)

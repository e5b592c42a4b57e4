"""The units on hosts that give them little stack, and trap exceptions of floating point."""

import ctypes
import ctypes.util
import platform
import subprocess
import sys
from pathlib import Path

import pytest

from baryscope.fmu.system import build_system

STEPS = 150  # until the tumble is known, and the first nodes have been taken again
PLENTY, LITTLE = 8 << 20, 192 << 10  # bytes; of the second, Python takes a part


@pytest.fixture(scope="module")
def system(envisat, tmp_path_factory):
    return build_system(envisat, tmp_path_factory.mktemp("system") / "chain.ssp")


def flown(system, *, stack=PLENTY, traps=False):
    """What a flight of its own process prints."""
    probe = Path(__file__).with_name("host_probe.py")
    command = [sys.executable, str(probe), str(system), str(STEPS), str(stack), str(int(traps))]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 0, f"{result.returncode}: {result.stderr}"
    assert len(result.stdout.splitlines()) == 4, result.stderr
    return result.stdout


@pytest.fixture(scope="module")
def usual(system):
    return flown(system)


def can_trap():
    name = ctypes.util.find_library("m")
    return platform.machine() == "x86_64" and name is not None and hasattr(ctypes.CDLL(name), "feenableexcept")


@pytest.mark.skipif(not can_trap(), reason="needs glibc on x86-64, whose feenableexcept turns exceptions into signals")
def test_no_step_has_an_exception_of_floating_point(system, usual):
    """A host that traps them, as debuggers of models do, ended at the estimator's first frame: 0 / 0."""
    assert flown(system, traps=True) == usual


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="other systems round stacks up")
def test_steps_and_tuning_need_little_stack(system, usual):
    """Threads of importers may have 256 kB, those of musl 128; the estimator needed 400, and 260 where it was tuned."""
    assert flown(system, stack=LITTLE) == usual

"""What all parts of the benchmark share: the scenario, its unit, lengths of runs, and closed forms to compare with."""

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from baryscope.models.scenario import Scenario

Result = TypeVar("Result")

STEP = 0.1  # s
PEERS = {
    "heyoka": "heyoka",
    "basilisk": "Basilisk",
    "pythonfmu": "pythonfmu",
    "gtsam": "gtsam",
}  # optional ones, and their packages


@dataclass(frozen=True)
class Setting:
    """Attributes:
    scenario: the target and its orbit.
    unit: its FMU, for FMI 2.
    folder: for temporary files.
    peers: the optional peers to be measured.
    steps: steps of 0.1 s in a run; a whole number of seconds.
    frames: frames of the long tracks.
    rows: rows of the long tables.
    """

    scenario: Scenario
    unit: Path
    folder: Path
    peers: frozenset[str] = frozenset()
    steps: int = 60_000
    frames: int = 60_000
    rows: int = 500_000

    @property
    def duration(self) -> float:
        """Length of a run, s."""
        return self.steps * STEP

    @cached_property
    def closed_form(self) -> "ClosedForm":
        """Attitude and position at the end of a run."""
        return ClosedForm.of(self.scenario, self.duration)


@dataclass(frozen=True)
class ClosedForm:
    """The state of a torque-free target, by Jacobi's functions with one quadrature and by two Kepler orbits.

    Attributes:
        attitude: R_I_B.
        position: (3,), the CoM in frame C, m.
    """

    attitude: Rotation
    position: NDArray[np.float64]

    @classmethod
    def of(cls, scenario: Scenario, duration: float) -> "ClosedForm":
        """At a time in whole seconds."""
        oracles = oracles_of_the_tests()
        J, rate = np.array(scenario.target.inertia), np.deg2rad(scenario.target.angular_rate_deg)
        turned = oracles.TorqueFree(J, rate).attitude(np.arange(duration + 1.0))[-1]
        start = Rotation.from_quat(scenario.target.attitude, scalar_first=True)
        return cls(start * turned, oracles.com_in_chaser_frame(scenario, [duration])[0])

    def errors(self, attitude: ArrayLike, position: ArrayLike) -> tuple[float, float]:
        """Errors of an attitude (quaternion w, x, y, z; body to inertial), rad, and of a CoM in C, m."""
        found = Rotation.from_quat(np.asarray(attitude, dtype=float), scalar_first=True)
        distance = np.linalg.norm(np.asarray(position, dtype=float) - self.position)
        return float((found.inv() * self.attitude).magnitude()), float(distance)


def oracles_of_the_tests() -> ModuleType:
    """tests/oracles.py, the closed forms and independent programs of the tests."""
    sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))
    try:
        import oracles
    finally:
        sys.path.pop(0)
    module: ModuleType = oracles
    return module


def best(work: Callable[[], object], repeats: int = 3) -> float:
    """The shortest of several runs, s."""
    return best_of(work, repeats)[0]


def best_of(work: Callable[[], Result], repeats: int) -> tuple[float, Result]:
    """The shortest of one or several runs, s, and what the last one returned."""
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        found = work()
        times.append(time.perf_counter() - begin)
    return min(times), found


def installed_peers() -> frozenset[str]:
    """The optional peers that are there."""
    return frozenset(peer for peer, package in PEERS.items() if find_spec(package))

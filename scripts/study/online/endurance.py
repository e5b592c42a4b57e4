"""A day of frames: whether time per frame, memory, error and claim stay as they are."""

import gc
import resource
import sys
import time as clock
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from baryscope.estimator.online import OnlineEstimator
from baryscope.fmu import Session
from baryscope.models.files import temporary_folder
from baryscope.models.scenario import load_scenario
from baryscope.study.flight import build_unit
from baryscope.study.population.consistency import nees
from baryscope.table import Table

SCENARIO, FEATURES = "envisat", 10
HEADINGS = (
    "hour",
    "status",
    "error mm",
    "claimed mm",
    "NEES",
    "µs a frame",
    "slowest of 1000",
    "filter kB",
    "process MB",
)


@dataclass(frozen=True)
class Hour:
    """What an hour of frames leaves.

    Attributes:
        number: of the hour, from 1; the last may be a part of one.
        status: at its end.
        error: of the centre of mass at its end, m.
        claimed: the deviation of that error, m.
        nees: of that error, of three degrees of freedom.
        frame: time of `update` from Python, mean, s.
        slow: the time that one frame in a thousand exceeds, s.
        filter: size of the saved filter, bytes.
        process: the largest memory that the process has had, bytes.
    """

    number: int
    status: str
    error: float
    claimed: float
    nees: float
    frame: float
    slow: float
    filter: int
    process: int


def endured(hours: float, rate: float, seed: int) -> Iterator[Hour]:
    """Fly Envisat with ten features in view, `rate` frames a second, and estimate online; an `Hour` after each hour."""
    scenario = load_scenario(SCENARIO)
    sigma, rng = scenario.sensor.noise, np.random.default_rng(seed)
    filter = OnlineEstimator(sigma, scenario.orbit)
    total, each = round(3600 * hours * rate), round(3600 * rate)
    with (
        temporary_folder() as folder,
        Session(build_unit(scenario, folder / "unit.fmu"), scenario.parameters()) as unit,
    ):
        for begin in range(0, total, each):
            frames = min(each, total - begin)
            walls, noise = np.empty(frames), np.empty((FEATURES, 3))
            for k in range(frames):
                unit.step_to((begin + k + 1) / rate)
                points = unit.features[:FEATURES] + sigma * rng.standard_normal(out=noise)
                start = clock.perf_counter()
                state = filter.update(unit.time, points)
                walls[k] = clock.perf_counter() - start
            gc.collect()
            error, covariance = state.position - unit.position, state.covariance[:3, :3]
            yield Hour(
                number=begin // each + 1,
                status=state.status,
                error=float(np.linalg.norm(error)),
                claimed=float(np.sqrt(np.trace(covariance))),
                nees=nees(error, covariance),
                frame=float(walls.mean()),
                slow=float(np.quantile(walls, 0.999)),
                filter=len(filter.save()),
                process=resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024),
            )


def row(hour: Hour) -> tuple[str, ...]:
    """Its cells, below HEADINGS."""
    return (
        str(hour.number),
        hour.status,
        f"{1e3 * hour.error:.3g}",
        f"{1e3 * hour.claimed:.3g}",
        f"{hour.nees:.2f}",
        f"{1e6 * hour.frame:.1f}",
        f"{1e6 * hour.slow:.0f}",
        f"{hour.filter / 1e3:.0f}",
        f"{hour.process / 1e6:.0f}",
    )


def hours_table(hours: list[Hour], rate: float) -> Table:
    """A row for each hour."""
    return Table(HEADINGS, tuple(map(row, hours)), f"{SCENARIO}, {FEATURES} features at {rate:g} Hz", left=2)

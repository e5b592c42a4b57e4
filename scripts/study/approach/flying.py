"""One approach of a draw, as a line of numbers: the chaser's miss and the error of what it is told, over time."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from baryscope.estimator.options import ScrewOptions
from baryscope.estimator.result import Cluster
from baryscope.fmu.system import build_system
from baryscope.models.files import temporary_folder
from baryscope.models.scenario import Scenario
from baryscope.study.approach.draws import drawn
from baryscope.study.approach.onboard import OnBoard
from baryscope.study.approach.thrusters import ExecutionErrors, WrongThrusters
from baryscope.study.loop import fly_loop
from baryscope.study.population.judging import measured
from baryscope.study.population.running import Line

DURATION, EVERY = 900.0, 10.0  # s, of a flight, and from one value of a line to the next
ARRIVED = 0.1  # m
LAG = 15.0  # s; it and the degrees of the paths miss least in draws of another seed, docs/approach.md
ONLINE = "online"
SCALE, POINTING = 0.03, np.deg2rad(2.0)  # of wrong thrusters: known gaps of propulsion that nobody has calibrated
EXECUTION = 0.01, np.deg2rad(0.5)  # of each push: its size, and its direction about each axis
UNTOLD = ("online-scale", "online-pointing", "online-execution")
"""The online estimator, and thrusters that are too strong by SCALE, point POINTING elsewhere, about any axis, or whose
pushes have errors of EXECUTION, each its own.
"""
METHODS: dict[str, tuple[str, ScrewOptions | None]] = {
    "pivot": ("pivot", None),
    "screw-gpa-lvlh": ("screw-gpa", ScrewOptions(lag=LAG, degree=2, axes="lvlh")),
    "screw-gpa": ("screw-gpa", ScrewOptions(lag=LAG, degree=1)),
}
LOOPS = (ONLINE, *UNTOLD, *METHODS)
"""What tells the controller where the centre of mass is: the online estimator, or a method that runs on board."""
USUAL = (ONLINE, "screw-gpa-lvlh", "screw-gpa")


def flown(seed: int, draw: int, label: str) -> Line:
    """The line of a draw and a loop, in SI units.

    miss: the chaser's distance from the true goal before the true grapple point, and error: of the CoM that the
    controller is told, None before, every EVERY s. arrived: when the miss is below ARRIVED for good, None if never.
    body_error: of the mean of the method's CoM in axes that the features hold; None for the online estimator, whose CoM
    is at rest there. nees: of the online estimator while it tracks the target, None else, every EVERY s. nearest: to
    the CoM; velocity_change: the sum of the commands; refused: runs without an answer.
    """
    scenario = drawn(seed, draw)
    pilot = OnBoard(scenario.orbit, *METHODS[label]) if label in METHODS else None
    wrong = _thrusters(scenario, seed, draw, label) if label in UNTOLD else None
    line: Line = {"seed": seed, "draw": draw, "loop": label}
    with measured(line), temporary_folder() as folder:
        system = build_system(scenario, folder / "chain.ssp")
        loop = fly_loop(system, duration=DURATION, approach=True, pilot=pilot or wrong)
    told = np.where(loop.status[:, None] > 0, loop.position, np.nan) if pilot is None else np.array(pilot.told)
    error = np.linalg.norm(told - loop.truth["target.position"], axis=1)
    marks = np.searchsorted(loop.time, np.arange(EVERY, DURATION + EVERY / 2, EVERY) - 1e-9)
    away = np.flatnonzero(loop.to_grapple > ARRIVED)
    return line | {
        "time": loop.time[marks].tolist(),
        "miss": loop.to_grapple[marks].tolist(),
        "error": _values(error[marks]),
        "nees": None if pilot else _values(loop.nees[marks]),
        "arrived": None if away[-1] == len(loop.time) - 1 else float(loop.time[away[-1] + 1]),
        "body_error": None if pilot is None or pilot.cluster is None else _in_body_axes(pilot.cluster, scenario),
        "nearest": float(np.linalg.norm(loop.chaser, axis=1).min()),
        "velocity_change": float(np.linalg.norm(loop.command, axis=1).sum() * (loop.time[1] - loop.time[0])),
        "refused": 0 if pilot is None else pilot.refused,
    }


def _values(values: NDArray[np.float64]) -> list[float | None]:
    return [value if np.isfinite(value) else None for value in values.tolist()]


def _thrusters(scenario: Scenario, seed: int, draw: int, label: str) -> WrongThrusters:
    """The wrong thrusters of a draw."""
    if label == UNTOLD[0]:
        return WrongThrusters(scenario.orbit, scale=SCALE)
    if label == UNTOLD[2]:
        return WrongThrusters(
            scenario.orbit, execution=ExecutionErrors(*EXECUTION, np.random.default_rng([seed, draw, 2]))
        )
    axis = np.random.default_rng([seed, draw, 1]).standard_normal(3)
    return WrongThrusters(scenario.orbit, misalignment=POINTING * axis / np.linalg.norm(axis))


def _in_body_axes(cluster: Cluster, scenario: Scenario) -> float:
    """The error of a cluster's CoM, m, with its features laid on the true ones."""
    true = np.array([scenario.features.points[index].position for index in cluster.features])
    centre = true.mean(axis=0)
    turn, _ = Rotation.align_vectors(cluster.points, true - centre)
    return float(np.linalg.norm(cluster.centre_of_mass + turn.apply(centre)))

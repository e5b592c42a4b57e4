"""One approach of a draw, as a line of numbers: the chaser's miss and the error of what it is told, over time."""

import numpy as np
from scipy.spatial.transform import Rotation

from baryscope.estimator.options import ScrewOptions
from baryscope.estimator.result import Cluster
from baryscope.fmu.system import build_system
from baryscope.models.files import temporary_folder
from baryscope.models.scenario import Scenario
from baryscope.study.approach.draws import drawn
from baryscope.study.approach.onboard import OnBoard
from baryscope.study.loop import fly_loop
from baryscope.study.population.judging import measured
from baryscope.study.population.running import Line

DURATION, EVERY = 900.0, 10.0  # s, of a flight, and from one value of a line to the next
ARRIVED = 0.1  # m
LAG = 15.0  # s; it and the degrees of the paths miss least in draws of another seed, docs/approach.md
ONLINE = "online"
METHODS: dict[str, tuple[str, ScrewOptions | None]] = {
    "pivot": ("pivot", None),
    "screw-gpa-lvlh": ("screw-gpa", ScrewOptions(lag=LAG, degree=2, axes="lvlh")),
    "screw-gpa": ("screw-gpa", ScrewOptions(lag=LAG, degree=1)),
}
LOOPS = (ONLINE, *METHODS)
"""What tells the controller where the centre of mass is: the online estimator, or a method that runs on board."""
USUAL = (ONLINE, "screw-gpa-lvlh", "screw-gpa")


def flown(seed: int, draw: int, label: str) -> Line:
    """The line of a draw and a loop, in SI units.

    miss: the chaser's distance from the true goal before the true grapple point, and error: of the CoM that the
    controller is told, None before, every EVERY s. arrived: when the miss is below ARRIVED for good, None if never.
    body_error: of the mean of the method's CoM in axes that the features hold; None for the online estimator, whose CoM
    is at rest there. nearest: to the CoM; velocity_change: the sum of the commands; refused: runs without an answer.
    """
    scenario = drawn(seed, draw)
    pilot = None if label == ONLINE else OnBoard(scenario.orbit, *METHODS[label])
    line: Line = {"seed": seed, "draw": draw, "loop": label}
    with measured(line), temporary_folder() as folder:
        loop = fly_loop(build_system(scenario, folder / "chain.ssp"), duration=DURATION, approach=True, pilot=pilot)
    told = np.where(loop.status[:, None] > 0, loop.position, np.nan) if pilot is None else np.array(pilot.told)
    error = np.linalg.norm(told - loop.truth["target.position"], axis=1)
    marks = np.searchsorted(loop.time, np.arange(EVERY, DURATION + EVERY / 2, EVERY) - 1e-9)
    away = np.flatnonzero(loop.to_grapple > ARRIVED)
    return line | {
        "time": loop.time[marks].tolist(),
        "miss": loop.to_grapple[marks].tolist(),
        "error": [value if np.isfinite(value) else None for value in error[marks].tolist()],
        "arrived": None if away[-1] == len(loop.time) - 1 else float(loop.time[away[-1] + 1]),
        "body_error": None if pilot is None or pilot.cluster is None else _in_body_axes(pilot.cluster, scenario),
        "nearest": float(np.linalg.norm(loop.chaser, axis=1).min()),
        "velocity_change": float(np.linalg.norm(loop.command, axis=1).sum() * (loop.time[1] - loop.time[0])),
        "refused": 0 if pilot is None else pilot.refused,
    }


def _in_body_axes(cluster: Cluster, scenario: Scenario) -> float:
    """The error of a cluster's CoM, m, with its features laid on the true ones."""
    true = np.array([scenario.features.points[index].position for index in cluster.features])
    centre = true.mean(axis=0)
    turn, _ = Rotation.align_vectors(cluster.points, true - centre)
    return float(np.linalg.norm(cluster.centre_of_mass + turn.apply(centre)))

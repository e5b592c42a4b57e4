"""Peers of the unit for benchmark.py: other people's simulators, stepped as the unit is.

Basilisk has a model of its own, whose end is compared with closed forms; a pythonfmu unit has ours.
"""

import tempfile
import textwrap
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from baryscope.models.scenario import Scenario
from baryscope.scripts.benchmarks.setting import oracles_of_the_tests

FloatArray = NDArray[np.float64]
OFFSETS = {"target": 0.0, "chaser": -20.0}  # m, of Basilisk's spacecraft, along the velocity


@dataclass(frozen=True)
class BasiliskRun:
    """Seconds a step, and errors at the end: the target's attitude, rad, and its position from the chaser, m."""

    seconds: float
    attitude_error: float
    position_error: float


def basilisk_steps(scenario: Scenario, step: float, steps: int) -> BasiliskRun:
    """Basilisk with two spacecraft under point-mass gravity and its own RK4, against closed forms."""
    from Basilisk.simulation import spacecraft
    from Basilisk.utilities import SimulationBaseClass, macros, simIncludeGravBody

    simulation = SimulationBaseClass.SimBaseClass()
    process = simulation.CreateNewProcess("process")
    process.addTask(simulation.CreateNewTask("task", macros.sec2nano(step)))
    gravity = simIncludeGravBody.gravBodyFactory()
    earth = gravity.createEarth()
    earth.isCentralBody = True
    start, velocity, rate = _basilisk_start(scenario)
    bodies: dict[str, Any] = {}
    for name, place in start.items():
        bodies[name] = body = spacecraft.Spacecraft()
        body.ModelTag = name
        body.hub.IHubPntBc_B = [list(row) for row in scenario.target.inertia]
        body.hub.mHub = 7828.0
        body.hub.r_CN_NInit = place[:, None].tolist()
        body.hub.v_CN_NInit = velocity[:, None].tolist()
        body.hub.omega_BN_BInit = rate[:, None].tolist()
        body.gravField.gravBodies = spacecraft.GravBodyVector(list(gravity.gravBodies.values()))
        simulation.AddModelToTask("task", body)
    simulation.InitializeSimulation()
    simulation.ConfigureStopTime(macros.sec2nano(step * steps))
    begin = time.perf_counter()
    simulation.ExecuteSimulation()
    seconds = (time.perf_counter() - begin) / steps

    ends = {name: body.scStateOutMsg.read() for name, body in bodies.items()}
    oracles, end = oracles_of_the_tests(), step * steps
    paths = {name: oracles.propagate_kepler(place, velocity, earth.mu, end)[0] for name, place in start.items()}
    off = np.subtract(ends["target"].r_BN_N, ends["chaser"].r_BN_N) - (paths["target"] - paths["chaser"])
    turned = oracles.TorqueFree(np.array(scenario.target.inertia), rate).attitude(np.arange(end + 1.0))[-1]
    attitude = Rotation.from_mrp(ends["target"].sigma_BN)
    return BasiliskRun(seconds, float((attitude.inv() * turned).magnitude()), float(np.linalg.norm(off)))


def _basilisk_start(scenario: Scenario) -> tuple[dict[str, FloatArray], FloatArray, FloatArray]:
    """Inertial positions by name, m, the velocity of both, m/s, and the angular rate, rad/s; attitudes are zero."""
    radius = scenario.orbit.semi_major_axis
    speed = float(np.sqrt(scenario.orbit.gravitational_parameter / radius))
    places = {name: np.array([radius, offset, 0.0]) for name, offset in OFFSETS.items()}
    return places, np.array([0.0, speed, 0.0]), np.deg2rad(scenario.target.angular_rate_deg)


_PYTHON_UNIT = """
    import numpy as np
    from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real
    from baryscope.models.scenario import load_scenario
    from baryscope.models.target import tumbling_target

    class Peer(Fmi2Slave):
        def __init__(self, **kwargs):
            super().__init__(**kwargs)
            scenario = load_scenario("envisat")
            self.system, self.p = tumbling_target(len(scenario.features.points)), scenario.flat_parameters()
            self.x, self.u = np.array(self.system.initial(self.p)).ravel(), np.zeros(6)
            self.y = np.array(self.system.outputs(self.x, self.p)).ravel()
            for k in range(self.y.size):
                getter = lambda k=k: float(self.y[k])
                self.register_variable(Real(f"y{k}", causality=Fmi2Causality.output, getter=getter))

        def rates(self, x):
            return np.array(self.system.rhs(x, self.u, self.p)).ravel()

        def do_step(self, time, step):
            x, h = self.x, step
            a = self.rates(x)
            b = self.rates(x + h / 2 * a)
            c = self.rates(x + h / 2 * b)
            d = self.rates(x + h * c)
            self.x = x + h / 6 * (a + 2 * b + 2 * c + d)
            self.y = np.array(self.system.outputs(self.x, self.p)).ravel()
            return True
"""


def pythonfmu_steps(step: float, steps: int) -> tuple[float, FloatArray]:
    """Seconds a step of a pythonfmu unit of the same model (one RK4 step each), and the last outputs."""
    import shutil

    import fmpy
    from fmpy.fmi2 import FMU2Slave
    from pythonfmu.builder import FmuBuilder

    with tempfile.TemporaryDirectory(prefix="baryscope-") as name:
        folder = Path(name)
        (folder / "peer.py").write_text(textwrap.dedent(_PYTHON_UNIT), encoding="utf-8")
        FmuBuilder.build_FMU(folder / "peer.py", dest=folder)
        unit = next(folder.glob("*.fmu"))
        description = fmpy.read_model_description(str(unit))
        unzipped = fmpy.extract(str(unit))
        slave = FMU2Slave(
            guid=description.guid, modelIdentifier=description.coSimulation.modelIdentifier, unzipDirectory=unzipped
        )
        slave.instantiate()
        slave.setupExperiment()
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        references = [v.valueReference for v in description.modelVariables if v.causality == "output"]
        begin = time.perf_counter()
        for index in range(steps):
            slave.doStep(index * step, step)
            outputs = slave.getReal(references)
        seconds = (time.perf_counter() - begin) / steps
        slave.terminate()
        slave.freeInstance()
        shutil.rmtree(unzipped, ignore_errors=True)
    return seconds, np.array(outputs)

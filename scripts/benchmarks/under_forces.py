"""The unit under J2, drag, light pressure and gravity gradient beside Basilisk, whose models of these are its own.

`python -m baryscope.scripts.benchmarks.under_forces FILE` records Basilisk's flight for the tests, which have no
Basilisk.
"""

import json
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from rich.table import Table
from scipy.spatial.transform import Rotation

from baryscope.fmu import Session, build_fmu
from baryscope.models.orbit import EARTH_J2, EARTH_RADIUS
from baryscope.models.scenario import Drag, Light, Scenario, load_scenario
from baryscope.scripts.benchmarks.report import Part, exceeds
from baryscope.scripts.benchmarks.setting import Setting

FloatArray = NDArray[np.float64]

DURATION, STEP = 1500.0, 0.25  # s, of Basilisk's run and of its RK4
MASS, DRAG_COEFFICIENT = 7828.0, 2.2  # kg, of both bodies; Basilisk takes area and coefficient apart
# An atmosphere at rest, as Basilisk's drag has it.
DRAG = Drag(density=4e-12, target=0.01, chaser=0.025, scale_height=6e4, rotation_rate=0.0)
# The shadow begins after some 800 s. Basilisk's Sun is at one astronomical unit, with a solar constant of its own.
SUN_DISTANCE, SOLAR_FLUX, LIGHT_SPEED, SHADOW_RADIUS = 149_597_870_700.0, 1361.0, 299_792_458.0, 6_378_136.6
LIGHT = Light(
    sun=(-0.42, 0.835, 0.355),
    target=0.4,
    chaser=0.1,
    pressure=SOLAR_FLUX / LIGHT_SPEED,
    shadow_radius=SHADOW_RADIUS,
)
# Basilisk holds density and shadow for a step. Each force moves or turns by over a hundred times these.
PLACE, ATTITUDE = 1e-3, 1e-7  # m, of the target from the chaser; rad
NAMES = ("target", "chaser")


@dataclass(frozen=True, eq=False)
class State:
    """Places and velocities of target and chaser (2, 3) in I, the target's attitude R_I_B and rate (3,) in B."""

    place: FloatArray
    velocity: FloatArray
    attitude: Rotation
    rate: FloatArray

    @classmethod
    def of(cls, session: Session) -> "State":
        """That of a unit."""
        place, velocity = session["orbit.position"], session["orbit.velocity"]
        return cls(
            np.array([place, place - session["target.position"]]),
            np.array([velocity, velocity - session["target.velocity"]]),
            Rotation.from_quat(session["target.attitude"], scalar_first=True),
            session["target.angularRate"],
        )

    @classmethod
    def parsed(cls, text: str) -> Self:
        """That of a recording."""
        values = json.loads(text)["end"]
        place, velocity, rate = (np.array(values[name]) for name in ("place", "velocity", "rate"))
        return cls(place, velocity, Rotation.from_quat(values["attitude"], scalar_first=True), rate)

    def recorded(self, version: str) -> str:
        """A recording of it, with Basilisk's version."""
        values = {
            "place": self.place.tolist(),
            "velocity": self.velocity.tolist(),
            "attitude": self.attitude.as_quat(scalar_first=True).tolist(),
            "rate": self.rate.tolist(),
        }
        return json.dumps({"by": f"Basilisk {version}", "duration": DURATION, "end": values}, indent=2) + "\n"

    @property
    def relative(self) -> FloatArray:
        """The target's place from the chaser (3,)."""
        return np.asarray(self.place[0] - self.place[1])


def under_forces(setting: Setting) -> Part:
    """The unit with all forces must agree with Basilisk, and without one of them must not."""
    if "basilisk" not in setting.peers:
        return Part()
    world = with_forces(setting.scenario)
    unit = build_fmu(world, setting.folder / "forces.fmu")
    return compared(unit, basilisk_flight(world, start_of(unit)))


def start_of(unit: Path) -> State:
    """The state in which a unit starts."""
    with Session(unit) as session:
        return State.of(session)


def compared(unit: Path, theirs: State) -> Part:
    """A unit under forces, and without each of them, from Basilisk's end of the same flight."""
    with Session(unit, {"solver.tolerance": 1e-13}) as session:
        session.step(DURATION)
        ours = State.of(session)
    table = Table(title=f"the unit from Basilisk after {DURATION:g} s, under forces", title_justify="left")
    for heading in ("forces", "place", "relative place", "attitude"):
        table.add_column(heading, justify="left" if heading == "forces" else "right")
    place, relative, attitude = apart(ours, theirs)
    table.add_row("all", f"{place:.1e} m", f"{relative:.1e} m", f"{attitude:.1e} rad")
    faults = [
        *exceeds("the unit under forces, against Basilisk: relative place", relative, PLACE, "m"),
        *exceeds("the unit under forces, against Basilisk: attitude", attitude, ATTITUDE, "rad"),
    ]
    for force, off in OFF.items():
        with Session(unit, {"solver.tolerance": 1e-13} | off) as session:
            session.step(DURATION)
            place, relative, attitude = apart(State.of(session), theirs)
        table.add_row(f"without {force} in the unit", f"{place:.1e} m", f"{relative:.1e} m", f"{attitude:.1e} rad")
        if max(relative / PLACE, attitude / ATTITUDE) < 100:
            faults.append(f"{force}: found no more difference than tolerated, expected to be tested")
    return Part(tables=(table,), faults=tuple(faults))


OFF: dict[str, dict[str, float | bool]] = {
    "J2": {"orbit.j2": 0.0},
    "drag": {"atmosphere.density": 0.0},
    "light": {"sun.pressure": 0.0},
    "gravity gradient": {"gravityGradient": False},
}


def with_forces(scenario: Scenario) -> Scenario:
    """The scenario with J2, drag, light pressure and gravity gradient."""
    orbit = replace(scenario.orbit, j2=EARTH_J2, equatorial_radius=EARTH_RADIUS)
    target = scenario.target.model_copy(update={"gravity_gradient": True})
    return scenario.model_copy(update={"orbit": orbit, "target": target, "drag": DRAG, "light": LIGHT})


def apart(one: State, other: State) -> tuple[float, float, float]:
    """Distances of the targets' places and of their places from the chaser, m, and the angle of attitudes, rad."""
    return (
        float(np.linalg.norm(one.place[0] - other.place[0])),
        float(np.linalg.norm(one.relative - other.relative)),
        float((one.attitude.inv() * other.attitude).magnitude()),
    )


def basilisk_flight(scenario: Scenario, start: State) -> State:
    """Basilisk's end: harmonics of degree 2, an exponential atmosphere with drag, light, shadow, gravity gradient."""
    from Basilisk.architecture import messaging
    from Basilisk.simulation import (
        GravityGradientEffector,
        dragDynamicEffector,
        eclipse,
        exponentialAtmosphere,
        radiationPressure,
        spacecraft,
        sphericalHarmonicsGravityModel,
    )
    from Basilisk.utilities import SimulationBaseClass, macros, simIncludeGravBody

    simulation = SimulationBaseClass.SimBaseClass()
    simulation.CreateNewProcess("process").addTask(simulation.CreateNewTask("task", macros.sec2nano(STEP)))
    orbit = scenario.orbit
    factory = simIncludeGravBody.gravBodyFactory()
    earth = factory.createEarth()
    earth.isCentralBody, earth.mu = True, orbit.gravitational_parameter
    harmonics = sphericalHarmonicsGravityModel.SphericalHarmonicsGravityModel()
    harmonics.radEquator, harmonics.muBody, harmonics.maxDeg = EARTH_RADIUS, earth.mu, 2
    harmonics.cBar = [[1.0], [0.0, 0.0], [-EARTH_J2 / np.sqrt(5), 0.0, 0.0]]
    harmonics.sBar = [[0.0], [0.0, 0.0], [0.0, 0.0, 0.0]]
    earth.gravityModel = harmonics
    air = exponentialAtmosphere.ExponentialAtmosphere()
    # Below its reference radius Basilisk's atmosphere does not get denser: that is the ground.
    air.planetRadius, air.scaleHeight = EARTH_RADIUS, DRAG.scale_height
    air.baseDensity = DRAG.density * np.exp((orbit.semi_major_axis - EARTH_RADIUS) / DRAG.scale_height)
    simulation.AddModelToTask("task", air)
    away = (SUN_DISTANCE * np.array(LIGHT.sun)).tolist()
    sun = messaging.SpicePlanetStateMsg().write(messaging.SpicePlanetStateMsgPayload(PositionVector=away))
    ground = messaging.SpicePlanetStateMsg().write(messaging.SpicePlanetStateMsgPayload(PlanetName="earth"))
    shadow = eclipse.Eclipse()
    shadow.sunInMsg.subscribeTo(sun)
    shadow.addPlanetToModel(ground)
    simulation.AddModelToTask("task", shadow)
    bodies: list[Any] = []
    for index, name in enumerate(NAMES):
        body = spacecraft.Spacecraft()
        body.ModelTag = name
        body.hub.mHub, body.hub.IHubPntBc_B = MASS, [list(row) for row in scenario.target.inertia]
        body.hub.r_CN_NInit, body.hub.v_CN_NInit = start.place[index][:, None], start.velocity[index][:, None]
        body.hub.sigma_BNInit, body.hub.omega_BN_BInit = start.attitude.as_mrp()[:, None], start.rate[:, None]
        body.gravField.gravBodies = spacecraft.GravBodyVector(list(factory.gravBodies.values()))
        turning = GravityGradientEffector.GravityGradientEffector()
        turning.ModelTag = f"gradient {name}"
        turning.addPlanetName(earth.planetName)
        body.addDynamicEffector(turning)
        air.addSpacecraftToModel(body.scStateOutMsg)
        drag = dragDynamicEffector.DragDynamicEffector()
        drag.ModelTag = f"drag {name}"
        drag.coreParams.dragCoeff = DRAG_COEFFICIENT
        drag.coreParams.projectedArea = getattr(DRAG, name) * MASS / DRAG_COEFFICIENT
        drag.atmoDensInMsg.subscribeTo(air.envOutMsgs[index])
        body.addDynamicEffector(drag)
        shadow.addSpacecraftToModel(body.scStateOutMsg)
        light = radiationPressure.RadiationPressure()
        light.ModelTag = f"light {name}"
        light.setUseCannonballModel()
        light.area, light.coefficientReflection = getattr(LIGHT, name) * MASS, 1.0
        light.sunEphmInMsg.subscribeTo(sun)
        light.sunEclipseInMsg.subscribeTo(shadow.eclipseOutMsgs[index])
        body.addDynamicEffector(light)
        for model in (body, turning, drag, light):
            simulation.AddModelToTask("task", model)
        bodies.append((body, turning, drag, light))
    simulation.InitializeSimulation()
    simulation.ConfigureStopTime(macros.sec2nano(DURATION))
    simulation.ExecuteSimulation()
    ends = [body.scStateOutMsg.read() for body, *_ in bodies]
    return State(
        np.array([end.r_BN_N for end in ends]),
        np.array([end.v_BN_N for end in ends]),
        Rotation.from_mrp(ends[0].sigma_BN),
        np.array(ends[0].omega_BN_B),
    )


def main() -> None:
    """Record Basilisk's flight of the preset envisat with all forces in the file that is named."""
    import Basilisk

    world = with_forces(load_scenario("envisat"))
    with TemporaryDirectory() as folder:
        end = basilisk_flight(world, start_of(build_fmu(world, Path(folder) / "forces.fmu")))
    Path(sys.argv[1]).write_text(end.recorded(Basilisk.__version__))


if __name__ == "__main__":
    main()

"""ApproachController as a unit: from the target's estimated motion to a command; from baryscope.models.approach."""

from collections.abc import Mapping

import numpy as np

from baryscope.fmu.units.blueprint import Blueprint, Core, FloatArray, Section, UnitKind, setting_of, starts_of
from baryscope.models.approach.reckoning import SIZE
from baryscope.models.approach.unit import ApproachSystem, approach_system, approach_table
from baryscope.models.orbit import orbit_parameters
from baryscope.models.scenario import Scenario
from baryscope.models.variables import AXES, Variable

NAME = "ApproachController"
USUAL = {
    "grapple.standoff": 2.0, "guidance.speed": 0.1, "guidance.rate": 0.02, "control.rate": 0.2,
    "corridor.halfAngle": np.deg2rad(20.0), "navigation.patience": 20.0, "navigation.deviation": 0.5,
    "thrust.correction": 0.2,
}  # fmt: skip
"""Start values that no scenario has, SI."""
LEAST_LIMIT, RESERVE = 0.05, 1.3  # m/s², of the thrust limit, and over what it takes to go around with the body
CLEARANCE = 0.5  # the keep-out sphere's radius over the range at which the chaser starts
FARTHEST = 1.5  # a retreat's over that range: then the sphere is as far away as the chaser starts from the target

_FRAMES = (
    ("C, chaser", "Origin at the chaser, inertial axes: the frame of target.position and target.velocity."),
    (
        "L, LVLH",
        "Origin at the target's centre of mass; x radially outward, y along-track, z along the orbit's normal: axes of "
        "the command, of hold.position and goal.offset.",
    ),
    ("B, body", "Origin at the target's centre of mass, axes of its attitude and inertia: those of the grapple point."),
)
_LAW = (
    "The goal is hold.position, at rest in L, or while synchronised the point at grapple.standoff before "
    "grapple.point, which turns with the body; it waits at hold.position until inertia and grapple point are known.",
    "A field of velocities leads there: guidance.rate times the distance, at most guidance.speed, relative to the "
    "goal. From rest to a goal at rest the path is straight: along R-bar or V-bar where both points are on it.",
    "Towards the keep-out sphere the field is at most guidance.rate times the distance from it: the chaser slides "
    "around it. While synchronised it goes to where the line from the grapple point outwards leaves the sphere, and in "
    "from there, in the cone corridor.halfAngle.",
    "The command is the field's derivative along the motion, plus control.rate times what the velocity lacks of it, "
    "less the natural relative acceleration on the Kepler orbit; it is scaled down to thrust.limit.",
    "Thrusters that are wrong by thrust.error, a scale s and a rotation vector m in the camera's axes, push by (1 + s) "
    "exp([m]x) times the command: it is corrected for that, in the axes of the camera as the command acts. What was "
    "told while navigation was valid holds on. Of a scale or a rotation beyond thrust.correction only so much counts.",
    "Where navigation fails, the chaser coasts for navigation.patience, or where that would lead it to the keep-out "
    "sphere the law goes on by dead reckoning. Then it retreats, out of the corridor along its axis, then straight "
    "away from the target to retreat.distance from the centre of mass and three deviations more, but retreat.farthest "
    "at most, and rests there, until navigation could be used for a third of the patience.",
    "Navigation fails where navigation.valid is false, where the keep-out sphere is nearer than three standard "
    "deviations and what it takes to brake by thrust.limit and one deviation is above navigation.deviation, and, for a "
    "synchronised chaser, where the tumble is not told any more. A deviation is that of target.position and that of "
    "target.velocity over control.rate.",
    "The body is taken to tumble freely, by target.inertia, of which any multiple does. Grapple point and direction "
    "are in the body axes of target.attitude: with an estimator's, those of its map.",
)
_USE = (
    "Connect the inputs to an estimator, or to TumblingTarget, and command.acceleration to its chaser.acceleration. "
    "thrust.error starts at 0: it takes thrusters for right, as those of TumblingTarget are.",
    "The command is computed from the inputs at the beginning of a step, and stands in the outputs after it. Where a "
    "master hands it on in the next step, it acts a step later (command.steps is 1). Where it acts in the same step, "
    "command.steps is 0; thrusters that wait have command.delay. It is computed for the middle of the step in which it "
    "acts: till then the body tumbles on, and the chaser with it.",
    "Before navigation could be used for the first time the command is zero, and other outputs are those of a chaser "
    "at chaser.position0; but camera.attitude looks at sight.position, or while that is zero at target.position, "
    "unless that is, too. While the chaser retreats it looks where dead reckoning has the target, or at a new "
    "sight.position.",
    "What is carried on from step to step is in saved states; a reset forgets it. Without covariances the target's "
    "position counts as exact.",
    "All but the orbit can be tuned between steps: a new hold.position is glided to, synchronised begins the approach.",
)


def controller_blueprint(scenario: Scenario) -> Blueprint:
    """The controller of a scenario's chaser: it holds where the chaser starts, and knows the orbit."""
    system = approach_system()
    return Blueprint(
        name=NAME,
        summary="A controller of a chaser near a tumbling target: LVLH hold, straight glides, approach to a grapple "
        "point synchronised with its rotation",
        variables=system.variables,
        starts=_starts(scenario, system),
        core=Core(
            functions=(system.outputs, system.checks.margins, system.checks.found),
            checks={"CHECKS": system.checks.checks},
            headers=("direct.h", "sampled.h"),
            files=("direct.c", "sampled.c"),
            sizes={"N_KEPT": SIZE},
        ),
        setting=setting_of(scenario),
        sections=(
            Section("Frames", "Quaternions are (w, x, y, z). Units are SI, angles in radians.", rows=_FRAMES),
            Section("The law", items=_LAW),
        ),
        use=_USE,
    )


def _starts(scenario: Scenario, system: ApproachSystem) -> dict[str, FloatArray]:
    known, first = scenario.parameters(), scenario.features.points[0]
    moments = np.array([known[f"target.inertia.{axes}"] for axes in AXES])
    away = float(np.linalg.norm(known["chaser.position0"]))
    sphere = CLEARANCE * away
    farthest = max(sphere, float(np.linalg.norm(first.position)) + USUAL["grapple.standoff"])
    around = float(np.sum(np.deg2rad(scenario.target.angular_rate_deg) ** 2)) * farthest
    given = {
        "target.attitude": known["target.attitude0"],
        "target.inertia": moments / moments[:3].sum(),
        "navigation.valid": 1.0,
        **orbit_parameters(scenario.orbit),
        "chaser.position0": known["chaser.position0"],
        "hold.position": known["chaser.position0"],
        "grapple.point": first.position,
        "command.steps": 1.0,
        "keepOut.radius": sphere,
        "retreat.distance": away,
        "retreat.farthest": FARTHEST * away,
        "thrust.limit": max(LEAST_LIMIT, RESERVE * around),
        **USUAL,
    }
    return starts_of(system.variables, given)


def _table(described: Mapping[str, tuple[int, ...]]) -> tuple[Variable, ...]:
    return approach_table()


CONTROLLER = UnitKind(NAME, controller_blueprint, _table)

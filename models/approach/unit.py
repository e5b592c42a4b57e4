"""ApproachController's table of variables and equations: from the target's motion in frame C to a command in LVLH.

The law is that of `guidance`. Two goals: a point at rest in LVLH (`hold.position`), or, while `synchronised` and the
tumble is known, a point before a grapple point of the body, which turns with it. Without navigation `reckoning` says
where the chaser is and whether it retreats, to a third goal: away from the target.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cache
from math import pi
from typing import Self

import casadi as ca

from baryscope.models.approach.guidance import Goal, Limits, Motion, commanded, entry, glide_velocity, in_corridor
from baryscope.models.approach.reckoning import (
    CLEAR,
    MODES,
    RECKONING,
    RETREAT,
    SIZE,
    WAITING,
    Belief,
    believed,
    carried_on,
    drift_is_clear,
    outage_and_mode,
    tumble_known,
)
from baryscope.models.approach.thrusters import believable, command_for, sight_rate
from baryscope.models.attitude import angular_acceleration, symmetric_inverse, symmetric_matrix
from baryscope.models.checks import DIRECTED, Check, CheckSet, orbit_checks, symbols_of
from baryscope.models.frames import (
    Symbol,
    normalised,
    quaternion_from_rotation,
    rotation_from_quaternion,
    rotation_I_L,
    turned,
)
from baryscope.models.keplerian import PARAMETERS, Conic, Elements, conic, true_anomaly_after
from baryscope.models.relative_motion import relative_acceleration
from baryscope.models.variables import AXES, LVLH, NOT_NEGATIVE, THRUSTERS, UPPER, Kind, Variable, variable_table

ALONG = 0.9  # cosine from which two directions are too much alike to span a plane


@dataclass(frozen=True)
class ApproachSystem:
    """The controller.

    Attributes:
        variables: the table.
        outputs: time since the start and length of the step, what was kept, inputs, parameters → outputs, what to keep.
        checks: the conditions on the parameters.
    """

    variables: tuple[Variable, ...]
    outputs: ca.Function
    checks: CheckSet


@cache
def approach_system() -> ApproachSystem:
    """Build the symbolic system."""
    table = approach_table()
    step, kept = ca.SX.sym("step", 2), ca.SX.sym("kept", SIZE)
    inputs, u = symbols_of(table, Kind.INPUT)
    parameters, p = symbols_of(table, Kind.PARAMETER)
    values, keep = _outputs(step, Belief.of(kept), inputs, parameters)
    y = ca.vertcat(*(values[variable.name] for variable in table if variable.kind == Kind.OUTPUT))
    return ApproachSystem(
        variables=table,
        outputs=ca.Function("unit_outputs", [step, kept, u, p], [y, keep.column], {"cse": True}),
        checks=CheckSet.over(p, _checks(parameters), "unit"),
    )


def _outputs(
    step: Symbol, kept: Belief, inputs: Mapping[str, Symbol], parameters: Mapping[str, Symbol]
) -> tuple[dict[str, Symbol], Belief]:
    """Outputs by name, and what is to be kept.

    The command is for the middle of the step in which it acts, some steps and a delay later; the thrusters are in the
    axes of the camera there.
    """
    time, length = ca.vertsplit(step)
    elements = Elements.named(parameters)
    true_anomaly = true_anomaly_after(time, elements)
    orbit, R_I_L = conic(elements.ellipse, true_anomaly), rotation_I_L(elements.R_I_P, true_anomaly)
    radius = parameters["keepOut.radius"]
    belief = believed(kept, inputs, parameters, R_I_L.T, _spin(orbit))
    outage, mode = outage_and_mode(belief, inputs, parameters, length)
    position_L, velocity_L = belief.position, belief.velocity
    body = _Body.told(R_I_L, belief)
    limits = Limits(
        parameters["guidance.speed"],
        parameters["guidance.rate"],
        radius,
        ca.cos(parameters["corridor.halfAngle"]),
    )
    nominal = _goal(body, orbit, belief, parameters)
    enclosed = ca.logic_and(ca.norm_2(position_L) < radius, in_corridor(position_L, nominal, limits))
    near = parameters["retreat.distance"]
    reach = ca.fmax(near, ca.fmin(near + CLEAR * belief.deviation, parameters["retreat.farthest"]))

    def aimed(goal: Goal, place: Symbol) -> Goal:
        return _either(mode == RETREAT, _retreat(goal, place, reach, enclosed), goal)

    goal = aimed(nominal, position_L)
    late = parameters["command.steps"] * length + parameters["command.delay"]
    # Body and chaser then: the chaser is and moves in the body's axes as now. Nothing changes if the goal is at rest.
    ahead = late + 0.5 * length
    by = goal.turning * ahead + goal.turning_rate * ahead**2 / 2
    place, glide = turned(position_L, by), turned(velocity_L - ca.cross(goal.turning, position_L), by)
    then = aimed(_goal(body.later(by, ahead), orbit, belief, parameters), place)
    moving = glide + ca.cross(then.turning, place)
    natural = relative_acceleration(place, moving, ca.SX.zeros(3), orbit)
    wanted = commanded(Motion(place, moving, natural), then, limits, parameters["control.rate"])
    coasts = ca.logic_and(mode == RECKONING, drift_is_clear(belief, parameters))
    view = _view(_looked_at(belief, mode, inputs, R_I_L), R_I_L, kept.across, parameters)
    # The view acts as late by steps as the command: it turns on for the delay and half a step, L for all of the time.
    turning = sight_rate(position_L, velocity_L, _spin(orbit)) * (parameters["command.delay"] + 0.5 * length)
    scale, wrong = believable(belief.scale, belief.misalignment, parameters["thrust.correction"])
    misalignment = turned(turned(R_I_L.T @ view @ wrong, turning), -_spin(orbit) * ahead)
    told = command_for(wanted, scale, misalignment)
    size, limit = ca.norm_2(told), parameters["thrust.limit"]
    flies = ca.logic_not(ca.logic_or(mode == WAITING, coasts))
    share = flies * ca.fmin(1, limit / ca.fmax(size, DIRECTED))
    push = share * wanted
    delayed = ca.fmin(1, late / length)
    acting = delayed * kept.push + (1 - delayed) * push
    outputs = {
        "command.acceleration": share * told,
        "command.limited": flies * (size > limit),
        "goal.offset": position_L - goal.position,
        "goal.velocityError": velocity_L - glide_velocity(position_L, goal, limits),
        "keepOut.distance": ca.norm_2(position_L) - radius,
        "corridor.inside": in_corridor(position_L, goal, limits),
        "goal.synchronised": goal.turns,
        "guidance.mode": mode,
        "navigation.outage": outage,
        "camera.attitude": quaternion_from_rotation(view),
    }
    belief = replace(belief, known=mode != WAITING, outage=outage, push=push, across=view[:, 0])
    return outputs, carried_on(belief, acting, (time, length), elements)


def _looked_at(belief: Belief, mode: Symbol, inputs: Mapping[str, Symbol], R_I_L: Symbol) -> Symbol:
    """What the camera looks at: the CoM, but where that is not valid the place at which features were seen, if ever.

    A filter that does not track yet may be wrong about the velocity, and carries the CoM out of view. A place that is
    no news goes on with the dead reckoning; as long as that is trusted, it is what counts: frames that fit nowhere are
    why navigation fails.
    """
    aside = ca.if_else(mode == RECKONING, 0, belief.aside)
    seen = ca.logic_or(belief.known, ca.norm_2(belief.sight) > DIRECTED)
    other = ca.logic_and(ca.logic_not(inputs["navigation.valid"]), seen)
    return ca.if_else(other, aside - R_I_L @ belief.position, inputs["target.position"])


def _view(seen: Symbol, R_I_L: Symbol, before: Symbol, parameters: Mapping[str, Symbol]) -> Symbol:
    """R_C_V of a camera: z at the target, or before it is seen at where it is from `chaser.position0`.

    It does not roll: x moves along z alone, from where it was before (parallel transport). Any x that depends on z only
    would leap somewhere, by more than a chaser can turn in a step. At first, and where the line of sight leaps towards
    where x was, x is normal to the orbit's normal, or to the radius within some 25° of that.
    """
    ahead = -R_I_L @ parameters["chaser.position0"]
    looked = ca.if_else(ca.norm_2(ahead) > DIRECTED, ahead, R_I_L[:, 0])
    looked = ca.if_else(ca.norm_2(seen) > DIRECTED, seen, looked)
    z = normalised(looked)
    across = ca.if_else(ca.fabs(ca.dot(R_I_L[:, 2], z)) < ALONG, R_I_L[:, 2], R_I_L[:, 0])
    goes_on = ca.logic_and(ca.norm_2(before) > DIRECTED, ca.fabs(ca.dot(before, z)) < ALONG)
    x = normalised(ca.if_else(goes_on, before - ca.dot(before, z) * z, ca.cross(across, z)))
    return ca.horzcat(x, ca.cross(z, x), z)


def _spin(orbit: Conic) -> Symbol:
    """Angular rate of L."""
    return ca.vertcat(0, 0, orbit.anomaly_rate)


@dataclass(frozen=True)
class _Body:
    """The free body: attitude R_L_B, angular rate in B, a multiple of its inertia; whether it is known where to go."""

    R_L_B: Symbol
    rate: Symbol
    inertia: Symbol
    known: Symbol

    @classmethod
    def told(cls, R_I_L: Symbol, belief: Belief) -> Self:
        """As it is believed; of a sphere where the inertia is not known."""
        known = tumble_known(belief.inertia, belief.point)
        J = symmetric_matrix(ca.vertsplit(belief.inertia))
        attitude = ca.if_else(known, belief.attitude, ca.SX([1, 0, 0, 0]))
        R_L_B = R_I_L.T @ rotation_from_quaternion(normalised(attitude))
        return cls(R_L_B, belief.rate, ca.if_else(known, J, ca.SX.eye(3)), known)

    def tumble(self, rate: Symbol) -> Symbol:
        """The angular acceleration at a rate, in B."""
        return angular_acceleration(self.inertia, symmetric_inverse(self.inertia), rate, ca.SX.zeros(3))

    def later(self, by: Symbol, seconds: Symbol) -> Self:
        """The body some seconds later, turned by a rotation vector in L till then; its rate by the midpoint rule."""
        R_L_B = ca.horzcat(*(turned(column, by) for column in ca.horzsplit(self.R_L_B)))
        halfway = self.rate + self.tumble(self.rate) * seconds / 2
        return replace(self, R_L_B=R_L_B, rate=self.rate + self.tumble(halfway) * seconds)


def _goal(body: _Body, orbit: Conic, belief: Belief, parameters: Mapping[str, Symbol]) -> Goal:
    """The goal in L. Its angular rate is that of the body less that of L, differentiated in L; the body is free.

    It turns while `synchronised`, but only where tumble and grapple point are known: an estimator tells zeros before.
    """
    apex_B, told = belief.point, belief.direction
    turns = ca.logic_and(parameters["synchronised"], body.known)
    outward = ca.if_else(ca.norm_2(apex_B) > DIRECTED, apex_B, ca.SX([1, 0, 0]))
    axis_B = normalised(ca.if_else(ca.norm_2(told) > DIRECTED, told, outward))
    before_B = apex_B + parameters["grapple.standoff"] * axis_B
    spin, rate_L = _spin(orbit), body.R_L_B @ body.rate
    turning_rate = body.R_L_B @ body.tumble(body.rate) - ca.cross(spin, rate_L)
    turning_rate -= ca.vertcat(0, 0, orbit.anomaly_acceleration)
    return Goal(
        position=ca.if_else(turns, body.R_L_B @ before_B, parameters["hold.position"]),
        apex=body.R_L_B @ apex_B,
        axis=body.R_L_B @ axis_B,
        turning=ca.if_else(turns, rate_L - spin, ca.SX.zeros(3)),
        turning_rate=ca.if_else(turns, turning_rate, ca.SX.zeros(3)),
        turns=turns,
    )


def _retreat(goal: Goal, place: Symbol, reach: Symbol, enclosed: Symbol) -> Goal:
    """The goal of a chaser that retreats from its place to a distance from the CoM, or stays if it is farther.

    Straight away, and then at rest in LVLH; but out of the corridor first, as it turns, where that encloses it.
    """
    distance, zero = ca.norm_2(place), ca.SX.zeros(3)
    away = place / ca.fmax(distance, DIRECTED) * ca.fmax(reach, distance)
    rests = replace(goal, position=away, turning=zero, turning_rate=zero, turns=ca.SX(0))
    return _either(enclosed, replace(goal, position=entry(goal, reach)), rests)


def _either(condition: Symbol, one: Goal, other: Goal) -> Goal:
    """One goal if the condition holds, else the other."""
    names = (field.name for field in fields(Goal))
    return Goal(*(ca.if_else(condition, getattr(one, name), getattr(other, name)) for name in names))


def approach_table() -> tuple[Variable, ...]:
    """The variables of ApproachController."""
    IN, PAR, OUT = Kind.INPUT, Kind.PARAMETER, Kind.OUTPUT
    orbit = {variable.name: variable for variable in variable_table(3)}

    def tunable(name: str, unit: str, what: str, limits: tuple[float, float] = NOT_NEGATIVE) -> Variable:
        return Variable(name, PAR, unit, what, tunable=True, limits=limits)

    return (
        Variable("target.position", IN, "m", "The target's CoM, frame C (chaser, inertial axes)", (3,)),
        Variable("target.velocity", IN, "m/s", "Velocity of the target's CoM, frame C", (3,)),
        Variable("target.positionCovariance", IN, "m2", "Covariance of target.position; 0: exact", (6,), axes=UPPER),
        Variable("target.velocityCovariance", IN, "m2/s2", "Covariance of target.velocity; 0: exact", (6,), axes=UPPER),
        Variable("target.attitude", IN, "1", "Attitude quaternion (w, x, y, z), body to inertial", (4,)),
        Variable("target.angularRate", IN, "rad/s", "Angular rate of the target, body axes", (3,)),
        Variable(
            "target.inertia", IN, "1", "Inertia over its trace, body axes; a multiple does; 0 if unknown", (6,),
            axes=AXES,
        ),
        Variable(
            "navigation.valid", IN, "1", "Whether the inputs may be used; else dead reckoning, then a retreat",
            boolean=True, discrete=True,
        ),
        Variable("sight.position", IN, "m", "Where the target was seen last, frame C; 0: never", (3,)),
        Variable(
            "thrust.error", IN, "1", "What thrusters are wrong by, a scale and rad about each camera axis; 0: nothing",
            (4,), axes=THRUSTERS,
        ),
        Variable("grapple.point", IN, "m", "Grapple point from the CoM, body axes; 0 if unknown", (3,)),
        Variable("grapple.direction", IN, "1", "Direction outwards there, body axes; 0: away from the CoM", (3,)),
        *(orbit[name] for name in PARAMETERS),
        Variable(
            "chaser.position0", PAR, "m", "Where the chaser starts, LVLH axes: from there the camera looks at first",
            (3,), tunable=True, axes=LVLH,
        ),
        Variable("hold.position", PAR, "m", "Where to hold, LVLH axes", (3,), tunable=True, axes=LVLH),
        Variable(
            "synchronised", PAR, "1", "Whether the goal is before the grapple point, not hold.position",
            boolean=True, tunable=True,
        ),
        tunable("grapple.standoff", "m", "Distance of the goal from the grapple point"),
        tunable("guidance.speed", "m/s", "Largest speed towards the goal"),
        tunable("guidance.rate", "1/s", "Speed towards the goal over its distance"),
        tunable("control.rate", "1/s", "Rate at which errors of velocity decay"),
        tunable("keepOut.radius", "m", "Radius of the keep-out sphere about the CoM; 0: none"),
        tunable("corridor.halfAngle", "rad", "Half angle of the cone before the grapple point", (0.0, pi)),
        tunable("navigation.patience", "s", "How long to go on by dead reckoning without navigation, before a retreat"),
        tunable(
            "navigation.deviation", "m",
            "Standard deviation of target.position, and of its velocity over control.rate, from which to retreat, "
            "if the sphere is nearer than three",
        ),
        tunable("retreat.distance", "m", "Distance from the CoM to which to retreat, farther by three deviations"),
        tunable("retreat.farthest", "m", "How far the deviations lead at most; retreat.distance if that is more"),
        tunable("command.steps", "1", "Steps until a command acts: 1 if handed on in the next step, 0 in the same"),
        tunable("command.delay", "s", "Time until a command acts on top of command.steps, as of thrusters"),
        tunable("thrust.limit", "m/s2", "Largest commanded acceleration"),
        tunable("thrust.correction", "1", "Largest scale, and misalignment in rad, that a command is corrected for"),
        Variable(
            "command.acceleration", OUT, "m/s2", "Commanded acceleration of the chaser, LVLH axes", (3,), axes=LVLH,
            discrete=True,
        ),
        Variable("command.limited", OUT, "1", "Whether the limit cut the command", boolean=True, discrete=True),
        Variable("goal.offset", OUT, "m", "Chaser from the goal, LVLH axes", (3,), axes=LVLH, discrete=True),
        Variable(
            "goal.velocityError", OUT, "m/s", "Chaser's velocity less that of the law, LVLH axes", (3,), axes=LVLH,
            discrete=True,
        ),
        Variable("keepOut.distance", OUT, "m", "Distance from the keep-out sphere, below 0 inside", discrete=True),
        Variable("corridor.inside", OUT, "1", "Whether the sphere may be entered", boolean=True, discrete=True),
        Variable("goal.synchronised", OUT, "1", "Whether the goal turns with the body", boolean=True, discrete=True),
        Variable(
            "guidance.mode", OUT, "1", ", ".join(f"{k}: {word}" for k, word in enumerate(MODES)), discrete=True,
            limits=(0.0, len(MODES) - 1.0),
        ),
        Variable(
            "navigation.outage", OUT, "s",
            "Grows while navigation cannot be used, falls while it can; above navigation.patience: retreat",
            discrete=True, limits=NOT_NEGATIVE,
        ),
        Variable(
            "camera.attitude", OUT, "1", "Attitude quaternion (w, x, y, z), camera to inertial, with the target ahead",
            (4,), discrete=True,
        ),
    )  # fmt: skip


def _checks(given: Mapping[str, Symbol]) -> tuple[Check, ...]:
    """The conditions on the parameters, in the order of reporting."""
    angle = given["corridor.halfAngle"]

    def check(name: str, expected: str, quantity: str, found: Symbol, margin: Symbol) -> Check:
        return Check(name, name, expected, quantity, found, margin)

    def positive(name: str, unit: str) -> Check:
        return check(name, f"a value above 0 {unit}", "value", given[name], given[name])

    def not_negative(name: str, unit: str) -> Check:
        return check(name, f"a value of at least 0 {unit}", "value", given[name], ca.if_else(given[name] >= 0, 1, -1))

    return (
        *orbit_checks(Elements.named(given)),
        not_negative("grapple.standoff", "m"),
        positive("guidance.speed", "m/s"),
        positive("guidance.rate", "1/s"),
        positive("control.rate", "1/s"),
        not_negative("keepOut.radius", "m"),
        check(
            "corridor.halfAngle", "0 to pi rad", "value", angle,
            ca.if_else(ca.logic_and(angle >= 0, angle <= pi), 1, -1),
        ),
        not_negative("command.steps", "steps"),
        not_negative("command.delay", "s"),
        not_negative("navigation.patience", "s"),
        not_negative("navigation.deviation", "m"),
        not_negative("retreat.distance", "m"),
        not_negative("retreat.farthest", "m"),
        positive("thrust.limit", "m/s2"),
        check(
            "thrust.correction", "0 to 0.9", "value", given["thrust.correction"],
            ca.if_else(ca.logic_and(given["thrust.correction"] >= 0, given["thrust.correction"] <= 0.9), 1, -1),
        ),
    )  # fmt: skip

"""What ApproachController knows without navigation: dead reckoning from the last state that could be used; its mode.

The state is carried on from step to step: the chaser by its natural relative acceleration and the commands that act,
the body by its free tumble. While navigation is valid, the inputs take its place. Where navigation fails, the chaser
coasts if that keeps clear of the keep-out sphere, else the law goes on with what is carried on. After
`navigation.patience` it retreats, until navigation could be used for a while. That is what is usual, a hold or a
retreat on propagated navigation (Fehse, Automated Rendezvous and Docking of Spacecraft, 2003, chapter 4), and not a
drift with whatever velocity there is. To coast is no idleness: thrusters that are wrong by a few percent are what makes
an estimator doubt, and without thrust it finds back.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Self

import casadi as ca

from baryscope.models.attitude import symmetric_matrix, tumble_step
from baryscope.models.checks import DIRECTED
from baryscope.models.frames import Symbol
from baryscope.models.keplerian import Elements, conic, true_anomaly_after
from baryscope.models.relative_motion import relative_acceleration

MODES = ("waiting", "nominal", "dead reckoning", "retreat")
WAITING, NOMINAL, RECKONING, RETREAT = range(len(MODES))
RECOVERY = 3.0  # by how much faster an outage falls than it grows
CLEAR, CLEAR_AGAIN = 3.0, 10.0  # standard deviations between chaser and sphere, and so many to end a retreat

Named = Mapping[str, Symbol]


@dataclass(frozen=True)
class Belief:
    """What is believed at the beginning of a step, and kept from one step to the next; all zeros at first.

    Attributes:
        position, velocity: (3,) ρ and ρ̇ of the chaser in LVLH, m and m/s.
        deviation, drift: standard deviations of the two, all axes together, m and m/s.
        attitude, rate: q_I_B (w, x, y, z) of the body, and ω in B, rad/s.
        inertia: (6,), any multiple, 0 while no tumble was ever known.
        point, direction: of the grapple point, in B, m and 1.
        known: 1 once navigation could be used, else 0.
        outage: s; it grows while navigation cannot be used, and falls, by RECOVERY as fast, while it can.
        push: (3,), the acceleration by the last command, LVLH, m/s².
        sight: (3,), `sight.position`, frame C, m.
        aside: (3,), from the CoM to there when it was news and navigation failed, frame C, m; else 0.
        across: (3,), x of the camera, frame C; 0 before the first step.
        scale, misalignment: what the thrusters are wrong by, the latter (3,), a rotation vector in the camera's axes.
    """

    position: Symbol
    velocity: Symbol
    deviation: Symbol
    drift: Symbol
    attitude: Symbol
    rate: Symbol
    inertia: Symbol
    point: Symbol
    direction: Symbol
    known: Symbol
    outage: Symbol
    push: Symbol
    sight: Symbol
    aside: Symbol
    across: Symbol
    scale: Symbol
    misalignment: Symbol

    @classmethod
    def of(cls, column: Symbol) -> Self:
        """From a column of SIZE."""
        ends = [sum(SIZES[:k]) for k in range(len(SIZES) + 1)]
        return cls(*ca.vertsplit(column, ends))

    @property
    def column(self) -> Symbol:
        """All of it, in order."""
        column: Symbol = ca.vertcat(*(getattr(self, field.name) for field in fields(self)))
        return column


SIZES = (3, 3, 1, 1, 4, 3, 6, 3, 3, 1, 1, 3, 3, 3, 3, 1, 3)  # of Belief's fields
SIZE = sum(SIZES)


def believed(kept: Belief, told: Named, given: Named, R_L_I: Symbol, spin: Symbol) -> Belief:
    """The inputs if navigation is valid, else what was kept; before there is any, a chaser at rest where it starts.

    An estimator that has lost the tumble tells a valid centre of mass all the same: a chaser that turns with the body
    then keeps what was known of it. In a retreat inputs count without being valid where they claim less than what was
    kept: a velocity that was wrong when navigation failed would carry the chaser away for good.

    Args:
        kept: from the step before.
        told: the inputs.
        given: the parameters.
        R_L_I: from inertial axes to L.
        spin: angular rate of L, rad/s.
    """
    valid, sight = told["navigation.valid"], told["sight.position"]
    told_tumble = tumble_known(told["target.inertia"], told["grapple.point"])
    of_body = ca.logic_and(valid, ca.logic_or(told_tumble, ca.logic_not(given["synchronised"])))
    place = -R_L_I @ told["target.position"]
    moving = -R_L_I @ told["target.velocity"] - ca.cross(spin, place)
    news = ca.norm_2(sight - kept.sight) > 0
    deviation, drift = (_deviation(told[f"target.{of}Covariance"]) for of in ("position", "velocity"))
    better = ca.logic_and(deviation > 0, deviation < kept.deviation)
    counts = ca.logic_or(valid, ca.logic_and(kept.outage > given["navigation.patience"], better))
    position = ca.if_else(counts, place, ca.if_else(kept.known, kept.position, given["chaser.position0"]))
    return replace(
        kept,
        position=position,
        velocity=ca.if_else(counts, moving, kept.velocity),
        deviation=ca.if_else(counts, deviation, kept.deviation),
        drift=ca.if_else(counts, drift, kept.drift),
        attitude=ca.if_else(of_body, told["target.attitude"], kept.attitude),
        rate=ca.if_else(of_body, told["target.angularRate"], kept.rate),
        inertia=ca.if_else(of_body, told["target.inertia"], kept.inertia),
        point=ca.if_else(of_body, told["grapple.point"], kept.point),
        direction=ca.if_else(of_body, told["grapple.direction"], kept.direction),
        scale=ca.if_else(valid, told["thrust.error"][0], kept.scale),
        misalignment=ca.if_else(valid, told["thrust.error"][1:], kept.misalignment),
        sight=sight,
        aside=ca.if_else(valid, 0, ca.if_else(news, sight + R_L_I.T @ position, kept.aside)),
    )


def _deviation(upper: Symbol) -> Symbol:
    """Of all axes together, of a covariance in the order of UPPER."""
    return ca.sqrt(ca.fmax(0, upper[0] + upper[3] + upper[5]))


def tumble_known(inertia: Symbol, point: Symbol) -> Symbol:
    """Whether inertia and grapple point are: an estimator tells zeros before."""
    return ca.logic_and(inertia[0] + inertia[1] + inertia[2] > 0, ca.norm_2(point) > DIRECTED)


def outage_and_mode(belief: Belief, told: Named, given: Named, length: Symbol) -> tuple[Symbol, Symbol]:
    """The outage, s, as it will be at the step's end if all stays as it is, and the place in MODES.

    Navigation can be used if it is valid, if its standard deviation is at most `navigation.deviation` or the keep-out
    sphere is CLEAR of them away, and where it takes the chaser to brake farther, and if it tells the tumble, unless
    that is not needed or was never known. A wrong velocity counts by how far it leads astray.

    Args:
        belief: at the step's beginning.
        told: the inputs.
        given: the parameters.
        length: of the step, s.
    """
    patience = given["navigation.patience"]
    longest = 2 * patience + length  # so that a retreat ends
    deviation = belief.deviation + belief.drift / given["control.rate"]
    margin = ca.if_else(belief.outage > patience, CLEAR_AGAIN, CLEAR) * deviation + braking(belief, given)
    distance = ca.norm_2(belief.position) - given["keepOut.radius"]
    clear = ca.logic_or(deviation <= given["navigation.deviation"], distance >= margin)
    told_tumble = tumble_known(told["target.inertia"], told["grapple.point"])
    needed = ca.logic_and(given["synchronised"], tumble_known(belief.inertia, belief.point))
    tumbles = ca.logic_or(told_tumble, ca.logic_not(needed))
    usable = ca.logic_and(told["navigation.valid"], ca.logic_and(clear, tumbles))
    known = ca.logic_or(belief.known, usable)
    more, less = ca.fmin(belief.outage + length, longest), ca.fmax(belief.outage - RECOVERY * length, 0)
    outage = known * ca.if_else(usable, less, more)
    flown = ca.if_else(outage > patience, RETREAT, ca.if_else(usable, NOMINAL, RECKONING))
    return outage, ca.if_else(known, flown, WAITING)


def braking(belief: Belief, given: Named) -> Symbol:
    """How far the chaser goes on towards the CoM as it brakes by `thrust.limit`, m."""
    closing = -ca.dot(belief.position, belief.velocity) / ca.fmax(ca.norm_2(belief.position), DIRECTED)
    return ca.fmax(closing, 0) ** 2 / (2 * given["thrust.limit"])


def drift_is_clear(belief: Belief, given: Named) -> Symbol:
    """Whether the chaser, drifting straight on for the patience, stays CLEAR deviations away from the sphere.

    What gravity adds in so short a time is millimetres.
    """
    span = given["navigation.patience"]
    speed = ca.fmax(ca.sumsqr(belief.velocity), DIRECTED)
    nearest = ca.fmin(ca.fmax(-ca.dot(belief.position, belief.velocity) / speed, 0), span)
    margin = CLEAR * (belief.deviation + span * belief.drift)
    return ca.norm_2(belief.position + nearest * belief.velocity) >= given["keepOut.radius"] + margin


def carried_on(belief: Belief, acting: Symbol, step: tuple[Symbol, Symbol], elements: Elements) -> Belief:
    """What is believed of the motion a step later.

    Args:
        belief: at the step's beginning.
        acting: the acceleration by commands in the step, LVLH, m/s².
        step: its beginning since the start, and its length, s.
        elements: the target's orbit.
    """
    time, length = step
    now, halfway = (
        conic(elements.ellipse, true_anomaly_after(moment, elements)) for moment in (time, time + length / 2)
    )
    slope = relative_acceleration(belief.position, belief.velocity, acting, now)
    middle, moving = belief.position + length / 2 * belief.velocity, belief.velocity + length / 2 * slope
    J = symmetric_matrix(ca.vertsplit(belief.inertia))
    J = ca.if_else(ca.trace(J) > 0, J, ca.SX.eye(3))
    known = ca.norm_2(belief.attitude) > DIRECTED
    attitude = ca.if_else(known, belief.attitude, ca.SX([1, 0, 0, 0]))  # else hosts that trap 0 / 0 end here
    turned, rate, _ = tumble_step(gravity_gradient=False)(attitude, belief.rate, ca.vec(J), length)
    return replace(
        belief,
        position=belief.position + length * moving,
        velocity=belief.velocity + length * relative_acceleration(middle, moving, acting, halfway),
        deviation=belief.deviation + length * belief.drift,
        attitude=ca.if_else(known, turned, belief.attitude),
        rate=rate,
    )

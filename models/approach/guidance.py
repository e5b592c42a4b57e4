"""A plain guidance law: a field of velocities that leads to a goal, and the acceleration that keeps the chaser on it.

The field w(ρ, t) is what the chaser's velocity in LVLH shall be at the place ρ. Its glideslope towards the goal g is as
fast as the distance is long, up to a speed (Hablani, Tapper, Dana-Bashian, J. Guidance 25, 2002):

    w = w_goal + v(e), e = ρ − g, v = −min(λ, v_max/|e|) e

so that from rest the chaser flies straight to a goal that rests: along R-bar and V-bar, where both are on them. Outside
of a keep-out sphere of radius R about the CoM the part of w towards it is at most λ (|ρ| − R): the chaser comes to rest
on the sphere, or slides around it. A goal that turns with the body is reached through a corridor, a cone before the
grapple point: outside of it, g is where its axis leaves the sphere.

The law linearises by feedback: with u = ẇ + k (w − ρ̇) − n(ρ, ρ̇), where ẇ is the total derivative along the motion and
n the natural acceleration, ρ̇ tends to w by the rate k.
"""

from dataclasses import dataclass

import casadi as ca

from baryscope.models.frames import Symbol

ROOM = 0.1  # m, about a goal in the corridor, for what the chaser is off
TINY = 1e-9  # m, keeps lengths and their derivatives from a division by zero


@dataclass(frozen=True)
class Limits:
    """What the field is bounded by.

    Attributes:
        speed: v_max, m/s, relative to the goal.
        rate: λ, 1/s.
        radius: R of the keep-out sphere, m; 0 for none.
        cosine: of the half angle of the corridor, a cone from the grapple point outwards, in which there is no sphere.
    """

    speed: Symbol
    rate: Symbol
    radius: Symbol
    cosine: Symbol


@dataclass(frozen=True)
class Goal:
    """Where to, in LVLH.

    Attributes:
        position: g, m from the target's CoM.
        apex: of the corridor, the grapple point, m.
        axis: of the corridor, outwards, of length 1.
        turning: with which g, apex and axis turn, rad/s; zero for a goal that rests.
        turning_rate: the derivative of that in LVLH, rad/s².
        turns: whether they do: 1 or 0.
    """

    position: Symbol
    apex: Symbol
    axis: Symbol
    turning: Symbol
    turning_rate: Symbol
    turns: Symbol


@dataclass(frozen=True)
class Motion:
    """The chaser's motion in LVLH.

    Attributes:
        position: ρ, m from the target's CoM.
        velocity: ρ̇, m/s.
        natural: n, the acceleration ρ̈ without a command, m/s².
    """

    position: Symbol
    velocity: Symbol
    natural: Symbol


def glide_velocity(position: Symbol, goal: Goal, limits: Limits) -> Symbol:
    """w(ρ), m/s. With a goal that turns the field turns as well, as far as the goal or the sphere is from the CoM."""
    distance = _length(position)
    reach = ca.fmax(_length(goal.position), limits.radius)
    own = position * ca.fmin(1, reach / distance)
    inside = in_corridor(position, goal, limits)
    outside = ca.logic_and(goal.turns, ca.logic_not(inside))
    offset = position - ca.if_else(outside, entry(goal, limits.radius), goal.position)
    slope = ca.fmin(limits.rate, limits.speed / _length(offset))
    wanted = ca.cross(goal.turning, own) - slope * offset
    outward = position / distance
    slowest = -limits.rate * (distance - limits.radius)
    lack = ca.fmax(0, slowest - ca.dot(wanted, outward))
    return wanted + ca.if_else(inside, 0, lack) * outward


def entry(goal: Goal, radius: Symbol) -> Symbol:
    """Where the corridor's axis leaves a sphere about the CoM, or the goal if that is farther out."""
    along = ca.dot(goal.apex, goal.axis)
    square = along**2 + radius**2 - ca.dot(goal.apex, goal.apex)
    out = ca.sqrt(ca.fmax(square, TINY**2)) - along
    return goal.apex + ca.fmax(out, ca.dot(goal.position - goal.apex, goal.axis)) * goal.axis


def in_corridor(position: Symbol, goal: Goal, limits: Limits) -> Symbol:
    """Whether the sphere may be entered: in front of the grapple point of a goal that turns, or without a sphere.

    Where the cone leaves less than ROOM beside the goal, as at its apex, it begins farther back, rounded off.
    """
    seen, standoff = position - goal.apex, ca.dot(goal.position - goal.apex, goal.axis)
    back = ca.fmax(0, limits.cosine * ca.sqrt(standoff**2 + ROOM**2) - standoff)
    inside = ca.dot(seen, goal.axis) + back >= limits.cosine * ca.norm_2(seen)
    return ca.logic_or(limits.radius == 0, ca.logic_and(goal.turns, inside))


def commanded(motion: Motion, goal: Goal, limits: Limits, gain: Symbol) -> Symbol:
    """u = ẇ + k (w − ρ̇) − n, m/s², with k the gain in 1/s."""
    position, place, apex, axis, turning = (ca.SX.sym(name, 3) for name in ("rho", "g", "apex", "axis", "turning"))
    free = Goal(place, apex, axis, turning, goal.turning_rate, goal.turns)
    moving = ca.vertcat(position, place, apex, axis, turning)
    where = ca.vertcat(motion.position, goal.position, goal.apex, goal.axis, goal.turning)
    turned = (ca.cross(goal.turning, vector) for vector in (goal.position, goal.apex, goal.axis))
    rates = ca.vertcat(motion.velocity, *turned, goal.turning_rate)
    change = ca.substitute(ca.jtimes(glide_velocity(position, free, limits), moving, rates), moving, where)
    return change + gain * (glide_velocity(motion.position, goal, limits) - motion.velocity) - motion.natural


def _length(vector: Symbol) -> Symbol:
    return ca.sqrt(ca.dot(vector, vector) + TINY**2)

"""The target's orbit and the relative motion under J2, step by step, as functions to be written as C code.

`relative_orbit.step_in_chaser_axes` has the same in closed form, without J2.
"""

import casadi as ca

from baryscope.models.differences import Pair
from baryscope.models.ephemeris.runge_kutta import step_of_order_4
from baryscope.models.ephemeris.trajectory import gravity
from baryscope.models.frames import Symbol
from baryscope.models.keplerian import Elements, osculating, position_and_velocity, true_anomaly_after


def oblate_functions() -> tuple[ca.Function, ...]:
    """What follows an orbit under J2: `oblate`, and from elements to places and back, `target_place`, `osculating`.

    `oblate`: (T, (μ, J₂, R), place, state) → (place, state, Φ), T s later by one step of fourth order. Place: of the
    target, [r; v] (6,) from the centre in I; state: of the target's CoM from the chaser (6,) in the same axes; Φ (6, 6)
    its derivative by what it was. The state is a difference that loses no digits.
    `target_place`: (time, elements at time 0) → place. `osculating`: (time, place, μ) → elements at time 0.
    """
    return _oblate(), _target_place(), _osculating()


def _oblate() -> ca.Function:
    T, body, place, state = (ca.SX.sym(name, size) for name, size in (("T", 1), ("body", 3), ("place", 6), ("x", 6)))

    def rates(both: Symbol, _: float) -> Symbol:
        r, v, p, w = ca.vertsplit(both, 3)
        force = gravity(Pair(r, -p), body, oblate=True)  # of the target, and of the chaser, which is at -p from it
        return ca.vertcat(v, force.base, w, -force.excess)

    moved = step_of_order_4(rates, ca.vertcat(place, state), T)
    there, seen = moved[:6], moved[6:]
    transition = ca.densify(ca.jacobian(seen, state))
    return ca.Function("oblate", [T, body, place, state], [there, seen, transition], {"cse": True})


def _target_place() -> ca.Function:
    time, (column, elements) = ca.SX.sym("time"), Elements.symbols()
    return ca.Function("target_place", [time, column], [position_and_velocity(time, elements)], {"cse": True})


def _osculating() -> ca.Function:
    time, place, mu = ca.SX.sym("time"), ca.SX.sym("place", 6), ca.SX.sym("mu")
    there = osculating(place, mu)
    column = there.column
    column[5] = true_anomaly_after(-time, there)
    return ca.Function("osculating", [time, place, mu], [column], {"cse": True})

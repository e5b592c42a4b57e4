"""Position and velocity of the target: on a Kepler orbit, under J2, or as an ephemeris tells; and the axes along them.

All in I, whose z axis is the central body's pole where J2 acts.
"""

from functools import cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from baryscope.models.columns import ColumnFunction
from baryscope.models.differences import Pair
from baryscope.models.ephemeris.elements import elements_of
from baryscope.models.ephemeris.runge_kutta import step_of_order_8
from baryscope.models.errors import ComputationError, Reason
from baryscope.models.forces import point_mass_gravity, zonal_gravity, zonal_strength
from baryscope.models.frames import Symbol
from baryscope.models.keplerian import Elements, position_and_velocity
from baryscope.models.orbit import Orbit

FloatArray = NDArray[np.float64]

ARC = 0.1  # rad from node to node: the position between them is a quintic, good to a millimetre
CHUNK = 64  # steps in one call of the compiled function
MOST_STEPS = 1_000_000  # of one integration


def target_states(orbit: Orbit, time: FloatArray) -> FloatArray:
    """Position and velocity (n, 6) of the target from the central body's centre in I, m and m/s, at times (n,) in s.

    By the orbit's ephemeris if it has one, else by its J2, else in closed form.

    Raises:
        InputError: a time outside the ephemeris.
        ComputationError: a time too far from time 0 to integrate to.
    """
    if orbit.ephemeris is not None:
        return orbit.ephemeris.states(time)
    if not orbit.j2:
        return kepler_states(orbit, time)
    return _oblate_states(orbit, time)


def kepler_states(orbit: Orbit, time: FloatArray) -> FloatArray:
    """The states (n, 6) of `target_states` on the ellipse of the elements at time 0, in closed form."""
    return _kepler_function()(time[None], orbit.elements)


def kepler_orbit_through(state: FloatArray, time: float, mu: float) -> Orbit:
    """The Kepler orbit of a target with a state (6,) in I, m and m/s, at a time in s.

    mu: gravitational parameter of the central body, m³/s².

    Raises:
        InputError: it is no ellipse, or one through the central body.
    """
    there = _osculating(state, mu)
    return there if time == 0 else _osculating(kepler_states(there, np.array([-time]))[0], mu)


def _osculating(state: FloatArray, mu: float) -> Orbit:
    elements: dict[str, Any] = {**elements_of(state, mu)}
    return Orbit(**elements, gravitational_parameter=mu)


def lvlh_axes(states: FloatArray) -> FloatArray:
    """R_I_L (n, 3, 3) for states (n, 6) of the target: x radial outward, z normal to position and velocity."""
    up = states[:, :3] / np.linalg.norm(states[:, :3], axis=1, keepdims=True)
    normal = np.cross(states[:, :3], states[:, 3:])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return np.stack([up, np.cross(normal, up), normal], axis=2)


def gravity_gradient(orbit: Orbit, states: FloatArray) -> FloatArray:
    """The gradient (n, 3, 3) of gravity in I, 1/s², at states (n, 6) of the target, with J2 if the orbit has it."""
    return _gradient_function(bool(orbit.j2))(states[:, :3].T, _body(orbit))


def gravity_difference(orbit: Orbit, states: FloatArray, offset: FloatArray) -> FloatArray:
    """How much more gravity accelerates what is at `offset` (n, 3), m in I, from the target than the target, (n, 3).

    To the last digits, in m/s², at states (n, 6) of the target, with J2 if the orbit has it.
    """
    return _difference_function(bool(orbit.j2))(states[:, :3].T, offset.T, _body(orbit))


def _body(orbit: Orbit) -> list[float]:
    return [orbit.gravitational_parameter, orbit.j2 or 0.0, orbit.equatorial_radius or 0.0]


def gravity(position: Pair, body: Symbol, *, oblate: bool) -> Pair:
    """Acceleration at two positions from the centre in I (m; base and excess), m/s²; body: (μ, J₂, R) (3,), SI."""
    mu, j2, radius = ca.vertsplit(body)
    central = point_mass_gravity(position, mu)
    return central + zonal_gravity(position, zonal_strength(mu, j2, radius)) if oblate else central


@cache
def _kepler_function() -> ColumnFunction:
    """(time, elements) → state."""
    time, (column, elements) = ca.SX.sym("time"), Elements.symbols()
    return ColumnFunction("kepler", [time, column], position_and_velocity(time, elements))


@cache
def _gradient_function(oblate: bool) -> ColumnFunction:
    """(position, (μ, J₂, R)) → ∂g/∂r."""
    position, body = ca.SX.sym("position", 3), ca.SX.sym("body", 3)
    return ColumnFunction("gradient", [position, body], ca.jacobian(_field(position, body, oblate), position))


@cache
def _difference_function(oblate: bool) -> ColumnFunction:
    """(position, offset, (μ, J₂, R)) → g(r + offset) − g(r)."""
    position, offset, body = ca.SX.sym("position", 3), ca.SX.sym("offset", 3), ca.SX.sym("body", 3)
    more = gravity(Pair(position, offset), body, oblate=oblate).excess
    return ColumnFunction("difference", [position, offset, body], more)


def _field(position: Symbol, body: Symbol, oblate: bool) -> Symbol:
    """g(r), m/s²."""
    return gravity(Pair(position, ca.SX.zeros(3)), body, oblate=oblate).base


@cache
def _field_function() -> ColumnFunction:
    position, body = ca.SX.sym("position", 3), ca.SX.sym("body", 3)
    return ColumnFunction("field", [position, body], _field(position, body, True))


@cache
def _advance() -> ca.Function:
    """(state, (μ, J₂, R), step) → states (6, CHUNK) after each of CHUNK steps of order 8 (Dormand, Prince)."""
    state, body, h = ca.SX.sym("state", 6), ca.SX.sym("body", 3), ca.SX.sym("step")

    def rates(here: Symbol, _: float) -> Symbol:
        return ca.vertcat(here[3:], _field(here[:3], body, True))

    return ca.Function("advance", [state, body, h], [step_of_order_8(rates, state, h)], {"cse": True}).mapaccum(CHUNK)


def _oblate_states(orbit: Orbit, time: FloatArray) -> FloatArray:
    """The motion under J2 from the elements at time 0, integrated to nodes ARC apart, and quintics between them."""
    h = ARC / orbit.periapsis_rate
    first, last = (int(np.floor(t / h)) for t in (time.min(initial=0.0), time.max(initial=0.0)))
    if last - first > MOST_STEPS:
        raise ComputationError(
            f"the tracks are {max(-first, last) * h / orbit.period:.2g} turns away from time 0 of the orbit, "
            "too many to integrate it under J2",
            Reason.TOO_LONG,
        )
    begin = kepler_states(orbit, np.zeros(1))[0]
    back, forth = _walk(orbit, begin, -h, -first), _walk(orbit, begin, h, last + 1)
    nodes = np.concatenate([back[:0:-1], forth])
    pull = _field_function()(nodes[:, :3].T, _body(orbit))
    left = np.floor(time / h).astype(np.intp) - first
    return _quintic(time / h - (left + first), left, nodes, pull, h)


def _walk(orbit: Orbit, begin: FloatArray, h: float, count: int) -> FloatArray:
    """The states (count + 1, 6) from `begin`, each `h` s after the last."""
    states, advance = [begin[None]], _advance()
    for _ in range(0, count, CHUNK):
        states.append(np.asarray(advance(states[-1][-1], _body(orbit), h)).T)
    return np.concatenate(states)[: count + 1]


def _quintic(s: FloatArray, left: NDArray[np.intp], nodes: FloatArray, pull: FloatArray, h: float) -> FloatArray:
    """States (n, 6) between nodes with states (k, 6) and accelerations (k, 3), a fraction s (n,) of h after `left`."""
    s = s[:, None]
    r0, v0, a0 = nodes[left, :3], h * nodes[left, 3:], h * h * pull[left]
    r1, v1, a1 = nodes[left + 1, :3], h * nodes[left + 1, 3:], h * h * pull[left + 1]
    # r = r₀ + v₀ s + a₀ s²/2 + c₃ s³ + c₄ s⁴ + c₅ s⁵ with the three conditions at s = 1.
    gap, slope, bend = r1 - r0 - v0 - a0 / 2, v1 - v0 - a0, a1 - a0
    c3 = 10 * gap - 4 * slope + bend / 2
    c4 = -15 * gap + 7 * slope - bend
    c5 = 6 * gap - 3 * slope + bend / 2
    position = r0 + s * (v0 + s * (a0 / 2 + s * (c3 + s * (c4 + s * c5))))
    velocity = v0 + s * (a0 + s * (3 * c3 + s * (4 * c4 + s * 5 * c5)))
    return np.concatenate([position, velocity / h], axis=1)

"""The rotation of a rigid body under small torques, and how its attitudes depend on rate and inertia."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from baryscope.study.population.interface import FloatArray
from baryscope.study.population.third.dice import direction, log_uniform, matrices
from baryscope.study.population.third.forces import MU

Place = Callable[[float], FloatArray]
Turned = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
SHAPES = np.array(  # directions of an inertia (5, 3, 3) that keep its trace
    [
        [[1, 0, 0], [0, -1, 0], [0, 0, 0]],
        [[0, 0, 0], [0, 1, 0], [0, 0, -1]],
        [[0, 1, 0], [1, 0, 0], [0, 0, 0]],
        [[0, 0, 1], [0, 0, 0], [1, 0, 0]],
        [[0, 0, 0], [0, 0, 1], [0, 1, 0]],
    ],
    dtype=float,
)


@dataclass(frozen=True)
class Torques:
    """Torques over the trace of the inertia, which is 1.

    eddy: torque over rate in the field of the Earth's dipole at the equator, 1/s; gradient: of gravity; steady (3,):
    fixed in B, 1/s²; slug: inertia and damping (1/s) of a sphere of fuel; growth (3,): change of the inertia along the
    axes of B, 1/s; unbalance (3,): that of weight along −z of C at an arm in B, 1/s².
    """

    eddy: float = 0.0
    gradient: bool = False
    steady: tuple[float, ...] = ()
    slug: tuple[float, float] = (0.0, 0.0)
    growth: tuple[float, ...] = ()
    unbalance: tuple[float, ...] = ()

    def words(self) -> list[str]:
        """Each torque with its size."""
        found = []
        if self.eddy:
            found.append(f"eddy currents 1/{1 / self.eddy:.2g} s")
        found += ["gravity gradient"] * self.gradient
        if self.steady:
            found.append(f"body torque {np.linalg.norm(self.steady):.2g} tr I/s²")
        if self.slug[0]:
            found.append(f"slosh {self.slug[0]:.2g} of the inertia, damped in {1 / self.slug[1]:.2g} s")
        if self.growth:
            found.append(f"inertia change {np.linalg.norm(self.growth):.2g}/s")
        if self.unbalance:
            found.append(f"unbalance {np.linalg.norm(self.unbalance):.2g} tr I/s²")
        return found


@dataclass(frozen=True, eq=False)
class Tumbled:
    """attitude (n, 3, 3) R_C_B; rate (n, 3) in B, rad/s; turn (n, 3, 8): rotation vectors in B by the first rate and
    by the five SHAPES of the inertia, of the free tumble at the rates that are; at: attitudes and rates at other times,
    from the first on.
    """

    attitude: FloatArray
    rate: FloatArray
    turn: FloatArray
    at: Turned


def drawn(rng: np.random.Generator, names: tuple[str, ...], rate: float, span: float) -> Torques:
    """The torques that are named, sized by what they do in the span, s, to a tumble of that rate, rad/s.

    Each turns the body by 1e-5 to 0.3 rad or so; the gravity's gradient is what it is.
    """

    def per_square_second() -> float:
        return 2 * log_uniform(rng, 1e-5, 0.3) / span**2 / 3

    eddy = log_uniform(rng, 1e-5, 0.1) / span if "eddy currents" in names else 0.0
    steady = tuple(per_square_second() * direction(rng)) if "body torque" in names else ()
    slug = (0.0, 0.0)
    if "slosh" in names:
        slug = (log_uniform(rng, 1e-5, 0.03), log_uniform(rng, 0.03, 3) * rate)
    growth = tuple(log_uniform(rng, 1e-5, 0.03) / span * direction(rng)) if "inertia change" in names else ()
    unbalance = tuple(log_uniform(rng, 0.1, 30) * per_square_second() * direction(rng)) if "unbalance" in names else ()
    return Torques(eddy, "gravity gradient" in names, steady, slug, growth, unbalance)


def tumbled(
    first: tuple[FloatArray, FloatArray], inertia: FloatArray, time: FloatArray, torques: Torques, place: Place
) -> Tumbled:
    """The tumble from R_C_B (3, 3) and the rate (3,) in B, rad/s, at time[0].

    inertia (3, 3) in B, of trace 1; place: of the target, geocentric in C, m, at a time; only eddy currents and gravity
    need it.
    """
    R, rate = first
    state = np.concatenate([[1.0, 0.0, 0.0, 0.0], rate, np.zeros(3)])
    elapsed = time - time[0]
    arguments = (inertia, torques, R, lambda t: place(time[0] + t))

    def integrated(end: float) -> Place:
        span, dense = (0.0, end), True
        found = solve_ivp(_slope, span, state, "DOP853", None, dense, args=arguments, rtol=1e-11, atol=1e-13)
        return lambda t: np.asarray(found.sol(t))

    def of(states: FloatArray) -> tuple[FloatArray, FloatArray]:
        q = states[:, :4] / np.linalg.norm(states[:, :4], axis=1, keepdims=True)
        return R @ matrices(q), states[:, 4:7]

    def at(times: FloatArray) -> tuple[FloatArray, FloatArray]:
        return of(integrated(times[-1] - time[0])(times - time[0]).T)

    found = integrated(elapsed[-1])
    turn = turned_by(lambda t: found(t)[4:7], inertia, elapsed)
    return Tumbled(*of(found(elapsed).T), turn, at)


def turned_by(rate: Place, inertia: FloatArray, time: FloatArray) -> FloatArray:
    """Rotation vectors (n, 3, 8) in B by a change of the first rate and of the inertia in SHAPES, in first order, about
    the rates (3,) in B that `rate` gives at a time; the attitude at time[0] is held.
    """
    inverse = np.linalg.inv(inertia)

    def slope(t: float, state: FloatArray) -> FloatArray:
        phi, change = state.reshape(2, 3, 8)
        w = rate(t)
        W = _cross(w)
        momentum = inertia @ w
        speeding = -inverse @ (W @ momentum)
        by_inertia = SHAPES @ speeding - SHAPES @ w @ W
        forced = np.concatenate([np.zeros((3, 3)), by_inertia.T], axis=1)
        change_rate = inverse @ ((_cross(momentum) - W @ inertia) @ change - forced)
        return np.concatenate([(change - W @ phi).ravel(), change_rate.ravel()])

    first = np.concatenate([np.zeros((3, 8)), np.eye(3, 8)])
    span = (time[0], time[-1])
    found = solve_ivp(slope, span, first.ravel(), "DOP853", time, rtol=1e-6, atol=1e-9)
    return np.asarray(found.y[:24].T.reshape(-1, 3, 8))


def _slope(  # t: s after the first time
    t: float, state: FloatArray, inertia: FloatArray, torques: Torques, R: FloatArray, place: Place
) -> FloatArray:
    q, w, slug_rate = state[:4], state[4:7], state[7:]
    moment, slug_slope, W = np.zeros(3), np.zeros(3), _cross(w)
    I = inertia  # noqa: E741
    if torques.growth:
        growth = np.diag(torques.growth)
        I = inertia + growth * t  # noqa: E741
        moment = moment - growth @ w
    if torques.eddy or torques.gradient or torques.unbalance:
        moment = moment + _outer_torque(t, w, I, torques, (R @ matrices(q[None])[0], place))
    if torques.steady:
        moment = moment + np.array(torques.steady)
    mass, damping = torques.slug
    if mass:
        moment = moment + mass * damping * slug_rate
    speeding = np.linalg.solve(I, moment - W @ I @ w)
    if mass:
        slug_slope = -speeding - damping * slug_rate - W @ slug_rate
    x, y, z = w
    spin = np.array([[0, -x, -y, -z], [x, 0, z, -y], [y, -z, 0, x], [z, y, -x, 0]])
    return np.concatenate([0.5 * spin @ q, speeding, slug_slope])


def _outer_torque(
    t: float, w: FloatArray, inertia: FloatArray, torques: Torques, where: tuple[FloatArray, Place]
) -> FloatArray:
    """The torque (3,) in B of the Earth's field and gravity, and of weight, at R_C_B of `where`."""
    R, place = where
    moment = np.zeros(3)
    if torques.unbalance:
        moment += np.cross(torques.unbalance, R.T @ np.array([0.0, 0.0, -1.0]))
    if torques.eddy or torques.gradient:
        r = place(t)
        distance = np.linalg.norm(r)
        up = R.T @ (r / distance)
        pole = R.T[:, 2]
        field = 3 * (pole @ up) * up - pole
        moment -= torques.eddy * (field @ field * w - field * (field @ w))
        if torques.gradient:
            moment += 3 * MU / distance**3 * _cross(up) @ inertia @ up
    return moment


def _cross(v: FloatArray) -> FloatArray:
    """v×, (3, 3): a product with it takes a fraction of the time of numpy's cross product of two vectors."""
    x, y, z = v
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])

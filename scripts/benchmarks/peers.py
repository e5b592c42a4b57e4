"""Peers of the unit for benchmark.py: general integrators of the same equations over the same time.

Each gives the seconds it took, set-up and compilation left out, and the states (q, ω, θ, ρ, ρ̇) it ended with, for
several tolerances and variants: the fastest that is no less accurate than the unit counts.
"""

import operator
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from baryscope.models.scenario import Scenario
from baryscope.models.target import PLACE_START
from baryscope.scripts.benchmarks.setting import best_of

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Flight:
    """One peer's run: who, in which variant, the seconds taken, and the state at the end."""

    peer: str
    variant: str
    seconds: float
    state: FloatArray


def scipy_flights(scenario: Scenario, duration: float) -> Iterator[Flight]:
    """scipy's DOP853 with CasADi's right-hand side, in one call."""
    system, p, x0, u = _problem(scenario)

    def rates(_: float, x: FloatArray) -> FloatArray:
        return np.asarray(system.rhs(x, u, p)).ravel()

    for tolerance in (1e-11, 1e-12, 1e-13):

        def run(tolerance: float = tolerance) -> FloatArray:
            solution = solve_ivp(rates, (0, duration), x0, "DOP853", rtol=tolerance, atol=tolerance)
            return np.asarray(solution.y[:, -1])

        yield Flight("scipy DOP853", f"tolerance {tolerance:g}", *best_of(run, 1))


def cvodes_flights(scenario: Scenario, duration: float) -> Iterator[Flight]:
    """CasADi's cvodes, Adams with functional iteration and BDF with Newton's."""
    system, p, x0, u = _problem(scenario)
    x = ca.SX.sym("x", 14)
    dae = {"x": x, "ode": system.rhs(x, u, p)}
    for scheme, iteration in (("adams", "functional"), ("bdf", "newton")):
        for tolerance in (1e-11, 1e-12, 1e-13, 1e-14):
            options: dict[str, Any] = {
                "abstol": tolerance, "reltol": tolerance, "linear_multistep_method": scheme,
                "nonlinear_solver_iteration": iteration, "max_num_steps": 10_000_000, "disable_internal_warnings": True,
            }  # fmt: skip
            integrator = ca.integrator("peer", "cvodes", dae, 0, duration, options)

            def run(integrator: ca.Function = integrator) -> FloatArray:
                return np.asarray(integrator(x0=x0)["xf"]).ravel()

            try:
                yield Flight("CasADi cvodes", f"{scheme}, tolerance {tolerance:g}", *best_of(run, 3))
            except RuntimeError:  # the tolerance is beyond it
                continue


def heyoka_flights(scenario: Scenario, duration: float) -> Iterator[Flight]:
    """heyoka's Taylor method after its compilation: coupled, and split in attitude and orbit as the unit is."""
    import heyoka as hy

    system, p, x0, _ = _problem(scenario)
    c = np.asarray(system.constants(p)).ravel()
    attitude, orbit = _heyoka_attitude(hy, c), _heyoka_orbit(hy, c)
    for tolerance in (1e-10, 1e-11, 1e-12, 1e-13, 1e-14, 1e-15, 0.0):
        for variant, parts in (("coupled", [slice(0, 14)]), ("split", [slice(0, 7), slice(7, 14)])):
            integrators = [
                (part, hy.taylor_adaptive((attitude + orbit)[part], list(x0[part]), tol=tolerance)) for part in parts
            ]

            def run(integrators: list[tuple[slice, Any]] = integrators) -> FloatArray:
                end = np.empty(14)
                for part, integrator in integrators:
                    integrator.time = 0.0
                    integrator.state[:] = x0[part]
                    integrator.propagate_until(duration)
                    end[part] = integrator.state
                return end

            run()  # what is compiled late is compiled now
            label = f"{variant}, tolerance {tolerance:g}" if tolerance else f"{variant}, own tolerance"
            yield Flight("heyoka", label, *best_of(run, 10))


def heyoka_under_torques(scenario: Scenario, duration: float) -> Flight:
    """heyoka with gravity gradient and the scenario's forces, attitude and orbit apart, at the unit's tolerance.

    Its states are in units of their sizes, since its tolerance is relative to the largest of them.
    """
    import heyoka as hy

    system, p, x0, u = _problem(scenario)
    c, scale = np.asarray(system.constants(p)).ravel(), np.asarray(system.nominals(p)).ravel()
    parts = (  # of the state, and the function of its rates
        (slice(0, PLACE_START + system.place_size), system.attitude_rates),
        (slice(PLACE_START, len(x0)), system.orbit_rates),
    )
    integrators = []
    for part, rates in parts:
        variables = hy.make_vars(*(f"x{k}" for k in range(part.stop - part.start)))
        sizes = scale[part].tolist()
        states = [size * variable for size, variable in zip(sizes, variables, strict=True)]
        found = _expressions(hy, rates, (states, u.tolist(), c.tolist()))
        equations = [(v, rate / size) for v, rate, size in zip(variables, found, sizes, strict=True)]
        integrators.append((part, hy.taylor_adaptive(equations, list(x0[part] / scale[part]), tol=1e-13)))

    def run() -> FloatArray:
        end = np.empty(len(x0))
        for part, integrator in integrators:
            integrator.time = 0.0
            integrator.state[:] = x0[part] / scale[part]
            integrator.propagate_until(duration)
            end[part] = integrator.state * scale[part]
        return end

    run()
    return Flight("heyoka", "split, tolerance 1e-13", *best_of(run, 20))


def _expressions(hy: Any, function: ca.Function, arguments: Sequence[Sequence[Any]]) -> list[Any]:
    """A CasADi function of some arguments, numbers or heyoka's variables, in heyoka's expressions."""
    one = {
        ca.OP_NEG: lambda a: -a,
        ca.OP_SQ: lambda a: a * a,
        ca.OP_TWICE: lambda a: 2.0 * a,
        ca.OP_INV: lambda a: 1 / a,
    }
    named = {ca.OP_SQRT: "sqrt", ca.OP_SIN: "sin", ca.OP_COS: "cos"}
    work: dict[int, Any] = {}
    results: dict[int, Any] = {}
    for k in range(function.n_instructions()):
        operation, into, out_of = (
            function.instruction_id(k), function.instruction_output(k), function.instruction_input(k),
        )  # fmt: skip
        if operation == ca.OP_CONST:
            work[into[0]] = function.instruction_constant(k)
        elif operation == ca.OP_INPUT:
            work[into[0]] = arguments[out_of[0]][out_of[1]]
        elif operation == ca.OP_OUTPUT:
            results[into[1]] = work[out_of[0]]
        elif operation in one:
            work[into[0]] = one[operation](work[out_of[0]])
        elif operation in named:
            value = work[out_of[0]]
            source = np if isinstance(value, float) else hy
            work[into[0]] = getattr(source, named[operation])(value)
        else:
            work[into[0]] = BINARY[operation](*(work[place] for place in out_of))
    return [hy.expression(value) if isinstance(value, float) else value for _, value in sorted(results.items())]


BINARY: dict[int, Callable[[Any, Any], Any]] = {
    ca.OP_ADD: operator.add, ca.OP_SUB: operator.sub, ca.OP_MUL: operator.mul, ca.OP_DIV: operator.truediv,
}  # fmt: skip


def _heyoka_attitude(hy: Any, c: FloatArray) -> list[Any]:
    """Euler's equation and the quaternion's, without torque; c as in baryscope.models.target."""
    qw, qx, qy, qz, wx, wy, wz = hy.make_vars("qw", "qx", "qy", "qz", "wx", "wy", "wz")
    J, inverse = c[:9].reshape(3, 3), c[9:18].reshape(3, 3)
    w = [wx, wy, wz]
    h = [sum(J[i, j] * w[j] for j in range(3)) for i in range(3)]
    gyroscopic = [w[(i + 1) % 3] * h[(i + 2) % 3] - w[(i + 2) % 3] * h[(i + 1) % 3] for i in range(3)]
    acceleration = [-sum(inverse[i, j] * gyroscopic[j] for j in range(3)) for i in range(3)]
    return [
        (qw, 0.5 * (-qx * wx - qy * wy - qz * wz)),
        (qx, 0.5 * (qw * wx + qy * wz - qz * wy)),
        (qy, 0.5 * (qw * wy + qz * wx - qx * wz)),
        (qz, 0.5 * (qw * wz + qx * wy - qy * wx)),
        *zip(w, acceleration, strict=True),
    ]


def _heyoka_orbit(hy: Any, c: FloatArray) -> list[Any]:
    """The true anomaly and the relative motion, in the unit's form of the gravity difference."""
    theta, x, y, z, vx, vy, vz = hy.make_vars("theta", "x", "y", "z", "vx", "vy", "vz")
    semi_latus_rectum, e, k = c[27:30]
    ratio, sine = 1.0 + e * hy.cos(theta), e * hy.sin(theta)
    r, rate = semi_latus_rectum / ratio, k * ratio**2
    rate_dot, stiffness = -2.0 * k * sine * ratio * rate, k * rate * ratio
    q = (2.0 * x + (x * x + y * y + z * z) / r) / r
    s = (1.0 + q) * hy.sqrt(1.0 + q)
    f = q * (3.0 + q * (3.0 + q)) / (1.0 + s)
    return [
        (theta, rate),
        (x, vx),
        (y, vy),
        (z, vz),
        (vx, 2.0 * rate * vy + rate_dot * y + rate**2 * x + stiffness / s * (f * r - x)),
        (vy, -2.0 * rate * vx - rate_dot * x + rate**2 * y - stiffness / s * y),
        (vz, -stiffness / s * z),
    ]


def _problem(scenario: Scenario) -> tuple[Any, FloatArray, FloatArray, FloatArray]:
    """The system, its parameters, its initial state and resting inputs."""
    system, p = scenario.system, scenario.flat_parameters()
    return system, p, np.asarray(system.initial(p)).ravel(), np.zeros(6)

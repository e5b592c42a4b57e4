"""TumblingTarget: attitude and relative orbital motion as CasADi functions of flat vectors.

    x = initial(p)      ẋ = rhs(x, u, p)      y = outputs(x, p)      scales = nominals(p)

x is (q_I_B, ω_B, θ, ρ_L, ρ̇_L): 14 numbers. The first eight (attitude) and the last seven (orbit) share the
true anomaly θ and can be integrated separately; the attitude needs θ for the gravity gradient only. u, p and y hold
the inputs, parameters and outputs of the table of variables, in its order, arrays row by row. The system is
autonomous: time enters through θ alone.

What depends on p alone (the inverse of J, the orbit's plane) is computed once per run, as c = constants(p). Functions
that are called often take c.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import casadi as ca

from baryscope.models.attitude import (
    angular_acceleration,
    angular_momentum,
    gravity_gradient_torque,
    inertia_tensor,
    rotational_energy,
    symmetric_inverse,
)
from baryscope.models.checks import CheckSet, parameter_checks
from baryscope.models.frames import Symbol, quaternion_rate, rotation_from_quaternion, rotation_I_L
from baryscope.models.keplerian import Conic, Elements, Ellipse, conic
from baryscope.models.quadratic import QuadraticForm, quadratic_form
from baryscope.models.relative_motion import relative_acceleration, target_from_chaser
from baryscope.models.variables import Kind, Variable, variable_table

STATE_SIZES = (4, 3, 1, 3, 3)  # q_I_B, ω_B, θ, ρ_L, ρ̇_L
ATTITUDE_PART, ORBIT_PART = slice(0, 8), slice(7, 14)
RATE_PART = slice(4, 7)  # ω_B in the attitude's part


@dataclass(frozen=True)
class TumblingTarget:
    """The system for one number of features.

    Attributes:
        variables: the table, in the order of the flat vectors.
        initial: p → x.
        rhs: x, u, p → ẋ.
        outputs: x, p → y.
        nominals: p → nominal size of each state, to which the relative tolerance refers.
        constants: p → c.
        free_attitude_rates: (q, ω, θ), u, c → their rates without gravity gradient, with θ̇ = 0.
        free_attitude_form: the same as weighted products with ω, without the constant part of the torque.
        attitude_rates: the rates with gravity gradient, and θ̇.
        orbit_rates: (θ, ρ, ρ̇), u, c → their rates.
        run_outputs: x, p, c → y.
        run_forward: x, u, p, c, seed of (u, x) → the seed's image in (y, ẋ).
        run_reverse: x, u, p, c, seed of (y, ẋ) → its image in (u, x).
        initial_forward: u, p, seed of (u, p) → its image in (y, x, ẋ) at the start.
        initial_reverse: u, p, seed of (y, x, ẋ) → its image in (u, p).
        checks: the conditions on p.
    """

    variables: tuple[Variable, ...]
    initial: ca.Function
    rhs: ca.Function
    outputs: ca.Function
    nominals: ca.Function
    constants: ca.Function
    free_attitude_rates: ca.Function
    free_attitude_form: QuadraticForm
    attitude_rates: ca.Function
    orbit_rates: ca.Function
    run_outputs: ca.Function
    run_forward: ca.Function
    run_reverse: ca.Function
    initial_forward: ca.Function
    initial_reverse: ca.Function
    checks: CheckSet

    def of_kind(self, kind: Kind) -> list[Variable]:
        """The variables of one kind, in order."""
        return [variable for variable in self.variables if variable.kind == kind]


@cache
def tumbling_target(feature_count: int) -> TumblingTarget:
    """Build the symbolic system for a target with `feature_count` features."""
    table = variable_table(feature_count)
    inputs, u = _symbols(table, Kind.INPUT)
    parameters, p = _symbols(table, Kind.PARAMETER)
    x = ca.SX.sym("x", sum(STATE_SIZES))
    constants_of_p = ca.Function("target_constants", [p], [_pack(_constants(parameters))], ["p"], ["c"])
    c = ca.SX.sym("c", constants_of_p.numel_out())
    constants = _unpack(c, _constants(parameters))

    gravity_gradient = parameters["gravityGradient"]
    attitude = {on: _attitude_rates(x[ATTITUDE_PART], inputs, constants, on) for on in (0, 1)}
    orbit = _orbit_rates(x[ORBIT_PART], inputs, constants)
    free, turned = attitude[0][RATE_PART], attitude[1][RATE_PART]
    rates = ca.vertcat(attitude[0][:4], free + gravity_gradient * (turned - free), orbit)
    values = _output_values(ca.vertsplit(x, [0, 4, 7, 8, 11, 14]), parameters, constants)
    y = ca.vertcat(*(_flat(values[v.name]) for v in table if v.kind == Kind.OUTPUT))

    def of_parameters(expression: Symbol) -> Symbol:
        return ca.substitute(expression, c, constants_of_p(p))

    x0 = _initial_state(parameters)
    start = ca.vertcat(y, x, rates)
    start = ca.substitute(of_parameters(start), x, x0)
    run = _derivatives("target_run", [x, u, p, c], ca.vertcat(u, x), ca.vertcat(y, rates))
    beginning = _derivatives("target_initial", [u, p], ca.vertcat(u, p), start)
    return TumblingTarget(
        variables=table,
        initial=ca.Function("target_initial", [p], [x0], ["p"], ["x"]),
        rhs=ca.Function("target_rhs", [x, u, p], [of_parameters(rates)], ["x", "u", "p"], ["xdot"]),
        outputs=ca.Function("target_outputs", [x, p], [of_parameters(y)], ["x", "p"], ["y"]),
        nominals=ca.Function("target_nominals", [p], [_nominal_state(parameters)], ["p"], ["scales"]),
        constants=constants_of_p,
        free_attitude_rates=_part("target_free_attitude_rates", x[ATTITUDE_PART], u, c, attitude[0]),
        free_attitude_form=quadratic_form("target_free_attitude", attitude[0], x[ATTITUDE_PART], c, RATE_PART),
        attitude_rates=_part("target_attitude_rates", x[ATTITUDE_PART], u, c, attitude[1]),
        orbit_rates=_part("target_orbit_rates", x[ORBIT_PART], u, c, orbit),
        run_outputs=ca.Function("target_run_outputs", [x, p, c], [y], ["x", "p", "c"], ["y"]),
        run_forward=run[0],
        run_reverse=run[1],
        initial_forward=beginning[0],
        initial_reverse=beginning[1],
        checks=CheckSet.over(p, parameter_checks(parameters)),
    )


def _part(name: str, x: Symbol, u: Symbol, c: Symbol, rates: Symbol) -> ca.Function:
    return ca.Function(name, [x, u, c], [rates], ["x", "u", "c"], ["xdot"])


def _derivatives(
    name: str, arguments: list[Symbol], knowns: Symbol, unknowns: Symbol
) -> tuple[ca.Function, ca.Function]:
    """Products of the Jacobian of `unknowns` with a seed: forward J s and reverse Jᵀ s, exact, without forming J."""
    forth, back = ca.SX.sym("seed", knowns.numel()), ca.SX.sym("seed", unknowns.numel())
    return (
        ca.Function(f"{name}_forward", [*arguments, forth], [ca.densify(ca.jtimes(unknowns, knowns, forth))]),
        ca.Function(f"{name}_reverse", [*arguments, back], [ca.densify(ca.jtimes(unknowns, knowns, back, True))]),
    )


def _symbols(table: tuple[Variable, ...], kind: Kind) -> tuple[dict[str, Symbol], Symbol]:
    """The variables of one kind as symbols of their shapes, and the flat vector of all of them."""
    flat = {v.name: ca.SX.sym(v.name, v.size) for v in table if v.kind == kind}
    shaped = {
        v.name: ca.reshape(flat[v.name], *reversed(v.shape)).T if len(v.shape) == 2 else flat[v.name]
        for v in table
        if v.kind == kind
    }
    return shaped, ca.vertcat(*flat.values())


def _flat(value: Symbol) -> Symbol:
    """A scalar, vector or matrix as a column, row by row."""
    return ca.vec(value.T) if value.shape[1] > 1 else value


def _constants(parameters: Mapping[str, Symbol]) -> dict[str, Symbol]:
    """Constants of the equations that follow from the parameters, computed once per run."""
    elements = Elements.named(parameters)
    ellipse = elements.ellipse
    J = inertia_tensor(parameters)
    return {
        "inertia": J,
        "inverse_inertia": symmetric_inverse(J),
        "R_I_P": elements.R_I_P,
        "semi_latus_rectum": ellipse.semi_latus_rectum,
        "eccentricity": ellipse.eccentricity,
        "rate": ellipse.rate,
    }


def _pack(constants: Mapping[str, Symbol]) -> Symbol:
    return ca.vertcat(*(ca.vec(value) for value in constants.values()))


def _unpack(c: Symbol, like: Mapping[str, Symbol]) -> dict[str, Symbol]:
    """The entries of c in the shapes of `like`."""
    values, start = {}, 0
    for name, shape in ((name, value.shape) for name, value in like.items()):
        size = shape[0] * shape[1]
        values[name] = ca.reshape(c[start : start + size], *shape)
        start += size
    return values


def _place(true_anomaly: Symbol, constants: Mapping[str, Symbol]) -> tuple[Conic, Symbol]:
    """The target's position and rates on its orbit, and R_I_L."""
    ellipse = Ellipse(constants["semi_latus_rectum"], constants["eccentricity"], constants["rate"])
    return conic(ellipse, true_anomaly), rotation_I_L(constants["R_I_P"], true_anomaly)


def _unit(q: Symbol) -> Symbol:
    return q / ca.norm_2(q)


def _initial_state(parameters: Mapping[str, Symbol]) -> Symbol:
    return ca.vertcat(
        _unit(parameters["target.attitude0"]),
        parameters["target.angularRate0"],
        parameters["orbit.trueAnomaly0"],
        parameters["chaser.position0"],
        parameters["chaser.velocity0"],
    )


def _nominal_state(parameters: Mapping[str, Symbol]) -> Symbol:
    """Sizes of the states: a component that crosses zero is held to the tolerance of its vector."""
    n = Elements.named(parameters).mean_motion
    spin = ca.fmax(ca.norm_2(parameters["target.angularRate0"]), n)
    reach = ca.norm_2(parameters["chaser.position0"])
    speed = ca.fmax(ca.norm_2(parameters["chaser.velocity0"]), n * reach)
    return ca.vertcat(ca.SX.ones(4), ca.repmat(spin, 3), 1, ca.repmat(reach, 3), ca.repmat(speed, 3))


def _attitude_rates(
    part: Symbol, inputs: Mapping[str, Symbol], constants: Mapping[str, Symbol], gravity_gradient: int
) -> Symbol:
    q_I_B, rate_B, true_anomaly = ca.vertsplit(part, [0, 4, 7, 8])
    J, torque, anomaly_rate = constants["inertia"], inputs["target.torque"], ca.SX(0)
    if gravity_gradient:
        orbit, R_I_L = _place(true_anomaly, constants)
        up_B = rotation_from_quaternion(_unit(q_I_B)).T @ R_I_L[:, 0]
        torque += gravity_gradient_torque(J, up_B, orbit.stiffness)
        anomaly_rate = orbit.anomaly_rate
    acceleration = angular_acceleration(J, constants["inverse_inertia"], rate_B, torque)
    return ca.vertcat(quaternion_rate(q_I_B, rate_B), acceleration, anomaly_rate)


def _orbit_rates(part: Symbol, inputs: Mapping[str, Symbol], constants: Mapping[str, Symbol]) -> Symbol:
    true_anomaly, position_L, velocity_L = ca.vertsplit(part, [0, 1, 4, 7])
    orbit, _ = _place(true_anomaly, constants)
    acceleration = relative_acceleration(position_L, velocity_L, inputs["chaser.acceleration"], orbit)
    return ca.vertcat(orbit.anomaly_rate, velocity_L, acceleration)


def _output_values(
    state: Sequence[Symbol], parameters: Mapping[str, Symbol], constants: Mapping[str, Symbol]
) -> dict[str, Symbol]:
    q_I_B, rate_B, true_anomaly, position_L, velocity_L = state
    J = constants["inertia"]
    orbit, R_I_L = _place(true_anomaly, constants)
    q_I_B = _unit(q_I_B)
    R_I_B = rotation_from_quaternion(q_I_B)
    position_C, velocity_C = target_from_chaser(position_L, velocity_L, orbit, R_I_L)
    features_C = ca.repmat(position_C, 1, parameters["target.features"].shape[0]) + (
        R_I_B @ parameters["target.features"].T
    )
    return {
        "features": features_C.T,
        "normals": (R_I_B @ parameters["target.normals"].T).T,
        "target.position": position_C,
        "target.velocity": velocity_C,
        "target.attitude": q_I_B,
        "target.angularRate": rate_B,
        "chaser.position": position_L,
        "chaser.velocity": velocity_L,
        "orbit.trueAnomaly": true_anomaly,
        "target.rotationalEnergy": rotational_energy(J, rate_B),
        "target.angularMomentum": angular_momentum(J, rate_B, R_I_B),
    }

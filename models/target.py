"""TumblingTarget: attitude and relative orbital motion put together as CasADi functions of flat vectors.

    x = initial(p)      ẋ = rhs(x, u, p)      y = outputs(x, p)      scales = nominals(p)

x is (q_I_B, ω_B, ρ_L, ρ̇_L, θ): 14 numbers. u, p and y hold the inputs, parameters and outputs of the table of
variables, in its order, arrays row by row. The system is autonomous: time enters through θ alone.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import casadi as ca

from baryscope.models.attitude import (
    angular_acceleration,
    angular_momentum,
    gravity_gradient_torque,
    inertia_tensor,
    rotational_energy,
)
from baryscope.models.checks import CheckSet, parameter_checks
from baryscope.models.frames import Symbol, quaternion_rate, rotation_from_quaternion, rotation_I_L
from baryscope.models.keplerian import Conic, conic, mean_motion
from baryscope.models.relative_motion import relative_acceleration, target_from_chaser
from baryscope.models.variables import Kind, Variable, variable_table

STATE_SIZES = (4, 3, 3, 3, 1)  # q_I_B, ω_B, ρ_L, ρ̇_L, θ


@dataclass(frozen=True)
class TumblingTarget:
    """The system for one number of features.

    Attributes:
        variables: the table, in the order of the flat vectors.
        initial: p → x.
        rhs: x, u, p → ẋ.
        outputs: x, p → y.
        nominals: p → the size of each state that a relative tolerance refers to.
        checks: what makes p possible.
    """

    variables: tuple[Variable, ...]
    initial: ca.Function
    rhs: ca.Function
    outputs: ca.Function
    nominals: ca.Function
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
    state = ca.vertsplit(x, [0, 4, 7, 10, 13, 14])

    rates = _rates(state, inputs, parameters)
    values = _output_values(state, parameters)
    y = ca.vertcat(*(_flat(values[v.name]) for v in table if v.kind == Kind.OUTPUT))
    return TumblingTarget(
        variables=table,
        initial=ca.Function("target_initial", [p], [_initial_state(parameters)], ["p"], ["x"]),
        rhs=ca.Function("target_rhs", [x, u, p], [rates], ["x", "u", "p"], ["xdot"]),
        outputs=ca.Function("target_outputs", [x, p], [y], ["x", "p"], ["y"]),
        nominals=ca.Function("target_nominals", [p], [_nominal_state(parameters)], ["p"], ["scales"]),
        checks=CheckSet.over(p, parameter_checks(parameters)),
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


def _orbit_at(true_anomaly: Symbol, parameters: Mapping[str, Symbol]) -> tuple[Conic, Symbol]:
    """The target's place on its orbit, and R_I_L there."""
    orbit = conic(
        parameters["orbit.semiMajorAxis"],
        parameters["orbit.eccentricity"],
        parameters["orbit.gravitationalParameter"],
        true_anomaly,
    )
    R_I_L = rotation_I_L(
        parameters["orbit.raan"],
        parameters["orbit.inclination"],
        parameters["orbit.argumentOfPeriapsis"] + true_anomaly,
    )
    return orbit, R_I_L


def _unit(q: Symbol) -> Symbol:
    return q / ca.norm_2(q)


def _initial_state(parameters: Mapping[str, Symbol]) -> Symbol:
    return ca.vertcat(
        _unit(parameters["target.attitude0"]),
        parameters["target.angularRate0"],
        parameters["chaser.position0"],
        parameters["chaser.velocity0"],
        parameters["orbit.trueAnomaly0"],
    )


def _nominal_state(parameters: Mapping[str, Symbol]) -> Symbol:
    """Sizes of the states: a component that crosses zero is held to the tolerance of its vector."""
    n = mean_motion(parameters["orbit.semiMajorAxis"], parameters["orbit.gravitationalParameter"])
    spin = ca.fmax(ca.norm_2(parameters["target.angularRate0"]), n)
    reach = ca.norm_2(parameters["chaser.position0"])
    speed = ca.fmax(ca.norm_2(parameters["chaser.velocity0"]), n * reach)
    return ca.vertcat(ca.SX.ones(4), ca.repmat(spin, 3), ca.repmat(reach, 3), ca.repmat(speed, 3), 1)


def _rates(state: list[Symbol], inputs: Mapping[str, Symbol], parameters: Mapping[str, Symbol]) -> Symbol:
    q_I_B, rate_B, position_L, velocity_L, true_anomaly = state
    mu = parameters["orbit.gravitationalParameter"]
    J = inertia_tensor(parameters)
    orbit, R_I_L = _orbit_at(true_anomaly, parameters)

    up_B = rotation_from_quaternion(_unit(q_I_B)).T @ R_I_L[:, 0]
    tide = gravity_gradient_torque(J, orbit.radius, up_B, mu)
    torque = inputs["target.torque"] + parameters["gravityGradient"] * tide
    return ca.vertcat(
        quaternion_rate(q_I_B, rate_B),
        angular_acceleration(J, rate_B, torque),
        velocity_L,
        relative_acceleration(position_L, velocity_L, inputs["chaser.acceleration"], orbit, mu),
        orbit.anomaly_rate,
    )


def _output_values(state: list[Symbol], parameters: Mapping[str, Symbol]) -> dict[str, Symbol]:
    q_I_B, rate_B, position_L, velocity_L, true_anomaly = state
    J = inertia_tensor(parameters)
    orbit, R_I_L = _orbit_at(true_anomaly, parameters)
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

"""TumblingTarget: attitude and relative orbital motion as CasADi functions of flat vectors.

    x = initial(p)      ẋ = rhs(x, u, p)      y = outputs(x, p)      scales = nominals(p)

x is (q_I_B, ω_B, θ, ρ_L, ρ̇_L): 14 numbers. The first eight (attitude) and the last seven (orbit) share the
true anomaly θ and can be integrated separately; the attitude needs θ for the gravity gradient only. With forces besides
the gravity of a point mass, position and velocity of the target follow θ, and what is shared is the three of them, the
target's place; the chaser's motion is in inertial axes (`perturbed`). u, p and y hold the inputs, parameters and
outputs of the table of variables, in its order, arrays row by row. The system is autonomous: time enters through the
place alone.

What depends on p alone (the inverse of J, the orbit's plane) is computed once per run, as c = constants(p). Functions
that are called often take c.

The Taylor series of the attitude under torques is that of q_P_D and ω_D: from the perifocal axes P (with forces, I) to
the target's principal axes D, in which J is diagonal and the direction of gravity stays in a plane: that takes less
time. Its constants are s = series_constants(p).

C has functions of one feature, `sight`, for a loop, and all else without them: y_r is y without features and normals.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import casadi as ca

from baryscope.models import perturbed
from baryscope.models.attitude import (
    Form,
    angular_acceleration,
    angular_momentum,
    inertia_tensor,
    moments_about,
    principal_axes,
    rotational_energy,
    symmetric_inverse,
)
from baryscope.models.checks import CheckSet, checks_of, state_checks, symbols_of
from baryscope.models.frames import (
    Sight,
    Symbol,
    conjugate,
    moved,
    normalised,
    pose,
    quaternion_product,
    quaternion_rate,
    rotation_from_quaternion,
    rotation_I_L,
    sights,
)
from baryscope.models.keplerian import Conic, Elements, Ellipse, conic
from baryscope.models.quadratic import QuadraticForm, quadratic_form
from baryscope.models.relative_motion import relative_acceleration, target_from_chaser
from baryscope.models.variables import NO_FORCES, Force, Forces, Kind, Variable, variable_table

PLACE_START = 7  # after q_I_B and ω_B
RATE_PART = slice(4, 7)  # ω_B in the attitude's part


@dataclass(frozen=True)
class TumblingTarget:
    """The system for one number of features and some forces.

    Attributes:
        forces: what acts besides point-mass gravity, the gravity gradient and the inputs.
        variables: the table, in the order of the flat vectors.
        place_size: number of states that tell where the target is, shared by attitude and orbit.
        initial: p → x.
        rhs, outputs: x, u, p → ẋ; and x, p → y.
        nominals: p → nominal size of each state, to which the relative tolerance refers.
        constants: p → c.
        free_attitude_rates: (q, ω, place), u, c → their rates without torques but the input, with the place at rest.
        free_attitude_form: the same as weighted products with ω, without the constant part of the torque.
        attitude_rates: the rates with gravity gradient (with eddy currents, where it is switched on) and of the place.
        series_constants: p → s.
        to_series: (q_I_B, ω_B), u, s → (q_P_D, ω_D), torque in D.
        from_series: (q_P_D, ω_D), s → (q_I_B, ω_B).
        series_rates: (q_P_D, ω_D, place), torque in D, s, ‖q‖⁻² → their rates as in `attitude_rates`, for series over a
            step: ‖q‖ is constant.
        orbit_rates: (place, ρ, ρ̇), u, c → their rates.
        pose: x, c → z, position in C and R_I_B by columns.
        sight: z, a feature's place and normal in the body → in C; and its derivatives.
        run_outputs: x, c → y_r, z.
        run_forward: x, u, p, c, seed of (u, p, x) → its image in (y_r, ẋ) and in z, with c held: exact for tunable
            Reals, on which c does not depend.
        run_reverse: x, u, p, c, seed of (y_r, ẋ), of z → its image in (u, p, x), before and behind the features.
        initial_forward: u, p, seed of (u, p) → its image in (y_r, x, ẋ) and in z at the start.
        initial_reverse: u, p, seed of (y_r, x, ẋ), of z → its image in (u, p), before and behind the features.
        checks: the conditions on p.
        state_checks: the conditions on x.
    """

    forces: Forces
    variables: tuple[Variable, ...]
    place_size: int
    initial: ca.Function
    rhs: ca.Function
    outputs: ca.Function
    nominals: ca.Function
    constants: ca.Function
    free_attitude_rates: ca.Function
    free_attitude_form: QuadraticForm
    attitude_rates: ca.Function
    series_constants: ca.Function
    to_series: ca.Function
    from_series: ca.Function
    series_rates: ca.Function
    orbit_rates: ca.Function
    pose: ca.Function
    sight: Sight
    run_outputs: ca.Function
    run_forward: ca.Function
    run_reverse: ca.Function
    initial_forward: ca.Function
    initial_reverse: ca.Function
    checks: CheckSet
    state_checks: CheckSet

    def of_kind(self, kind: Kind) -> list[Variable]:
        """The variables of one kind, in order."""
        return [variable for variable in self.variables if variable.kind == kind]


@cache
def tumbling_target(feature_count: int, forces: Forces = NO_FORCES) -> TumblingTarget:
    """Build the symbolic system for a target with `feature_count` features under some forces."""
    table = variable_table(feature_count, forces)
    inputs, u = symbols_of(table, Kind.INPUT)
    parameters, p = symbols_of(table, Kind.PARAMETER)
    place_size = sum(perturbed.PLACE_SIZES) if forces else 1
    relative = PLACE_START + place_size
    x = ca.SX.sym("x", relative + 6)
    attitude_part, orbit_part = slice(0, relative), slice(PLACE_START, relative + 6)
    constants_of_p = ca.Function("target_constants", [p], [_pack(_constants(parameters, forces))], ["p"], ["c"])
    c = ca.SX.sym("c", constants_of_p.numel_out())
    constants = _unpack(c, _constants(parameters, forces))

    gravity_gradient = parameters["gravityGradient"]
    part = x[attitude_part]
    exact = Form.plain(rotation_from_quaternion(normalised(part[:4])))
    forms = {"free": None, "exact": exact}
    attitude = {how: _attitude_rates(part, inputs, constants, form, forces) for how, form in forms.items()}
    orbit = _orbit_rates(x[orbit_part], inputs, constants, forces)
    free, turned = attitude["free"][RATE_PART], attitude["exact"][RATE_PART]
    turning = turned if Force.EDDY_CURRENTS in forces else free + gravity_gradient * (turned - free)
    rates = ca.vertcat(attitude["free"][:4], turning, orbit)
    values = _output_values(x, parameters, constants, forces)
    every = [_flat(values[v.name]) for v in table if v.kind == Kind.OUTPUT]
    y, y_rest = ca.vertcat(*every), ca.vertcat(*every[2:])  # features and normals are the first
    z = pose(values["target.position"], rotation_from_quaternion(normalised(x[:4])))

    def of_parameters(expression: Symbol) -> Symbol:
        return ca.substitute(expression, c, constants_of_p(p))

    x0 = _initial_state(parameters, forces)
    start, start_pose = (ca.substitute(of_parameters(part), x, x0) for part in (ca.vertcat(y_rest, x, rates), z))
    features = _features_in(table, u.numel())
    run = _derivatives("target_run", [x, u, p, c], ca.vertcat(u, p, x), features, (ca.vertcat(y_rest, rates), z))
    series = _series(part, u, inputs["target.torque"], _series_constants(parameters, forces), forces)
    beginning = _derivatives("target_initial", [u, p], ca.vertcat(u, p), features, (start, start_pose))
    return TumblingTarget(
        forces=forces,
        variables=table,
        place_size=place_size,
        initial=ca.Function("target_initial", [p], [x0], ["p"], ["x"]),
        rhs=ca.Function("target_rhs", [x, u, p], [of_parameters(rates)], ["x", "u", "p"], ["xdot"]),
        outputs=ca.Function("target_outputs", [x, p], [of_parameters(y)], ["x", "p"], ["y"]),
        nominals=ca.Function("target_nominals", [p], [_nominal_state(parameters, forces)], ["p"], ["scales"]),
        constants=constants_of_p,
        free_attitude_rates=_part("target_free_attitude_rates", part, u, c, attitude["free"]),
        free_attitude_form=quadratic_form("target_free_attitude", attitude["free"], part, c, RATE_PART),
        attitude_rates=_part("target_attitude_rates", part, u, c, attitude["exact"]),
        series_constants=ca.Function(
            "target_series_constants", [p], [_pack(_series_constants(parameters, forces))], ["p"], ["s"]
        ),
        **series,
        orbit_rates=_part("target_orbit_rates", x[orbit_part], u, c, orbit),
        pose=ca.Function("target_pose", [x, c], [ca.cse(z)]),
        sight=sights("target_sight"),
        run_outputs=ca.Function("target_run_outputs", [x, c], ca.cse([y_rest, z])),
        run_forward=run[0],
        run_reverse=run[1],
        initial_forward=beginning[0],
        initial_reverse=beginning[1],
        checks=checks_of(feature_count, forces),
        state_checks=CheckSet.over(x, state_checks(x[:4], x[PLACE_START:relative]), "target_state"),
    )


def _part(name: str, x: Symbol, u: Symbol, c: Symbol, rates: Symbol) -> ca.Function:
    return ca.Function(name, [x, u, c], [ca.cse(rates)], ["x", "u", "c"], ["xdot"])


def _derivatives(
    name: str, arguments: list[Symbol], knowns: Symbol, left_out: slice, unknowns: Sequence[Symbol]
) -> tuple[ca.Function, ca.Function]:
    """Products of the Jacobian of `unknowns` with a seed: forward J s and reverse Jᵀ s, exact, without forming J.

    A range of the knowns is left out: of the forward seed it is ignored, and the reverse image has two parts.
    """
    before, behind = range(left_out.start), range(left_out.stop, knowns.numel())
    forth, back = ca.SX.sym("seed", knowns.numel()), [ca.SX.sym("seed", part.numel()) for part in unknowns]
    places = [*before, *behind]
    images = [ca.jtimes(part, knowns[places], forth[places]) for part in unknowns]
    image = ca.jtimes(ca.vertcat(*unknowns), knowns[places], ca.vertcat(*back), True)
    parts = ca.vertsplit(ca.densify(image), [0, len(before), len(places)])
    return (
        ca.Function(f"{name}_forward", [*arguments, forth], ca.cse([ca.densify(part) for part in images])),
        ca.Function(f"{name}_reverse", [*arguments, *back], ca.cse(parts)),
    )


def _features_in(table: tuple[Variable, ...], inputs: int) -> slice:
    """Where features and normals stand in (u, p), one behind the other."""
    own = [variable for variable in table if variable.kind == Kind.PARAMETER]
    first = [variable.name for variable in own].index("target.features")
    start = inputs + sum(variable.size for variable in own[:first])
    return slice(start, start + 2 * own[first].size)


def _flat(value: Symbol) -> Symbol:
    """A scalar, vector or matrix as a column, row by row."""
    return ca.vec(value.T) if value.shape[1] > 1 else value


def _constants(parameters: Mapping[str, Symbol], forces: Forces) -> dict[str, Symbol]:
    """Constants of the equations that follow from the parameters, computed once per run."""
    elements = Elements.named(parameters)
    ellipse = elements.ellipse
    J = inertia_tensor(parameters)
    body = {"inertia": J, "inverse_inertia": symmetric_inverse(J)}
    if forces:
        body |= perturbed.constants_of(parameters, forces)
        return body | ({"gravity_gradient": parameters["gravityGradient"]} if Force.EDDY_CURRENTS in forces else {})
    return body | {
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


def _series_constants(parameters: Mapping[str, Symbol], forces: Forces) -> dict[str, Symbol]:
    """The constants in the axes of the series, with diagonals of J and its inverse; q_I_B = turn q_P_D; and R_B_D."""
    constants = _constants(parameters, forces)
    q_B_D = principal_axes(constants["inertia"])
    R_B_D = rotation_from_quaternion(q_B_D)
    moments = moments_about(constants["inertia"], R_B_D)
    turned = {"inertia": moments, "inverse_inertia": 1 / moments}
    if "magnetic_tensor" in constants:
        turned["magnetic_tensor"] = R_B_D.T @ constants["magnetic_tensor"] @ R_B_D
    q_I_P = ca.SX([1, 0, 0, 0]) if forces else Elements.named(parameters).q_I_P
    units = ca.horzsplit(ca.densify(ca.SX.eye(4)))
    turn = ca.horzcat(*(quaternion_product(quaternion_product(q_I_P, q), conjugate(q_B_D)) for q in units))
    constants.pop("R_I_P", None)
    return constants | turned | {"turn": turn, "R_B_D": R_B_D}


def _series(
    part: Symbol, u: Symbol, torque_B: Symbol, like: Mapping[str, Symbol], forces: Forces
) -> dict[str, ca.Function]:
    """The functions of the attitude's series."""
    s = ca.SX.sym("s", _pack(like).numel())
    constants = _unpack(s, like)
    turn, R_B_D = constants["turn"], constants["R_B_D"]
    state, torque, shrinking = part[:PLACE_START], ca.SX.sym("torque", 3), ca.SX.sym("shrinking")
    q, rate = state[:4], state[RATE_PART]
    axes = {name: ca.diag(constants[name]) for name in ("inertia", "inverse_inertia")} | {"R_I_P": ca.SX.eye(3)}
    form = Form.of_products(rotation_from_quaternion(q), shrinking)
    rates = _attitude_rates(part, {"target.torque": torque}, constants | axes, form, forces)
    to_D, to_B = (ca.vertcat(A @ q, R @ rate) for A, R in ((turn.T, R_B_D.T), (turn, R_B_D)))
    return {
        "to_series": ca.Function("target_to_series", [state, u, s], [to_D, R_B_D.T @ torque_B]),
        "from_series": ca.Function("target_from_series", [state, s], [to_B]),
        "series_rates": ca.Function("target_series_rates", [part, torque, s, shrinking], [ca.cse(rates)]),
    }


def _place(true_anomaly: Symbol, constants: Mapping[str, Symbol]) -> tuple[Conic, Symbol]:
    """The target's position and rates on its orbit, and R_I_L."""
    ellipse = Ellipse(constants["semi_latus_rectum"], constants["eccentricity"], constants["rate"])
    return conic(ellipse, true_anomaly), rotation_I_L(constants["R_I_P"], true_anomaly)


def _initial_state(parameters: Mapping[str, Symbol], forces: Forces) -> Symbol:
    attitude = ca.vertcat(normalised(parameters["target.attitude0"]), parameters["target.angularRate0"])
    if forces:
        return ca.vertcat(attitude, perturbed.initial_motion(parameters, forces))
    return ca.vertcat(
        attitude,
        parameters["orbit.trueAnomaly0"],
        parameters["chaser.position0"],
        parameters["chaser.velocity0"],
    )


def _nominal_state(parameters: Mapping[str, Symbol], forces: Forces) -> Symbol:
    """Sizes of the states: a component that crosses zero is held to the tolerance of its vector."""
    n = Elements.named(parameters).mean_motion
    spin = ca.fmax(ca.norm_2(parameters["target.angularRate0"]), n)
    reach = ca.norm_2(parameters["chaser.position0"])
    speed = ca.fmax(ca.norm_2(parameters["chaser.velocity0"]), n * reach)
    place = perturbed.nominal_place(parameters) if forces else 1
    return ca.vertcat(ca.SX.ones(4), ca.repmat(spin, 3), place, ca.repmat(reach, 3), ca.repmat(speed, 3))


def _attitude_rates(
    part: Symbol,
    inputs: Mapping[str, Symbol],
    constants: Mapping[str, Symbol],
    form: Form | None,
    forces: Forces,
) -> Symbol:
    """Rates of (q, ω, place); without a form, only the torque input acts and the place rests."""
    q_I_B, rate_B, place = ca.vertsplit(part, [0, 4, PLACE_START, part.numel()])
    J, torque, place_rates = constants["inertia"], inputs["target.torque"], ca.SX.zeros(place.numel())
    turned = None
    if form is not None:
        turned = form.turned
        if forces:
            torque += perturbed.torque(place, form, rate_B, constants, forces)
            place_rates = perturbed.place_rates(place, constants, forces)
        else:
            orbit, R_I_L = _place(place, constants)
            torque += form.gradient(J, R_I_L[:, 0], orbit.stiffness)
            place_rates = orbit.anomaly_rate
    acceleration = angular_acceleration(J, constants["inverse_inertia"], rate_B, torque, turned)
    return ca.vertcat(quaternion_rate(q_I_B, rate_B), acceleration, place_rates)


def _orbit_rates(part: Symbol, inputs: Mapping[str, Symbol], constants: Mapping[str, Symbol], forces: Forces) -> Symbol:
    if forces:
        return perturbed.motion_rates(part, inputs["chaser.acceleration"], constants, forces)
    true_anomaly, position_L, velocity_L = ca.vertsplit(part, [0, 1, 4, 7])
    orbit, _ = _place(true_anomaly, constants)
    acceleration = relative_acceleration(position_L, velocity_L, inputs["chaser.acceleration"], orbit)
    return ca.vertcat(orbit.anomaly_rate, velocity_L, acceleration)


def _output_values(
    x: Symbol, parameters: Mapping[str, Symbol], constants: Mapping[str, Symbol], forces: Forces
) -> dict[str, Symbol]:
    q_I_B, rate_B, part = ca.vertsplit(x, [0, 4, PLACE_START, x.numel()])
    J = constants["inertia"]
    q_I_B = normalised(q_I_B)
    R_I_B = rotation_from_quaternion(q_I_B)
    motion = perturbed.outputs(part, constants, forces) if forces else _motion_outputs(part, constants)
    features, normals = (parameters[f"target.{name}"] for name in ("features", "normals"))
    features_C, normals_C = moved(motion["target.position"], R_I_B, features, normals)
    return motion | {
        "features": features_C,
        "normals": normals_C,
        "target.attitude": q_I_B,
        "target.angularRate": rate_B,
        "target.rotationalEnergy": rotational_energy(J, rate_B),
        "target.angularMomentum": angular_momentum(J, rate_B, R_I_B),
    }


def _motion_outputs(part: Symbol, constants: Mapping[str, Symbol]) -> dict[str, Symbol]:
    """Outputs that follow from (θ, ρ, ρ̇)."""
    true_anomaly, position_L, velocity_L = ca.vertsplit(part, [0, 1, 4, 7])
    orbit, R_I_L = _place(true_anomaly, constants)
    position_C, velocity_C = target_from_chaser(position_L, velocity_L, orbit, R_I_L)
    return {
        "target.position": position_C,
        "target.velocity": velocity_C,
        "chaser.position": position_L,
        "chaser.velocity": velocity_L,
        "orbit.trueAnomaly": true_anomaly,
    }

"""Orbit and relative motion under forces that a Kepler orbit does not hold, in inertial axes.

The target's place is (θ, r, v): the angle gone around the centre, and position and velocity from the centre. The
chaser's position and velocity from the target's, (ρ, ρ̇), are in inertial axes, too; its outputs are in the LVLH frame
of the target as it flies, which turns with the plane of the orbit.
"""

from collections.abc import Mapping

import casadi as ca

from baryscope.models.attitude import Form, symmetric_tensor
from baryscope.models.differences import Pair
from baryscope.models.forces import (
    Atmosphere,
    Sunlight,
    dipole_field,
    drag,
    eddy_current_torque,
    light_pressure,
    point_mass_gravity,
    zonal_gravity,
    zonal_strength,
)
from baryscope.models.frames import Symbol, normalised
from baryscope.models.keplerian import Elements, at_anomaly
from baryscope.models.variables import Force, Forces

Values = Mapping[str, Symbol]
PLACE_SIZES = (1, 3, 3)  # θ, r, v


def constants_of(parameters: Values, forces: Forces) -> dict[str, Symbol]:
    """What the equations need of the parameters."""
    constants = {"mu": parameters["orbit.gravitationalParameter"]}
    if Force.J2 in forces:
        j2, radius = parameters["orbit.j2"], parameters["orbit.equatorialRadius"]
        constants["zonal"] = zonal_strength(constants["mu"], j2, radius)
    if Force.LIGHT in forces:
        constants["sun"] = normalised(parameters["sun.direction"])
    if Force.EDDY_CURRENTS in forces:
        constants["magnetic_tensor"] = symmetric_tensor(parameters, "target.magneticTensor")
    copied = [
        "atmosphere.density", "atmosphere.referenceRadius", "atmosphere.scaleHeight", "atmosphere.rotationRate",
        "target.drag", "chaser.drag", "sun.pressure", "sun.shadowRadius", "target.light", "chaser.light",
        "magneticField.dipole",
    ]  # fmt: skip
    return constants | {name: parameters[name] for name in copied if name in parameters}


def accelerations(position: Pair, velocity: Pair, constants: Values, forces: Forces) -> Pair:
    """Accelerations of target (base) and chaser (with the excess) without thrust, in I, m/s²."""
    total = point_mass_gravity(position, constants["mu"])
    if Force.J2 in forces:
        total = total + zonal_gravity(position, constants["zonal"])
    if Force.DRAG in forces:
        names = ("density", "referenceRadius", "scaleHeight", "rotationRate")
        air = Atmosphere(*(constants[f"atmosphere.{name}"] for name in names))
        slowed = drag(position.base, velocity.base, air, constants["target.drag"])
        total = total + Pair(slowed, drag(position.other, velocity.other, air, constants["chaser.drag"]) - slowed)
    if Force.LIGHT in forces:
        light = Sunlight(constants["sun"], constants["sun.pressure"], constants["sun.shadowRadius"])
        pushed = light_pressure(position.base, light, constants["target.light"])
        total = total + Pair(pushed, light_pressure(position.other, light, constants["chaser.light"]) - pushed)
    return total


def place_rates(place: Symbol, constants: Values, forces: Forces) -> Symbol:
    """Rates of (θ, r, v)."""
    _, r, v = ca.vertsplit(place, [0, 1, 4, 7])
    nothing = ca.SX.zeros(3)
    force = accelerations(Pair(r, nothing), Pair(v, nothing), constants, forces).base
    return ca.vertcat(_turning(r, v), v, force)


def motion_rates(part: Symbol, acceleration_L: Symbol, constants: Values, forces: Forces) -> Symbol:
    """Rates of (θ, r, v, ρ, ρ̇) under the chaser's commanded acceleration in L."""
    _, r, v, offset, drift = ca.vertsplit(part, [0, 1, 4, 7, 10, 13])
    force = accelerations(Pair(r, offset), Pair(v, drift), constants, forces)
    R_I_L = lvlh_axes(r, v)
    return ca.vertcat(_turning(r, v), v, force.base, drift, force.excess + R_I_L @ acceleration_L)


def lvlh_axes(r: Symbol, v: Symbol) -> Symbol:
    """R_I_L at a position and velocity from the centre."""
    up, normal = normalised(r), normalised(ca.cross(r, v))
    return ca.horzcat(up, ca.cross(normal, up), normal)


def lvlh_rate(r: Symbol, v: Symbol, acceleration_I: Symbol) -> Symbol:
    """The angular rate of L, in L: (r/h) a_z about x, by which the plane turns, and h/r² about z, rad/s."""
    h, radius = ca.norm_2(ca.cross(r, v)), ca.norm_2(r)
    return ca.vertcat(radius / h * ca.dot(lvlh_axes(r, v)[:, 2], acceleration_I), 0, h / radius**2)


def initial_motion(parameters: Values, forces: Forces) -> Symbol:
    """(θ, r, v, ρ, ρ̇) at the start: the Kepler orbit of the elements osculates there."""
    elements, constants = Elements.named(parameters), constants_of(parameters, forces)
    theta = elements.true_anomaly
    r, v = ca.vertsplit(at_anomaly(theta, elements), 3)
    R_I_L, spin = lvlh_axes(r, v), _spin(r, v, constants, forces)
    position_L, velocity_L = parameters["chaser.position0"], parameters["chaser.velocity0"]
    return ca.vertcat(theta, r, v, R_I_L @ position_L, R_I_L @ (velocity_L + ca.cross(spin, position_L)))


def nominal_place(parameters: Values) -> Symbol:
    """Sizes of θ, r and v."""
    elements = Elements.named(parameters)
    a = elements.semi_major_axis
    return ca.vertcat(1, ca.repmat(a, 3), ca.repmat(elements.mean_motion * a, 3))


def outputs(part: Symbol, constants: Values, forces: Forces) -> dict[str, Symbol]:
    """Outputs that follow from (θ, r, v, ρ, ρ̇); the chaser's are in the LVLH frame of the target as it flies."""
    theta, r, v, offset, drift = ca.vertsplit(part, [0, 1, 4, 7, 10, 13])
    R_L_I, spin = lvlh_axes(r, v).T, _spin(r, v, constants, forces)
    position_L = R_L_I @ offset
    return {
        "target.position": -offset,
        "target.velocity": -drift,
        "chaser.position": position_L,
        "chaser.velocity": R_L_I @ drift - ca.cross(spin, position_L),
        "orbit.trueAnomaly": theta,
        "orbit.position": r,
        "orbit.velocity": v,
    }


def torque(place: Symbol, form: Form, angular_rate_B: Symbol, constants: Values, forces: Forces) -> Symbol:
    """The torque that depends on the place, N m in B: by the gravity gradient and eddy currents.

    Without eddy currents, the gravity gradient is on wherever this is asked for; with them, where its switch says so.
    """
    _, r, v = ca.vertsplit(place, [0, 1, 4, 7])
    radius = ca.norm_2(r)
    gradient = form.gradient(constants["inertia"], r / radius, constants["mu"] / radius**3)
    if Force.EDDY_CURRENTS not in forces:
        return gradient
    field = dipole_field(r, constants["magneticField.dipole"])
    field_rate = ca.jtimes(field, r, v)
    eddy = eddy_current_torque(
        constants["magnetic_tensor"], angular_rate_B, form.to_body(field), form.to_body(field_rate)
    )
    return eddy + constants["gravity_gradient"] * gradient


def _turning(r: Symbol, v: Symbol) -> Symbol:
    """θ̇ = h/r², rad/s."""
    return ca.norm_2(ca.cross(r, v)) / ca.dot(r, r)


def _spin(r: Symbol, v: Symbol, constants: Values, forces: Forces) -> Symbol:
    nothing = ca.SX.zeros(3)
    return lvlh_rate(r, v, accelerations(Pair(r, nothing), Pair(v, nothing), constants, forces).base)

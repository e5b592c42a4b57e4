"""Conditions on the parameters of the unit, and on states that are set, as CasADi expressions.

Scenario files and the FMU refuse the same values because both evaluate these conditions: the reader of files through
`casadi.Function`, the unit through C code generated from them.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Self

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from baryscope.models.attitude import inertia_tensor, moments_about, principal_axes, symmetric_tensor
from baryscope.models.frames import Symbol, rotation_from_quaternion
from baryscope.models.keplerian import Elements
from baryscope.models.variables import NO_FORCES, TOLERANCES, Forces, Kind, Variable, variable_table

SINGULAR = 1e-14  # of the trace of J: a smaller moment is rounding
TRIANGLE_TOLERANCE = 1e-9  # of the trace of J: a flat plate has I₁ + I₂ = I₃ exactly
COLLINEAR_TOLERANCE = 1e-8  # of the squared trace of the features' scatter
TINY = 1e-300  # keeps the number in a message from a division by zero
DIRECTED = 1e-50  # a quaternion's length from this to its inverse: powers of it neither vanish nor overflow
UNIT_TOLERANCE = 1e-3  # of a quaternion's or normal's length: enough for four printed digits


@dataclass(frozen=True)
class Check:
    """One condition on the parameters or the states.

    Attributes:
        variable: the unit's variable it concerns.
        field: the scenario file's field it concerns; of a state, its name.
        expected: the condition in words, for a message.
        quantity: name of the number that the message shows.
        found: that number.
        margin: positive if and only if the condition holds.
    """

    variable: str
    field: str
    expected: str
    quantity: str
    found: Symbol
    margin: Symbol


@dataclass(frozen=True)
class CheckSet:
    """Checks compiled over one flat vector of parameters or states.

    Attributes:
        checks: the conditions, in the order of reporting.
        margins: vector → margin of each check.
        found: vector → the number that the message of each check shows.
    """

    checks: tuple[Check, ...]
    margins: ca.Function
    found: ca.Function

    @classmethod
    def over(cls, vector: Symbol, checks: tuple[Check, ...], name: str = "target") -> Self:
        """Compile `checks`, which are expressions of the column `vector`; the functions' names begin with `name`."""
        margins = ca.vertcat(*(check.margin for check in checks))
        found = ca.vertcat(*(check.found for check in checks))
        return cls(
            checks,
            ca.Function(f"{name}_margins", [vector], [margins]),
            ca.Function(f"{name}_found", [vector], [found]),
        )

    def failure(self, vector: NDArray[np.float64]) -> str | None:
        """The first check that fails, as `field: found …, expected …`; None when all hold."""
        margins = np.array(self.margins(vector)).ravel()
        if np.all(margins > 0):
            return None
        index = int(np.argmin(margins > 0))
        check, value = self.checks[index], np.array(self.found(vector)).ravel()[index]
        return f"{check.field}: found {check.quantity} {value:g}, expected {check.expected}"


def symbols_of(table: tuple[Variable, ...], kind: Kind) -> tuple[dict[str, Symbol], Symbol]:
    """The variables of one kind as symbols of their shapes, and the flat vector of all of them."""
    flat = {v.name: ca.SX.sym(v.name, v.size) for v in table if v.kind == kind}
    shaped = {
        v.name: ca.reshape(flat[v.name], *reversed(v.shape)).T if len(v.shape) == 2 else flat[v.name]
        for v in table
        if v.kind == kind
    }
    return shaped, ca.vertcat(*flat.values())


@cache
def checks_of(feature_count: int, forces: Forces = NO_FORCES) -> CheckSet:
    """The conditions on p of a target with `feature_count` features under some forces, made without its equations."""
    parameters, p = symbols_of(variable_table(feature_count, forces), Kind.PARAMETER)
    return CheckSet.over(p, parameter_checks(parameters))


def parameter_checks(parameters: Mapping[str, Symbol]) -> tuple[Check, ...]:
    """All conditions on the parameters, in the order of reporting."""
    return (
        *_inertia_checks(parameters),
        *_feature_checks(parameters),
        *orbit_checks(Elements.named(parameters)),
        *_other_checks(parameters),
        *force_checks(parameters),
    )


def _inertia_checks(parameters: Mapping[str, Symbol]) -> tuple[Check, ...]:
    """J is positive definite and no principal moment exceeds the sum of the others.

    The second condition means that ½ tr(J) 1 − J, the second moments of mass, has no negative eigenvalue.
    """
    J = inertia_tensor(parameters)
    trace, (smallest, largest) = ca.trace(J), _extreme_eigenvalues(J)
    return (
        Check(
            "target.inertia",
            "target.inertia",
            "a positive definite tensor (all principal moments above 0 kg m²)",
            "smallest principal moment",
            smallest,
            smallest - SINGULAR * trace,
        ),
        Check(
            "target.inertia",
            "target.inertia",
            "no principal moment larger than the sum of the other two (triangle inequality)",
            "largest principal moment over the sum of the others",
            largest / (trace - largest),
            (1 / 2 + TRIANGLE_TOLERANCE) * trace - largest,
        ),
    )


def _feature_checks(parameters: Mapping[str, Symbol]) -> tuple[Check, ...]:
    features, normals = parameters["target.features"], parameters["target.normals"]
    count = features.shape[0]
    centred = features - ca.repmat(ca.sum1(features) / count, count, 1)
    scatter = centred.T @ centred
    trace = ca.trace(scatter)
    minors = (trace**2 - ca.trace(scatter @ scatter)) / 2  # sum of the principal ones of 2 × 2
    worst = ca.mmax(ca.fabs(ca.sqrt(ca.sum2(normals**2)) - 1))
    return (
        Check(
            "target.features",
            "features.points",
            "at least three features that do not lie on one line",
            "rms distance from a line through them in m",
            ca.sqrt(ca.fmax(minors, 0) / ca.fmax(trace, TINY) / count),
            minors - COLLINEAR_TOLERANCE * trace**2,
        ),
        Check(
            "target.normals",
            "features.points",
            "normals of length 1",
            "largest deviation of a length from 1",
            worst,
            UNIT_TOLERANCE - worst,
        ),
    )


def orbit_checks(elements: Elements) -> tuple[Check, ...]:
    """The conditions on the orbit alone."""
    a, e, mu = elements.semi_major_axis, elements.eccentricity, elements.gravitational_parameter
    return (
        Check("orbit.semiMajorAxis", "orbit.semi_major_axis", "a length above 0 m", "value", a, a),
        Check(
            "orbit.eccentricity",
            "orbit.eccentricity",
            "0 ≤ e < 1",
            "value",
            e,
            # e = 0 is allowed, so the margin there must still be positive.
            ca.if_else(ca.logic_and(e >= 0, e < 1), 1, -1),
        ),
        Check(
            "orbit.gravitationalParameter",
            "orbit.gravitational_parameter",
            "a value above 0 m³/s²",
            "value",
            mu,
            mu,
        ),
    )


def _other_checks(parameters: Mapping[str, Symbol]) -> tuple[Check, ...]:
    length = ca.norm_2(parameters["target.attitude0"])
    reach = ca.norm_2(parameters["chaser.position0"])
    tolerance, (smallest, largest) = parameters["solver.tolerance"], TOLERANCES
    return (
        Check(
            "target.attitude0",
            "target.attitude",
            "a unit quaternion (w, x, y, z)",
            "length",
            length,
            UNIT_TOLERANCE - ca.fabs(length - 1),
        ),
        Check(
            "chaser.position0",
            "chaser.position",
            "a chaser away from the target's centre of mass",
            "range in m",
            reach,
            reach,
        ),
        Check(
            "solver.tolerance",
            "run.tolerance",
            f"a value between {smallest:g} and {largest:g}",
            "value",
            tolerance,
            ca.fmin(tolerance - 0.999 * smallest, 1.001 * largest - tolerance),
        ),
    )


def force_checks(parameters: Mapping[str, Symbol]) -> tuple[Check, ...]:
    """The conditions on the parameters of those forces that the unit has."""
    above_zero = {
        "orbit.equatorialRadius": ("orbit.equatorial_radius", "m"),
        "atmosphere.referenceRadius": ("drag.reference_radius", "m"),
        "atmosphere.scaleHeight": ("drag.scale_height", "m"),
        "sun.shadowRadius": ("light.shadow_radius", "m"),
    }
    found = [
        Check(name, field, f"a value above 0 {unit}", "value", parameters[name], parameters[name])
        for name, (field, unit) in above_zero.items()
        if name in parameters
    ]
    if "sun.direction" in parameters:
        length = ca.norm_2(parameters["sun.direction"])
        margin = UNIT_TOLERANCE - ca.fabs(length - 1)
        found.append(Check("sun.direction", "light.sun", "a unit vector", "length", length, margin))
    if "target.magneticTensor.xx" in parameters:
        M = symmetric_tensor(parameters, "target.magneticTensor")
        smallest, largest = _extreme_eigenvalues(M)
        found.append(
            Check(
                "target.magneticTensor",
                "eddy_currents.tensor",
                "no eigenvalue below 0 S m⁴, so that the currents take energy",
                "smallest eigenvalue",
                smallest,
                smallest + TRIANGLE_TOLERANCE * largest + TINY,
            )
        )
    return tuple(found)


def state_checks(attitude: Symbol, place: Symbol) -> tuple[Check, ...]:
    """The conditions on states without which the equations have no value.

    Args:
        attitude: the quaternion.
        place: the true anomaly; with forces also position and velocity of the target from the central body.
    """

    def check(name: str, expected: str, quantity: str, found: Symbol, margin: Symbol) -> Check:
        return Check(name, name, expected, quantity, found, margin)

    length = ca.norm_2(attitude)
    expected = f"a quaternion with a direction (length between {DIRECTED:g} and {1 / DIRECTED:g})"
    turning = check("state.attitude", expected, "length", length, ca.fmin(length - DIRECTED, 1 / DIRECTED - length))
    if place.numel() == 1:
        return (turning,)
    _, position, velocity = ca.vertsplit(place, [0, 1, 4, 7])
    distance, swept = ca.norm_2(position), ca.norm_2(ca.cross(position, velocity))
    return (
        turning,
        check("state.orbitPosition", "a place away from the centre", "distance in m", distance, distance),
        check("state.orbitVelocity", "a velocity that is not along the position", "area rate in m²/s", swept, swept),
    )


def _extreme_eigenvalues(matrix: Symbol) -> tuple[Symbol, Symbol]:
    """Smallest and largest eigenvalue of a symmetric matrix (3, 3), good to rounding of the largest."""
    values = moments_about(matrix, rotation_from_quaternion(principal_axes(matrix)))
    return ca.mmin(values), ca.mmax(values)

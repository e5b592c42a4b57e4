"""CentreOfMassEstimator: its table of variables, and what turns a rig's measurements into the chaser's axes.

The filter itself is C (fmu/csrc/online). It works in C: origin at the chaser's CoM, inertial axes. A rig measures in V,
the camera's axes, of which it tells the attitude; commands are in LVLH.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from math import inf

import casadi as ca

from baryscope.models.attitude import from_upper_elements, upper_elements
from baryscope.models.checks import Check, CheckSet, force_checks, orbit_checks, symbols_of
from baryscope.models.frames import Symbol, normalised, quaternion_from_rotation, rotation_from_quaternion, rotation_I_L
from baryscope.models.keplerian import PARAMETERS, Elements, true_anomaly_after
from baryscope.models.variables import (
    AXES,
    CAMERA,
    FORCE_PARAMETERS,
    LVLH,
    NOT_NEGATIVE,
    THRUSTERS,
    UPPER,
    Force,
    Kind,
    Variable,
    variable_table,
)

STATUSES = ("waiting", "starting", "tracking", "doubtful", "lost")
"""The values of `status`, from 0; those of the online estimator."""
POSITIVE = (1e-12, inf)
FARTHEST_AHEAD = 1e6  # s; farther on numbers overflow


@dataclass(frozen=True)
class NavigationSystem:
    """The estimator's surroundings for one number of features.

    Attributes:
        variables: the table.
        point: q_C_V, lever arm, point in V, upper triangle of its covariance → both in C.
        attitude: R (9,), row by row → its quaternion.
        push: time since the start, elements, acceleration in L → in C.
        checks: the conditions on the parameters.
    """

    variables: tuple[Variable, ...]
    point: ca.Function
    attitude: ca.Function
    push: ca.Function
    checks: CheckSet


@cache
def navigation_system(feature_count: int) -> NavigationSystem:
    """Build the symbolic system for a target with `feature_count` features."""
    table = navigation_table(feature_count)
    given, p = symbols_of(table, Kind.PARAMETER)
    return NavigationSystem(
        variables=table,
        point=_point(),
        attitude=_attitude(),
        push=_push(),
        checks=CheckSet.over(p, _checks(given), "unit"),
    )


def _point() -> ca.Function:
    q, arm, point, upper = (ca.SX.sym(name, size) for name, size in (("q", 4), ("arm", 3), ("p", 3), ("P", 6)))
    R_C_V = rotation_from_quaternion(normalised(q))
    turned = R_C_V @ from_upper_elements(upper) @ R_C_V.T
    found = [R_C_V @ (point + arm), upper_elements(turned)]
    return ca.Function("unit_point", [q, arm, point, upper], found, {"cse": True})


def _attitude() -> ca.Function:
    rows = ca.SX.sym("R", 9)
    return ca.Function("unit_attitude", [rows], [quaternion_from_rotation(ca.reshape(rows, 3, 3).T)], {"cse": True})


def _push() -> ca.Function:
    time, acceleration, (column, elements) = ca.SX.sym("time"), ca.SX.sym("a", 3), Elements.symbols()
    R_I_L = rotation_I_L(elements.R_I_P, true_anomaly_after(time, elements))
    return ca.Function("unit_push", [time, column, acceleration], [R_I_L @ acceleration], {"cse": True})


def navigation_table(feature_count: int) -> tuple[Variable, ...]:
    """The variables of CentreOfMassEstimator for so many features."""
    n = feature_count
    IN, PAR, OUT = Kind.INPUT, Kind.PARAMETER, Kind.OUTPUT
    orbit, unknown = {variable.name: variable for variable in variable_table(3)}, "; 0 until the tumble is known"

    def shown(name: str, unit: str, what: str, shape: tuple[int, ...] = (), **more: object) -> Variable:
        return Variable(name, OUT, unit, what, shape, discrete=True, **more)  # type: ignore[arg-type]

    return (
        Variable("points", IN, "m", "Measured points, camera axes", (n, 3), axes=CAMERA),
        Variable("covariances", IN, "m2", "Covariances of the points, all 0: of filter.sigma", (n, 6), axes=UPPER),
        Variable("seen", IN, "1", "Whether the feature is seen", (n,), boolean=True, per_feature=True, discrete=True),
        Variable("camera.attitude", IN, "1", "Attitude quaternion (w, x, y, z), camera to inertial, as measured", (4,)),
        Variable("sample.time", IN, "s", "Time of the sample that the inputs are of"),
        Variable("sample.number", IN, "1", "Number of samples so far; a sample is taken where this is another"),
        Variable("chaser.acceleration", IN, "m/s2", "Commanded acceleration of the chaser, LVLH axes", (3,), axes=LVLH),
        Variable("camera.leverArm", PAR, "m", "Camera from the chaser's CoM, camera axes", (3,), axes=CAMERA),
        Variable(
            "camera.attitudeNoise", PAR, "rad", "Standard deviation of the measured attitude, each axis",
            limits=(0.0, 1.0),
        ),
        Variable("filter.sigma", PAR, "m", "Standard deviation of a coordinate without a covariance", limits=POSITIVE),
        Variable(
            "filter.offset", PAR, "1", "Standard deviation of the CoM from the features' centroid at first, in radii",
            limits=POSITIVE,
        ),
        Variable("filter.speed", PAR, "m/s", "Standard deviation of the CoM's velocity at first", limits=POSITIVE),
        Variable(
            "filter.thrust", PAR, "1",
            "Standard deviation of what the chaser's thrusters are wrong by: scale, and rad about each axis; 0: exact",
            limits=(0.0, 1.0),
        ),
        Variable("onOrbit", PAR, "1", "Whether the target moves on the orbit below, else freely", boolean=True),
        *(orbit[name] for name in PARAMETERS),
        *FORCE_PARAMETERS[Force.J2],
        Variable(
            "prediction.horizon", PAR, "s", "How far ahead predicted.position is, without thrust", tunable=True,
            limits=(0.0, FARTHEST_AHEAD),
        ),
        shown("target.position", "m", "The target's CoM, frame C (chaser, inertial axes)", (3,)),
        shown("target.velocity", "m/s", "Velocity of the target's CoM, frame C", (3,)),
        shown("target.positionCovariance", "m2", "Covariance of target.position", (6,), axes=UPPER),
        shown("target.velocityCovariance", "m2/s2", "Covariance of target.velocity", (6,), axes=UPPER),
        shown(
            "target.attitude", "1",
            "Attitude quaternion (w, x, y, z), body to inertial; of the last sample until the tumble is known", (4,),
        ),
        shown("target.attitudeCovariance", "rad2", "Covariance of its rotation vector in C", (6,), axes=UPPER),
        shown("target.angularRate", "rad/s", f"Angular rate, body axes{unknown}", (3,)),
        shown("target.angularRateCovariance", "rad2/s2", "Covariance of target.angularRate", (6,), axes=UPPER),
        shown("target.inertia", "1", f"Inertia over its trace, body axes{unknown}", (6,), axes=AXES),
        shown("tumble.known", "1", "Whether the target tumbles freely, and how is known", boolean=True),
        shown("navigation.valid", "1", "Whether the filter tracks the target: status is 2", boolean=True),
        shown(
            "status", "1", ", ".join(f"{k}: {word}" for k, word in enumerate(STATUSES)),
            limits=(0.0, len(STATUSES) - 1.0),
        ),
        shown("sight.position", "m", "Where the last sample saw features, in the mean, frame C; 0: none", (3,)),
        shown("sight.time", "s", "sample.time of the last sample that was taken"),
        shown("sight.residuals", "m", "How far its points are off the map, frame C; 0 where not known", (n, 3)),
        shown("sight.fits", "1", "Whether its point fits the map", (n,), boolean=True, per_feature=True),
        shown("sight.rejected", "1", "Whether its point does not fit the map", (n,), boolean=True, per_feature=True),
        shown("samples", "1", "Number of samples that were taken", limits=NOT_NEGATIVE),
        shown("processNoise", "m2/s3", "Estimated density of white acceleration", limits=NOT_NEGATIVE),
        shown("noiseRatio", "1", "Mean square of the residuals over the expected one", limits=NOT_NEGATIVE),
        shown("noiseLasting", "1", "How many samples have the same errors of the features", limits=NOT_NEGATIVE),
        shown(
            "thrust.error", "1", "What the thrusters are wrong by, a scale and rad about each camera axis", (4,),
            axes=THRUSTERS,
        ),
        shown(
            "thrust.deviation", "1", "Standard deviations of thrust.error; 0 before thrust, or exact", (4,),
            axes=THRUSTERS,
        ),
        shown(
            "thrust.execution", "1",
            "Standard deviation of what each push is wrong by of its own, in each direction, as a part of the push",
            limits=NOT_NEGATIVE,
        ),
        shown("body.features", "m", "Features from the CoM, body axes; 0 if unknown", (n, 3)),
        shown("body.covariances", "m2", "Covariances of body.features; 0 if unknown", (n, 6), axes=UPPER),
        shown("body.known", "1", "Whether the feature is in the map", (n,), boolean=True, per_feature=True),
        shown("predicted.attitude", "1", "target.attitude prediction.horizon ahead, if the tumble is known", (4,)),
        shown("predicted.position", "m", "The target's CoM prediction.horizon ahead, frame C", (3,)),
        shown("predicted.positionCovariance", "m2", "Covariance of predicted.position", (6,), axes=UPPER),
    )  # fmt: skip


def _checks(given: Mapping[str, Symbol]) -> tuple[Check, ...]:
    """The conditions on the parameters, in the order of reporting."""

    def check(name: str, expected: str, holds: Symbol) -> Check:
        return Check(name, name, expected, "value", given[name], ca.if_else(holds, 1, -1))

    def positive(name: str, unit: str) -> Check:
        return check(name, f"a value above 0{unit}", given[name] > 0)

    noise, thrust, ahead = (given[name] for name in ("camera.attitudeNoise", "filter.thrust", "prediction.horizon"))
    return (
        check("camera.attitudeNoise", "0 to 1 rad", ca.logic_and(noise >= 0, noise <= 1)),
        positive("filter.sigma", " m"),
        positive("filter.offset", ""),
        positive("filter.speed", " m/s"),
        check("filter.thrust", "0 to 1", ca.logic_and(thrust >= 0, thrust <= 1)),
        *orbit_checks(Elements.named(given)),
        *force_checks(given),
        check("prediction.horizon", f"0 to {FARTHEST_AHEAD:g} s", ca.logic_and(ahead >= 0, ahead <= FARTHEST_AHEAD)),
    )

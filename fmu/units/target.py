"""TumblingTarget as a unit: attitude, relative motion and features, integrated; from baryscope.models.target."""

from collections.abc import Mapping

import numpy as np

from baryscope.fmu.layout.archive import MODEL_NAME
from baryscope.fmu.layout.platforms import FmiVersion
from baryscope.fmu.units.blueprint import (
    Blueprint,
    Core,
    Dependencies,
    FloatArray,
    Section,
    UnitKind,
    feature_count,
    setting_of,
)
from baryscope.fmu.units.integrator import integrator_header
from baryscope.fmu.units.series import series_source
from baryscope.fmu.units.structure import dependencies
from baryscope.models.scenario import Scenario
from baryscope.models.target import PLACE_START, TumblingTarget
from baryscope.models.variables import Force, Kind, Variable, forces_of, variable_table

EXPERIMENT_TOLERANCE = 1e-6  # for the importer's own solver in Model Exchange; the unit keeps solver.tolerance

_FRAMES = (
    ("I, inertial", "Axes that do not rotate, through the centre of the body that the target circles."),
    (
        "L, LVLH",
        "Origin at the target's centre of mass; x radially outward, y along-track, z along the orbit's normal.",
    ),
    ("B, body", "Origin at the target's centre of mass; fixed in the target. The axes of inertia tensor and features."),
    ("C, chaser", "Origin at the chaser, axes parallel to I: the frame of the outputs features and normals."),
)
_EQUATIONS = (
    "The target is one rigid body. Its angular momentum changes by the torque input and, where gravityGradient is "
    "true, by the gravity gradient (Euler's equations with the full inertia tensor, the attitude as a quaternion).",
    "The chaser is a point. Its motion from the target's centre of mass is not linearised: the difference of the two "
    "bodies' gravity and the commanded acceleration, in the axes of LVLH, which turn as the target goes round.",
    "A feature is where the target's centre of mass is from the chaser, plus its place in the body turned by the "
    "attitude.",
)
_ORBITS = {
    False: "The target flies on a Kepler ellipse, given by its elements at time 0.",
    True: "The target's orbit is integrated under the forces below; the elements are those that osculate at time 0.",
}
_FORCES = {
    Force.J2: "the oblateness of the central body, by its second zonal coefficient",
    Force.DRAG: "drag of an exponential atmosphere that rotates, on target and chaser",
    Force.LIGHT: "pressure of sunlight on target and chaser, with umbra and penumbra",
    Force.EDDY_CURRENTS: "the torque of eddy currents in the field of a magnetic dipole",
}
_USE = (
    "Set parameters before or in Initialization Mode. Fixed ones can be changed again after a reset only; tunable ones "
    "between communication steps, in Model Exchange in Event Mode.",
    "The length of communication steps is free and does not change the results: the unit integrates with steps of its "
    "own (Taylor series of order 20, Dormand and Prince's method of order 8) to solver.tolerance.",
    "An importer's tolerance, if it is smaller, tightens solver.tolerance; it never loosens it.",
    "States can be saved and restored bitwise. Derivatives by time, inputs, states and parameters are exact.",
    "What cannot be (an inertia that no body has, an eccentricity of 1, a step of 0) is refused with a message, and "
    "changes nothing.",
)


def target_blueprint(scenario: Scenario) -> Blueprint:
    """The unit of a scenario's target and chaser."""
    system = scenario.system

    def depending(fmi: FmiVersion) -> tuple[Dependencies, Dependencies]:
        return dependencies(system, fmi)

    return Blueprint(
        name=MODEL_NAME,
        summary="A tumbling target on a Keplerian orbit and a chaser near it: attitude, relative motion, "
        "and the target's features as the chaser sees them",
        variables=system.variables,
        starts=_starts(scenario),
        core=_core(system),
        setting=setting_of(scenario),
        sections=_sections(scenario),
        use=_USE,
        dependencies=depending,
        tolerance=max(EXPERIMENT_TOLERANCE, scenario.run.tolerance),
    )


def _starts(scenario: Scenario) -> dict[str, FloatArray]:
    """The parameters tell the states; their starts are for importers that evaluate the unit uninitialised."""
    system = scenario.system
    starts = {variable.name: np.zeros(variable.shape) for variable in system.of_kind(Kind.INPUT)}
    states = np.array(system.initial(scenario.flat_parameters())).ravel()
    for variable in system.of_kind(Kind.STATE):
        starts[variable.name], states = states[: variable.size].reshape(variable.shape), states[variable.size :]
    return starts | scenario.parameters()


def _core(system: TumblingTarget) -> Core:
    return Core(
        functions=(
            system.initial,
            system.nominals,
            system.constants,
            system.free_attitude_rates,
            system.free_attitude_form.weights,
            system.free_attitude_form.rates,
            system.attitude_rates,
            system.series_constants,
            system.to_series,
            system.from_series,
            system.orbit_rates,
            system.pose,
            system.sight.function,
            system.sight.forward,
            system.sight.reverse,
            system.run_outputs,
            system.run_forward,
            system.run_reverse,
            system.initial_forward,
            system.initial_reverse,
            system.checks.margins,
            system.checks.found,
            system.state_checks.margins,
            system.state_checks.found,
        ),
        checks={"CHECKS": system.checks.checks, "STATE_CHECKS": system.state_checks.checks},
        headers=("target.h",),
        files=("integrator.c", "dop853.c", "taylor.c", "turned.c", "sight.c", "target.c", "derivatives.c"),
        sizes={
            "PLACE_SIZE": system.place_size,
            "ALWAYS_TURNED": int(Force.EDDY_CURRENTS in system.forces),
            "N_FEATURES": next(v.shape[0] for v in system.variables if v.name == "features"),
            "N_CONSTANTS": system.constants.numel_out(),
            "N_SERIES_CONSTANTS": system.series_constants.numel_out(),
            "N_WEIGHTS": system.free_attitude_form.weights.numel_out(),
        },
        generated={
            "dop853.h": integrator_header(PLACE_START + system.place_size),
            "turned.c": series_source(system.series_rates, PLACE_START),
        },
    )


def _sections(scenario: Scenario) -> tuple[Section, ...]:
    forces = [_FORCES[force] for force in Force if force in scenario.forces]
    text = "Quaternions are (w, x, y, z) and turn body into inertial coordinates. Units are SI, angles in radians."
    rows, labels = [], setting_of(scenario).labels
    for row, (label, point) in enumerate(zip(labels, scenario.features.points, strict=True), start=1):
        position, normal = (", ".join(f"{c:.6g}" for c in vector) for vector in (point.position, point.normal))
        rows.append((str(row), label, position, normal))
    return (
        Section("Frames", text, rows=_FRAMES),
        Section("Equations", items=(_ORBITS[bool(forces)], *_EQUATIONS)),
        *([Section("Forces", "Forces that are built in:", items=tuple(forces))] if forces else []),
        Section(
            "Features",
            "The rows of features, normals and their parameters; positions from the centre of mass and outward normals "
            "in body axes, as they are at the start.",
            head=("row", "label", "position, m", "normal"),
            rows=tuple(rows),
            last=True,
        ),
    )


def _table(described: Mapping[str, tuple[int, ...]]) -> tuple[Variable, ...]:
    return variable_table(feature_count(described, "normals"), forces_of(described))


TARGET = UnitKind(MODEL_NAME, target_blueprint, _table)

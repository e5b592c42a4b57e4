"""The table of the unit's variables: the only place that defines name, unit, shape and description.

The FMU's XML, its C tables and the Python session are all derived from it.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from itertools import product
from math import prod


class Kind(StrEnum):
    """The kind of a variable. States and their derivatives are local variables in FMI."""

    INPUT = "input"
    PARAMETER = "parameter"
    OUTPUT = "output"
    STATE = "state"
    DERIVATIVE = "derivative"


class Force(StrEnum):
    """What acts besides point-mass gravity, the gravity gradient and the inputs; built into the unit or not."""

    J2 = "j2"
    DRAG = "drag"
    LIGHT = "light"
    EDDY_CURRENTS = "eddy currents"


Forces = frozenset[Force]
NO_FORCES: Forces = frozenset()


@dataclass(frozen=True)
class Variable:
    """One variable of the unit, a scalar or an array.

    Attributes:
        name: structured name, Modelica style, without indices.
        kind: input, parameter, output, state or derivative of a state.
        unit: a key of UNITS; "1" for pure numbers.
        description: one line; states the frame and, for quaternions, the order.
        shape: () for a scalar; arrays are flattened row by row.
        boolean: true for a Boolean, false for a Real.
        tunable: whether a parameter may be changed in mid-run.
    """

    name: str
    kind: Kind
    unit: str
    description: str
    shape: tuple[int, ...] = ()
    boolean: bool = False
    tunable: bool = False

    @property
    def size(self) -> int:
        """Number of scalars."""
        return prod(self.shape)

    @property
    def scalar_names(self) -> list[str]:
        """FMI 2 names of its scalars, `features[3,1]` or `der(state.position[3])`, row by row; indices start at 1."""
        if not self.shape:
            return [self.name]
        stem, close = (self.name.removesuffix(")"), ")") if self.name.endswith(")") else (self.name, "")
        indices = product(*(range(1, extent + 1) for extent in self.shape))
        return [f"{stem}[{','.join(map(str, index))}]{close}" for index in indices]


# Exponents of the SI base units that the unit's variables need; "rad" counts as one in FMI.
UNITS: dict[str, dict[str, int]] = {
    "1": {},
    "s": {"s": 1},
    "m": {"m": 1},
    "1/s": {"s": -1},
    "m/s": {"m": 1, "s": -1},
    "m/s2": {"m": 1, "s": -2},
    "m3/s2": {"m": 3, "s": -2},
    "rad": {"rad": 1},
    "rad/s": {"rad": 1, "s": -1},
    "rad/s2": {"rad": 1, "s": -2},
    "kg.m2": {"kg": 1, "m": 2},
    "kg.m2/s": {"kg": 1, "m": 2, "s": -1},
    "N.m": {"kg": 1, "m": 2, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2},
    "m2/kg": {"m": 2, "kg": -1},
    "kg/m3": {"kg": 1, "m": -3},
    "N/m2": {"kg": 1, "m": -1, "s": -2},
    "S.m4": {"A": 2, "s": 3, "m": 2, "kg": -1},
    "T.m3": {"kg": 1, "m": 3, "s": -2, "A": -1},
}
AXES = ("xx", "yy", "zz", "xy", "xz", "yz")  # elements of a symmetric tensor


def variable_table(feature_count: int, forces: Forces = NO_FORCES) -> tuple[Variable, ...]:
    """All variables of the unit for a target with `feature_count` features, in the order of their kinds."""
    n = feature_count
    IN, PAR, OUT, STATE, RATE = Kind.INPUT, Kind.PARAMETER, Kind.OUTPUT, Kind.STATE, Kind.DERIVATIVE
    moments = {axes: f"moment of inertia about {axes[0]}" for axes in AXES[:3]}
    products = {axes: f"{axes[0]},{axes[1]} element (minus the product of inertia)" for axes in AXES[3:]}
    inertia = [
        Variable(f"target.inertia.{axes}", PAR, "kg.m2", f"Target inertia tensor about its CoM, body axes: {what}")
        for axes, what in (moments | products).items()
    ]
    states = _states(perturbed=bool(forces))
    return (
        Variable("chaser.acceleration", IN, "m/s2", "Commanded acceleration of the chaser, LVLH axes", (3,)),
        Variable("target.torque", IN, "N.m", "Torque on the target, body axes", (3,)),
        *inertia,
        Variable("target.features", PAR, "m", "The features from the CoM, body axes", (n, 3), tunable=True),
        Variable("target.normals", PAR, "1", "Outward unit normals at the features, body axes", (n, 3), tunable=True),
        Variable("target.attitude0", PAR, "1", "Attitude quaternion at the start (w, x, y, z), body to inertial", (4,)),
        Variable("target.angularRate0", PAR, "rad/s", "Angular rate at the start, body axes", (3,)),
        Variable("orbit.semiMajorAxis", PAR, "m", "Semi-major axis of the target's orbit"),
        Variable("orbit.eccentricity", PAR, "1", "Eccentricity of the target's orbit"),
        Variable("orbit.inclination", PAR, "rad", "Inclination of the target's orbit"),
        Variable("orbit.raan", PAR, "rad", "Right ascension of the ascending node"),
        Variable("orbit.argumentOfPeriapsis", PAR, "rad", "Argument of periapsis"),
        Variable("orbit.trueAnomaly0", PAR, "rad", "True anomaly at the start"),
        Variable("orbit.gravitationalParameter", PAR, "m3/s2", "Gravitational parameter of the central body"),
        Variable("chaser.position0", PAR, "m", "Chaser from the target's CoM at the start, LVLH axes", (3,)),
        Variable("chaser.velocity0", PAR, "m/s", "Chaser's velocity in LVLH at the start, LVLH axes", (3,)),
        Variable("gravityGradient", PAR, "1", "Whether the gravity gradient acts", boolean=True, tunable=True),
        Variable("solver.tolerance", PAR, "1", "Relative tolerance of the integrator", tunable=True),
        *(variable for force in Force if force in forces for variable in FORCE_PARAMETERS[force]),
        Variable("features", OUT, "m", "Positions of the features, frame C (chaser, inertial axes)", (n, 3)),
        Variable("normals", OUT, "1", "Outward unit normals at the features, frame C", (n, 3)),
        Variable("target.position", OUT, "m", "The target's CoM, frame C", (3,)),
        Variable("target.velocity", OUT, "m/s", "Velocity of the target's CoM, frame C", (3,)),
        Variable("target.attitude", OUT, "1", "Attitude quaternion (w, x, y, z), body to inertial", (4,)),
        Variable("target.angularRate", OUT, "rad/s", "Angular rate of the target, body axes", (3,)),
        Variable("chaser.position", OUT, "m", "Chaser from the target's CoM, LVLH axes", (3,)),
        Variable("chaser.velocity", OUT, "m/s", "Chaser's velocity in LVLH, LVLH axes", (3,)),
        Variable("orbit.trueAnomaly", OUT, "rad", _ANGLE if forces else "True anomaly of the target, not wrapped"),
        Variable("target.rotationalEnergy", OUT, "J", "Rotational energy of the target"),
        Variable("target.angularMomentum", OUT, "kg.m2/s", "Angular momentum about the CoM, inertial axes", (3,)),
        *(_ORBIT_OUTPUTS if forces else ()),
        *(Variable(f"state.{name}", STATE, unit, f"State: {what}", shape) for name, unit, _, what, shape in states),
        *(
            Variable(f"der(state.{name})", RATE, unit, f"Derivative of the state: {what}", shape)
            for name, _, unit, what, shape in states
        ),
    )  # fmt: skip


def forces_of(names: Iterable[str]) -> Forces:
    """The forces that a unit has, by the names of its variables, scalars or arrays."""
    stems = {name.partition("[")[0] for name in names}
    return frozenset(force for force, own in FORCE_PARAMETERS.items() if own[0].name in stems)


_ANGLE = "Angle that the target has gone around the centre since its periapsis, not wrapped"
_ORBIT_OUTPUTS = (
    Variable("orbit.position", Kind.OUTPUT, "m", "The target's CoM from the centre it circles, inertial axes", (3,)),
    Variable("orbit.velocity", Kind.OUTPUT, "m/s", "Velocity of the target's CoM, inertial axes", (3,)),
)  # fmt: skip
FORCE_PARAMETERS = {
    Force.J2: (
        Variable("orbit.j2", Kind.PARAMETER, "1", "Second zonal coefficient of the central body, pole along z"),
        Variable("orbit.equatorialRadius", Kind.PARAMETER, "m", "Equatorial radius to which the coefficient refers"),
    ),
    Force.DRAG: (
        Variable("atmosphere.density", Kind.PARAMETER, "kg/m3", "Density of the atmosphere at the reference radius"),
        Variable("atmosphere.referenceRadius", Kind.PARAMETER, "m", "Distance from the centre where the density holds"),
        Variable("atmosphere.scaleHeight", Kind.PARAMETER, "m", "Height over which the density falls to 1/e"),
        Variable("atmosphere.rotationRate", Kind.PARAMETER, "rad/s", "Rotation of the air about the inertial z axis"),
        Variable("target.drag", Kind.PARAMETER, "m2/kg", "Target's drag coefficient times area over mass"),
        Variable("chaser.drag", Kind.PARAMETER, "m2/kg", "Chaser's drag coefficient times area over mass"),
    ),
    Force.LIGHT: (
        Variable("sun.direction", Kind.PARAMETER, "1", "Unit vector towards the Sun, inertial axes", (3,)),
        Variable("sun.pressure", Kind.PARAMETER, "N/m2", "Pressure of the sunlight on a surface that absorbs it"),
        Variable("sun.shadowRadius", Kind.PARAMETER, "m", "Radius of the sphere that casts the shadow"),
        Variable("target.light", Kind.PARAMETER, "m2/kg", "Target's radiation coefficient times area over mass"),
        Variable("chaser.light", Kind.PARAMETER, "m2/kg", "Chaser's radiation coefficient times area over mass"),
    ),
    Force.EDDY_CURRENTS: (
        *(
            Variable(f"target.magneticTensor.{axes}", Kind.PARAMETER, "S.m4", f"Magnetic tensor, body axes: {axes}")
            for axes in AXES
        ),
        Variable("magneticField.dipole", Kind.PARAMETER, "T.m3", "Dipole of the magnetic field, inertial axes", (3,)),
    ),
}  # fmt: skip


def _states(*, perturbed: bool) -> tuple[tuple[str, str, str, str, tuple[int, ...]], ...]:
    """Name, unit, unit of the derivative, description and shape of each state."""
    turning = (
        ("attitude", "1", "1/s", "attitude, quaternion (w, x, y, z), body to inertial, not normalised", (4,)),
        ("angularRate", "rad/s", "rad/s2", "angular rate of the target, body axes", (3,)),
    )
    if perturbed:
        return (
            *turning,
            ("trueAnomaly", "rad", "rad/s", "angle that the target has gone around the centre", ()),
            ("orbitPosition", "m", "m/s", "target from the centre of the central body, inertial axes", (3,)),
            ("orbitVelocity", "m/s", "m/s2", "velocity of the target, inertial axes", (3,)),
            ("position", "m", "m/s", "chaser from the target's CoM, inertial axes", (3,)),
            ("velocity", "m/s", "m/s2", "chaser's velocity from the target's, inertial axes", (3,)),
        )
    return (
        *turning,
        ("trueAnomaly", "rad", "rad/s", "true anomaly of the target", ()),
        ("position", "m", "m/s", "chaser from the target's CoM, LVLH axes", (3,)),
        ("velocity", "m/s", "m/s2", "chaser's velocity in LVLH, LVLH axes", (3,)),
    )

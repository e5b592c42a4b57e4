"""The table of the unit's variables: the only place that defines name, unit, shape and description.

The FMU's XML, its C tables and the Python session are all derived from it.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cache
from itertools import product
from math import inf, nextafter, pi, prod


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


XYZ = ("x", "y", "z")
LVLH = ("x, radial", "y, along-track", "z, along the orbit's normal")
QUATERNION = ("w", "x", "y", "z")
NO_LIMITS = (-inf, inf)
NOT_NEGATIVE = (0.0, inf)
BELOW_ONE = (0.0, nextafter(1.0, 0.0))
TOLERANCES = (1e-15, 1e-3)  # relative, of the integrators


@dataclass(frozen=True)
class Variable:
    """One variable of the unit, a scalar or an array.

    Attributes:
        name: structured name, Modelica style, without indices.
        kind: input, parameter, output, state or derivative of a state.
        unit: a key of UNITS; "1" for pure numbers.
        description: one line; states the frame and, for quaternions, the order.
        shape: () for a scalar; arrays are flattened row by row. The rows of a matrix belong to the features.
        per_feature: the elements of a vector belong to the features, too.
        boolean: true for a Boolean, false for a Real.
        discrete: whether an input or output changes at sample times only, as Booleans do.
        tunable: whether a parameter may be changed in mid-run.
        axes: names of the elements of a vector, or of the columns of a matrix; by the shape unless given.
        display: unit in which people read it, of DISPLAY_UNITS; "" for degrees for angles and rates, else for `unit`.
        limits: smallest and largest value that makes sense physically.
    """

    name: str
    kind: Kind
    unit: str
    description: str
    shape: tuple[int, ...] = ()
    boolean: bool = False
    discrete: bool = False
    per_feature: bool = False
    tunable: bool = False
    axes: tuple[str, ...] = ()
    display: str = ""
    limits: tuple[float, float] = NO_LIMITS

    @property
    def size(self) -> int:
        """Number of scalars."""
        return prod(self.shape)

    @property
    def is_of_features(self) -> bool:
        """Whether it has a row for every feature."""
        return self.per_feature or len(self.shape) > 1

    @property
    def scalar_names(self) -> list[str]:
        """FMI 2 names of its scalars, `features[3,1]` or `der(state.position[3])`, row by row; indices start at 1."""
        if not self.shape:
            return [self.name]
        stem, close = (self.name.removesuffix(")"), ")") if self.name.endswith(")") else (self.name, "")
        indices = product(*(range(1, extent + 1) for extent in self.shape))
        return [f"{stem}[{','.join(map(str, index))}]{close}" for index in indices]

    @property
    def display_unit(self) -> str:
        """The unit in which people read it; its own unit if that is no other one."""
        degrees = (display for display in DISPLAY_UNITS.get(self.unit, ()) if display.startswith("deg"))
        return self.display or next(degrees, self.unit)

    def scalar_description(self, element: int, labels: Sequence[str]) -> str:
        """The description of one of its scalars, counted row by row from 0: with the feature's label and the axis."""
        if not self.shape:
            return self.description
        if self.per_feature:
            return f"{self.description}: {labels[element]}"
        axes = self.axes or (QUATERNION if self.shape[-1] == len(QUATERNION) else XYZ)
        row, column = divmod(element, self.shape[-1])
        label = f"{labels[row]}, " if len(self.shape) > 1 else ""
        return f"{self.description}: {label}{axes[column]}"

    def whole_description(self, labels: Sequence[str]) -> str:
        """The description of the variable as a whole: with its axes and, where its rows are features, their labels."""
        description = f"{self.description}: {'; '.join(self.axes)}" if self.axes else self.description
        return f"{description}; rows: {', '.join(labels)}" if self.is_of_features and labels else description


# Exponents of the SI base units that the unit's variables need; "rad" counts as one in FMI.
UNITS: dict[str, dict[str, int]] = {
    "1": {},
    "s": {"s": 1},
    "m": {"m": 1},
    "m2": {"m": 2},
    "1/s": {"s": -1},
    "m/s": {"m": 1, "s": -1},
    "m/s2": {"m": 1, "s": -2},
    "m2/s2": {"m": 2, "s": -2},
    "m2/s3": {"m": 2, "s": -3},
    "m3/s2": {"m": 3, "s": -2},
    "rad": {"rad": 1},
    "rad/s": {"rad": 1, "s": -1},
    "rad/s2": {"rad": 1, "s": -2},
    "rad2": {"rad": 2},
    "rad2/s2": {"rad": 2, "s": -2},
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
# What a value is multiplied by for display, by unit and display unit.
DISPLAY_UNITS: dict[str, dict[str, float]] = {
    "rad": {"deg": 180 / pi},
    "rad/s": {"deg/s": 180 / pi},
    "rad/s2": {"deg/s2": 180 / pi},
    "m": {"km": 1e-3},
    "m/s": {"km/s": 1e-3},
    "m3/s2": {"km3/s2": 1e-9},
}
AXES = ("xx", "yy", "zz", "xy", "xz", "yz")  # elements of a symmetric tensor
UPPER = ("xx", "xy", "xz", "yy", "yz", "zz")  # of a covariance, row by row
CAMERA = ("x, along the baseline", "y", "z, boresight")  # axes of a pair of cameras
THRUSTERS = ("scale", *CAMERA)  # what thrusters are wrong by


@cache
def variable_table(feature_count: int, forces: Forces = NO_FORCES) -> tuple[Variable, ...]:
    """All variables of the unit for a target with `feature_count` features, in the order of their kinds."""
    n = feature_count
    IN, PAR, OUT = Kind.INPUT, Kind.PARAMETER, Kind.OUTPUT
    moments = {axes: f"moment of inertia about {axes[0]}" for axes in AXES[:3]}
    products = {axes: f"{axes[0]},{axes[1]} element (minus the product of inertia)" for axes in AXES[3:]}
    inertia = [
        Variable(
            f"target.inertia.{axes}",
            PAR,
            "kg.m2",
            f"Target inertia tensor about its CoM, body axes: {what}",
            limits=NOT_NEGATIVE if axes in moments else NO_LIMITS,
        )
        for axes, what in (moments | products).items()
    ]
    states = _states(perturbed=bool(forces))
    return (
        Variable("chaser.acceleration", IN, "m/s2", "Commanded acceleration of the chaser, LVLH axes", (3,), axes=LVLH),
        Variable("target.torque", IN, "N.m", "Torque on the target, body axes", (3,)),
        *inertia,
        Variable("target.features", PAR, "m", "The features from the CoM, body axes", (n, 3), tunable=True),
        Variable("target.normals", PAR, "1", "Outward unit normals at the features, body axes", (n, 3), tunable=True),
        Variable("target.attitude0", PAR, "1", "Attitude quaternion at the start (w, x, y, z), body to inertial", (4,)),
        Variable("target.angularRate0", PAR, "rad/s", "Angular rate at the start, body axes", (3,)),
        Variable(
            "orbit.semiMajorAxis", PAR, "m", "Semi-major axis of the target's orbit", display="km", limits=NOT_NEGATIVE
        ),
        Variable("orbit.eccentricity", PAR, "1", "Eccentricity of the target's orbit", limits=BELOW_ONE),
        Variable("orbit.inclination", PAR, "rad", "Inclination of the target's orbit"),
        Variable("orbit.raan", PAR, "rad", "Right ascension of the ascending node"),
        Variable("orbit.argumentOfPeriapsis", PAR, "rad", "Argument of periapsis"),
        Variable("orbit.trueAnomaly0", PAR, "rad", "True anomaly at the start"),
        Variable(
            "orbit.gravitationalParameter", PAR, "m3/s2", "Gravitational parameter of the central body",
            display="km3/s2", limits=NOT_NEGATIVE,
        ),
        Variable("chaser.position0", PAR, "m", "Chaser from the target's CoM at the start, LVLH axes", (3,), axes=LVLH),
        Variable("chaser.velocity0", PAR, "m/s", "Chaser's velocity in LVLH at the start, LVLH axes", (3,), axes=LVLH),
        Variable("gravityGradient", PAR, "1", "Whether the gravity gradient acts", boolean=True, tunable=True),
        Variable(
            "solver.tolerance", PAR, "1", "Relative tolerance of the unit's integrators",
            tunable=True, limits=TOLERANCES,
        ),
        *(variable for force in Force if force in forces for variable in FORCE_PARAMETERS[force]),
        Variable("features", OUT, "m", "Positions of the features, frame C (chaser, inertial axes)", (n, 3)),
        Variable("normals", OUT, "1", "Outward unit normals at the features, frame C", (n, 3)),
        Variable("target.position", OUT, "m", "The target's CoM, frame C", (3,)),
        Variable("target.velocity", OUT, "m/s", "Velocity of the target's CoM, frame C", (3,)),
        Variable("target.attitude", OUT, "1", "Attitude quaternion (w, x, y, z), body to inertial", (4,)),
        Variable("target.angularRate", OUT, "rad/s", "Angular rate of the target, body axes", (3,)),
        Variable("chaser.position", OUT, "m", "Chaser from the target's CoM, LVLH axes", (3,), axes=LVLH),
        Variable("chaser.velocity", OUT, "m/s", "Chaser's velocity in LVLH, LVLH axes", (3,), axes=LVLH),
        Variable("orbit.trueAnomaly", OUT, "rad", _ANGLE if forces else "True anomaly of the target, not wrapped"),
        Variable("target.rotationalEnergy", OUT, "J", "Rotational energy of the target", limits=NOT_NEGATIVE),
        Variable("target.angularMomentum", OUT, "kg.m2/s", "Angular momentum about the CoM, inertial axes", (3,)),
        *(_ORBIT_OUTPUTS if forces else ()),
        *states,
        *(_rate_of(state) for state in states),
    )  # fmt: skip


def forces_of(names: Iterable[str]) -> Forces:
    """The forces that a unit has, by the names of its variables, scalars or arrays."""
    stems = {name.partition("[")[0] for name in names}
    return frozenset(force for force, own in FORCE_PARAMETERS.items() if own[0].name in stems)


_ANGLE = "Angle that the target has gone around the centre since its periapsis, not wrapped"
_ORBIT_OUTPUTS = (
    Variable(
        "orbit.position", Kind.OUTPUT, "m", "The target's CoM from the centre it circles, inertial axes", (3,),
        display="km",
    ),
    Variable("orbit.velocity", Kind.OUTPUT, "m/s", "Velocity of the target's CoM, inertial axes", (3,), display="km/s"),
)  # fmt: skip


def _area_parameters(name: str, coefficient: str) -> tuple[Variable, ...]:
    """What target and chaser show to the air or the light, by their mass."""
    return tuple(
        Variable(
            f"{body}.{name}", Kind.PARAMETER, "m2/kg", f"{body.title()}'s {coefficient} times area over mass",
            limits=NOT_NEGATIVE,
        )
        for body in ("target", "chaser")
    )  # fmt: skip


FORCE_PARAMETERS = {
    Force.J2: (
        Variable("orbit.j2", Kind.PARAMETER, "1", "Second zonal coefficient of the central body, pole along z"),
        Variable(
            "orbit.equatorialRadius", Kind.PARAMETER, "m", "Equatorial radius to which the coefficient refers",
            display="km", limits=NOT_NEGATIVE,
        ),
    ),
    Force.DRAG: (
        Variable(
            "atmosphere.density", Kind.PARAMETER, "kg/m3", "Density of the atmosphere at the reference radius",
            limits=NOT_NEGATIVE,
        ),
        Variable(
            "atmosphere.referenceRadius", Kind.PARAMETER, "m", "Distance from the centre where the density holds",
            display="km", limits=NOT_NEGATIVE,
        ),
        Variable(
            "atmosphere.scaleHeight", Kind.PARAMETER, "m", "Height over which the density falls to 1/e",
            display="km", limits=NOT_NEGATIVE,
        ),
        Variable("atmosphere.rotationRate", Kind.PARAMETER, "rad/s", "Rotation of the air about the inertial z axis"),
        *_area_parameters("drag", "drag coefficient"),
    ),
    Force.LIGHT: (
        Variable("sun.direction", Kind.PARAMETER, "1", "Unit vector towards the Sun, inertial axes", (3,)),
        Variable(
            "sun.pressure", Kind.PARAMETER, "N/m2", "Pressure of the sunlight on a surface that absorbs it",
            limits=NOT_NEGATIVE,
        ),
        Variable(
            "sun.shadowRadius", Kind.PARAMETER, "m", "Radius of the sphere that casts the shadow",
            display="km", limits=NOT_NEGATIVE,
        ),
        *_area_parameters("light", "radiation coefficient"),
    ),
    Force.EDDY_CURRENTS: (
        *(
            Variable(
                f"target.magneticTensor.{axes}", Kind.PARAMETER, "S.m4", f"Magnetic tensor, body axes: {axes}",
                limits=NOT_NEGATIVE if axes[0] == axes[1] else NO_LIMITS,
            )
            for axes in AXES
        ),
        Variable("magneticField.dipole", Kind.PARAMETER, "T.m3", "Dipole of the magnetic field, inertial axes", (3,)),
    ),
}  # fmt: skip


def _states(*, perturbed: bool) -> tuple[Variable, ...]:
    """The states; `_rate_of` gives their derivatives."""
    turning = (
        _state("attitude", "1", "attitude, quaternion (w, x, y, z), body to inertial, not normalised", (4,)),
        _state("angularRate", "rad/s", "angular rate of the target, body axes", (3,)),
    )
    if perturbed:
        return (
            *turning,
            _state("trueAnomaly", "rad", "angle that the target has gone around the centre"),
            _state(
                "orbitPosition", "m", "target from the centre of the central body, inertial axes", (3,), display="km"
            ),
            _state("orbitVelocity", "m/s", "velocity of the target, inertial axes", (3,), display="km/s"),
            _state("position", "m", "chaser from the target's CoM, inertial axes", (3,)),
            _state("velocity", "m/s", "chaser's velocity from the target's, inertial axes", (3,)),
        )
    return (
        *turning,
        _state("trueAnomaly", "rad", "true anomaly of the target"),
        _state("position", "m", "chaser from the target's CoM, LVLH axes", (3,), axes=LVLH),
        _state("velocity", "m/s", "chaser's velocity in LVLH, LVLH axes", (3,), axes=LVLH),
    )


def _state(
    name: str, unit: str, what: str, shape: tuple[int, ...] = (), *, axes: tuple[str, ...] = (), display: str = ""
) -> Variable:
    return Variable(f"state.{name}", Kind.STATE, unit, f"State: {what}", shape, axes=axes, display=display)


_BY_THE_SECOND = {"1": "1/s", "m": "m/s", "m/s": "m/s2", "rad": "rad/s", "rad/s": "rad/s2"}


def _rate_of(state: Variable) -> Variable:
    """The derivative of a state."""
    return replace(
        state,
        name=f"der({state.name})",
        kind=Kind.DERIVATIVE,
        unit=_BY_THE_SECOND[state.unit],
        description=state.description.replace("State", "Derivative of the state", 1),
        display="km/s" if state.display == "km" else "",
    )

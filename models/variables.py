"""The table of the unit's variables: the only place that defines name, unit, shape and description.

The FMU's XML, its C tables and the Python session are all derived from it.
"""

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
}


def variable_table(feature_count: int) -> tuple[Variable, ...]:
    """All variables of the unit for a target with `feature_count` features, in the order of their kinds."""
    n = feature_count
    IN, PAR, OUT, STATE, RATE = Kind.INPUT, Kind.PARAMETER, Kind.OUTPUT, Kind.STATE, Kind.DERIVATIVE
    moments = {axes: f"moment of inertia about {axes[0]}" for axes in ("xx", "yy", "zz")}
    products = {axes: f"{axes[0]},{axes[1]} element (minus the product of inertia)" for axes in ("xy", "xz", "yz")}
    inertia = [
        Variable(f"target.inertia.{axes}", PAR, "kg.m2", f"Target inertia tensor about its CoM, body axes: {what}")
        for axes, what in (moments | products).items()
    ]
    states: tuple[tuple[str, str, str, str, tuple[int, ...]], ...] = (
        ("attitude", "1", "1/s", "attitude, quaternion (w, x, y, z), body to inertial, not normalised", (4,)),
        ("angularRate", "rad/s", "rad/s2", "angular rate of the target, body axes", (3,)),
        ("trueAnomaly", "rad", "rad/s", "true anomaly of the target", ()),
        ("position", "m", "m/s", "chaser from the target's CoM, LVLH axes", (3,)),
        ("velocity", "m/s", "m/s2", "chaser's velocity in LVLH, LVLH axes", (3,)),
    )
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
        Variable("features", OUT, "m", "Positions of the features, frame C (chaser, inertial axes)", (n, 3)),
        Variable("normals", OUT, "1", "Outward unit normals at the features, frame C", (n, 3)),
        Variable("target.position", OUT, "m", "The target's CoM, frame C", (3,)),
        Variable("target.velocity", OUT, "m/s", "Velocity of the target's CoM, frame C", (3,)),
        Variable("target.attitude", OUT, "1", "Attitude quaternion (w, x, y, z), body to inertial", (4,)),
        Variable("target.angularRate", OUT, "rad/s", "Angular rate of the target, body axes", (3,)),
        Variable("chaser.position", OUT, "m", "Chaser from the target's CoM, LVLH axes", (3,)),
        Variable("chaser.velocity", OUT, "m/s", "Chaser's velocity in LVLH, LVLH axes", (3,)),
        Variable("orbit.trueAnomaly", OUT, "rad", "True anomaly of the target, not wrapped"),
        Variable("target.rotationalEnergy", OUT, "J", "Rotational energy of the target"),
        Variable("target.angularMomentum", OUT, "kg.m2/s", "Angular momentum about the CoM, inertial axes", (3,)),
        *(Variable(f"state.{name}", STATE, unit, f"State: {what}", shape) for name, unit, _, what, shape in states),
        *(
            Variable(f"der(state.{name})", RATE, unit, f"Derivative of the state: {what}", shape)
            for name, _, unit, what, shape in states
        ),
    )  # fmt: skip

"""A controller of one's own as a unit, in the place of ApproachController. To copy; needs `pip install pythonfmu`.

pythonfmu build -f scripts/examples/own_controller.py
baryscope fly --scenario envisat --controller OwnController.fmu --approach --duration 900

It turns with the body: along the keep-out sphere to the axis of the grapple point, and down that axis. Variables have
the names of ApproachController's, by which they are connected; of the parameters it takes those that it needs.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pythonfmu import Boolean, Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

Vector = NDArray[np.float64]

INPUTS = {  # frames as in docs/unit.md: C is inertial with the chaser in its origin, B the body
    "target.position": 3, "target.velocity": 3, "target.attitude": 4, "target.angularRate": 3, "target.inertia": 6,
    "grapple.point": 3, "sight.position": 3,
}  # fmt: skip
OUTPUTS = {"command.acceleration": 3, "camera.attitude": 4}
ELEMENTS = ("semiMajorAxis", "eccentricity", "inclination", "raan", "argumentOfPeriapsis", "trueAnomaly0")
ORBIT = tuple(f"orbit.{name}" for name in (*ELEMENTS, "gravitationalParameter"))
SPHERE, SPEED, RATE, GAIN = 10.0, 0.15, 0.03, 0.2  # m, m/s, 1/s, 1/s
COSINE = np.cos(np.deg2rad(20))  # of the angle from the grapple axis within which the chaser goes in


class OwnController(Fmi2Slave):
    """A glide with the body, whose velocity in its axes is a field that leads to the goal."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.value: dict[str, Vector] = {}
        for name, size in INPUTS.items():
            self.add(name, size, Fmi2Causality.input)
        for name, size in OUTPUTS.items():
            self.add(name, size, Fmi2Causality.output)
        for name in (*ORBIT, "grapple.standoff"):
            self.add(name, None, Fmi2Causality.parameter)
        self.add("navigation.valid", None, Fmi2Causality.input, Boolean)
        self.add("synchronised", None, Fmi2Causality.parameter, Boolean)
        self.add("goal.synchronised", None, Fmi2Causality.output, Boolean)
        self.value["camera.attitude"][0] = 1.0

    def add(self, name: str, size: int | None, causality: Fmi2Causality, kind: type = Real) -> None:
        """Declare a variable, whose scalars stand in an array of `value`; size None: one without an index."""
        values = self.value[name] = np.zeros(size or 1)
        tunable = Fmi2Variability.tunable if causality == Fmi2Causality.parameter else None
        for k in range(size or 1):
            self.register_variable(
                kind(
                    f"{name}[{k + 1}]" if size else name,
                    causality=causality,
                    variability=tunable,
                    getter=lambda k=k: values[k],
                    setter=lambda new, k=k: values.__setitem__(k, new),
                ),
                nested=False,
            )

    def do_step(self, time: float, step: float) -> bool:
        """The command from the inputs at the step's beginning. It acts a step later, for a step."""
        told, command = self.value, np.zeros(3)
        knows = told["navigation.valid"][0] and told["target.inertia"].any() and told["grapple.point"].any()
        turns = told["goal.synchronised"][0] = bool(knows and told["synchronised"][0])
        if turns:
            R, rate = rotation(told["target.attitude"]), told["target.angularRate"]
            place = -R.T @ told["target.position"]  # of the chaser, in B
            moving = -R.T @ told["target.velocity"] - np.cross(rate, place)
            spinning = tumble(told["target.inertia"], rate)
            glide = self.field(place)
            change = (self.field(place + 1e-3 * glide) - glide) / 1e-3
            push = change + GAIN * (glide - moving) + 2 * np.cross(rate, moving)
            push += np.cross(spinning, place) + np.cross(rate, np.cross(rate, place))
            late = R @ (push + 1.5 * step * np.cross(rate, push))  # the body turns on till the middle of that step
            command = lvlh([told[name][0] for name in ORBIT], time).T @ late
        told["command.acceleration"][:] = command
        valid = told["navigation.valid"][0] or not told["sight.position"].any()
        looked_at = told["target.position" if valid else "sight.position"]
        if looked_at.any():
            told["camera.attitude"][:] = looking(looked_at)
        return True

    def field(self, place: Vector) -> Vector:
        """The wanted velocity in B, m/s, at a place there: round on the sphere, then in."""
        point = self.value["grapple.point"]
        axis, distance = point / np.linalg.norm(point), np.linalg.norm(place)
        outward = place / distance
        aside = axis - (axis @ outward) * outward
        goal = SPHERE if axis @ outward < COSINE else np.linalg.norm(point) + self.value["grapple.standoff"][0]
        return bounded(RATE * distance * aside) + bounded(RATE * (goal - distance) * outward)


def bounded(velocity: Vector) -> Vector:
    """A velocity, or one of SPEED in its direction."""
    return velocity / max(1.0, float(np.linalg.norm(velocity)) / SPEED)


def rotation(q: Vector) -> Vector:
    """The rotation of a quaternion (w, x, y, z), from B to C."""
    w, (x, y, z) = q[0], q[1:]
    turn = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return (np.eye(3) + 2 * w * turn + 2 * turn @ turn) if q.any() else np.eye(3)


def tumble(inertia: Vector, rate: Vector) -> Vector:
    """The angular acceleration of a free body, by Euler's equations."""
    xx, yy, zz, xy, xz, yz = inertia
    J = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return np.linalg.solve(J, -np.cross(rate, J @ rate))


def lvlh(orbit: Sequence[float], time: float) -> Vector:
    """The axes of LVLH as columns in C: radial, along-track, normal."""
    a, e, inclination, node, periapsis, start, mu = orbit
    factor = np.sqrt((1 - e) / (1 + e))
    at_start = 2 * np.arctan(factor * np.tan(start / 2))
    mean = at_start - e * np.sin(at_start) + np.sqrt(mu / a**3) * time
    eccentric = mean
    for _ in range(20):
        eccentric = mean + e * np.sin(eccentric)
    u = periapsis + 2 * np.arctan(np.tan(eccentric / 2) / factor)
    c, s = np.cos(inclination), np.sin(inclination)
    tilt = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    return np.asarray(about_z(node) @ tilt @ about_z(u))


def about_z(angle: float) -> Vector:
    """A turn about z."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def looking(target: Vector) -> Vector:
    """The attitude (w, x, y, z) of a camera with the target ahead: the shortest turn of z there."""
    ahead = target / np.linalg.norm(target)
    q = np.array([1 + ahead[2], -ahead[1], ahead[0], 0]) if ahead[2] > -0.999 else np.array([0, 1.0, 0, 0])
    return np.asarray(q / np.linalg.norm(q))

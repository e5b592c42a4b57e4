"""What judging asks of a case, of whichever population it is."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import trapezoid

from baryscope.estimator import FeatureTracks
from baryscope.models.orbit import Orbit

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Sample:
    """tracks: what the estimators get; right (n, m): observations of what the label says, without a blunder; precision
    (n, m, 3, 3): the true inverse covariance of the noise in C, 1/m².
    """

    tracks: FeatureTracks
    right: BoolArray
    precision: FloatArray


@dataclass(frozen=True, eq=False)
class Truth:
    """The motion at k times: path (k, 3) of the centre of mass in C, m, its velocity (k, 3), m/s; attitude (k, 3, 3)
    R_C_B; rate (k, 3) in B, rad/s.
    """

    path: FloatArray
    velocity: FloatArray
    attitude: FloatArray
    rate: FloatArray

    def state(self, point: FloatArray) -> FloatArray:
        """Position and velocity (k, 6) in C of a point (3,) in B from the centre of mass, m."""
        arm, speed = self.attitude @ point, np.cross(self.rate, point)
        return np.concatenate([self.path + arm, self.velocity + np.einsum("kij,kj->ki", self.attitude, speed)], axis=1)


def turns(rate: FloatArray, time: FloatArray) -> float:
    """How often a target of rates (n, 3), rad/s, turns over times (n,), s."""
    return float(trapezoid(np.linalg.norm(rate, axis=1), time) / (2 * np.pi))


class Drawn(Protocol):
    """The truth of a case: n times, m labels."""

    def at(self, time: FloatArray) -> Truth:
        """The truth at other ascending times (k,) in s, from the first on: in gaps, and carried on after the last time,
        in the same world.
        """
        ...

    @property
    def kind(self) -> str:
        """Words that name what is special, or how it was drawn."""
        ...

    @property
    def time(self) -> FloatArray:
        """(n,) s."""
        ...

    @property
    def orbital(self) -> bool:
        """Whether the target flies; if not, an orbit says nothing of it."""
        ...

    @property
    def orbit(self) -> Orbit:
        """That of the target, as an estimator may be told it."""
        ...

    @property
    def path(self) -> FloatArray:
        """The centre of mass (n, 3) in C, m."""
        ...

    @property
    def path_jacobian(self) -> FloatArray:
        """(n, 3, 6), of the path by a state of the chaser."""
        ...

    @property
    def attitude(self) -> FloatArray:
        """(n, 3, 3) R_C_B."""
        ...

    @property
    def rate(self) -> FloatArray:
        """(n, 3) the angular rate in B, rad/s."""
        ...

    @property
    def turn(self) -> FloatArray:
        """(n, 3, 8): rotation vectors in B by rate and inertia."""
        ...

    @property
    def points(self) -> FloatArray:
        """What is behind each label (m, 3) in B, from the centre of mass, m."""
        ...

    @property
    def sensor(self) -> object:
        """A dataclass of its errors."""
        ...

    @property
    def noise(self) -> float:
        """Its standard deviation, in a unit of the population's own."""
        ...

    @property
    def told(self) -> float | None:
        """The sigma that the estimator is told, if it is."""
        ...

    @property
    def radius(self) -> float:
        """The rms distance of the features that are seen from their centroid, m."""
        ...

    @property
    def rotations(self) -> float:
        """How often the target turns while it is watched."""
        ...

"""Elements of an orbit at a moment, in which what a relative motion tells of it is nearly Gaussian."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.geometry.so3 import exp_rotation
from baryscope.models.ephemeris.trajectory import kepler_orbit_through, lvlh_axes
from baryscope.models.errors import InputError
from baryscope.models.orbit import Orbit

FloatArray = NDArray[np.float64]

# What `LocalElements.moved` takes: rotations about the LVLH axes in rad, and changes of the shape.
NAMES = (
    "orbit turned about the radius",
    "orbit turned about the track",
    "orbit turned about the normal",
    "orbit mean motion, relative",
    "orbit eccentricity along the radius",
    "orbit eccentricity along the track",
)


@dataclass(frozen=True, eq=False)
class LocalElements:
    """An orbit by R_I_L (3, 3) at a moment, and its shape (3,): ln n, e cos θ and e sin θ, n in rad/s, θ there.

    To turn an orbit does not change its size, as it does to second order to move a state on a straight line.
    """

    axes: FloatArray
    shape: FloatArray

    @classmethod
    def through(cls, place: FloatArray, velocity: FloatArray, mu: float) -> "LocalElements":
        """The elements of a target at a place (3,), m, with a velocity (3,), m/s; NaN if its orbit is open.

        mu: gravitational parameter of the central body, m³/s².
        """
        r, h = float(np.linalg.norm(place)), np.cross(place, velocity)
        p = float(h @ h) / mu
        cosine, sine = p / r - 1, float(place @ velocity) / r * np.sqrt(p / mu)
        squared = 1 - cosine**2 - sine**2
        log_rate = np.log(mu * (squared / p) ** 3) / 2 if squared > 0 else np.nan
        return cls(_axes(place, velocity), np.array([log_rate, cosine, sine]))

    @classmethod
    def of_circle(cls, place: FloatArray, velocity: FloatArray, mu: float) -> "LocalElements":
        """The elements of the circle through a place (3,), m, in the plane of a velocity (3,), m/s."""
        log_rate = np.log(mu / np.linalg.norm(place) ** 3) / 2
        return cls(_axes(place, velocity), np.array([log_rate, 0.0, 0.0]))

    def moved(self, by: FloatArray) -> "LocalElements":
        """The elements turned by a rotation vector in these axes, and with another shape; by (6,)."""
        return LocalElements(self.axes @ exp_rotation(by[:3]), self.shape + by[3:])

    @property
    def period(self) -> float:
        """The period, s."""
        return float(2 * np.pi / np.exp(self.shape[0]))

    @property
    def eccentricity(self) -> float:
        """The eccentricity."""
        return float(np.hypot(*self.shape[1:]))

    def orbit(self, time: float, mu: float) -> Orbit:
        """The orbit with these elements at a time in s; mu: gravitational parameter of the central body, m³/s².

        Raises:
            InputError: it is open, or goes through the central body.
        """
        log_rate, cosine, sine = self.shape
        with np.errstate(all="ignore"):  # what is no orbit becomes numbers that are not finite
            p = np.cbrt(mu / np.exp(2 * log_rate)) * (1 - cosine**2 - sine**2)
            speed = np.sqrt(mu / p)
        if not (np.isfinite(p) and np.isfinite(speed)):
            raise InputError(f"an orbit of ln n, e cos θ, e sin θ {self.shape.tolist()}, expected an ellipse")
        radial, along, _ = self.axes.T
        state = np.concatenate([p / (1 + cosine) * radial, speed * (sine * radial + (1 + cosine) * along)])
        return kepler_orbit_through(state, time, mu)


def _axes(place: FloatArray, velocity: FloatArray) -> FloatArray:
    return np.asarray(lvlh_axes(np.concatenate([place, velocity])[None])[0])


def places_on_orbit(position: FloatArray, acceleration: FloatArray, mu: float) -> FloatArray | None:
    """The target's places (k, 3) from the central body's centre, m, one beside the other; None where nothing is bent.

    At every moment gravity's gradient alone accelerates the centre of mass at p from the chaser: with the target at a
    distance r from the centre, in the direction of the unit vector u,

        p̈ = μ/r³ (3 u uᵀ − 1) p          so          w = (r³/μ p̈ + p)/3 = u uᵀ p,

    which is along u, and w·w = w·p: a quadratic equation for r³/μ. The opposite places would do as well.

    position (k, 3) of the centre of mass from the chaser, m, and its acceleration (k, 3), m/s², in inertial axes; mu:
    gravitational parameter, m³/s².
    """
    along, size = np.sum(position * acceleration, axis=1), np.sum(acceleration**2, axis=1)
    if not (size > 0).all():
        return None
    cube = (along + np.sqrt(along**2 + 8 * size * np.sum(position**2, axis=1))) / (2 * size)  # r³/μ
    towards = cube[:, None] * acceleration + position
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    turned = np.where(np.sum(towards[1:] * towards[:-1], axis=1) < 0, -1.0, 1.0)
    towards[1:] *= np.cumprod(turned)[:, None]
    return np.asarray(towards * np.cbrt(cube * mu)[:, None])

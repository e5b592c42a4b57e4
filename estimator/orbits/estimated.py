"""A relative motion on an orbit that the path itself tells: its elements are unknowns of the path."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.findings import EstimatedOrbit
from baryscope.estimator.orbits.elements import NAMES, LocalElements
from baryscope.estimator.orbits.error import perturbing_accelerations
from baryscope.estimator.paths.extended_path import parts_of
from baryscope.estimator.paths.forces import Force, longest_on
from baryscope.estimator.paths.nonlinear_path import Beside, NonlinearPath
from baryscope.estimator.paths.path import Path
from baryscope.estimator.paths.relative_motion import RelativeOrbit
from baryscope.models.ephemeris.trajectory import gravity_gradient, target_states
from baryscope.models.errors import InputError
from baryscope.models.keplerian import ELEMENT_COUNT
from baryscope.models.orbit import EARTH_MU, Orbit
from baryscope.models.relative_orbit import paths_from_chaser

FloatArray = NDArray[np.float64]

STEP = 1e-4  # of the elements, of the difference quotient of the gradient
SHAPE = slice(3, 6)  # among the elements


@dataclass(frozen=True, eq=False)
class EstimatedOrbitPath(NonlinearPath):
    """Relative motion on an orbit near one of given elements: how it departs from these are unknowns, the force's.

    elements: at the middle of begin … end, about which the path is linear in the departure. A change of the gravity
    gradient acts about a motion on their orbit.
    """

    elements: LocalElements

    @property
    def orbit(self) -> Orbit:
        """The orbit of the elements."""
        return self.elements.orbit((self.begin + self.end) / 2, EARTH_MU)

    def moved(self, x: FloatArray) -> LocalElements:
        """The elements for unknowns x (p,) of a path that begins with these."""
        return self.elements.moved(x[self.own] / self._displacement)

    def found(self, x: FloatArray) -> Orbit:
        """The orbit for unknowns x (p,) of a path that begins with these.

        Raises:
            InputError: it is none.
        """
        return self.moved(x).orbit((self.begin + self.end) / 2, EARTH_MU)

    def beside_linear(self, origin: float, state: FloatArray, time: FloatArray) -> Beside:
        """See `NonlinearPath`."""
        middle, whole = (self.begin + self.end) / 2, _states(self, np.concatenate([[origin], time]))
        of_motion, of_orbit = whole[:, :, : self.base.size], whole[:, :, self.own]
        transition = of_motion[1:] @ np.linalg.inv(of_motion[0])
        response = of_orbit[1:] - transition @ of_orbit[0]
        there = paths_from_chaser([self.orbit.elements], origin, state[None], time)

        def beside(states: FloatArray, unknowns: FloatArray) -> FloatArray:
            moved = (self.elements.moved(one / self._displacement) for one in unknowns)
            elements = np.array([_elements_of(one, middle) for one in moved])
            by_state = np.einsum("nij,mj->mni", transition, states - state)
            by_orbit = np.einsum("nij,mj->mni", response, unknowns)
            return np.asarray(paths_from_chaser(elements, origin, states, time) - there - by_state - by_orbit)

        return beside

    def finding(self, x: FloatArray, of_x: FloatArray) -> EstimatedOrbit:
        """The orbit, for unknowns x (p,) with their covariance (p, p)."""
        found = self.moved(x)
        shape = (of_x[self.own, self.own] / np.outer(self._displacement, self._displacement))[SHAPE, SHAPE]
        towards = found.shape[1:] / max(found.eccentricity, np.finfo(float).tiny)
        return EstimatedOrbit(
            found.period,
            found.period * float(np.sqrt(shape[0, 0])),
            found.eccentricity,
            float(np.sqrt(towards @ shape[1:, 1:] @ towards)),
        )

    @property
    def own(self) -> slice:
        """Which of the unknowns are the departures of the elements."""
        return slice(self.base.size, self.size)


def on_estimated_orbit(elements: LocalElements, x: FloatArray, begin: float, end: float) -> EstimatedOrbitPath:
    """The relative motion on the orbit of elements at the middle of begin … end in s, and on those near it.

    x (6,): of the motion on it about which a change of the gravity gradient acts. It goes on outside begin … end, where
    a smooth path that is found within would lead anywhere.

    Raises:
        InputError: an orbit that is none.
    """
    middle = (begin + end) / 2
    orbit = elements.orbit(middle, EARTH_MU)
    motion = RelativeOrbit(orbit, middle)
    neighbours = [
        [elements.moved(way * STEP * axis).orbit(middle, EARTH_MU) for way in (1, -1)] for axis in np.eye(len(NAMES))
    ]

    def gradient(orbit: Orbit, time: FloatArray) -> FloatArray:
        return gravity_gradient(orbit, target_states(orbit, time))

    def acceleration(time: FloatArray) -> FloatArray:
        pairs = ((gradient(ahead, time), gradient(behind, time)) for ahead, behind in neighbours)
        return perturbing_accelerations(pairs, STEP, motion.at(time).position(x))

    deviations = np.ones(len(NAMES))  # of rad, of the logarithm of the mean motion, and of the eccentricity
    force = Force(acceleration, NAMES, "1", deviations, longest_on(orbit, begin, end), np.zeros(0))
    return EstimatedOrbitPath(motion, force, begin, end, elements)


def _elements_of(local: LocalElements, time: float) -> tuple[float, ...]:
    """The seven elements of `Orbit` from those at a time in s; NaN of an open orbit."""
    try:
        return local.orbit(time, EARTH_MU).elements
    except InputError:
        return (np.nan,) * ELEMENT_COUNT


def _states(path: Path, time: FloatArray) -> FloatArray:
    """The Jacobian (n, 6, p) of position and velocity at times (n,) in s by a path's unknowns."""
    return np.concatenate([path.at(time).jacobian, path.rate_at(time).jacobian], axis=1)


def estimated_orbit_in(path: Path) -> EstimatedOrbitPath | None:
    """The part of a path that is a motion on an orbit that the tracks tell, if one is; its unknowns are the first."""
    return next((part for part in parts_of(path) if isinstance(part, EstimatedOrbitPath)), None)


def acting_orbit(told: Orbit | None, path: Path) -> Orbit | None:
    """The orbit whose gravity acts on a path: the one that the tracks tell, or that is given; None if there is none."""
    estimated = estimated_orbit_in(path)
    return told if estimated is None else estimated.orbit


def estimated_orbit(path: Path, x: FloatArray, of_x: FloatArray) -> tuple[EstimatedOrbit, ...]:
    """The finding of the orbit that a path lies on, if the tracks tell it.

    x (p,): the path's unknowns, of_x (p, p): their covariance.
    """
    part = estimated_orbit_in(path)
    return () if part is None else (part.finding(x, of_x),)

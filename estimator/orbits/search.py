"""The orbit on which a smooth path lies, where none is given.

Places and accelerations on the path tell places on an orbit (`elements.places_on_orbit`), from which the elements of
the greatest likelihood are sought; on each orbit the relative motion is linear in its own six unknowns. So twelve
numbers take the place of all coefficients of the path. Both are weighed by their marginal likelihoods, the orbit's by
Laplace's approximation, but for how the likelihood falls off along the principal axes of the elements: where the chaser
keeps its place in LVLH, the plane of the orbit is told by second order only, and better than its curvature says.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial import chebyshev
from numpy.polynomial.polynomial import polyfit
from numpy.typing import NDArray

from baryscope.estimator.hyperparameters.evidence import GaussianLikelihood, cost
from baryscope.estimator.orbits.elements import LocalElements, places_on_orbit
from baryscope.estimator.paths.path import SmoothPath
from baryscope.estimator.paths.relative_motion import RelativeOrbit
from baryscope.models.errors import ComputationError, InputError
from baryscope.models.orbit import EARTH_MU

FloatArray = NDArray[np.float64]

DEGREES = (3, 5, 8, 80)  # up to which coefficients tell accelerations: of higher ones noise tells more
INNER = 0.7  # of half the time span, in which they tell them
PLACES = 121  # on the orbit, from which a start follows
ARC = 0.7  # rad from the middle one, of those that tell its velocity
FEWEST = 5  # of them
MU = 1e3 * EARTH_MU  # of the search: orbits of the same rates, ten times as far from a body that has no surface
STARTS = 2  # from which the elements are sought, one after the other: the best ones
MOST_EVALUATIONS = 60  # of the residuals, from one start
WEAK = 1e-14  # information over the greatest: that of rounding
STEP = 1e-5  # of the elements, for derivatives by them
SCALE = 0.01  # of the elements, in which they are sought
FAR = 1e6  # of all residuals where there is no orbit
DEVIATIONS = 2.0  # along each principal axis of the elements, where the likelihood is looked at
GAUSSIAN = 0.5, 2.0  # of the growth of −2 ln p there over its square, where the likelihood is a Gaussian one
LEAST_GROWN = 0.25  # the same with the other elements at their best: below, a covariance claims far too much
MOST_BENT = 2.0  # of that without less that with these: a valley bends by more away from where a covariance has it


@dataclass(frozen=True, eq=False)
class OrbitFit:
    """An orbit by its elements at the middle of the time span, the unknowns x (6,) of `RelativeOrbit` from there, and
    the coefficients (p,) of that path. gain: 2 ln of the Bayes factor, the ratio of its marginal likelihood to that of
    the law of the coefficients. prior_cost: what −2 ln p is greater by where x has the prior that the law has of mean
    and first coefficients, in place of none.
    """

    elements: LocalElements
    x: FloatArray
    coefficients: FloatArray
    gain: float
    prior_cost: float


def likeliest_orbit(
    linear: GaussianLikelihood, smooth: SmoothPath, theta: FloatArray, *, gaussian: bool = True
) -> OrbitFit | None:
    """The likeliest orbit for what the tracks tell of the coefficients (p,) of a smooth path; None if none is told.

    theta (h,): the hyperparameters of the smooth path's prior; gaussian: whether the orbit has to be told as well as a
    Gaussian likelihood tells it, or better, without which gain and covariance say little.
    """
    search = _Search.of(linear, smooth)
    starts = [found for one in _starts(smooth, linear.x) if (found := search.motion_on(one)) is not None]
    for start in sorted(starts, key=lambda one: one.squares)[:STARTS]:
        best = search.refined(start)
        by_elements = search.by_elements(best)
        if by_elements is None:
            continue
        grown = search.grown(best, by_elements) if gaussian else np.ones((6, 2))
        if grown is None:
            continue
        try:
            best.elements.orbit(0.0, EARTH_MU)
        except InputError:  # below the Earth's surface
            continue
        prior_cost = best.prior_cost(float(np.exp(theta[0])))
        gain = cost(linear, smooth.prior, theta) - search.cost(best, by_elements) - prior_cost
        gain += 2 * float(np.log((1 / np.sqrt(grown)).mean(axis=-1)).sum())
        return OrbitFit(best.elements, best.x, best.coefficients, gain, prior_cost)
    return None


@dataclass(frozen=True, eq=False)
class _Motion:
    """The best relative motion on an orbit: its x (6,), columns (p, 6) of the coefficients by x, and its squares."""

    elements: LocalElements
    x: FloatArray
    columns: FloatArray
    squares: float

    @property
    def coefficients(self) -> FloatArray:
        """The coefficients (p,) of the path."""
        return np.asarray(self.columns @ self.x)

    def prior_cost(self, variance: float) -> float:
        """−2 ln of the density of x where the first coefficients are normal, of this variance in m², and the mean of
        the path is as likely anywhere.
        """
        first = self.coefficients[3:6]
        volume = -2 * float(np.linalg.slogdet(self.columns[:6])[1])
        return volume + float(first @ first) / variance + 3 * float(np.log(variance))


@dataclass(frozen=True, eq=False)
class _Search:
    """The residuals root c − target (k,) of coefficients c (p,); rest: their squares at the linearisation."""

    smooth: SmoothPath
    root: FloatArray
    target: FloatArray
    rest: float

    @classmethod
    def of(cls, linear: GaussianLikelihood, smooth: SmoothPath) -> "_Search":
        """The search by what the tracks tell of a smooth path."""
        values, axes = np.linalg.eigh(linear.information)
        told = values > WEAK * values[-1]
        root = np.sqrt(values[told])[:, None] * axes[:, told].T
        shift = axes[:, told].T @ linear.rhs / np.sqrt(values[told])
        return cls(smooth, root, root @ linear.x + shift, float(shift @ shift))

    @cached_property
    def _points(self) -> FloatArray:
        """Chebyshev's points (degree + 1,), ascending."""
        return np.asarray(chebyshev.chebpts1(self.smooth.degree + 1), dtype=np.float64)

    @cached_property
    def _coefficients(self) -> FloatArray:
        """The coefficients (degree + 1, degree + 1) of values there."""
        return np.asarray(np.linalg.inv(chebyshev.chebvander(self._points, self.smooth.degree)), dtype=np.float64)

    def motion_on(self, elements: LocalElements) -> _Motion | None:
        """The best motion on an orbit; None if it is none.

        Time 0 is the middle of the time span: an orbit whose elements are of decades ago, as where times are those of a
        clock, has a phase too coarse for difference quotients.
        """
        since_middle = (self.smooth.end - self.smooth.begin) / 2 * self._points
        try:
            moved = RelativeOrbit(elements.orbit(0.0, MU), 0.0).at(since_middle).jacobian
        except (InputError, ComputationError):
            return None
        columns = np.einsum("dn,nij->dij", self._coefficients, moved).reshape(-1, 6)
        x = np.linalg.lstsq(self.root @ columns, self.target)[0]
        residual = self.root @ (columns @ x) - self.target
        return _Motion(elements, x, columns, float(residual @ residual))

    def refined(self, start: _Motion) -> _Motion:
        """The motion of least squares near another."""
        return self._refined_along(start.elements, SCALE * np.eye(6)) or start

    def _refined_along(self, start: LocalElements, axes: FloatArray) -> _Motion | None:
        """The motion of least squares on orbits that lie along axes (6, k) from one; None of none."""
        from scipy.optimize import least_squares  # slow to load, and few commands need it

        def residuals(by: FloatArray) -> FloatArray:
            found = self.motion_on(start.moved(axes @ by))
            if found is None:
                return np.full(len(self.target), FAR * float(np.linalg.norm(self.target)))
            return self.root @ found.coefficients - self.target

        by = least_squares(residuals, np.zeros(axes.shape[1]), max_nfev=MOST_EVALUATIONS).x
        return self.motion_on(start.moved(axes @ by))

    def by_elements(self, at: _Motion) -> FloatArray | None:
        """The derivatives (k, 6) of the residuals by the elements, for a given x; None at the border of all orbits."""
        found = []
        for axis in STEP * np.eye(6):
            ahead, behind = self.motion_on(at.elements.moved(axis)), self.motion_on(at.elements.moved(-axis))
            if ahead is None or behind is None:
                return None
            found.append(self.root @ ((ahead.columns - behind.columns) @ at.x) / (2 * STEP))
        return np.stack(found, axis=1)

    def cost(self, best: _Motion, by_elements: FloatArray) -> float:
        """−2 ln of the marginal likelihood, up to the constant of `evidence.cost`, x having no prior.

        The elements are normal with a deviation of 1, of rad, of ln n and of the eccentricity.
        """
        design = np.hstack([self.root @ best.columns, by_elements])
        hessian = design.T @ design
        hessian[6:, 6:] += np.eye(6)
        return best.squares - self.rest + float(np.linalg.slogdet(hessian)[1])

    def grown(self, best: _Motion, by_elements: FloatArray) -> FloatArray | None:
        """How −2 ln p grows over how it would by its curvature (6, 2), either way along the principal axes of the
        elements, with the others at their best; None where a covariance does not hold.
        """
        by_x = self.root @ best.columns
        across = by_elements - by_x @ np.linalg.lstsq(by_x, by_elements)[0]
        values, axes = np.linalg.eigh(across.T @ across)
        if not values[0] > 0:
            return None
        deviations, grown = axes / np.sqrt(values), np.empty((6, 2))
        for index, way in np.ndindex(grown.shape):
            away = deviations[:, index] * (DEVIATIONS if way else -DEVIATIONS)
            straight = self._growth(self.motion_on(best.elements.moved(away)), best)
            grown[index, way] = straight
            if GAUSSIAN[0] <= straight <= GAUSSIAN[1]:
                continue
            others = np.delete(deviations, index, axis=1)
            grown[index, way] = self._growth(self._refined_along(best.elements.moved(away), others), best)
            if not max(LEAST_GROWN, straight - MOST_BENT) <= grown[index, way] < np.inf:
                return None
        return grown

    @staticmethod
    def _growth(found: _Motion | None, best: _Motion) -> float:
        return np.inf if found is None else (found.squares - best.squares) / DEVIATIONS**2


def _starts(smooth: SmoothPath, x: FloatArray) -> Iterator[LocalElements]:
    """Orbits that accelerations on a path tell."""
    half = (smooth.end - smooth.begin) / 2
    at = np.linspace(-INNER, INNER, PLACES)
    for degree in sorted({min(one, smooth.degree) for one in DEGREES}):
        own = x.reshape(-1, 3)[: degree + 1]
        position = np.asarray(chebyshev.chebval(at, own).T, dtype=np.float64)
        bend = np.asarray(chebyshev.chebval(at, chebyshev.chebder(own, 2)).T, dtype=np.float64)
        places = places_on_orbit(position, bend / half**2, MU)
        if places is not None:
            near = _near_the_middle(places)
            place, velocity, _ = polyfit(at[near] * half, places[near], 2)
            yield LocalElements.through(place, velocity, MU)
            yield LocalElements.of_circle(place, velocity, MU)


def _near_the_middle(places: FloatArray) -> slice:
    """Which places (k, 3) on an orbit, one beside the other, are on the arc about the middle one, or next to it."""
    middle, towards = len(places) // 2, places / np.linalg.norm(places, axis=1, keepdims=True)
    away = np.flatnonzero(towards @ towards[middle] < np.cos(ARC))
    first = max(away[away < middle], default=-1) + 1
    last = min(away[away > middle], default=len(places)) - 1
    return slice(min(first, middle - FEWEST // 2), max(last, middle + FEWEST // 2) + 1)

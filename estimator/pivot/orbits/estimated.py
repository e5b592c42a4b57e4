"""An orbit that is not given, where the path tells it."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from baryscope.estimator.hyperparameters.evidence import GaussianLikelihood, cost, maximise
from baryscope.estimator.options import PathOptions
from baryscope.estimator.orbits.elements import NAMES
from baryscope.estimator.orbits.error import InexactOrbitPath
from baryscope.estimator.orbits.estimated import EstimatedOrbitPath, estimated_orbit_in, on_estimated_orbit
from baryscope.estimator.orbits.oblateness import oblateness_in, oblateness_on
from baryscope.estimator.orbits.search import OrbitFit, likeliest_orbit
from baryscope.estimator.paths.extended_path import based_on
from baryscope.estimator.paths.forces import Force
from baryscope.estimator.paths.interpolated_path import interpolated
from baryscope.estimator.paths.path import Path, SmoothPath
from baryscope.estimator.paths.prior import Prior
from baryscope.estimator.paths.process_noise import DENSITY
from baryscope.estimator.paths.seen_path import as_seen
from baryscope.estimator.paths.trajectory import smooth_in
from baryscope.estimator.pivot.free_attitudes import linearised
from baryscope.estimator.pivot.initial_solution import InitialSolution
from baryscope.estimator.pivot.joint_covariance import SPURIOUS
from baryscope.estimator.pivot.orbits.smooth_rotation import by_smooth_rotation
from baryscope.estimator.pivot.pivot_solution import DECISIVE, PivotSolution
from baryscope.estimator.pivot.reduced import of_first, scaled
from baryscope.estimator.pivot.refinement import refined
from baryscope.estimator.pivot.unexplained import gain_over, squares_by_chance
from baryscope.models.errors import ComputationError, InputError

FloatArray = NDArray[np.float64]

CUBIC = 12.0  # unknowns of a path, of which an orbit has as many
MOST_LINEARISED = 4  # times that the path is linearised about an orbit
NEAR = 0.5  # deviations from the elements about which it is linear
UNTOLD = 0.01  # of the distance: J2 moves the target against the chaser by as much, 3 J2 of it in a radian


def with_estimated_orbit(
    found: PivotSolution, start: InitialSolution, options: PathOptions
) -> tuple[PivotSolution, InitialSolution]:
    """The solution on an orbit that a smooth path itself tells, if it is likelier there, and its start."""
    for fit in _orbits_of(found, options):
        try:
            other, fresh = _refined_on(fit, found, start, options)
        except (ComputationError, InputError):  # the latter of an orbit that is none
            continue
        if other.converged and _is_likelier(found, other, start, fit):
            return other, fresh
    return found, start


def _is_likelier(found: PivotSolution, other: PivotSolution, start: InitialSolution, fit: OrbitFit) -> bool:
    """Whether a solution on an orbit is likelier than one on a smooth path, which need not have converged."""
    if found.converged and gain_over(found, other, start) - fit.prior_cost >= DECISIVE:
        return True
    return squares_by_chance(found, other) and _gain_there(found, other, start) >= DECISIVE


def _orbits_of(found: PivotSolution, options: PathOptions) -> Iterator[OrbitFit]:
    """The orbits that a smooth path may lie on; what is asked for as a polynomial stays one.

    Near the smooth path it is known how likely the orbit is, but where most of what the tracks tell there is spurious:
    then the path follows noise of the attitudes, as none on an orbit could, and the orbit is sought without that, too.
    Where the path lies on none, it may do so but for process noise.
    """
    smooth, known = smooth_in(found.path), options.acceleration
    if smooth is None or options.trajectory is not None:
        return
    if known is not None and known.fires(smooth.begin, np.inf):  # a path on an orbit that is found knows of no thrust
        return
    if found.slip.variance > 0 or found.path_unknowns <= CUBIC:
        return
    linear, prior, theta = scaled(found.problem, found.variance), found.path.prior, found.posterior.theta
    fit, spurious = _likeliest(linear, prior, theta, smooth), False
    if fit is None or fit.gain < DECISIVE:
        spurious = found.shown_spurious_share >= SPURIOUS
        told = by_smooth_rotation(found, smooth) if spurious else None
        other = None if told is None else likeliest_orbit(told, smooth, maximise(told, smooth.prior), gaussian=False)
        if other is not None and other.gain >= DECISIVE:
            yield other
    if fit is not None and (fit.gain >= DECISIVE or spurious):
        yield fit
        return
    if (index := prior.index(DENSITY)) is not None:
        noisy = theta.copy()
        noisy[index] = max(theta[index], np.log(_density_of_oblateness(found, smooth)))
        other, price = _likeliest(linear, prior, noisy, smooth), cost(linear, prior, noisy) - cost(linear, prior, theta)
        if other is not None and other.gain - price >= DECISIVE:
            yield other


def _likeliest(linear: GaussianLikelihood, prior: Prior, theta: FloatArray, smooth: SmoothPath) -> OrbitFit | None:
    """The likeliest orbit beside the other unknowns of a path, for hyperparameters (h,), of which the smooth path's are
    the first.
    """
    own = of_first(linear, prior, theta, smooth.size)
    return likeliest_orbit(own, smooth, theta[: len(smooth.prior.hyperparameters)])


def _density_of_oblateness(found: PivotSolution, smooth: SmoothPath) -> float:
    """The density q in m²/s³ of noise that displaces a path as the Earth's J2 does: by √(q T³/3) in time T."""
    distance = np.linalg.norm(found.sampled.itself.position(found.solution.x), axis=1)
    return 3 * float(np.mean((UNTOLD * distance) ** 2)) / (smooth.end - smooth.begin) ** 3


def _refined_on(
    fit: OrbitFit, found: PivotSolution, start: InitialSolution, options: PathOptions
) -> tuple[PivotSolution, InitialSolution]:
    """The solution with the orbit's elements among the unknowns, and its start; with the Earth's J2 where that explains
    what else would be process noise.

    Raises:
        ComputationError: it diverges.
        InputError: it leads to an orbit that is none.
    """
    smooth = smooth_in(found.path)
    assert smooth is not None  # noqa: S101  on which the orbit was found
    others = found.solution.x[smooth.size :]
    at = replace(found, solution=found.solution.moved_to(np.concatenate([fit.coefficients, others])))
    orbital = on_estimated_orbit(fit.elements, fit.x, smooth.begin, smooth.end)
    x = np.concatenate([fit.x, np.zeros(len(NAMES)), others])
    plain, fresh = _until_near(based_on(found.path, orbital), x, at, start, options)
    if plain.converged and not plain.has(DENSITY):
        return plain, fresh
    try:
        oblate, other = _with_oblateness(plain, fresh, options)
    except (ComputationError, InputError):
        return plain, fresh
    likelier = oblate.converged and not (plain.converged and gain_over(plain, oblate, start) < DECISIVE)
    return (oblate, other) if likelier else (plain, fresh)


def _with_oblateness(
    found: PivotSolution, start: InitialSolution, options: PathOptions
) -> tuple[PivotSolution, InitialSolution]:
    """The solution with the Earth's J2 on an estimated orbit, and its start.

    Raises:
        ComputationError: it diverges, or the orbit is not the Earth's.
        InputError: it leads to an orbit that is none.
    """
    orbital = estimated_orbit_in(start.path)
    assert orbital is not None  # noqa: S101  on which it was found
    force = _of_oblateness(orbital, found)
    oblate = InexactOrbitPath(orbital, force, orbital.begin, orbital.end, True, float(force.deviations[0]))
    x = np.insert(found.solution.x[: start.path.size], orbital.size, 0.0)
    return _until_near(based_on(start.path, oblate, orbital), x, found, start, options)


def linearised_anew(
    found: PivotSolution, start: InitialSolution, options: PathOptions
) -> tuple[PivotSolution, InitialSolution] | None:
    """The solution on an estimated orbit, linearised about its own elements, and its start, which are those given where
    these are near; None where there is no such orbit, or it leads to none.
    """
    if estimated_orbit_in(start.path) is None:
        return None
    if _is_near(start.path, found):
        return found, start
    try:
        again = _until_near(start.path, found.solution.x[: start.path.size], found, start, options)
    except (ComputationError, InputError):
        return None
    return again if again[0].converged else None


def _until_near(
    path: Path, x: FloatArray, near: PivotSolution, start: InitialSolution, options: PathOptions
) -> tuple[PivotSolution, InitialSolution]:
    """The solution with the elements of an orbit among the unknowns, about which the path is linearised until they are
    near, and its start.

    x (p,): unknowns of the path, near: a solution there.

    Raises:
        ComputationError: it diverges.
        InputError: it leads to an orbit that is none.
    """
    for _ in range(MOST_LINEARISED):
        path, x = _about_elements_of(path, x, near)
        fresh = replace(start.on(path, interpolated(path.at, path.frequency, start.time), x), slips=False)
        near = refined(fresh.near(near), options)
        x = near.solution.x[: path.size]  # it may have more modes of noise
        if _is_near(path, near):
            break
    return near, fresh


def _is_near(path: Path, found: PivotSolution) -> bool:
    """Whether a solution's elements are near those about which a path on an estimated orbit is linear."""
    orbital = estimated_orbit_in(path)
    assert orbital is not None  # noqa: S101  as it is on one
    departures = orbital.factors(found.solution.x, found.variance * found.solution.covariance)
    return all(abs(one.value) <= NEAR * one.deviation for one in departures)


def _about_elements_of(path: Path, x: FloatArray, near: PivotSolution) -> tuple[Path, FloatArray]:
    """The path on an orbit of the elements that unknowns x (p,) have, and those of it at the same place.

    J2, if it acts, does so on that orbit, and changes the gravity gradient on the path of a solution near.

    Raises:
        ComputationError: J2 acts, but the orbit is not the Earth's.
    """
    orbital = estimated_orbit_in(path)
    assert orbital is not None  # noqa: S101  see `_until_near`
    if not x[orbital.own].any():
        return path, x
    again = on_estimated_orbit(orbital.moved(x), x[: orbital.base.size], orbital.begin, orbital.end)
    there = x.copy()
    there[orbital.own] = 0.0
    path = based_on(path, again, orbital)
    oblate = oblateness_in(path)
    if oblate is not None:
        path = based_on(path, replace(oblate, force=_of_oblateness(again, near)), oblate)
    return path, there


def _of_oblateness(orbital: EstimatedOrbitPath, near: PivotSolution) -> Force:
    """What the Earth's J2 does on an orbit, to the path of a solution near.

    Raises:
        ComputationError: the orbit is not the Earth's.
    """
    force = oblateness_on(orbital.orbit, near.position, (orbital.begin, orbital.end))
    if force is None:
        raise ComputationError("an orbit that is not the Earth's has no J2 of hers")
    return force


def _gain_there(found: PivotSolution, other: PivotSolution, start: InitialSolution) -> float:
    """2 ln of the Bayes factor of an orbit over a smooth path with bodies as they are on the orbit; −inf of none.

    With other offsets attitudes have other errors, which may make a smooth path there likelier by chance. But that a
    path of many coefficients lies on an orbit with wrong offsets would be a greater one.
    """
    smooth, orbital = smooth_in(found.path), estimated_orbit_in(other.path)
    assert smooth is not None and orbital is not None  # noqa: S101, PT018  as both were asked for
    path = based_on(other.path, smooth, orbital)
    x = np.concatenate([_coefficients(smooth, orbital, other.solution.x), other.solution.x[orbital.size :]])
    sampled = as_seen(path, interpolated(path.at, path.frequency, start.time), start.errors, x)
    problem = linearised(other.bodies, other.observations, sampled, x, other.shifts, other.offset_information)
    linear = scaled(problem, other.variance)
    theta = maximise(linear, path.prior)
    fit = _likeliest(linear, path.prior, theta, smooth)
    return -np.inf if fit is None else fit.gain


def _coefficients(smooth: SmoothPath, orbital: Path, x: FloatArray) -> FloatArray:
    """The coefficients (p,) of a smooth path through the places of another, which begins with unknowns of x (q,)."""
    at = chebyshev.chebpts1(smooth.degree + 1)
    time = (smooth.begin + smooth.end) / 2 + (smooth.end - smooth.begin) / 2 * at
    places = orbital.at(time).position(x[: orbital.size])
    return np.asarray(np.linalg.solve(chebyshev.chebvander(at, smooth.degree), places).ravel())

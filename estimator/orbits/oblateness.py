"""A relative motion on an orbit of which it is not known whether it is under the Earth's J2.

J2 is there or not: its share of the Earth's is 1 or 0. The unknown that stands for it is Gaussian, of the mean and the
deviation of a fair coin, a half each. What the tracks tell of it moves it to either side; what they do not tell stays
in the covariance of all else.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.orbits.error import InexactOrbitPath, inexact_parts, perturbing_accelerations
from baryscope.estimator.paths.extended_path import parts_of
from baryscope.estimator.paths.forces import Force, ForcedPath, longest_on
from baryscope.estimator.paths.path import Path
from baryscope.estimator.paths.relative_motion import PerturbedOrbit
from baryscope.estimator.thrust import KnownAcceleration
from baryscope.models.ephemeris.trajectory import gravity_gradient, kepler_orbit_through, target_states
from baryscope.models.orbit import Orbit

FloatArray = NDArray[np.float64]

HALF = 0.5  # of J2 where the path is linear in its share, and the deviation of that
SHARE = "share of the Earth's J2"
NAME = f"{SHARE}, above a half"


@dataclass(frozen=True, eq=False)
class EstimatedOblatenessPath(ForcedPath):
    """Relative motion on an orbit with half of J2: its share above that is an unknown, the force's.

    orbit: that with half of it; j2: all of it.
    """

    orbit: Orbit
    j2: float


def perhaps_oblate(
    plain: Orbit,
    oblate: Orbit,
    position: Callable[[FloatArray], FloatArray],
    span: tuple[float, float],
    known: KnownAcceleration | None = None,
) -> EstimatedOblatenessPath:
    """The relative motion on an orbit with an unknown share of J2, over a span (begin, end) in s.

    plain, oblate: the orbit without J2 and with it; position: times (k,) in s → the path (k, 3) in C, m, on which the
    change of the gravity gradient acts; known: the acceleration of the chaser.
    """
    assert oblate.j2 is not None  # noqa: S101  as it is the oblate one

    half, longest = replace(oblate, j2=HALF * oblate.j2), longest_on(oblate, *span)
    force = Force(_of_j2(plain, oblate, position), (NAME,), "1", np.array([HALF]), longest, np.zeros(0))
    return EstimatedOblatenessPath(PerturbedOrbit(half, sum(span) / 2, known), force, *span, half, oblate.j2)


def oblateness_on(
    orbit: Orbit, position: Callable[[FloatArray], FloatArray], span: tuple[float, float]
) -> Force | None:
    """What the Earth's J2 does to the relative motion on an orbit that is estimated, None if that is not the Earth's.

    Its share is 1 or 0, of which the mean square is a half, and what it is beside an orbit without: orbits with J2 and
    without go through the same state in the middle of the span. position: as for `perhaps_oblate`.
    """
    middle = sum(span) / 2
    plain = kepler_orbit_through(target_states(orbit, np.array([middle]))[0], 0.0, orbit.gravitational_parameter)
    oblate = plain.with_earths_j2()
    return None if oblate is None else _share_of(plain, oblate, position, span, middle)


def oblateness_beside(
    orbit: Orbit, position: Callable[[FloatArray], FloatArray], span: tuple[float, float]
) -> Force | None:
    """The same of an orbit that is told without J2: orbits with J2 and without have the elements told at time 0."""
    oblate = orbit.with_earths_j2()
    return None if oblate is None else _share_of(orbit, oblate, position, span)


def _share_of(
    plain: Orbit,
    oblate: Orbit,
    position: Callable[[FloatArray], FloatArray],
    span: tuple[float, float],
    zero: float = 0.0,
) -> Force:
    """The force whose unknown is the share of J2, of a mean square of a half; zero: time 0 of the orbits, s."""
    deviation, longest = np.array([np.sqrt(HALF)]), longest_on(oblate, *span)
    return Force(_of_j2(plain, oblate, position, zero), (SHARE,), "1", deviation, longest, np.zeros(0))


def _of_j2(
    plain: Orbit, oblate: Orbit, position: Callable[[FloatArray], FloatArray], zero: float = 0.0
) -> Callable[[FloatArray], FloatArray]:
    """What J2 does, at times in s, m/s²: on the orbit with it beside that without. zero: time 0 of both, s."""

    def acceleration(time: FloatArray) -> FloatArray:
        ahead, behind = (gravity_gradient(one, target_states(one, time - zero)) for one in (oblate, plain))
        return perturbing_accelerations([(ahead, behind)], HALF, position(time))

    return acceleration


def oblateness_in(path: Path) -> InexactOrbitPath | None:
    """The part of a path on an estimated orbit that is J2, if one is."""
    return next((part for part in inexact_parts(path) if part.force.names == (SHARE,)), None)


def perhaps_oblate_in(path: Path) -> EstimatedOblatenessPath | None:
    """The part of a path that may be under J2 or not, if one is; its unknowns are the first."""
    return next((part for part in parts_of(path) if isinstance(part, EstimatedOblatenessPath)), None)

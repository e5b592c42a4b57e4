"""What a wrong orbit does to a path: the gravity gradient acts along another trajectory of the target.

A displacement δ of the target changes the relative acceleration by (∂G/∂r · δ) p, with p the path of the centre of
mass from the chaser. δ follows the same linear equation as p. So the six components of δ and its rate at the epoch are
factors of known accelerations, once p is known to a fraction.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.paths.extended_path import parts_of
from baryscope.estimator.paths.forces import Force, ForcedPath, longest_on
from baryscope.estimator.paths.path import Path
from baryscope.estimator.paths.prior import Alternative, Hyperparameter, Prior
from baryscope.estimator.paths.relative_motion import PerturbedOrbit
from baryscope.models.ephemeris.trajectory import gravity_gradient, target_states
from baryscope.models.orbit import Orbit

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

ORBIT_ERROR = "orbit error"  # the hyperparameter: the variance of each component
NAMES = tuple(
    f"orbit {axis}{rate}" for rate in ("", " rate over mean motion") for axis in ("radial", "along", "across")
)
STEP = 1e3  # m, of the difference quotient of the gradient
UNTOLD_TURN = float(np.radians(0.2))  # of an orbit, rad, rms: each size from 1 m to GREATEST is as likely as another
LEAST = 1.0  # m, standard deviation of a component
GREATEST = float(np.radians(1.0))  # the same seen from the Earth's centre, rad: a file that is further off is another's
# A wrong period shows along the track, a hundred times more than radially after a day; a wrong plane shows across.
SHARES = np.array([0.01, 1.0, 1.0, 0.01, 0.01, 1.0])  # on a circle


@dataclass(frozen=True, eq=False)
class InexactOrbitPath(ForcedPath):
    """A path on an orbit with an error of a given size, with a push, or, where the orbit is estimated, with J2.

    told: whether its size is told, or the tracks are likelier with it, else it is the one that is likely; deviation: m,
    m/s², or a share of J2. doubtful (k,): the indices of components of which there is none in an alternative; likely:
    whether these are likelier than that, else they are the alternative.
    """

    told: bool
    deviation: float
    doubtful: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.intp))
    likely: bool = True

    @cached_property
    def own_prior(self) -> Prior:
        """The prior of the force's unknowns."""
        acting, rows = self.prior_of_force(), self.doubtful
        if not len(rows):
            return acting
        none = replace(acting, alternatives=(Alternative(rows, np.full(len(rows), -np.inf)),))
        if self.likely:
            return none
        return replace(none.instead(none.alternatives[0]), alternatives=(Alternative(rows, acting.offset[rows]),))

    def acting(self, base: Path) -> "InexactOrbitPath":
        """The same on another base, without an alternative."""
        return replace(self, base=base, doubtful=self.doubtful[:0])


def inexact_parts(path: Path) -> tuple[InexactOrbitPath, ...]:
    """The parts of a path that are errors of given sizes, from the outermost one."""
    return tuple(part for part in parts_of(path) if isinstance(part, InexactOrbitPath))


def orbit_error(
    orbit: Orbit,
    position: Callable[[FloatArray], FloatArray],
    begin: float,
    end: float,
    deviation: float | None = None,
    *,
    untold: bool = False,
) -> Force:
    """The accelerations of the centre of mass by an error of the orbit over begin … end in s.

    Their factors are the target's displacement in LVLH at the middle of the time, and its rate over the mean motion, m.
    position: times (k,) in s → the path (k, 3) in C, m. deviation: along the track, m; None: to be estimated. untold:
    what is likely of an orbit, of which the tracks say how large a share may be: shares are those on a circle then.
    """
    displaced = PerturbedOrbit(orbit, (begin + end) / 2)

    def acceleration(time: FloatArray) -> FloatArray:
        states, pairs = target_states(orbit, time), []
        for move in np.moveaxis(displaced.at(time).jacobian, 2, 0):
            ahead, behind = states.copy(), states.copy()
            ahead[:, :3] -= STEP * move  # the path of the centre of mass is against that of the chaser
            behind[:, :3] += STEP * move
            pairs.append((gravity_gradient(orbit, ahead), gravity_gradient(orbit, behind)))
        return perturbing_accelerations(pairs, STEP, position(time))

    longest, breaks = longest_on(orbit, begin, end), np.zeros(0)
    shares = SHARES if untold else shares_on(orbit, (begin + end) / 2)
    if deviation is not None:
        return Force(acceleration, NAMES, "m", deviation * shares, longest, breaks)
    greatest = GREATEST * orbit.semi_major_axis
    scale = Hyperparameter(ORBIT_ERROR, 2 * float(np.log(LEAST)), 2 * float(np.log(greatest)))
    return Force(acceleration, NAMES, "m", shares, longest, breaks, scale)


def shares_on(orbit: Orbit, moment: float) -> FloatArray:
    """The deviations (6,) of the factors of `NAMES` at a moment in s, over that of the place along the track.

    On an ellipse, a target that is early has another radius and other rates than one whose ellipse is turned in its
    plane, though both are as far along: by ṙ r/h of that, and in the rates by r̈ r/h and ∓ṙ/r, h being r² θ̇.
    """
    state = target_states(orbit, np.array([moment]))[0]
    place, velocity = state[:3], state[3:]
    r, h = float(np.linalg.norm(place)), float(np.linalg.norm(np.cross(place, velocity)))
    climb, fall = float(place @ velocity) / r, h**2 / r**3 - orbit.gravitational_parameter / r**2
    n = orbit.mean_motion
    return np.asarray(np.hypot(SHARES, [climb * r / h, 0.0, 0.0, fall * r / h / n, climb / r / n, 0.0]))


def perturbing_accelerations(
    gradients: Iterable[tuple[FloatArray, FloatArray]], step: float, position: FloatArray
) -> FloatArray:
    """Accelerations (k, 3, c) of the centre of mass in C by unit changes s of the orbit, (∂G/∂s) p, m/s².

    gradients: G (k, 3, 3), 1/s², a step ahead and one behind of each of c changes s; position (k, 3), p in C, m.
    """
    changes = ((ahead - behind) / (2 * step) for ahead, behind in gradients)
    return np.stack([np.einsum("kij,kj->ki", change, position) for change in changes], axis=2)


def with_orbit_error(
    path: Path, orbit: Orbit, position: Callable[[FloatArray], FloatArray], begin: float, end: float
) -> Path:
    """The path with an error of the orbit among its unknowns; arguments as for `orbit_error`."""
    return ForcedPath(path, orbit_error(orbit, position, begin, end), begin, end)

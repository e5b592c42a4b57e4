"""The choice of a path's model: by its name and what is known of orbit and forces."""

from dataclasses import dataclass, replace

from baryscope.estimator.camera.shared import SharedErrors
from baryscope.estimator.options import HIGHEST_DEGREE, PathOptions
from baryscope.estimator.paths.extended_path import parts_of
from baryscope.estimator.paths.forces import ForcedPath, PushedPath, ThrustedPath, constant_of, firings_of, thrust_of
from baryscope.estimator.paths.path import FIXED, Path, Polynomial, SmoothPath
from baryscope.estimator.paths.process_noise import disturbed
from baryscope.estimator.paths.relative_motion import PerturbedOrbit, RelativeOrbit
from baryscope.estimator.paths.seen_path import SeenPath
from baryscope.estimator.thrust import KnownAcceleration
from baryscope.models.errors import InputError
from baryscope.models.orbit import Orbit

# Of a smooth path: the first is enough for half a turn of a circle to 1e-14 of its radius, for three to 1e-3.
SMOOTH_DEGREES = (20, 40, 80)
TRAJECTORIES = "fixed, polynomial, polynomial:N or relative-orbit"


@dataclass(frozen=True)
class Trajectory:
    """The chosen model of the path: its kind, and the degree of a polynomial, None if the data choose it.

    highest: the degree up to which a smooth path has coefficients.
    """

    kind: str
    degree: int | None = None
    highest: int = SMOOTH_DEGREES[0]

    def path(
        self, orbit: Orbit | None, begin: float, end: float, acceleration: KnownAcceleration | None = None
    ) -> Path:
        """The path over begin … end in s; a polynomial without a given degree is a smooth path."""
        if self.kind == "relative-orbit" and orbit is not None:
            if not orbit.j2 and orbit.ephemeris is None and acceleration is None:
                return RelativeOrbit(orbit, (begin + end) / 2)
            return PerturbedOrbit(orbit, (begin + end) / 2, acceleration)
        path = SmoothPath(self.highest, begin, end) if self.degree is None else Polynomial(self.degree, begin, end)
        return path if acceleration is None else ThrustedPath(path, acceleration, orbit, begin, end)


def chosen_path(
    options: PathOptions,
    orbit: Orbit | None,
    begin: float,
    end: float,
    errors: SharedErrors | None = None,
    highest: int = SMOOTH_DEGREES[0],
) -> Path:
    """The path over begin … end in s, with the forces and the process noise of the options, and a camera's errors.

    highest: the degree up to which a smooth path has coefficients.

    Raises:
        InputError: an unknown trajectory, a degree out of range, accelerations of a fixed point, or what is asked for
            needs an orbit or its epoch.
    """
    trajectory, known = replace(trajectory_of(options.trajectory, orbit), highest=highest), options.acceleration
    if trajectory.degree == 0 and (known is not None or options.constant_acceleration != "none"):
        name = "constant_acceleration" if known is None else "acceleration"
        raise InputError(f"{name}: found with a fixed trajectory, expected one on which something moves")
    path = trajectory.path(orbit, begin, end, known)
    if errors is not None and len(errors.deviations):
        path = SeenPath(path, errors)
    if known is not None and known.scale > 0:
        path = ForcedPath(path, thrust_of(known, orbit, begin, end), begin, end)
    if known is not None and known.firing > 0 and known.fires(begin, end):
        path = ForcedPath(path, firings_of(known, orbit, begin, end), begin, end)
    if options.constant_acceleration != "none":
        path = PushedPath(path, constant_of(options.constant_acceleration, orbit, begin, end), begin, end)
    return disturbed(path, options.process_noise, begin, end, 0.0 if known is None else known.noise)


def highest_degree(path: Path) -> int:
    """The degree up to which the smooth part of a path has coefficients; the first of all if it has none."""
    smooth = smooth_in(path)
    return SMOOTH_DEGREES[0] if smooth is None else smooth.degree


def smooth_in(path: Path) -> SmoothPath | None:
    """The part of a path that is smooth, if one is; its hyperparameters are the first."""
    return next((part for part in parts_of(path) if isinstance(part, SmoothPath)), None)


def trajectory_of(text: str | None, orbit: Orbit | None) -> Trajectory:
    """The trajectory named `fixed`, `polynomial`, `polynomial:N` or `relative-orbit`.

    None means `relative-orbit` if there is an orbit, else `polynomial`.

    Raises:
        InputError: an unknown name, a degree out of range, or relative motion without an orbit.
    """
    if text is None:
        return Trajectory("polynomial" if orbit is None else "relative-orbit")
    if text == "relative-orbit" and orbit is None:
        raise InputError("trajectory is relative-orbit, which needs the target's orbit; expected an orbit")
    if text == FIXED:
        return Trajectory("polynomial", 0)
    kind, _, number = text.partition(":")
    if text in ("polynomial", "relative-orbit"):
        return Trajectory(kind)
    if kind != "polynomial" or not number.isdecimal():
        raise InputError(f"trajectory is {text!r}, expected {TRAJECTORIES}")
    if len(number) > 9 or int(number) > HIGHEST_DEGREE:
        raise InputError(f"trajectory is {text!r}, expected a degree of 0 to {HIGHEST_DEGREE}")
    return Trajectory("polynomial", int(number))

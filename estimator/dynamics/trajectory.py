"""The choice of a path's model: by its name and what is known of orbit and forces."""

from dataclasses import dataclass

from baryscope.estimator.dynamics.paths import FIXED, Path, Polynomial, Smooth
from baryscope.estimator.dynamics.relative_motion import PerturbedOrbit, RelativeOrbit
from baryscope.estimator.options import HIGHEST_DEGREE
from baryscope.models.errors import InputError
from baryscope.models.orbit import Orbit

SMOOTH_DEGREE = 20  # of a smooth path: enough for half a turn of a circle to 1e-14 of its radius, for three to 1e-3
TRAJECTORIES = "fixed, polynomial, polynomial:N or relative-orbit"


@dataclass(frozen=True)
class Trajectory:
    """The chosen model of the path: its kind, and the degree of a polynomial, None if the data choose it."""

    kind: str
    degree: int | None = None

    def path(self, orbit: Orbit | None, begin: float, end: float) -> Path:
        """The path over begin … end in s; a polynomial without a given degree is a smooth path."""
        if self.kind == "relative-orbit" and orbit is not None:
            model = RelativeOrbit if orbit.j2 is None and orbit.ephemeris is None else PerturbedOrbit
            return model(orbit, (begin + end) / 2)
        return Smooth(SMOOTH_DEGREE, begin, end) if self.degree is None else Polynomial(self.degree, begin, end)


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

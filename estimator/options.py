"""The options of each family of methods; the data choose those that are None."""

from dataclasses import dataclass
from typing import Literal

from baryscope.estimator.limits import COARSEST, FINEST, LATEST, SHORTEST_STEP
from baryscope.models.errors import InputError

Reference = Literal["mean", "first"]
Axes = Literal["inertial", "lvlh"]
Noise = Literal["stereo", "fixed"]
Torque = Literal["none", "gravity-gradient"]

HIGHEST_DEGREE = 20  # of a polynomial path
LOWEST_CUTOFF = 1 / LATEST  # Hz


@dataclass(frozen=True)
class ScrewOptions:
    """lag between the two poses of a screw in s; cutoff of the low-pass in Hz (math.inf: none); degree of the
    polynomial in time; axes in which the tracks are registered; reference of the Procrustes registration.

    Raises:
        InputError: an invalid value.
    """

    lag: float | None = None
    cutoff: float | None = None
    degree: int | None = None
    axes: Axes = "inertial"
    reference: Reference = "mean"

    def __post_init__(self) -> None:
        if self.lag is not None and not (SHORTEST_STEP <= self.lag <= LATEST):
            raise InputError(f"lag is {self.lag}, expected {SHORTEST_STEP:g} to {LATEST:g} s")
        if self.cutoff is not None and not self.cutoff >= LOWEST_CUTOFF:
            raise InputError(f"cutoff is {self.cutoff}, expected a frequency of at least {LOWEST_CUTOFF:g} Hz")
        if self.degree is not None and not 0 <= self.degree <= HIGHEST_DEGREE:
            raise InputError(f"degree is {self.degree}, expected 0 to {HIGHEST_DEGREE}")
        _check_one_of("axes", self.axes, ("inertial", "lvlh"))
        _check_one_of("reference", self.reference, ("mean", "first"))


@dataclass(frozen=True)
class PathOptions:
    """trajectory of the CoM: fixed, polynomial, polynomial:N or relative-orbit; sigma: the known standard deviation of
    a coordinate in m, or a factor on the standard deviations if the tracks have covariances; noise: whether the given
    covariances depend on the range (stereo) or not (fixed); torque on the target, for `ml` and `ekf`.

    None means: relative-orbit if an orbit is given, else a polynomial whose degree the data choose; sigma from the
    residuals; the torque that fits the tracks better.

    Raises:
        InputError: an invalid value.
    """

    trajectory: str | None = None
    sigma: float | None = None
    noise: Noise = "stereo"
    torque: Torque | None = None

    def __post_init__(self) -> None:
        if self.sigma is not None and not (FINEST <= self.sigma <= COARSEST):
            raise InputError(f"sigma is {self.sigma}, expected a standard deviation of {FINEST:g} to {COARSEST:g} m")
        _check_one_of("noise", self.noise, ("stereo", "fixed"))
        _check_one_of("torque", self.torque, (None, "none", "gravity-gradient"))


Options = ScrewOptions | PathOptions


def _check_one_of(name: str, value: object, known: tuple[object, ...]) -> None:
    if value not in known:
        raise InputError(f"{name} is {value!r}, expected one of {', '.join(str(item) for item in known if item)}")

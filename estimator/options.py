"""The options of each family of methods; the data choose those that are None."""

import math
from dataclasses import dataclass
from typing import Literal, get_args

from baryscope.estimator.limits import COARSEST, FINEST, LATEST, SHORTEST_STEP
from baryscope.estimator.thrust import KnownAcceleration
from baryscope.models.arguments import number_within
from baryscope.models.errors import InputError
from baryscope.models.orbit import Orbit

Reference = Literal["mean", "first"]
Axes = Literal["inertial", "lvlh"]
Noise = Literal["auto", "stereo", "fixed"]
ConstantAxes = Literal["none", "lvlh", "inertial", "drag", "sun"]
Burns = Literal["auto", "none"]
Torque = Literal["none", "gravity-gradient"]
DensityWord = Literal["auto", "none"]
Density = float | DensityWord

HIGHEST_DEGREE = 20  # of a polynomial path
DENSEST = 1e6  # m²/s³ or rad²/s³: a kilometre per second after a second
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
        for name, low, high, expected in (
            ("lag", SHORTEST_STEP, LATEST, f"{SHORTEST_STEP:g} to {LATEST:g} s"),
            ("cutoff", LOWEST_CUTOFF, math.inf, f"a frequency of at least {LOWEST_CUTOFF:g} Hz"),
            ("degree", 0, HIGHEST_DEGREE, f"a whole number, 0 to {HIGHEST_DEGREE}"),
        ):
            _keep(self, name, low, high, expected)
        if self.degree is not None:
            if self.degree != int(self.degree):
                raise InputError(f"degree is {self.degree}, expected a whole number, 0 to {HIGHEST_DEGREE}")
            object.__setattr__(self, "degree", int(self.degree))
        _check_one_of("axes", self.axes, get_args(Axes))
        _check_one_of("reference", self.reference, get_args(Reference))


@dataclass(frozen=True)
class PathOptions:
    """trajectory of the CoM: fixed, polynomial, polynomial:N or relative-orbit; sigma: the known standard deviation of
    a coordinate in m, or a factor on the standard deviations if the tracks have covariances; noise: whether the given
    covariances depend on the measured range (stereo) or not (fixed), or whether they themselves tell (auto); torque on
    the target, for `ml` and `ekf`.

    process_noise: density of the white acceleration on the path, m²/s³, or, of a fixed one, the variance of the white
    noise of its position, m², as of a pivot that slips; torque_noise: density of the white angular
    acceleration of the target, rad²/s³, for `ml` and `ekf`. auto: estimated from the tracks; none: the models hold
    exactly, but for the orbit's accuracy where it is told, and for the Earth's J2 where the tracks tell the orbit.

    acceleration: of the chaser, as its thrusters' log tells, for `pivot`, `ml` and, if it is exact or its noise white,
    `ekf`; constant_acceleration: an
    unknown one of the target less the chaser, in LVLH or inertial axes, against the target's way through the air, away
    from the Sun, or none, for `pivot` and `ml`.

    None means: relative-orbit if an orbit is given, or if the tracks tell one, else polynomial; sigma from the
    residuals; the likelier torque, with `ml` with both in the covariance where tracks do not decide.

    Raises:
        InputError: an invalid value.
    """

    trajectory: str | None = None
    sigma: float | None = None
    noise: Noise = "auto"
    torque: Torque | None = None
    process_noise: Density = "auto"
    torque_noise: Density = "auto"
    acceleration: KnownAcceleration | None = None
    constant_acceleration: ConstantAxes = "none"
    unknown_burns: Burns = "auto"

    def __post_init__(self) -> None:
        if not isinstance(self.trajectory, str | None):
            raise InputError(f"trajectory is {self.trajectory!r}, expected a text as polynomial:2")
        _keep(self, "sigma", FINEST, COARSEST, f"a standard deviation of {FINEST:g} to {COARSEST:g} m")
        _check_one_of("noise", self.noise, get_args(Noise))
        _check_one_of("torque", self.torque, (None, *get_args(Torque)))
        _check_one_of("constant_acceleration", self.constant_acceleration, get_args(ConstantAxes))
        _check_one_of("unknown_burns", self.unknown_burns, get_args(Burns))
        if not isinstance(self.acceleration, KnownAcceleration | None):
            raise InputError(f"acceleration: found {type(self.acceleration).__name__}, expected KnownAcceleration")
        for name, unit in (("process_noise", "m²/s³, of a fixed path m²"), ("torque_noise", "rad²/s³")):
            if isinstance(getattr(self, name), str):
                _check_one_of(name, getattr(self, name), get_args(DensityWord))
            else:
                expected = f"auto, none or a density above 0 to {DENSEST:g} {unit}"
                _keep(self, name, math.ulp(0.0), DENSEST, expected, optional=False)


Options = ScrewOptions | PathOptions


def torques_of(orbit: Orbit | None, options: PathOptions) -> tuple[Orbit | None, ...]:
    """The orbits whose gravity-gradient torque is tried; None is no torque.

    Raises:
        InputError: a gravity gradient without an orbit.
    """
    if options.torque == "gravity-gradient" and orbit is None:
        raise InputError("torque is gravity-gradient, which needs the target's orbit; expected an orbit")
    if orbit is None or options.torque == "none":
        return (None,)
    return (orbit,) if options.torque == "gravity-gradient" else (None, orbit)


def refuse_forces(options: PathOptions, method: str) -> None:
    """Refuse accelerations for a method that has none.

    Raises:
        InputError: there is one.
    """
    if options.acceleration is not None:
        raise InputError(f"acceleration: found with {method}, expected pivot, ml or ekf")
    if options.constant_acceleration != "none":
        raise InputError(f"constant_acceleration: found with {method}, expected pivot or ml")


def _keep(options: Options, name: str, low: float, high: float, expected: str, *, optional: bool = True) -> None:
    """Keep a number of the options as a float, if it is from `low` to `high`, or None where it is optional."""
    value = getattr(options, name)
    if value is not None or not optional:
        object.__setattr__(options, name, number_within(name, value, low, high, expected))


def _check_one_of(name: str, value: object, known: tuple[object, ...]) -> None:
    if not isinstance(value, str | None) or value not in known:
        raise InputError(f"{name} is {value!r}, expected one of {', '.join(str(item) for item in known if item)}")

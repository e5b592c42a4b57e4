"""A push of the target less the chaser that nobody tells, as an unknown of the path: drag, light, a leak.

Drag varies with the density of the air, which is greater by day than by night, and light with the attitude and in the
Earth's shadow: so a push has a constant part, and waves of the orbit's frequency and of twice that, which are smaller
by given ratios.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.findings import PushAxes, UnknownPush
from baryscope.estimator.options import PathOptions
from baryscope.estimator.paths.extended_path import parts_of
from baryscope.estimator.paths.forces import BROAD, SPAN_TIMES, VARIES, Force, ForcedPath, PushedPath, constant_of
from baryscope.estimator.paths.path import Path
from baryscope.estimator.paths.prior import Hyperparameter
from baryscope.estimator.paths.process_noise import ProcessNoisePath
from baryscope.models.ephemeris.trajectory import lvlh_axes, target_states
from baryscope.models.orbit import EARTH_RADIUS, Orbit

FloatArray = NDArray[np.float64]

UNTOLD_LIGHT = 1e-7  # m/s²: as light is on one body more than on another, in any orbit
# What drag is at an altitude on bodies that differ by 0.02 m²/kg, and the scale height there (Vallado 2013, table 8-4).
UNTOLD_DRAG, ALTITUDE, SCALE_HEIGHT = 1e-6, 450e3, 61e3  # m/s², m
MOST_PUSH = 1e-5  # m/s², where nothing stays for long
# Shares of waves in a push, both phases together, as of density that is twice as great at the most as at the least: if
# its logarithm is a wave of κ = 1/3, it has one of twice the frequency, of κ²/4.
WAVES = {"cosine": 1 / 3, "sine": 1 / 3, "cosine of twice the arc": 1 / 36, "sine of twice the arc": 1 / 36}
PUSH, LEAST_PUSH = "push", 1e-9  # the hyperparameter: the variance of each component; m/s², the least deviation


@dataclass(frozen=True, eq=False)
class UnknownPushPath(PushedPath):
    """A path with a push that nobody tells.

    axes: in which its constant part has a constant direction, and of its components; sun: away from the Sun, and none
    in the Earth's shadow. constants: how many of the force's unknowns that part has, the first ones.
    """

    axes: PushAxes
    constants: int

    def of_size(self, base: Path, theta: float) -> "UnknownPushPath":
        """The push on another base, of a known size: theta, the logarithm of the variance of its components."""
        known = replace(self.force, deviations=float(np.exp(theta / 2)) * self.force.deviations, scale=None)
        return replace(self, base=base, force=known)

    def finding(self, x: FloatArray, of_x: FloatArray) -> UnknownPush:
        """The constant part of the push, for unknowns x (p,) with their covariance (p, p)."""
        constant = self.factors(x, of_x)[: self.constants]
        return UnknownPush(self.axes, tuple(one.value for one in constant), tuple(one.deviation for one in constant))


def untold_push(orbit: Orbit) -> float:
    """The deviation of a constant acceleration of the target less the chaser that nobody tells, m/s²."""
    altitude = orbit.semi_major_axis * (1 - orbit.eccentricity) - EARTH_RADIUS
    drag = UNTOLD_DRAG * float(np.exp((ALTITUDE - altitude) / SCALE_HEIGHT)) if orbit.is_the_earths else 0.0
    return UNTOLD_LIGHT + min(drag, MOST_PUSH)


def may_be_pushed(path: ProcessNoisePath, options: PathOptions) -> bool:
    """Whether a push may act beside a path: none is told or found, nor process noise given, which stands for all."""
    return options.constant_acceleration == "none" and path.density is None and unknown_push_in(path) is None


def untold_push_beside(path: ProcessNoisePath, orbit: Orbit, options: PathOptions) -> ForcedPath | None:
    """A path's base with a constant push of the size that is likely where nobody tells one; None where none may act."""
    if not may_be_pushed(path, options):
        return None
    pushed = constant_of("lvlh", orbit, path.begin, path.end)
    push = replace(pushed, deviations=np.full(len(pushed.names), untold_push(orbit)))
    return ForcedPath(path.base, push, path.begin, path.end)


def with_any_push(path: Path, orbit: Orbit, begin: float, end: float) -> tuple[UnknownPushPath, ...]:
    """The path over begin … end in s with a push in LVLH, in C, or by light, where it is known where the Sun is.

    Of each, any size up to that of one that is told to be estimated is as likely as another.
    """
    scale = Hyperparameter(PUSH, 2 * float(np.log(LEAST_PUSH)), 2 * float(np.log(BROAD)))
    known: tuple[PushAxes, ...] = ("lvlh", "inertial") if orbit.epoch is None else ("lvlh", "inertial", "sun")
    found = []
    for axes in known:
        constant = constant_of(axes, orbit, begin, end)
        count = len(constant.names)
        force = constant if axes == "sun" else _varying(constant, orbit, begin, end)
        sizes = np.repeat([1.0, *(share / np.sqrt(2) for share in WAVES.values())], count)[: len(force.names)]
        found.append(UnknownPushPath(path, replace(force, deviations=sizes, scale=scale), begin, end, axes, count))
    return tuple(found)


def _varying(force: Force, orbit: Orbit, begin: float, end: float) -> Force:
    """The force, and the same times the waves of the arc since begin, less what these are on average until end.

    begin, end: s. So what it is itself is the mean over that time.
    """
    to_begin = lvlh_axes(target_states(orbit, np.array([begin])))[0, :, :2]

    def waves(time: FloatArray) -> FloatArray:
        place = target_states(orbit, time)[:, :3]
        cosine, sine = (place @ to_begin / np.linalg.norm(place, axis=1, keepdims=True)).T
        return np.stack([cosine, sine, cosine**2 - sine**2, 2 * cosine * sine], axis=1)

    mean = waves(np.linspace(begin, end, SPAN_TIMES)).mean(axis=0)

    def acceleration(time: FloatArray) -> FloatArray:
        own, wave = force.acceleration(time), waves(time) - mean
        varying = own[:, :, None, :] * wave[:, None, :, None]
        return np.concatenate([own, varying.reshape(*own.shape[:2], -1)], axis=2)

    names = tuple(f"{VARIES} {name}, {wave}" for wave in WAVES for name in force.names)
    return replace(force, acceleration=acceleration, names=force.names + names)


def unknown_push_in(path: Path) -> UnknownPushPath | None:
    """The part of a path that has a push that nobody tells, if one has."""
    return next((part for part in parts_of(path) if isinstance(part, UnknownPushPath)), None)


def unknown_push(path: Path, x: FloatArray, of_x: FloatArray) -> tuple[UnknownPush, ...]:
    """The finding of a push on a path, if it has one; x (p,): the path's unknowns, of_x (p, p): their covariance."""
    part = unknown_push_in(path)
    return () if part is None else (part.finding(x, of_x),)

"""What known or constant accelerations do to a path: its response to them, and unknown factors on it.

The centre of mass is seen from the chaser, so it accelerates against the chaser's thrust. On an orbit the response
follows the gravity gradient; without one it is free flight.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.options import ConstantAxes
from baryscope.estimator.paths.extended_path import ExtendedPath, Factor, named_factors, parts_of
from baryscope.estimator.paths.linear_motion import (
    ARC,
    Acceleration,
    Integrations,
    LinearMotion,
    Motion,
    Panels,
    forced,
)
from baryscope.estimator.paths.path import Path
from baryscope.estimator.paths.prior import Hyperparameter, Prior
from baryscope.estimator.paths.relative_motion import PerturbedOrbit, bend, orbit_in
from baryscope.estimator.paths.sampled_path import SampledPath
from baryscope.estimator.thrust import KnownAcceleration
from baryscope.models.ephemeris.sun import sun_direction, sunlit
from baryscope.models.ephemeris.trajectory import lvlh_axes, target_states
from baryscope.models.ephemeris.utc import utc_of
from baryscope.models.errors import InputError
from baryscope.models.orbit import EARTH_RADIUS, EARTH_ROTATION_RATE, Orbit

FloatArray = NDArray[np.float64]

BROAD = 1e-4  # m/s², of an unknown constant acceleration: more than drag does above 200 km, or light anywhere
SPAN_TIMES = 65  # at which the rms displacement of a response is taken
PENUMBRA = 5.0  # s, in which the light changes so little that a response can be integrated over it
TURN = 8 * ARC  # rad of the highest wave of a response in the time over which the accelerations are smooth
UNIT = "m/s²"
VARIES = "variation of the"  # names of factors begin so that are those of a force's changes


@dataclass(frozen=True, eq=False)
class Force:
    """Accelerations of the centre of mass in C, each times an unknown factor, and how fast they change.

    acceleration: times (k,) in s → (k, 3, c), m/s² per unit of the factor; names (c,), and unit of the factors;
    deviations (c,): of their prior, in that unit, times the root of the hyperparameter `scale` if there is one;
    longest: s, over which the accelerations are smooth; breaks (m,): s, at which they jump.
    """

    acceleration: Acceleration
    names: tuple[str, ...]
    unit: str
    deviations: FloatArray
    longest: float
    breaks: FloatArray
    scale: Hyperparameter | None = None

    @property
    def frequency(self) -> float:
        """The highest angular frequency of the response, rad/s; infinite if the accelerations jump."""
        return np.inf if self.breaks.size else TURN / self.longest


@dataclass(frozen=True, eq=False)
class ForcedPath(ExtendedPath):
    """A path with the response to a force: the unknowns of `base`, and those of the force.

    A force's unknown is the rms displacement it causes over begin … end, in m. The response begins at rest in the
    middle.
    """

    force: Force
    begin: float
    end: float

    @property
    def size(self) -> int:
        """The number of unknowns."""
        return self.base.size + len(self.force.names)

    @cached_property
    def prior(self) -> Prior:
        """The prior of the base, and that of the force's unknowns."""
        return self.base.prior.joined(self.own_prior)

    @cached_property
    def own_prior(self) -> Prior:
        """The prior of the force's unknowns."""
        return self.prior_of_force()

    def prior_of_force(self) -> Prior:
        """The prior of the force's unknowns by its deviations."""
        own = Prior.known((self.force.deviations * self._displacement) ** 2)
        if self.force.scale is None:
            return own
        return Prior(own.offset, np.ones((len(own.offset), 1)), (self.force.scale,))

    @property
    def frequency(self) -> float:
        """The frequency of the base or of the response; see `Path`."""
        return max(self.base.frequency, self.force.frequency)

    def at(self, time: FloatArray) -> SampledPath:
        """The path at times (n,) in s."""
        return self.base.at(time).extended(self.columns(time))

    def columns(self, time: FloatArray) -> FloatArray:
        """What the force's unknowns move the path by at times (n,) in s, (n, 3, c), m for each metre."""
        return self.response(time).position(time) / self._displacement

    def rate_at(self, time: FloatArray) -> SampledPath:
        """The velocity at times (n,) in s."""
        return self.base.rate_at(time).extended(self.response(time).velocity(time) / self._displacement)

    def factors(self, x: FloatArray, of_x: FloatArray) -> tuple[Factor, ...]:
        """The estimated factors from x and its covariance, in which the force's unknowns follow the base's."""
        own = slice(self.base.size, self.size)
        values = x[own] / self._displacement
        deviations = np.sqrt(np.diag(of_x)[own]) / self._displacement
        return named_factors(self.force.names, (self.force.unit,) * len(values), values, deviations)

    @cached_property
    def _displacement(self) -> FloatArray:
        """The rms displacement (c,) for a factor of 1, m; 1 where there is none."""
        time = np.linspace(self.begin, self.end, SPAN_TIMES)
        rms = np.sqrt(np.mean(np.sum(self.response(time).position(time) ** 2, axis=1), axis=0))
        return np.where(rms > 0, rms, 1.0)

    def response(self, time: FloatArray) -> Motion:
        """The response over the times (n,) to factors of 1, computed once for all that lie within begin … end."""
        return self._over(time)[1]

    def _over(self, time: FloatArray) -> tuple[LinearMotion, Motion]:
        """The equation of motion over the times (n,), and the response."""
        return self._integrations.over(time)

    @cached_property
    def _integrations(self) -> Integrations[tuple[LinearMotion, Motion]]:
        return Integrations(self._integrated, self.begin, self.end)

    def _integrated(self, time: FloatArray) -> tuple[LinearMotion, Motion]:
        force, epoch = self.force, (self.begin + self.end) / 2
        panels = Panels.over(time, epoch, force.longest, force.breaks)
        equation = LinearMotion.over(panels, self.base.gravity_gradient)
        return equation, equation.forced(force.acceleration(panels.points))


@dataclass(frozen=True, eq=False)
class PushedPath(ForcedPath):
    """A path with the response to a force that may lead far from it, as a constant push of hours: it is no longer
    linear in the factors, as gravity there differs from what its gradient tells.
    """

    def at(self, time: FloatArray) -> SampledPath:
        """The path at times (n,) in s."""
        return self._bent(super().at(time), time, Motion.position)

    def rate_at(self, time: FloatArray) -> SampledPath:
        """The velocity at times (n,) in s."""
        return self._bent(super().rate_at(time), time, Motion.velocity)

    def _bent(
        self, linear: SampledPath, time: FloatArray, seen: Callable[[Motion, FloatArray], FloatArray]
    ) -> SampledPath:
        """What is linear in the factors, with what gravity adds beyond its gradient."""
        orbit, size = orbit_in(self.base), self.base.size
        if orbit is None:
            return linear
        equation, response = self._over(time)
        before, columns = self.base.at(equation.panels.points), response.at_points / self._displacement
        columns = columns.reshape(-1, 3, self.size - size)

        def position(x: FloatArray) -> FloatArray:
            origin = before.position(x[:size])
            return linear.position(x) + seen(bend(equation, orbit, origin, origin + columns @ x[size:]), time)[:, :, 0]

        return SampledPath(linear.jacobian, position)


@dataclass(frozen=True, eq=False)
class ThrustedPath(ExtendedPath):
    """A polynomial path on which the chaser's known acceleration acts: it departs from `base` by the response.

    The response begins at rest in the middle of begin … end. orbit: for LVLH axes.
    """

    known: KnownAcceleration
    orbit: Orbit | None
    begin: float
    end: float

    @property
    def frequency(self) -> float:
        """Infinite: accelerations may jump."""
        return np.inf

    def at(self, time: FloatArray) -> SampledPath:
        """The path at times (n,) in s."""
        return self.base.at(time).moved(self._forced.response(time).position(time)[:, :, 0])

    def rate_at(self, time: FloatArray) -> SampledPath:
        """The velocity at times (n,) in s."""
        return self.base.rate_at(time).moved(self._forced.response(time).velocity(time)[:, :, 0])

    @cached_property
    def _forced(self) -> ForcedPath:
        """The path with the acceleration's response as an unknown."""
        return ForcedPath(self.base, thrust_of(self.known, self.orbit, self.begin, self.end), self.begin, self.end)


def thrust_of(known: KnownAcceleration, orbit: Orbit | None, begin: float, end: float) -> Force:
    """The chaser's known acceleration over begin … end in s, times the unknown error of its scale."""
    return Force(
        lambda time: -known.inertial(time, orbit)[:, :, None],
        ("acceleration scale",),
        "1",
        np.array([known.scale]),
        min(longest_on(orbit, begin, end), known.smooth_for(begin, end)),
        known.time,
    )


def firings_of(known: KnownAcceleration, orbit: Orbit | None, begin: float, end: float) -> Force:
    """The errors of each firing over begin … end in s: a vector in the log's axes, relative to the magnitude."""
    firing = known.firings(begin, end)
    count, size = int(firing.max(initial=-1)) + 1, np.linalg.norm(known.value, axis=1)
    starts = [float(known.time[int(np.argmax(firing == one))]) for one in range(count)]

    def acceleration(time: FloatArray) -> FloatArray:
        row = known.held_at(time)
        active = np.flatnonzero(np.where(row >= 0, firing[row], -1) >= 0)
        found = np.zeros((len(time), 3, count, 3))
        if active.size:
            rows = row[active]
            found[active, :, firing[rows]] = -size[rows, None, None] * known.axes_at(time[active], orbit)
        return found.reshape(len(time), 3, 3 * count)

    names = tuple(f"error of the firing from {start:g} s, {axis}" for start in starts for axis in "xyz")
    deviations = np.full(3 * count, known.firing)
    longest = min(longest_on(orbit, begin, end), known.smooth_for(begin, end))
    return Force(acceleration, names, "1", deviations, longest, known.time)


def untold_firings(path: Path, begin: float, end: float, time: FloatArray) -> FloatArray:
    """The covariance (n, 6, 6) of position and velocity in C by errors of firings before `begin` and after `end`.

    Tracks from begin to end, s, tell nothing of them; between these it is zero. time (n,) in s.
    """
    found = np.zeros((len(time), 6, 6))
    told = next((part for part in parts_of(path) if isinstance(part, PerturbedOrbit | ThrustedPath)), None)
    first, last = min(begin, float(time.min())), max(end, float(time.max()))
    if told is None or told.known is None or told.known.firing == 0 or (first == begin and last == end):
        return found
    others = told.known.besides(begin, end)
    if (others.firings(first, last) >= 0).any():
        force, middle = firings_of(others, told.orbit, first, last), (begin + end) / 2
        motion = forced(time, middle, path.gravity_gradient, force.acceleration, force.longest, force.breaks)
        columns = np.concatenate([motion.position(time), motion.velocity(time)], axis=1) * force.deviations
        found += columns @ np.swapaxes(columns, 1, 2)
    return found


def lasting(path: Path, variance: float, begin: float, end: float, time: FloatArray) -> FloatArray:
    """The covariance (n, 6, 6) of position and velocity in C by an acceleration that lasts before `begin` and after
    `end`, of a variance of each coordinate, (m/s²)².

    It keeps its direction in C, as light pressure does, or on an orbit as probably in LVLH, as drag does. Between begin
    and end it is zero. time (n,) in s.
    """
    found, orbit = np.zeros((len(time), 6, 6)), orbit_in(path)
    if variance == 0:
        return found

    def fixed(at: FloatArray) -> FloatArray:
        in_C = np.broadcast_to(np.eye(3), (len(at), 3, 3))
        if orbit is None:
            return in_C
        return np.asarray(np.concatenate([in_C, lvlh_axes(target_states(orbit, at))], axis=2) / np.sqrt(2))

    for edge, outside in ((begin, time < begin), (end, time > end)):
        if outside.any():
            away = time[outside]
            longest = longest_on(orbit, float(away.min(initial=edge)), float(away.max(initial=edge)))
            motion = forced(away, edge, path.gravity_gradient, fixed, longest, np.zeros(0))
            columns = np.concatenate([motion.position(away), motion.velocity(away)], axis=1)
            found[outside] = variance * columns @ np.swapaxes(columns, 1, 2)
    return found


def constant_of(axes: ConstantAxes, orbit: Orbit | None, begin: float, end: float) -> Force:
    """An unknown constant acceleration of the target less that of the chaser, by axes.

    lvlh, inertial: its three components in these axes; drag: against the target's velocity through air that turns with
    the Earth; sun: away from the Sun, and none in the Earth's shadow.

    Raises:
        InputError: no orbit, or none with an epoch for the Sun.
    """
    if orbit is None:
        raise InputError(f"constant_acceleration is {axes}, which needs the target's orbit; expected an orbit")
    longest = longest_on(orbit, begin, end)
    if axes == "lvlh":
        names = ("radial acceleration", "along-track acceleration", "cross-track acceleration")
        return Force(
            lambda time: lvlh_axes(target_states(orbit, time)), names, UNIT, np.full(3, BROAD), longest, np.zeros(0)
        )
    if axes == "inertial":
        names = ("acceleration along x", "acceleration along y", "acceleration along z")
        return Force(
            lambda time: np.tile(np.eye(3), (len(time), 1, 1)), names, UNIT, np.full(3, BROAD), longest, np.zeros(0)
        )
    if axes == "drag":
        return Force(
            lambda time: _against_air(target_states(orbit, time))[:, :, None],
            ("deceleration by drag",),
            UNIT,
            np.array([BROAD]),
            longest,
            np.zeros(0),
        )
    if orbit.epoch is None:
        raise InputError("constant_acceleration is sun, which needs the UTC of time 0; expected an orbit with an epoch")
    light = _light_of(orbit)
    fine = np.linspace(begin, end, int(np.ceil((end - begin) / PENUMBRA)) + 2)
    share = np.linalg.norm(light(fine)[:, :, 0], axis=1)
    changing = np.flatnonzero(np.abs(np.diff(share)) > 1e-6)
    breaks = np.unique(np.concatenate([fine[changing], fine[changing + 1]]))
    return Force(light, ("acceleration away from the Sun",), UNIT, np.array([BROAD]), longest, breaks)


def _against_air(state: FloatArray) -> FloatArray:
    """Unit vectors (n, 3) against the velocity through air that turns with the Earth, for states (n, 6) in I."""
    through_air = state[:, 3:] - np.cross([0.0, 0.0, EARTH_ROTATION_RATE], state[:, :3])
    return np.asarray(-through_air / np.linalg.norm(through_air, axis=1, keepdims=True))


def _light_of(orbit: Orbit) -> Callable[[FloatArray], FloatArray]:
    """What gives columns (n, 3, 1) in I at times (n,) in s: away from the Sun, as long as its share that is seen."""
    begin = utc_of(orbit.epoch, "orbit.epoch")

    def light(time: FloatArray) -> FloatArray:
        towards = sun_direction(begin, time)
        share = sunlit(target_states(orbit, time)[:, :3], towards, orbit.equatorial_radius or EARTH_RADIUS)
        return -(share[:, None] * towards)[:, :, None]

    return light


def longest_on(orbit: Orbit | None, begin: float, end: float) -> float:
    """The longest panel of an integration in s on an orbit, or in free flight over begin … end."""
    return max(end - begin, 1.0) if orbit is None else ARC / orbit.periapsis_rate

"""Relative orbital motion: in closed form on Kepler orbits, and with known forces.

On a Kepler orbit the position is the difference of two Kepler orbits, and its Jacobian the linearisation by Yamanaka
and Ankersen about a chaser at the target. With J2, an orbit from an ephemeris, or known accelerations of the chaser the
position is exact, too: the linear motion about the target (`linear_motion`) corrected by what the gravity gradient
leaves out, iterated until it is consistent (Picard). What is left out is of the order of the distance over the orbit's
radius, so two or three iterations suffice near the target.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.geometry.so3 import cross_matrices
from baryscope.estimator.paths.extended_path import parts_of
from baryscope.estimator.paths.linear_motion import ARC, LinearMotion, Motion, Panels
from baryscope.estimator.paths.path import Path
from baryscope.estimator.paths.prior import Prior
from baryscope.estimator.paths.sampled_path import SampledPath
from baryscope.estimator.thrust import KnownAcceleration
from baryscope.models.ephemeris.trajectory import gravity_difference, gravity_gradient, lvlh_axes, target_states
from baryscope.models.errors import ComputationError, Reason
from baryscope.models.lvlh import lvlh_attitude, lvlh_rate
from baryscope.models.orbit import Orbit
from baryscope.models.relative_orbit import relative_path, relative_transition

FloatArray = NDArray[np.float64]

NODE_ARC = 0.01  # rad of true anomaly between nodes: the spline's error is 5/384 arc⁴ of the distance, 3 nm at 20 m
MOST_WEIGHTS = 200_000  # of values at nodes in those at times, that are kept as a matrix
HARMONIC = 4.0  # of the rate at periapsis: the highest frequency of relative motion
MOST_ITERATIONS = 60  # of the motion under gravity beyond its gradient: more are those of one that diverges
CONVERGED = 1e-13  # of the largest distance
BENDS = 2  # iterations of what gravity beyond its gradient adds to a response: each gains the distance over the radius


@dataclass(frozen=True, eq=False)
class _OnOrbit:
    """Relative motion on a known orbit: x is the chaser's (ρ, ρ̇/n) in LVLH at the epoch in s, (6,), all in m.

    n is the mean motion of the orbit's elements.
    """

    orbit: Orbit
    epoch: float

    name = "relative-orbit"
    size = 6

    @property
    def prior(self) -> Prior:
        """No prior."""
        return Prior.none(self.size)

    @property
    def frequency(self) -> float:
        """HARMONIC times the rate at periapsis."""
        return HARMONIC * self.orbit.periapsis_rate

    def gravity_gradient(self, time: FloatArray) -> FloatArray:
        """The gravity gradient (n, 3, 3) at the target in C, 1/s², at times (n,) in s."""
        return gravity_gradient(self.orbit, target_states(self.orbit, time))


@dataclass(frozen=True, eq=False)
class RelativeOrbit(_OnOrbit):
    """Free relative motion on a Kepler orbit: the CoM's position in C is −R_I_L ρ."""

    @property
    def scale(self) -> FloatArray:
        """The factors (6,) from x to (ρ, ρ̇) in m and m/s."""
        return np.repeat([1.0, self.orbit.mean_motion], 3)

    def at(self, time: FloatArray) -> SampledPath:
        """The path at times (n,) in s; many times are interpolated by a cubic spline between nodes NODE_ARC apart."""
        nodes = self._nodes(time)
        R_I_L = lvlh_attitude(self.orbit, nodes)
        return self._sampled(time, nodes, lambda state: -(R_I_L @ state[:, :3]))

    def rate_at(self, time: FloatArray) -> SampledPath:
        """The CoM's velocity in C, −R_I_L (ρ̇ + θ̇ e_z × ρ), at times (n,) in s, interpolated as in `at`."""
        nodes = self._nodes(time)
        R_I_L = lvlh_attitude(self.orbit, nodes)
        turn = lvlh_rate(self.orbit, nodes)[:, None, None] * cross_matrices(np.eye(3)[2:])
        return self._sampled(time, nodes, lambda state: -(R_I_L @ (state[:, 3:] + turn @ state[:, :3])))

    def _sampled(self, time: FloatArray, nodes: FloatArray, seen: Callable[[FloatArray], FloatArray]) -> SampledPath:
        """What `seen` makes of columns (k, 6, p) of the state (ρ, ρ̇) at k nodes, interpolated to the times (n,)."""
        jacobian = seen(relative_transition(self.orbit, nodes, self.epoch)) * self.scale
        interpolated = _interpolation(nodes, time)

        def position(x: FloatArray) -> FloatArray:
            state = relative_path(self.orbit, self.scale * x, nodes, self.epoch)
            return interpolated(seen(state[:, :, None])[:, :, 0])

        return SampledPath(interpolated(jacobian), position)

    def _nodes(self, time: FloatArray) -> FloatArray:
        """Evenly spaced times that span the given ones, or the given ones themselves if they are few."""
        begin, end = float(time.min()), float(time.max())
        count = int(np.ceil((end - begin) * self.orbit.periapsis_rate / NODE_ARC)) + 1
        return time if len(time) < 4 * count or count < 4 else np.linspace(begin, end, count)


def _interpolation(nodes: FloatArray, time: FloatArray) -> Callable[[FloatArray], FloatArray]:
    """The function from values (k, ...) at nodes to those (n, ...) at times, of a cubic spline.

    It is linear in the values: where that matrix is small, to find it once costs less than a spline for each values.
    """
    if nodes is time:
        return lambda values: values
    from scipy.interpolate import CubicSpline  # slow to load, and only tracks in orbit need it

    if len(time) * len(nodes) > MOST_WEIGHTS:
        return lambda values: np.asarray(CubicSpline(nodes, values)(time))
    weights = CubicSpline(nodes, np.eye(len(nodes)))(time)
    return lambda values: (weights @ values.reshape(len(nodes), -1)).reshape(-1, *values.shape[1:])


@dataclass(frozen=True, eq=False)
class PerturbedOrbit(_OnOrbit):
    """Relative motion under known forces, with the same unknowns: ρ̇ is the rate in axes that turn about the orbit
    normal at h/r². The jacobian is that of a chaser at the target.

    orbit: with J2, an ephemeris, or neither; known: the acceleration of the chaser besides gravity.
    """

    known: KnownAcceleration | None = None

    @property
    def longest(self) -> float:
        """The longest panel of an integration, in s."""
        return ARC / self.orbit.periapsis_rate

    @property
    def frequency(self) -> float:
        """HARMONIC times the rate at periapsis; infinite with an ephemeris or known accelerations, which may jump."""
        return super().frequency if self.orbit.ephemeris is None and self.known is None else np.inf

    def at(self, time: FloatArray) -> SampledPath:
        """The path at times (n,) in s."""
        return self._sampled(time, Motion.position)

    def rate_at(self, time: FloatArray) -> SampledPath:
        """The velocity of the centre of mass in C at times (n,) in s."""
        return self._sampled(time, Motion.velocity)

    def _sampled(self, time: FloatArray, seen: Callable[[Motion, FloatArray], FloatArray]) -> SampledPath:
        panels = self._panels(time)
        reference = target_states(self.orbit, panels.points)
        gradient = gravity_gradient(self.orbit, reference)
        equation = LinearMotion(panels, gradient)
        from_x = self._from_x()
        thrust = 0.0 if self.known is None else -self.known.inertial(panels.points, self.orbit)

        def left_out(p: FloatArray) -> FloatArray:
            return beyond_gradient(self.orbit, reference, gradient, p) + thrust

        def position(x: FloatArray) -> FloatArray:
            return seen(_exact(equation, equation.free @ (from_x @ x)[:, None], left_out), time)[:, :, 0]

        return SampledPath(seen(equation.free @ from_x, time), position)

    def _panels(self, time: FloatArray) -> Panels:
        if self.known is None:
            return Panels.over(time, self.epoch, self.longest)
        begin, end = (float(find(np.append(time, self.epoch))) for find in (np.min, np.max))
        return Panels.over(time, self.epoch, min(self.longest, self.known.smooth_for(begin, end)), self.known.time)

    def _from_x(self) -> FloatArray:
        """The factor (6, 6) from x to position and velocity of the centre of mass in C at the epoch, m and m/s."""
        state = target_states(self.orbit, np.array([self.epoch]))
        R_I_L = lvlh_axes(state)[0]
        r, v = state[0, :3], state[0, 3:]
        rate = float(np.linalg.norm(np.cross(r, v)) / (r @ r))
        turn = rate * np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
        factor = np.zeros((6, 6))
        factor[:3, :3] = -R_I_L
        factor[3:] = -R_I_L @ np.hstack([turn, self.orbit.mean_motion * np.eye(3)])
        return factor


def orbit_in(path: Path) -> Orbit | None:
    """The orbit of the relative motion that a path is, or is based on; None if it is another one."""
    return next((part.orbit for part in parts_of(path) if isinstance(part, _OnOrbit)), None)


def beyond_gradient(orbit: Orbit, reference: FloatArray, gradient: FloatArray, p: FloatArray) -> FloatArray:
    """What gravity does beyond its gradient to the centre of mass at p (k, 3) in C from the chaser, m: (k, 3), m/s².

    reference (k, 6): the target's states, gradient (k, 3, 3): there.
    """
    return np.asarray(-gravity_difference(orbit, reference, -p) - np.einsum("kij,kj->ki", gradient, p))


def bend(equation: LinearMotion, orbit: Orbit, before: FloatArray, after: FloatArray) -> Motion:
    """What gravity beyond its gradient adds to the response to a force, of the order of its square over the radius.

    before, after (k, 3): the path in C without the response and with it, at the equation's Gauss points, m.
    """
    reference, gradient = target_states(orbit, equation.panels.points), equation.gradient
    assert gradient is not None  # noqa: S101  there is an orbit
    without = beyond_gradient(orbit, reference, gradient, before)
    motion = equation.forced((beyond_gradient(orbit, reference, gradient, after) - without)[:, :, None])
    for _ in range(BENDS):
        here = after + motion.at_points.reshape(-1, 3)
        motion = equation.forced((beyond_gradient(orbit, reference, gradient, here) - without)[:, :, None])
    return motion


def _exact(equation: LinearMotion, linear: Motion, left_out: Callable[[FloatArray], FloatArray]) -> Motion:
    """The motion near `linear` with what it leaves out, m/s², a function of the positions (k, 3) at the Gauss points.

    Raises:
        ComputationError: the iteration diverges: the chaser is too far away, or for too long.
    """
    motion, before = linear, np.zeros((1, 3))
    for _ in range(MOST_ITERATIONS):
        p = motion.at_points.reshape(-1, 3)
        distance = float(np.abs(p).max())
        if not np.isfinite(distance):
            break
        if float(np.abs(p - before).max()) <= CONVERGED * distance:
            return motion
        motion, before = linear + equation.forced(left_out(p)[:, :, None]), p
    raise ComputationError(
        f"a chaser {np.abs(linear.at_points).max():.3g} m from the target: too far for its relative motion to be found",
        Reason.OPEN_ORBIT,
    )

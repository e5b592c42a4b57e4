"""Relative motion with known forces: J2, an orbit from an ephemeris, and known accelerations of the chaser.

The position is exact: the linear motion about the target (`linear_motion`) corrected by what the gravity gradient
leaves out, iterated until it is consistent (Picard). What is left out is of the order of the distance over the orbit's
radius, so two or three iterations suffice near the target.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.dynamics.linear_motion import ARC, LinearMotion, Motion, Panels
from baryscope.estimator.dynamics.paths import SampledPath
from baryscope.models.ephemeris.trajectory import gravity_difference, gravity_gradient, lvlh_axes, target_states
from baryscope.models.errors import ComputationError, Reason
from baryscope.models.orbit import Orbit

FloatArray = NDArray[np.float64]

MOST_ITERATIONS = 60
CONVERGED = 1e-13  # of the largest distance


@dataclass(frozen=True, eq=False)
class PerturbedOrbit:
    """Relative motion under known forces: x is the chaser's (ρ, ρ̇/n) in LVLH at the epoch in s, (6,), all in m.

    The same unknowns as those of `RelativeOrbit`: n is the mean motion of the orbit's elements, and ρ̇ the rate in axes
    that turn about the orbit normal at h/r². The jacobian is that of a chaser at the target.

    orbit: with J2, an ephemeris, or neither.
    """

    orbit: Orbit
    epoch: float

    name = "relative-orbit"
    size = 6

    @property
    def longest(self) -> float:
        """The longest panel of an integration, in s."""
        return ARC / self.orbit.periapsis_rate

    def gravity_gradient(self, time: FloatArray) -> FloatArray:
        """The gravity gradient (n, 3, 3) at the target in C, 1/s², at times (n,) in s."""
        return gravity_gradient(self.orbit, target_states(self.orbit, time))

    def at(self, time: FloatArray) -> SampledPath:
        """The path at times (n,) in s."""
        return self._sampled(time, Motion.position)

    def rate_at(self, time: FloatArray) -> SampledPath:
        """The velocity of the centre of mass in C at times (n,) in s."""
        return self._sampled(time, Motion.velocity)

    def _sampled(self, time: FloatArray, seen: Callable[[Motion, FloatArray], FloatArray]) -> SampledPath:
        panels = Panels.over(time, self.epoch, self.longest)
        reference = target_states(self.orbit, panels.points)
        gradient = gravity_gradient(self.orbit, reference)
        equation = LinearMotion(panels, gradient)
        from_x = self._from_x()

        def left_out(p: FloatArray) -> FloatArray:
            return np.asarray(-gravity_difference(self.orbit, reference, -p) - np.einsum("kij,kj->ki", gradient, p))

        def position(x: FloatArray) -> FloatArray:
            return seen(_exact(equation, equation.free @ (from_x @ x)[:, None], left_out), time)[:, :, 0]

        return SampledPath(seen(equation.free @ from_x, time), position)

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


def _exact(equation: LinearMotion, linear: Motion, left_out: Callable[[FloatArray], FloatArray]) -> Motion:
    """The motion near `linear` with what the gravity gradient leaves out, m/s², at positions (k, 3) at Gauss points.

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

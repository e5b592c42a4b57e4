"""The smoother of `ekf`: the path at all times from the filter's last state.

It is the disturbance smoother (de Jong 1989; Bryson and Frazier's adjoint), which is equivalent to that of Rauch, Tung
and Striebel and needs no inverse of a covariance: the last state is propagated back, and the process noise estimated
from the observations after each step is subtracted. Without process noise it is the propagation alone.
"""

from dataclasses import dataclass

import numpy as np

from baryscope.estimator.ekf.filter import Trace
from baryscope.estimator.ekf.motion import PathProcess
from baryscope.estimator.ekf.state import State
from baryscope.estimator.tracks import FloatArray


@dataclass(frozen=True, eq=False)
class SmoothedPath:
    """The process, and its state u (n, p) with the covariance (n, p, p) at all times."""

    process: PathProcess
    u: FloatArray
    covariance: FloatArray

    @property
    def position(self) -> FloatArray:
        """The centre of mass in C, (n, 3)."""
        return np.asarray(self.process.nominal + (self.process.observed @ self.u[:, :, None])[:, :, 0])

    @property
    def position_covariance(self) -> FloatArray:
        """Its covariance (n, 3, 3), m²."""
        return self._projected(self.process.observed)

    @property
    def regular(self) -> bool:
        """Whether positions are finite and variances positive: they may be lost in rounding."""
        variance = np.einsum("kii->ki", self.position_covariance)
        return bool(np.isfinite(self.position).all() and (variance >= 0).all() and np.isfinite(variance).all())

    @property
    def velocity(self) -> FloatArray:
        """Of the centre of mass in C, (n, 3), m/s."""
        moved = (self.process.observed_rate @ self.u[:, :, None])[:, :, 0]
        return np.asarray(self.process.nominal_rate + moved)

    @property
    def velocity_covariance(self) -> FloatArray:
        """Its covariance (n, 3, 3), (m/s)²."""
        return self._projected(self.process.observed_rate)

    def _projected(self, H: FloatArray) -> FloatArray:
        return np.asarray(H @ self.covariance @ np.swapaxes(H, 1, 2))


def smoothed_path(
    state: State, process: PathProcess, noise: FloatArray, first: int, traces: tuple[Trace, ...]
) -> SmoothedPath:
    """The path of the first member, from its state at the last frame.

    noise (n - 1, p, p): covariance of the path's process noise per step; traces: of the frames from `first` on; without
    traces the process noise is not estimated, and only increases the covariance.
    """
    n, p = process.observed.shape[0], process.observed.shape[2]
    u, covariance = np.empty((n, p)), np.empty((n, p, p))
    u[-1], covariance[-1] = state.path[0], state.covariance[0, :p, :p]
    s = state.covariance.shape[1]
    rhs, information = np.zeros(s), np.zeros((s, s))
    backwards = np.linalg.inv(process.transition)
    for frame in range(n - 1, 0, -1):
        Q, back = noise[frame - 1], backwards[frame - 1]
        if traces and frame > first:
            trace = traces[frame - first]
            rhs = trace.follow.T @ rhs + trace.rhs
            information = trace.follow.T @ information @ trace.follow + trace.information
            cross = trace.covariance @ information[:, :p] @ Q
            before = covariance[frame] - Q - Q @ information[:p, :p] @ Q + cross + cross.T
            u[frame - 1] = back @ (u[frame] - Q @ rhs[:p])
            d = len(trace.moved)
            rhs[:d] = trace.moved.T @ rhs[:d]
            information[:d] = trace.moved.T @ information[:d]
            information[:, :d] = information[:, :d] @ trace.moved
        else:
            before = covariance[frame] + Q
            u[frame - 1] = back @ u[frame]
        covariance[frame - 1] = back @ before @ back.T
    return SmoothedPath(process, u, covariance)

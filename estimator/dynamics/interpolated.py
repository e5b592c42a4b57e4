"""A path at many times, interpolated between few: sums over frames become sums over panels.

In a panel of time the path and its Jacobian J are polynomials of degree ORDER − 1 through their values at Chebyshev's
points. So Σ Jᵀ W J over the frames of a panel needs of the weights W (3, 3) only the sums with products of two
interpolation weights, and neither time nor memory for (n, 3, p) numbers. The error of a wave of phase φ = ω h over a
panel is 2 (φ/4)^ORDER / ORDER! of it (Trefethen, Approximation Theory and Approximation Practice, ch. 8).
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.dynamics.paths import Frames, SampledPath

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

ORDER = 8  # points of a panel
PHASE = 0.6  # rad of the highest frequency in a panel: an error of 1e-11
FEWEST = 1000  # frames, and
WORTHWHILE = 4  # frames of a point, on average, from which interpolation is much faster


@dataclass(frozen=True, eq=False)
class Panels:
    """k panels of equal length: their points (k ORDER,) in s, ascending, and the weights (n, ORDER) of n frames.

    The value at a frame is the sum of its weights times the values at the points of its panel; panel j has the frames
    first[j] to first[j + 1], first (k + 1,).
    """

    points: FloatArray
    first: IntArray
    weights: FloatArray

    @classmethod
    def over(cls, time: FloatArray, count: int) -> "Panels":
        """`count` panels over ascending times (n,) in s."""
        length = float(time[-1] - time[0]) / count
        index = np.minimum(((time - time[0]) / length).astype(np.intp), count - 1)
        nodes = -np.cos(np.pi * (np.arange(ORDER) + 0.5) / ORDER)
        own = 2 * ((time - time[0]) / length - index) - 1
        others = nodes[None, :] + np.diag(np.full(ORDER, np.nan))
        scale = np.nanprod(nodes[:, None] - others, axis=1)
        apart = own[:, None] - nodes
        before, after = np.ones_like(apart), np.ones_like(apart)
        np.cumprod(apart[:, :-1], axis=1, out=before[:, 1:])
        np.cumprod(apart[:, :0:-1], axis=1, out=after[:, -2::-1])
        middle = time[0] + (np.arange(count) + 0.5) * length
        points = (middle[:, None] + length / 2 * nodes).ravel()
        return cls(points, np.searchsorted(index, np.arange(count + 1)), before * after / scale)

    def parts(self, frames: Frames) -> Iterator[tuple[int, slice, FloatArray]]:
        """For each panel that has some of the ascending frames: its index, which they are, and their weights."""
        if isinstance(frames, slice):
            begin, end, _ = frames.indices(len(self.weights))
            first = np.clip(self.first, begin, end) - begin
        else:
            first = np.searchsorted(frames, self.first)
        weights = self.weights[frames]
        for index in np.flatnonzero(np.diff(first)).tolist():
            part = slice(int(first[index]), int(first[index + 1]))
            yield index, part, weights[part]

    def at_frames(self, values: FloatArray) -> FloatArray:
        """The values (n, ...) at the frames of values (k ORDER, ...) at the points."""
        by_panel = values.reshape(len(self.first) - 1, ORDER, -1)
        found = np.empty((len(self.weights), by_panel.shape[2]))
        for index, part, weights in self.parts(slice(None)):
            np.matmul(weights, by_panel[index], out=found[part])
        return found.reshape(len(found), *values.shape[1:])


class InterpolatedPath(SampledPath):
    """A path at the frames of panels, from itself at their points."""

    def __init__(self, panels: Panels, at_points: SampledPath) -> None:
        object.__setattr__(self, "panels", panels)
        object.__setattr__(self, "at_points", at_points)
        object.__setattr__(self, "position", lambda x: panels.at_frames(at_points.position(x)))
        object.__setattr__(self, "seen_of", None)
        object.__setattr__(self, "turn", None)

    panels: Panels
    at_points: SampledPath

    @cached_property
    def jacobian(self) -> FloatArray:
        """The Jacobian (n, 3, p) at the frames."""
        return self.panels.at_frames(self.at_points.jacobian)

    @property
    def size(self) -> int:
        """The number of unknowns."""
        return self.at_points.size

    @cached_property
    def _by_panel(self) -> FloatArray:
        """The Jacobian (k, 3 ORDER, p) at the points of each panel."""
        return self.at_points.jacobian.reshape(-1, 3 * ORDER, self.size)

    def grams(self, frames: Frames, weights: FloatArray) -> FloatArray:
        """See `SampledPath`."""
        several = weights.shape[1]
        total = np.zeros((several, self.size, self.size))
        for index, part, own in self.panels.parts(frames):
            pairs = _pairs(own).T @ weights[part].reshape(len(own), 9 * several)
            blocks = pairs.reshape(ORDER, ORDER, several, 3, 3).transpose(2, 0, 3, 1, 4)
            jacobian = self._by_panel[index]
            total += jacobian.T @ blocks.reshape(several, 3 * ORDER, 3 * ORDER) @ jacobian
        return total

    @property
    def frames(self) -> int:
        """The number of times n."""
        return len(self.panels.weights)

    def moment(self, frames: Frames, values: FloatArray) -> FloatArray:
        """See `SampledPath`."""
        columns = values.shape[2]
        total = np.zeros((self.size, columns))
        for index, part, weights in self.panels.parts(frames):
            sums = weights.T @ values[part].reshape(len(weights), -1)
            total += self._by_panel[index].T @ sums.reshape(3 * ORDER, columns)
        return total

    def covariance(self, of_x: FloatArray) -> FloatArray:
        """See `SampledPath`."""
        found = np.empty((self.frames, 9))
        for index, part, weights in self.panels.parts(slice(None)):
            block = self._by_panel[index] @ of_x @ self._by_panel[index].T
            pairs = block.reshape(ORDER, 3, ORDER, 3).transpose(0, 2, 1, 3).reshape(ORDER * ORDER, 9)
            found[part] = _pairs(weights) @ pairs
        return found.reshape(-1, 3, 3)

    def times(self, columns: FloatArray) -> FloatArray:
        """See `SampledPath`."""
        return self.panels.at_frames(self.at_points.jacobian @ columns)


def _pairs(weights: FloatArray) -> FloatArray:
    """The products (n, ORDER²) of two of the weights (n, ORDER)."""
    return np.asarray((weights[:, :, None] * weights[:, None]).reshape(len(weights), -1))


def interpolated(at: Callable[[FloatArray], SampledPath], frequency: float, time: FloatArray) -> SampledPath:
    """A path at ascending times (n,) in s: interpolated where they are many for its highest frequency in rad/s.

    at: gives it sampled at times, such as `Path.at` and `Path.rate_at` do.
    """
    span = float(time[-1] - time[0])
    count = max(span * frequency / PHASE, 1.0)
    if not max(FEWEST, WORTHWHILE * ORDER * count) <= len(time) or span <= 0:
        return at(time)
    panels = Panels.over(time, int(np.ceil(count)))
    return InterpolatedPath(panels, at(panels.points))

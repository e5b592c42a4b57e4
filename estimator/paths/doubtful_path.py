"""What a force that is too weak to show in the tracks does to predictions.

An orbit that is off, or a push that nobody tells, may move the path less than noise does as long as there are tracks,
and far more than it ahead of them, where its displacement grows with the square of the time.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.paths.extended_path import ExtendedPath, parts_of
from baryscope.estimator.paths.forces import Force, ForcedPath
from baryscope.estimator.paths.path import Path
from baryscope.estimator.paths.sampled_path import SampledPath

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class DoubtfulPath(ExtendedPath):
    """A path on which a force may act that its estimate leaves out: it has no unknowns of its own.

    The force's c unknowns are those of a `ForcedPath` over begin … end, s. square (c, c): the mean of their products
    for what the tracks tell of them, m²; follows (p, c): what the unknowns of the whole path take on of them, of which
    the last, modes of process noise, may be more or fewer than on the path that is asked.
    """

    force: Force
    begin: float
    end: float
    square: FloatArray
    follows: FloatArray

    def at(self, time: FloatArray) -> SampledPath:
        """See `Path`."""
        return self.base.at(time)

    def rate_at(self, time: FloatArray) -> SampledPath:
        """See `Path`."""
        return self.base.rate_at(time)

    def left_out(self, path: Path, time: FloatArray) -> FloatArray:
        """The covariance (n, 6, 6) of position and velocity at times (n,) in s, of a path that this is a part of."""
        forced, size = ForcedPath(self.base, self.force, self.begin, self.end), self.base.size
        own = [forced.at(time).jacobian[:, :, size:], forced.rate_at(time).jacobian[:, :, size:]]
        shared = min(len(self.follows), path.size)
        followed = [sampled.jacobian[:, :, :shared] for sampled in (path.at(time), path.rate_at(time))]
        columns = np.concatenate(own, axis=1) + np.concatenate(followed, axis=1) @ self.follows[:shared]
        return np.asarray(columns @ self.square @ np.swapaxes(columns, 1, 2))


def left_out(path: Path, begin: float, end: float, time: FloatArray) -> FloatArray:
    """The covariance (n, 6, 6) of position and velocity in C by forces on the path that its estimate leaves out, before
    `begin` and after `end`; between these, where they do not show, it is zero. time (n,) in s.
    """
    found, outside = np.zeros((len(time), 6, 6)), (time < begin) | (time > end)
    for part in parts_of(path):
        if isinstance(part, DoubtfulPath) and outside.any():
            found[outside] += part.left_out(path, time[outside])
    return found

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

    estimated: the whole path on which it was left out, of p unknowns. The force's c unknowns are those of a
    `ForcedPath` over begin … end, s. square (c, c): the mean of their products for what the tracks tell of them, m²;
    follows (p, c): what the unknowns of the estimated path take on of them.
    """

    estimated: Path
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

    def left_out(self, time: FloatArray) -> FloatArray:
        """The covariance (n, 6, 6) of position and velocity at times (n,) in s."""
        forced = ForcedPath(self.estimated, self.force, self.begin, self.end)
        whole = np.concatenate([forced.at(time).jacobian, forced.rate_at(time).jacobian], axis=1)
        columns = whole[:, :, : len(self.follows)] @ self.follows + whole[:, :, len(self.follows) :]
        return np.asarray(columns @ self.square @ np.swapaxes(columns, 1, 2))


def doubtful_parts(path: Path) -> tuple[DoubtfulPath, ...]:
    """The parts of a path that are forces which its estimate leaves out, from the outermost one."""
    return tuple(part for part in parts_of(path) if isinstance(part, DoubtfulPath))


def left_out(path: Path, begin: float, end: float, time: FloatArray) -> FloatArray:
    """The covariance (n, 6, 6) of position and velocity in C by forces on the path that its estimate leaves out, before
    `begin` and after `end`; between these, where they do not show, it is zero. time (n,) in s.
    """
    found, outside = np.zeros((len(time), 6, 6)), (time < begin) | (time > end)
    for part in doubtful_parts(path) if outside.any() else ():
        found[outside] += part.left_out(time[outside])
    return found

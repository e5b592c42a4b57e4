"""What a path does away from the tracks where it is linear in its unknowns only near them.

An orbit that is told to a tenth of a radian by what a few rotations show leads ahead of them to places on an arc: what
is linear in its elements puts all of them on the tangent, and claims next to nothing across it. So members of the
posterior at the end of the tracks are followed each on its own orbit. What their path is beside the linear one is a
shift in the mean, what it has of another slope, and the rest.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.geometry.members import PAIRS, opposite_pairs, root_of
from baryscope.estimator.paths.extended_path import parts_of
from baryscope.estimator.paths.forces import ForcedPath
from baryscope.estimator.paths.path import Path
from baryscope.models.errors import ComputationError, Reason

FloatArray = NDArray[np.float64]
# Positions and velocities (m, 6) at an origin in m and m/s, and unknowns (m, c) → what m paths are beside the linear
# one, (m, n, 6); NaN of those that do not exist
Beside = Callable[[FloatArray, FloatArray], FloatArray]

SHORTER = (1.0, 0.5, 0.25, 0.1, 0.0)  # of a member's way, until its path exists


class NonlinearPath(ForcedPath, ABC):
    """A path with a response that is linear in its unknowns as long as they are small."""

    @abstractmethod
    def beside_linear(self, origin: float, state: FloatArray, time: FloatArray) -> Beside:
        """What position and velocity at times (n,) in s are beside those that are linear in the unknowns, of paths
        through states at the origin in s; state (6,): a likely one.
        """


@dataclass(frozen=True, eq=False)
class Curvature:
    """What n positions and velocities are beside linear ones: their mean (n, 6), their slope (n, 6, 6 + c) by the state
    at an end of the tracks and the path's own unknowns, in SI and m, and the covariance (n, 6, 6) of the rest.
    """

    mean: FloatArray
    slope: FloatArray
    covariance: FloatArray


def nonlinear_in(path: Path) -> NonlinearPath | None:
    """The part of a path that is linear near the tracks only, if one is; its unknowns are the first."""
    return next((part for part in parts_of(path) if isinstance(part, NonlinearPath)), None)


@dataclass(frozen=True, eq=False)
class End:
    """What is known at an end of the tracks, the origin in s: position and velocity (6,), with their Jacobian (6, u) by
    unknowns of which the last are the path's x (p,), and the covariance (u, u) of all.
    """

    origin: float
    state: FloatArray
    by_unknowns: FloatArray
    x: FloatArray
    covariance: FloatArray

    def curvature(self, part: NonlinearPath, time: FloatArray) -> Curvature:
        """The curvature at times (n,) in s beyond the end, its slope (n, 6, u) by all unknowns; part: of the path.

        Raises:
            ComputationError: there is no path of the likeliest unknowns.
        """
        own = np.zeros((part.size - part.base.size, len(self.covariance)))
        own[:, len(self.covariance) - len(self.x) :] = np.eye(part.size, len(self.x))[part.base.size :]
        known = np.concatenate([self.by_unknowns, own])
        mean = np.concatenate([self.state, self.x[part.base.size : part.size]])
        found = curvature_away(part, self.origin, (mean, known @ self.covariance @ known.T), time)
        return replace(found, slope=found.slope @ known)


def curvature_away(
    path: NonlinearPath, origin: float, known: tuple[FloatArray, FloatArray], time: FloatArray
) -> Curvature:
    """The curvature of a path at times (n,) in s on one side of the tracks, of which the origin is that end.

    known: mean (6 + c,) and covariance of the state there and of the path's own unknowns.

    Raises:
        ComputationError: there is no path of the likeliest unknowns.
    """
    mean, covariance = known
    beside = path.beside_linear(origin, mean[:6], time)
    root, inverse = root_of(covariance)
    ways = opposite_pairs(root.shape[1])
    here, *off = _followed(beside, mean, np.concatenate([np.zeros((1, len(mean))), ways @ root.T]))
    ahead, behind = np.split(np.array(off) - here, 2)
    odd, even = (ahead - behind) / 2, (ahead + behind) / 2
    by_way = np.einsum("mni,mk->nik", odd, ways[:PAIRS]) / PAIRS
    odd -= np.einsum("nik,mk->mni", by_way, ways[:PAIRS])
    shift = even.mean(axis=0)
    even -= shift
    rest = np.einsum("mni,mnj->nij", odd, odd) + np.einsum("mni,mnj->nij", even, even)
    return Curvature(here + shift, by_way @ inverse.T, rest / PAIRS)


def _followed(beside: Beside, mean: FloatArray, changes: FloatArray) -> FloatArray:
    """What members (m, n, 6), of changed unknowns (m, 6 + c), are beside the linear path, or those that are changed as
    far as they can be.

    Raises:
        ComputationError: not even those without a change have a path.
    """
    found, left = np.empty(0), np.arange(len(changes))
    for share in SHORTER:
        members = beside(*np.split(mean + share * changes[left], [6], axis=1))
        found = members if share == 1 else found
        found[left] = members
        left = left[~np.isfinite(members).all(axis=(1, 2))]
        if not len(left):
            return found
    raise ComputationError("the tracks tell no orbit on which the path could go on", Reason.DIVERGED)

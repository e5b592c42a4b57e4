"""A path of the centre of mass at given times, as a function of its unknowns, and the sums over frames that need it."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.geometry.symmetric import FULL, elements_of

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]
Frames = slice | IntArray


@dataclass(frozen=True)
class SampledPath:
    """A path at n times: the function position, x (p,) → (n, 3) in m in C, and its jacobian (n, 3, p) by x.

    If it is what a camera with errors sees (`seen`): seen_of, the path itself, and turn (n, 3, p), the derivative by x
    of the attitudes that it sees, as rotation vectors in C.
    """

    jacobian: FloatArray
    position: Callable[[FloatArray], FloatArray]
    seen_of: "SampledPath | None" = None
    turn: FloatArray | None = None

    @property
    def itself(self) -> "SampledPath":
        """The path itself, whatever a camera sees."""
        return self if self.seen_of is None else self.seen_of

    @property
    def size(self) -> int:
        """The number of unknowns."""
        return int(self.jacobian.shape[2])

    @property
    def frames(self) -> int:
        """The number of times n."""
        return len(self.jacobian)

    def covariance(self, of_x: FloatArray) -> FloatArray:
        """The covariance (n, 3, 3) of the positions, m², for the covariance (p, p) of x."""
        return np.asarray(self.times(of_x) @ np.swapaxes(self.jacobian, 1, 2))

    def times(self, columns: FloatArray) -> FloatArray:
        """The products (n, 3, k) of the Jacobian with columns (p, k)."""
        # One multiplication: one for each frame would take several times as long.
        return np.asarray((self.jacobian.reshape(-1, self.size) @ columns).reshape(self.frames, 3, -1))

    def gram(self, frames: Frames, weights: FloatArray) -> FloatArray:
        """Σ Jᵀ W J (p, p) over k ascending frames, for symmetric weights (k, 3, 3)."""
        own = self.jacobian[frames]
        return np.asarray(own.reshape(-1, self.size).T @ (weights @ own).reshape(-1, self.size))

    def gram_and_diagonal(
        self, frames: Frames, weights: FloatArray, others: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """That, and the diagonal (p,) of the same for other weights (k, 3, 3)."""
        own = self.jacobian[frames]
        return self.gram(frames, weights), np.asarray(np.einsum("kip,kip->p", own, others @ own))

    def mean_square(self) -> FloatArray:
        """The mean (p, p) of Jᵀ J over the frames."""
        return self.gram(slice(0, self.frames), np.broadcast_to(np.eye(3), (self.frames, 3, 3))) / self.frames

    def moment(self, frames: Frames, values: FloatArray) -> FloatArray:
        """Σ Jᵀ v (..., p, c) over k ascending frames, for values (..., k, 3, c)."""
        *lead, _, _, columns = values.shape
        return product(self.jacobian[frames].reshape(-1, self.size), values.reshape(*lead, -1, columns))

    @property
    def offset(self) -> FloatArray:
        """The position (n, 3) at x = 0, where known accelerations alone bring it, m."""
        return self.position(np.zeros(self.size))

    def with_terms(self, terms: FloatArray) -> "SampledPath":
        """The path with further unknowns, three of each of k terms (n, k), as of `IsotropicPath`."""
        return self.extended(of_three_axes(terms))

    def extended(self, columns: FloatArray) -> "SampledPath":
        """The path with further unknowns, of which it is a linear function with columns (n, 3, k)."""
        size = self.size
        return SampledPath(
            np.concatenate([self.jacobian, columns], axis=2),
            lambda x: self.position(x[:size]) + columns @ x[size:],
            None if self.seen_of is None else self.seen_of.extended(columns),
            None if self.turn is None else np.concatenate([self.turn, np.zeros_like(columns)], axis=2),
        )

    def frames_at(self, index: IntArray) -> "SampledPath":
        """The path at some of its times, by their ascending indices (k,)."""
        seen_of = None if self.seen_of is None else self.seen_of.frames_at(index)
        turn = None if self.turn is None else self.turn[index]
        return SampledPath(self.jacobian[index], lambda x: self.position(x)[index], seen_of, turn)

    def moved(self, by: FloatArray) -> "SampledPath":
        """The path moved by (n, 3) in m."""
        seen_of = None if self.seen_of is None else self.seen_of.moved(by)
        return SampledPath(self.jacobian, lambda x: self.position(x) + by, seen_of, self.turn)

    def lengths(self, directions: FloatArray) -> FloatArray:
        """The rms displacement (k,) of the path, m, for changes (p, k) of x."""
        return np.asarray(np.sqrt(np.mean(np.sum(self.times(directions) ** 2, axis=1), axis=0)))


def product(jacobian: FloatArray, values: FloatArray) -> FloatArray:
    """Jᵀ v (..., p, c) for J (k, p) and v (..., k, c), in one multiplication."""
    lead = values.ndim - 2
    # By transpose, as moveaxis takes longer than the multiplication.
    rows = values.transpose(lead, *range(lead), lead + 1)
    found = (jacobian.T @ rows.reshape(len(jacobian), -1)).reshape(-1, *rows.shape[1:])
    return np.asarray(found.transpose(*range(1, lead + 1), 0, lead + 1))


class IsotropicPath(SampledPath):
    """A path of terms (n, q) that are the same in three axes: at T x, with x (3 q,) as a matrix (q, 3), and an offset.

    Its Jacobian is T ⊗ 1. Sums over frames need T alone.
    """

    terms: FloatArray
    shifted: FloatArray | None

    def __init__(self, terms: FloatArray, shifted: FloatArray | None = None) -> None:
        def position(x: FloatArray) -> FloatArray:
            found = terms @ x.reshape(-1, 3)
            return np.asarray(found if shifted is None else found + shifted)

        object.__setattr__(self, "terms", terms)
        object.__setattr__(self, "shifted", shifted)
        object.__setattr__(self, "position", position)
        object.__setattr__(self, "seen_of", None)
        object.__setattr__(self, "turn", None)

    @cached_property
    def jacobian(self) -> FloatArray:
        """The Jacobian (n, 3, p)."""
        return of_three_axes(self.terms)

    @property
    def size(self) -> int:
        """The number of unknowns."""
        return 3 * int(self.terms.shape[1])

    @property
    def frames(self) -> int:
        """The number of times n."""
        return len(self.terms)

    def covariance(self, of_x: FloatArray) -> FloatArray:
        """See `SampledPath`."""
        terms = self.terms.shape[1]
        elements = elements_of(of_x.reshape(terms, 3, terms, 3).transpose(0, 2, 1, 3))
        found = [np.einsum("nq,nq->n", self.terms @ own, self.terms) for own in np.moveaxis(elements, -1, 0)]
        return np.stack(found, axis=1)[:, FULL]

    def times(self, columns: FloatArray) -> FloatArray:
        """See `SampledPath`."""
        return np.asarray((self.terms @ columns.reshape(self.terms.shape[1], -1)).reshape(self.frames, 3, -1))

    def gram(self, frames: Frames, weights: FloatArray) -> FloatArray:
        """See `SampledPath`."""
        own = self.terms[frames]
        (k, q), elements = own.shape, elements_of(weights)
        found = own.T @ (elements[:, :, None] * own[:, None]).reshape(k, 6 * q)
        return np.asarray(found.reshape(q, 6, q)[:, FULL].transpose(0, 1, 3, 2).reshape(3 * q, 3 * q))

    def gram_and_diagonal(
        self, frames: Frames, weights: FloatArray, others: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """See `SampledPath`."""
        squares = self.terms[frames] ** 2
        return self.gram(frames, weights), np.asarray(squares.T @ np.diagonal(others, axis1=1, axis2=2)).ravel()

    def moment(self, frames: Frames, values: FloatArray) -> FloatArray:
        """See `SampledPath`."""
        own = self.terms[frames]
        # The order that makes a view of values with the frames last in memory.
        lead = values.ndim - 3
        rows = values.transpose(lead, *range(lead), lead + 2, lead + 1)
        found = (own.T @ rows.reshape(len(own), -1)).reshape(own.shape[1], *rows.shape[1:])
        found = found.transpose(*range(1, lead + 1), 0, lead + 2, lead + 1)
        return np.asarray(found.reshape(*found.shape[:-3], self.size, found.shape[-1]))

    def with_terms(self, terms: FloatArray) -> "IsotropicPath":
        """See `SampledPath`."""
        return IsotropicPath(np.concatenate([self.terms, terms], axis=1), self.shifted)

    def frames_at(self, index: IntArray) -> "IsotropicPath":
        """See `SampledPath`."""
        return IsotropicPath(self.terms[index], None if self.shifted is None else self.shifted[index])

    def moved(self, by: FloatArray) -> "IsotropicPath":
        """See `SampledPath`."""
        return IsotropicPath(self.terms, by if self.shifted is None else self.shifted + by)


def of_three_axes(terms: FloatArray) -> FloatArray:
    """The Jacobian (n, 3, 3 q) of terms (n, q) that are the same in three axes, by three unknowns of each."""
    n, q = terms.shape
    return np.asarray(np.einsum("nq,ij->niqj", terms, np.eye(3)).reshape(n, 3, 3 * q))

"""How a smooth path goes on before and after the time in which it is seen: by its Taylor polynomial at that end.

Polynomials of a high degree, which represent a smooth path within a time span, lead anywhere outside it, with the
slightest share of a slow decrease of their coefficients. What is known there is what the path does at the end, and
how large its derivatives are. With p⁽ʲ⁾ the derivatives at the end and τ the time from there, the path is

    p(τ) = Σ_{j ≤ k} p⁽ʲ⁾ τʲ/j! + d τᵏ⁺¹/(k + 1)! + d′ τᵏ⁺²/(k + 2)!

where the next two derivatives d and d′ are not taken from the end, where they are hardly told, but are unknown vectors
as large as such derivatives are where the path is seen. The order k is, at each time, that of the narrowest claim:
noise makes it lower, and the more of them are told, the higher.
"""

from dataclasses import dataclass
from functools import cached_property
from math import factorial

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from baryscope.estimator.paths.extended_path import based_on
from baryscope.estimator.paths.path import Path, SmoothPath
from baryscope.estimator.paths.sampled_path import IsotropicPath
from baryscope.estimator.paths.trajectory import smooth_in

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

HIGHEST = 4  # order: beyond, the derivatives at an end are told by hardly any tracks
TIMES = 33  # in a half of the time span, at which the sizes of derivatives are taken


@dataclass(frozen=True, eq=False)
class ExtrapolatedPath(SmoothPath):
    """A smooth path that goes on outside begin … end: x (q, 3) are its coefficients, with a covariance (3 q, 3 q)."""

    x: FloatArray
    covariance: FloatArray

    def at(self, time: FloatArray) -> IsotropicPath:
        """The path at times (n,) in s."""
        return self._going_on(time, 0)

    def rate_at(self, time: FloatArray) -> IsotropicPath:
        """The path's velocity at times (n,) in s."""
        return self._going_on(time, 1)

    def untold(self, time: FloatArray) -> FloatArray:
        """The covariance (n, 6, 6) of position and velocity at times (n,) in s by the derivatives beyond the order."""
        side, away = self._away(time)
        order = self._order(side, away)
        found = np.zeros((len(time), 2, 2))
        sizes = self._sizes_at(side, away)
        for more in (1, 2):
            size = sizes[np.arange(len(away)), order + more]
            both = np.stack([_powers(away)[np.arange(len(away)), order + more - k] for k in (0, 1)], axis=1)
            found += size[:, None, None] * both[:, :, None] * both[:, None, :]
        found[away == 0] = 0.0
        return np.asarray(np.kron(found, np.eye(3)))

    def _going_on(self, time: FloatArray, derivative: int) -> IsotropicPath:
        """The derivative of the path at times (n,), 0 for the path itself."""
        side, away = self._away(time)
        terms = self._derivatives(np.clip(time, self.begin, self.end), derivative)
        outside, order = away != 0, self._order(side, away)
        by_end = np.zeros((len(time), HIGHEST + 1))
        by_end[:, derivative:] = _powers(away)[:, : HIGHEST + 1 - derivative]
        by_end[np.arange(HIGHEST + 1) > order[:, None]] = 0.0
        terms[outside] = np.einsum("nk,nkq->nq", by_end[outside], self._at_ends[side[outside]])
        return IsotropicPath(terms)

    def _away(self, time: FloatArray) -> tuple[IntArray, FloatArray]:
        """Of times (n,) the nearer end, 0 or 1, and how far they are after it, or, below zero, before it, in s."""
        away = time - np.clip(time, self.begin, self.end)
        return np.asarray(away > 0, dtype=np.intp), np.asarray(away)

    def _order(self, side: IntArray, away: FloatArray) -> IntArray:
        """The order (n,) of the narrowest claim in position."""
        powers, sizes, variances = _powers(away), self._sizes_at(side, away), []
        for k in range(HIGHEST + 1):
            own = powers[:, : k + 1]
            told = np.einsum("nj,njl,nl->n", own, self._of_ends[side, : k + 1, : k + 1], own)
            untold = (sizes[:, k + 1 : k + 3] * powers[:, k + 1 : k + 3] ** 2).sum(axis=1)
            variances.append(told + untold)
        return np.asarray(np.argmin(variances, axis=0))

    def _derivatives(self, time: FloatArray, order: int) -> FloatArray:
        """The derivatives (n, q) of an order of the Chebyshev polynomials at times (n,), per s to that power."""
        own = np.eye(self.degree + 1)
        derived = chebyshev.chebder(own, order) if order else own
        return np.asarray(chebyshev.chebval(self._scaled(time), derived).T / self._half**order)

    @cached_property
    def _isotropic(self) -> FloatArray:
        """The covariance (q, q) of the coefficients, the mean of the three axes, m²."""
        count = self.degree + 1
        return np.asarray(np.einsum("qara->qr", self.covariance.reshape(count, 3, count, 3)) / 3)

    @cached_property
    def _at_ends(self) -> FloatArray:
        """The derivatives (2, HIGHEST + 1, q) of the polynomials at both ends."""
        ends = np.array([self.begin, self.end])
        return np.stack([self._derivatives(ends, k) for k in range(HIGHEST + 1)], axis=1)

    @cached_property
    def _of_ends(self) -> FloatArray:
        """The covariances (2, HIGHEST + 1, HIGHEST + 1) of the path's derivatives at both ends, of a coordinate."""
        return np.asarray(self._at_ends @ self._isotropic @ np.swapaxes(self._at_ends, 1, 2))

    def _sizes_at(self, side: IntArray, away: FloatArray) -> FloatArray:
        """The mean squares (n, HIGHEST + 3) of a coordinate's derivatives on the way to times beyond the ends.

        From one half of the time span to the next, of which the middles are half a span apart, they go on growing as
        they have grown from the farther half to the nearer one: an ellipse may near its periapsis.
        """
        span = self.end - self.begin
        halves = 2 * (np.abs(away) / span + 0.25)  # from the middle of the nearer half
        near, growth = self._halves[side], np.maximum(self._halves[side] / self._halves[1 - side], 1.0)
        return np.asarray(near * growth ** halves[:, None])

    @cached_property
    def _halves(self) -> FloatArray:
        """The mean squares (2, HIGHEST + 3) of a coordinate's derivatives, in both halves of the time span.

        The median over time, as they are told least at the ends.
        """
        time, found = np.linspace(self.begin, self.end, 2 * TIMES - 1), []
        for order in range(HIGHEST + 3):
            rows = self._derivatives(time, order)
            square = np.sum((rows @ self.x.reshape(-1, 3)) ** 2, axis=1) / 3
            square += np.einsum("nq,nq->n", rows @ self._isotropic, rows)
            found.append([np.median(square[:TIMES]), np.median(square[TIMES - 1 :])])
        return np.maximum(np.array(found).T, np.finfo(float).tiny)


def _powers(away: FloatArray) -> FloatArray:
    """τʲ/j! (n, HIGHEST + 3) of times τ (n,) in s."""
    order = np.arange(HIGHEST + 3)
    return np.asarray(away[:, None] ** order / np.array([factorial(j) for j in order]))


def extrapolated(path: Path, x: FloatArray, covariance: FloatArray) -> Path:
    """The path, of which a smooth part goes on outside its time; x (p,) with their covariance (p, p): its unknowns."""
    smooth = smooth_in(path)
    if smooth is None:
        return path
    own = slice(0, smooth.size)
    return based_on(path, ExtrapolatedPath(smooth.degree, smooth.begin, smooth.end, x[own], covariance[own, own]))


def untold_of(path: Path, time: FloatArray) -> FloatArray:
    """The covariance (n, 6, 6) of position and velocity at times (n,) by what is not told of how a path goes on."""
    smooth = smooth_in(path)
    return smooth.untold(time) if isinstance(smooth, ExtrapolatedPath) else np.zeros((len(time), 6, 6))

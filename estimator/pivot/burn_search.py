"""The search for unknown burns in the linear equations of the drifting pivot, c_k = g(t_k; x) + R_k d.

These know the attitudes from the registration, so that metres of error of the path do no harm. The time is cut into
cells of equal length, with an acceleration of its own in each. Their prior is white noise of a density of maximum
marginal likelihood. A burn is an acceleration of a variance of its own in some consecutive cells. The gain of all such
windows in 2 ln p follows from sums over the information on the cells (sparse Bayesian learning: Tipping and Faul 2003).
The window of the greatest gain becomes a burn, whose times are then fitted together with those of all others, and the
density anew. Of all numbers of burns the likeliest is taken, at a price for each: that of the windows looked at.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from baryscope.estimator.adjustment.evidence import RIDGE, Linear, conditional, cost, maximise
from baryscope.estimator.dynamics.burns import UNKNOWNS, Burn, Burned, burn_axes
from baryscope.estimator.dynamics.forces import BROAD, longest_on
from baryscope.estimator.dynamics.linear_motion import LinearMotion, Panels
from baryscope.estimator.dynamics.paths import Path
from baryscope.estimator.dynamics.prior import Hyperparameter, Prior
from baryscope.estimator.dynamics.process_noise import DENSITY
from baryscope.estimator.pivot.drift import frame_covariances
from baryscope.estimator.pivot.free_attitudes import Solution
from baryscope.estimator.pivot.refinement import ROUNDING, Subsample
from baryscope.estimator.registration.clusters import Registered
from baryscope.models.ephemeris.trajectory import lvlh_axes, target_states
from baryscope.models.orbit import Orbit

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

FEWEST_CELLS, MOST_CELLS, FRAMES_PER_CELL = 8, 128, 4
LONGEST = 1 / 6  # of the span, that a burn lasts
SMOOTH = 15  # unknowns of accelerations that are no burns: three constants in LVLH, and their first two harmonics
DURATIONS = 24  # at which the likelihood of a duration is looked at that is less than TOLD deviations
TOLD, RANGE = 12.0, 5.0  # and up to RANGE deviations above it
QUIET = 100.0  # precision of a cell by its noise over its information: noise without an effect
MOST_BURNS = 12
QUIETER = (1e-2, 1e-4)  # shares of the noise that stands for all burns
COSTLY = 10.0  # times as inaccurate as without noise are the offsets: then it is looked for burns once more
PATIENCE = 2  # burns that are added although they make the model less likely
ODDS = 1e3  # against a burn anywhere, before the tracks are looked at
NOISE_ROUNDS = 2  # of the observations' variance and of the noise's density by turns
SETTLING = 8  # fits of the burns' times
TOLERANCE = 3.0  # of 2 ln p, by which the priors' changes with the times may lower it
SIZES = np.exp(np.linspace(0.0, 16.0, 17))  # of a burn's variance, over that which the tracks just tell
WORTH_TRYING = 10.0  # gain of a window in 2 ln p, for noise that may have to stand for the burn as well


@dataclass(frozen=True, eq=False)
class BurnFit:
    """Burns, and the posterior of all unknowns: of bodies' offsets, path, burns and cells, in this order.

    score: −2 ln p up to a constant; variance of an observation of weight 1; theta: logarithm of the noise's density;
    matrix and rhs: the normal equations.
    """

    burns: tuple[Burn, ...]
    score: float
    variance: float
    theta: FloatArray
    mean: FloatArray
    covariance: FloatArray
    matrix: FloatArray
    rhs: FloatArray


@dataclass(frozen=True)
class _Limit:
    """Of a fit: the greatest logarithm of the noise's density, and the variance unless it is estimated."""

    density: float = np.inf
    variance: float | None = None


FREE = _Limit()


@dataclass(frozen=True, eq=False)
class BurnSearch:
    """The equations of all frames with an attitude, with unknowns of bodies, path and cells.

    few: the bodies. rows (f, 3, u + 3 c + 1): the equations, the last column being what is observed; frame (f,): of
    which rows of `time` (n,) in s; root (f, 3, 3) of the inverse of their covariance; edges (c + 1,) of the cells in s;
    base: the path without process noise; others: the prior of the u unknowns before the cells; noise: deviation of a
    coordinate from the registration, m; least: lower bound of the variance of an observation of weight 1, m².
    """

    few: Subsample
    rows: FloatArray
    frame: IntArray
    root: FloatArray
    time: FloatArray
    edges: FloatArray
    base: Path
    orbit: Orbit
    others: Prior
    noise: float
    least: float

    @property
    def price(self) -> float:
        """What a burn must gain in 2 ln p: that of the windows looked at, and of its being there at all."""
        return float(2 * np.log(ODDS * self.cells * max(self.cells * LONGEST, 1.0)))

    @property
    def offsets(self) -> int:
        """The number of unknowns of the bodies' offsets."""
        return len(self.others.offset) - self.base.size - SMOOTH

    @property
    def cells(self) -> int:
        """The number of cells."""
        return len(self.edges) - 1

    @property
    def width(self) -> float:
        """The length of a cell in s."""
        return float(self.edges[1] - self.edges[0])

    def likeliest(self) -> tuple["BurnSearch", BurnFit]:
        """The fit with the likeliest burns, and the search with the weights that belong to it.

        Noise that has to stand for burns lets the path follow the body's rotation, which hides a wrong offset, and so
        the burns. If noise is left beside the burns, they are looked for once more with less of it. The frames' noise
        depends on the offset, so that solutions are compared with weights of their own.
        """
        without = self._fitted((), self.least, NOISE_ROUNDS)
        search, best = self, self._extended(without)
        if self._cost_of_noise(best) >= COSTLY:
            search, best = self._own(best, FREE)
            for share in QUIETER:
                limit = _Limit(float(without.theta[0] + np.log(share)))
                held = replace(limit, variance=self.noise**2)
                found = self._extended(self._fitted((), self.noise**2, 1, held), held)
                other, found = self._own(found, limit)
                if other._total(found) < search._total(best):
                    search, best = other, found
        return search, search._spread(best) if best.burns else best

    def _own(self, fit: BurnFit, limit: "_Limit") -> tuple["BurnSearch", BurnFit]:
        """The search with weights for the offsets of a fit, and the fit with these and with a free variance."""
        search = self.weighted(tuple(fit.mean[: self.offsets].reshape(-1, 3)))
        return search, search._settled(fit.burns, self.noise**2, limit)

    def weighted(self, offsets: tuple[FloatArray, ...]) -> "BurnSearch":
        """The search with the weights of the frames for the offsets (3,) of all bodies, m."""
        noise = frame_covariances(self.few.bodies, self.few.observations.weight, offsets)
        axes = np.concatenate([body.attitude for body in self.few.bodies])
        return replace(self, root=np.linalg.inv(np.linalg.cholesky(np.concatenate(noise))) @ np.swapaxes(axes, 1, 2))

    def _extended(self, start: BurnFit, limit: _Limit = FREE) -> BurnFit:
        """The likeliest of a fit with no burn, one burn, and so on."""
        best = current = start
        while len(current.burns) < min(MOST_BURNS, len(best.burns) + PATIENCE):
            window = self._window(current)
            if window is None:
                break
            current = self._settled((*current.burns, window), current.variance, limit)
            best = current if self._total(current) < self._total(best) else best
        return best

    def _total(self, fit: BurnFit) -> float:
        """The score and the price of the burns."""
        return fit.score + self.price * len(fit.burns)

    def _cost_of_noise(self, fit: BurnFit) -> float:
        """The deviation of the offsets over that without noise, burns being as they are."""
        own, rest = slice(self.offsets), slice(len(fit.rhs) - 3 * self.cells)
        known = fit.matrix[rest, rest] / fit.variance + np.diag(self._prior(fit.burns).precision(np.zeros(0)))
        quiet = _solved(known, np.eye(len(known))[:, own])[own]
        return float(np.sqrt(np.trace(fit.covariance[own, own]) / np.trace(quiet)))

    def _noisy(self, fit: BurnFit) -> bool:
        """Whether the noise of a fit has an effect."""
        most = float(np.diag(fit.matrix)[-3 * self.cells :].max()) / fit.variance
        return bool(self.width < QUIET * most * np.exp(fit.theta[0]))

    def without(self, fit: BurnFit, index: int) -> BurnFit:
        """The fit without one of its burns."""
        rest = fit.burns[:index] + fit.burns[index + 1 :]
        return self._spread(self._settled(rest, fit.variance)) if rest else self._fitted((), fit.variance, 1)

    @cached_property
    def _weighted(self) -> FloatArray:
        """The equations times the root of their weight."""
        rows = self.root @ self.rows
        return np.asarray(rows.reshape(-1, rows.shape[2]))

    @cached_property
    def _gram(self) -> FloatArray:
        return np.asarray(self._weighted.T @ self._weighted)

    def _burned(self, burns: tuple[Burn, ...]) -> Burned:
        return Burned(self.base, self.orbit, burns, float(self.edges[0]), float(self.edges[-1]))

    def _prior(self, burns: tuple[Burn, ...]) -> Prior:
        """That of offsets, path and burns."""
        return self.others.joined(Prior.known(self._burned(burns).variances)) if burns else self.others

    def _equations(self, burns: tuple[Burn, ...]) -> tuple[FloatArray, FloatArray]:
        """The normal equations (p, p) and (p,) of offsets, path, burns and cells."""
        u, k, gram = len(self.others.offset), UNKNOWNS * len(burns), self._gram
        size = len(gram) - 1 + k
        places, own = np.concatenate([np.arange(u), np.arange(u + k, size)]), np.arange(u, u + k)
        matrix, rhs = np.zeros((size, size)), np.zeros(size)
        matrix[np.ix_(places, places)], rhs[places] = gram[:-1, :-1], gram[:-1, -1]
        if burns:
            columns = (self.root @ self._burned(burns).columns(self.time)[self.frame]).reshape(-1, k)
            cross = columns.T @ self._weighted
            matrix[np.ix_(own, places)], rhs[own] = cross[:, :-1], cross[:, -1]
            matrix[np.ix_(places, own)] = cross[:, :-1].T
            matrix[np.ix_(own, own)] = columns.T @ columns
        return matrix, rhs

    def _fitted(self, burns: tuple[Burn, ...], variance: float, rounds: int, limit: _Limit = FREE) -> BurnFit:
        """The posterior of all unknowns for burns with given times, from a variance."""
        matrix, rhs = self._equations(burns)
        white = Prior(
            np.full(3 * self.cells, -np.log(self.width)),
            np.ones((3 * self.cells, 1)),
            (Hyperparameter(DENSITY, optional=True),),
        )
        prior, total, values = self._prior(burns).joined(white), float(self._gram[-1, -1]), 3 * len(self.rows)
        for _ in range(rounds):
            linear = Linear(matrix / variance, rhs / variance, np.zeros(len(rhs)))
            theta = np.minimum(maximise(linear, prior), limit.density)
            mean, covariance = conditional(linear, prior, theta)
            score = cost(linear, prior, theta) + total / variance + values * float(np.log(variance))
            score -= 2 * float(np.linalg.slogdet(self.root)[1].sum())
            if limit.variance is not None:
                break
            left = values - float(np.vdot(linear.information, covariance))
            squares = total - 2 * float(rhs @ mean) + float(mean @ matrix @ mean)
            variance = max(squares / max(left, 1.0), self.least)
        return BurnFit(burns, score, variance, theta, mean, covariance, matrix, rhs)

    def _settled(self, burns: tuple[Burn, ...], variance: float, limit: _Limit = FREE) -> BurnFit:
        """The fit with the burns' times at their maximum."""
        u = len(self.others.offset)
        first = fit = self._fitted(burns, variance, 1, limit)
        for _ in range(SETTLING):
            own = slice(u, u + UNKNOWNS * len(fit.burns))
            moved, still = self._burned(fit.burns).settled(fit.mean[own], fit.covariance[own, own])
            fit = self._fitted(moved, fit.variance, 1, limit)
            if still:
                break
        return fit if fit.score < first.score + TOLERANCE else first

    def _spread(self, fit: BurnFit) -> BurnFit:
        """The fit about the mean durations, and with the deviations of these, where the tracks hardly tell them.

        The path is not linear in a duration that may be near zero, or that lies in a time without frames. The mean is
        that over the likelihood of a range of durations, with all else at its maximum but for the noise.
        """
        u, longest = len(self.others.offset), LONGEST * float(self.edges[-1] - self.edges[0])
        burns = list(fit.burns)
        for index, burn in enumerate(fit.burns):
            at = u + UNKNOWNS * index + UNKNOWNS - 1
            deviation = np.sqrt(fit.covariance[at, at]) / burn.speed
            middle, most = (burn.begin + burn.end) / 2, max(longest, burn.slack[1])
            most = min(most, 2 * (middle - self.edges[0]), 2 * (self.edges[-1] - middle))
            flat = (float(np.ptp(self.edges)) / np.sqrt(12), most / np.sqrt(12))
            burns[index] = replace(burn, slack=flat)
            if TOLD * deviation < burn.duration:
                continue
            step = min(most, burn.duration + RANGE * deviation) / DURATIONS
            durations = step * (np.arange(DURATIONS) + 0.5)
            tried = [replace(burn, begin=middle - one / 2, end=middle + one / 2, slack=flat) for one in durations]
            costs = np.array([self._cost((*burns[:index], one, *burns[index + 1 :]), fit) for one in tried])
            weight = np.exp(-(costs - costs.min()) / 2)
            weight /= weight.sum()
            mean = float(weight @ durations)
            spread = float(np.sqrt(weight @ (durations - mean) ** 2))
            slack = (flat[0], max(spread, step))
            burns[index] = replace(burn, begin=middle - mean / 2, end=middle + mean / 2, slack=slack)
        return self._fitted(tuple(burns), fit.variance, 1)

    def _cost(self, burns: tuple[Burn, ...], fit: BurnFit) -> float:
        """−2 ln p of burns up to a constant, with their durations as they are, all else at its maximum near a fit."""
        matrix, rhs = self._equations(burns)
        u = len(self.others.offset)
        durations = np.arange(u, u + UNKNOWNS * len(burns)).reshape(-1, UNKNOWNS)[:, 4]
        x = fit.mean.copy()
        x[durations] = 0.0
        noise = np.full(3 * self.cells, self.width / np.exp(fit.theta[0]))
        precision = np.concatenate([self._prior(burns).precision(np.zeros(0)), noise])
        gone = durations
        if not self._noisy(fit):
            gone = np.append(durations, np.arange(len(x) - len(noise), len(x)))
            x[gone] = 0.0
        kept = np.setdiff1d(np.arange(len(x)), gone)
        squares = float(self._gram[-1, -1] - 2 * rhs @ x + x @ matrix @ x) / fit.variance + float(precision @ (x * x))
        right = ((rhs - matrix @ x) / fit.variance - precision * x)[kept]
        known = (matrix / fit.variance + np.diag(precision))[np.ix_(kept, kept)]
        return squares - float(right @ _solved(known, right[:, None])[:, 0])

    def _window(self, fit: BurnFit) -> Burn | None:
        """The window of the greatest gain beside the burns of a fit; None if it gains too little to be tried."""
        first, last = _windows(self.cells, max(int(LONGEST * self.cells), 1))
        information, score = self._of_windows(fit, first, last)
        values, vectors = np.linalg.eigh(information)
        values = np.maximum(values, 1e-12 * np.maximum(values[:, -1:], 1e-300))
        along = np.einsum("kij,ki->kj", vectors, score)
        size = SIZES / values.mean(axis=1)[:, None]
        grown = 1 + size[:, :, None] * values[:, None]
        gain = ((along**2)[:, None] * size[:, :, None] / grown - np.log(grown)).sum(axis=2)
        k, s = np.unravel_index(int(np.argmax(gain)), gain.shape)
        if gain[k, s] <= WORTH_TRYING:
            return None
        begin, end = float(self.edges[first[k]]), float(self.edges[last[k]])
        acceleration = vectors[k] @ (along[k] * size[k, s] / grown[k, s])
        slack = max(self.width, self._gap(begin, end))
        deviation = float(np.sqrt(size[k, s])) * (end - begin)
        return Burn(begin, end, acceleration * (end - begin), deviation, (slack, max(slack, (end - begin) / 2)))

    def _of_windows(self, fit: BurnFit, first: IntArray, last: IntArray) -> tuple[FloatArray, FloatArray]:
        """The information (k, 3, 3) on a constant acceleration in windows, and its right-hand side (k, 3).

        It is what is left beside all that a fit has. first, last (k,): the windows' cells, the last not included.
        """
        others, n = len(fit.rhs) - 3 * self.cells, self.cells
        matrix, rhs = fit.matrix / fit.variance, fit.rhs / fit.variance
        known = matrix[:others, :others] + np.diag(self._prior(fit.burns).precision(np.zeros(0)))
        mixed = np.column_stack([matrix[:others, others:], rhs[:others]])
        gone = mixed[:, :-1].T @ _solved(known, mixed)
        own = np.column_stack([matrix[others:, others:], rhs[others:]]) - gone
        density = float(np.exp(fit.theta[0]))
        own -= own[:, :-1] @ _solved(own[:, :-1] + self.width / density * np.eye(3 * n), own)
        sums = np.zeros((n + 1, n + 1, 3, 3))
        sums[1:, 1:] = np.moveaxis(own[:, :-1].reshape(n, 3, n, 3), 1, 2).cumsum(axis=0).cumsum(axis=1)
        ends = np.concatenate([np.zeros((1, 3)), own[:, -1].reshape(n, 3).cumsum(axis=0)])
        found = sums[last, last] - sums[first, last] - sums[last, first] + sums[first, first]
        return (found + np.swapaxes(found, 1, 2)) / 2, ends[last] - ends[first]

    def _gap(self, begin: float, end: float) -> float:
        """The longest time without a frame that begin … end touch, s."""
        times = np.unique(self.time[self.frame])
        near = (times[1:] >= begin) & (times[:-1] <= end)
        return float(np.diff(times)[near].max(initial=0.0))


def burn_search(
    registered: Registered, few: Subsample, time: FloatArray, base: Path, found: Solution, orbit: Orbit
) -> BurnSearch:
    """The search beside a path without process noise.

    few: a subsample of the bodies, with times (n,) in s of its frames; found: a solution without burns, about whose
    path the equations are linear, and whose offsets weigh the frames.
    """
    x = found.x[: base.size]
    n = int(np.clip(len(time) // FRAMES_PER_CELL, FEWEST_CELLS, MOST_CELLS))
    edges = np.linspace(time.min(), time.max(), n + 1)
    sampled = base.at(time)
    cells = _cells(base, orbit, edges, time)
    columns = np.concatenate([sampled.jacobian, cells @ _smooth(orbit, edges), cells], axis=2)
    offset = sampled.position(x) - sampled.jacobian @ x
    bodies, count, rows = few.bodies, len(few.bodies), []
    for index, (body, origin, step) in enumerate(zip(bodies, registered.origins, few.steps, strict=True)):
        own = np.zeros((len(body.frames), 3, 3 * count))
        own[:, :, 3 * index : 3 * index + 3] = body.attitude
        left = (origin[::step] - offset[body.frames])[:, :, None]
        rows.append(np.concatenate([own, columns[body.frames], left], axis=2))
    frames, smooth = np.concatenate([body.frames for body in bodies]), Prior.known(np.full(SMOOTH, BROAD**2))
    others = Prior.none(3 * count).joined(base.prior).joined(smooth)
    distance = max(float(np.abs(origin).max()) for origin in registered.origins)
    least = (ROUNDING * distance) ** 2
    both = zip(registered.bodies, found.bodies, strict=True)
    offsets = tuple(after.points.mean(axis=0) - before.points.mean(axis=0) for before, after in both)
    root, all_rows = np.tile(np.eye(3), (len(frames), 1, 1)), np.concatenate(rows)
    search = BurnSearch(few, all_rows, frames, root, time, edges, base, orbit, others, registered.noise, least)
    return search.weighted(offsets)


def _cells(base: Path, orbit: Orbit, edges: FloatArray, time: FloatArray) -> FloatArray:
    """The responses (n, 3, 3 c) to a unit acceleration of the chaser in each of c cells, at times (n,), m."""
    panels = Panels.over(time, float(edges[0]), longest_on(orbit, float(edges[0]), float(edges[-1])), edges)
    at, c = panels.points, len(edges) - 1
    pushes = np.zeros((len(at), 3, c, 3))
    pushes[np.arange(len(at)), :, np.clip(np.searchsorted(edges, at, "right") - 1, 0, c - 1)] = -burn_axes(orbit, at)
    return LinearMotion.over(panels, base.gravity_gradient).forced(pushes.reshape(len(at), 3, -1)).position(time)


def _smooth(orbit: Orbit, edges: FloatArray) -> FloatArray:
    """The accelerations (3 c, SMOOTH) in c cells that are constant in LVLH, or turn once or twice in an orbit."""
    axes = lvlh_axes(target_states(orbit, (edges[1:] + edges[:-1]) / 2))
    along, ahead = axes[:, :, 0] @ axes[0, :, 0], axes[:, :, 0] @ axes[0, :, 1]
    angle = np.arctan2(ahead, along)
    shapes = [np.ones_like(angle), np.cos(angle), np.sin(angle), np.cos(2 * angle), np.sin(2 * angle)]
    return np.kron(np.array(shapes).T, np.eye(3))


def _windows(cells: int, most: int) -> tuple[IntArray, IntArray]:
    """All windows of at most so many consecutive cells: the first (k,), and that after the last (k,)."""
    first, length = (one.ravel() for one in np.meshgrid(np.arange(cells), np.arange(1, most + 1), indexing="ij"))
    inside = first + length <= cells
    return first[inside], (first + length)[inside]


def _solved(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """The solution of a positive definite system, scaled to a unit diagonal."""
    scale = 1 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    factor = cho_factor(matrix * np.outer(scale, scale) + RIDGE * np.eye(len(matrix)))
    return np.asarray(scale[:, None] * cho_solve(factor, scale[:, None] * right))

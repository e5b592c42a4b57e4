"""The linear equations of the drifting pivot with unknown burns, c_k = g(t_k; x) + R_k d, and their solution.

These have the attitudes of `poses`, so that metres of error of the path do no harm. The time is cut into cells of equal
length, with an acceleration of its own in each. Their prior is white noise of a density of maximum marginal likelihood.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotrs

from baryscope.estimator.hyperparameters.evidence import (
    GaussianLikelihood,
    cholesky,
    conditional,
    cost,
    held,
    maximise,
    solved,
)
from baryscope.estimator.paths.burns import UNKNOWNS, Burn, BurnedPath, burn_axes
from baryscope.estimator.paths.forces import BROAD, longest_on
from baryscope.estimator.paths.linear_motion import LinearMotion, Panels
from baryscope.estimator.paths.path import Path
from baryscope.estimator.paths.prior import Hyperparameter, Prior
from baryscope.estimator.paths.process_noise import DENSITY
from baryscope.estimator.pivot.burns.poses import Posed
from baryscope.estimator.pivot.drift import roots_in_C
from baryscope.models.ephemeris.trajectory import lvlh_axes, target_states
from baryscope.models.orbit import Orbit

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

FEWEST_CELLS, MOST_CELLS, FRAMES_PER_CELL = 8, 128, 4
LONGEST = 1 / 6  # of the span, that a burn lasts
LONGEST_WITHOUT_ORBIT = 200.0  # s, in which no orbit about the Earth turns by more than 0.35 rad, even at its periapsis
NOISE_ROUNDS = 2  # of the observations' variance and of the noise's density by turns
BENT = 0.1  # of the deviation of a mean of all frames: what the path may be off by, where it is linear in the burns
SETTLING = 8  # fits of the burns' times
FAINT = 1e-14  # m/s²: an acceleration without an effect, 1 mm in five days
TOLERANCE = 3.0  # of 2 ln p, by which the priors' changes with the times may lower it


@dataclass(frozen=True, eq=False)
class BurnFit:
    """Burns, and the posterior of all unknowns: of bodies' offsets, path, burns and cells, in this order.

    score: −2 ln p up to a constant. It is that of the best attitudes, so that the frames' variances do not count: they
    would make small offsets likelier. variance of an observation of weight 1; theta: the hyperparameters of the path,
    and the logarithm of the noise's density; matrix and rhs: the normal equations. bend (n, 3): what gravity beyond its
    gradient adds to the response to the burns, m, None if that is nothing.
    """

    burns: tuple[Burn, ...]
    score: float
    variance: float
    theta: FloatArray
    mean: FloatArray
    covariance: FloatArray
    matrix: FloatArray
    rhs: FloatArray
    bend: FloatArray | None

    @property
    def density(self) -> float:
        """The density of the noise, m²/s³."""
        return float(np.exp(self.theta[-1]))


@dataclass(frozen=True)
class Limit:
    """Of a fit: the greatest logarithm of the noise's density, and the variance unless it is estimated."""

    density: float = np.inf
    variance: float | None = None


FREE = Limit()


@dataclass(frozen=True, eq=False)
class BurnEquations:
    """The equations of all poses, with unknowns of offsets, path and cells.

    rows (f, 3, u + 3 c + 1): the equations, the last column being what is observed; frame (f,): of which rows of `time`
    (n,) in s; root (f, 3, 3) of the inverse of their covariance; edges (c + 1,) of the cells in s; base: the path
    without process noise; others: the prior of the u unknowns before the cells.
    """

    posed: Posed
    rows: FloatArray
    frame: IntArray
    root: FloatArray
    time: FloatArray
    edges: FloatArray
    base: Path
    orbit: Orbit | None
    others: Prior

    @property
    def variance(self) -> float:
        """The variance of an observation of weight 1, as the poses have it, m², or 1 with covariances."""
        return self.posed.poses.variance

    @property
    def offsets(self) -> int:
        """The number of unknowns of the offsets."""
        return self.posed.offsets.size

    @property
    def cells(self) -> int:
        """The number of cells."""
        return len(self.edges) - 1

    @property
    def width(self) -> float:
        """The length of a cell in s."""
        return float(self.edges[1] - self.edges[0])

    @property
    def longest(self) -> float:
        """How long a burn may last, s."""
        share = LONGEST * float(self.edges[-1] - self.edges[0])
        return share if self.orbit is not None else min(share, LONGEST_WITHOUT_ORBIT)

    def may_be_one(self, burn: Burn) -> bool:
        """Whether a burn may be one, and not what gravity does where the orbit is not known."""
        return self.orbit is not None or burn.duration <= self.longest

    def weighted(self, offsets: FloatArray) -> "BurnEquations":
        """The equations with the weights of the frames for the offsets (k, 3) of all axes, m."""
        return replace(self, root=roots_in_C(self.posed.poses.attitude, self.posed.covariances(offsets)))

    def fitted(
        self,
        burns: tuple[Burn, ...],
        variance: float,
        rounds: int,
        limit: Limit = FREE,
        bend: FloatArray | None = None,
        theta: FloatArray | None = None,
        near: FloatArray | None = None,
    ) -> BurnFit:
        """The posterior of all unknowns for burns with given times, from a variance.

        bend: see `BurnFit`; theta: hyperparameters that are held, None for those of maximum likelihood, which are
        sought near others or over their ranges.
        """
        matrix, rhs, total = self._equations(burns, bend)
        prior, values, best = self.whole_prior(burns), 3 * len(self.rows), near if theta is None else theta
        for _ in range(rounds):
            linear = GaussianLikelihood(matrix / variance, rhs / variance, np.zeros(len(rhs)))
            best = _limited(linear, prior, best, limit.density) if theta is None else theta
            mean, covariance = conditional(linear, prior, best)
            score = cost(linear, prior, best) + total / variance + values * float(np.log(variance))
            if limit.variance is not None:
                break
            left = values - float(np.vdot(linear.information, covariance))
            squares = total - 2 * float(rhs @ mean) + float(mean @ matrix @ mean)
            variance = max(squares / max(left, 1.0), self.posed.poses.least)
        assert best is not None  # noqa: S101  there was a round
        return BurnFit(burns, score, variance, best, mean, covariance, matrix, rhs, bend)

    def settled(self, burns: tuple[Burn, ...], about: BurnFit, limit: Limit = FREE) -> BurnFit:
        """The fit with the burns' times at their maximum; about: a fit whose path and variance are near.

        How smooth its path is holds with other burns, too, but the noise's density is sought in its whole range: it
        stands for the burns that one of the two has not.
        """
        variance, x = about.variance, self.path_in(about)
        if not burns:
            return self.fitted((), variance, NOISE_ROUNDS, limit)
        u = len(self.others.offset)
        bend = self.burned(burns, x).bend(self.time)
        if bend is not None and np.abs(bend).max() < BENT * np.sqrt(variance / len(self.frame)):
            bend = None
        first = self.fitted(burns, variance, 1, limit, bend, near=np.append(about.theta[:-1], np.nan))
        own = slice(u, u + UNKNOWNS * len(burns))
        mean, covariance, x = first.mean[own], first.covariance[own, own], self.path_in(first)
        moving = _WithNoise(self, first.variance, first.theta)
        for _ in range(SETTLING):
            burns, still = self.burned(burns).settled(mean, covariance)
            bend = None if bend is None else self.burned(burns, x).bend(self.time)
            if still:
                break
            mean, covariance, x = moving.posterior(burns, bend)
        fit = self.fitted(burns, first.variance, NOISE_ROUNDS, limit, bend, near=first.theta)
        return fit if fit.score < first.score + TOLERANCE else first

    def without_smooth(self, fit: BurnFit) -> BurnFit:
        """The fit without accelerations that are no burns, which the path has none of: it has to do with its noise."""
        own = self.offsets + self.base.size
        if own == len(self.others.offset):
            return fit
        offset = np.append(self.others.offset[:own], np.full(len(self.others.offset) - own, 2 * np.log(FAINT)))
        alone = replace(self, others=replace(self.others, offset=offset))
        return alone.fitted(fit.burns, fit.variance, NOISE_ROUNDS, bend=fit.bend, near=fit.theta)

    def path_in(self, fit: BurnFit) -> FloatArray:
        """The unknowns (p,) of the path in a fit."""
        return fit.mean[self.offsets : self.offsets + self.base.size]

    def duration_costs(self, others: tuple[Burn, ...], tried: tuple[Burn, ...], fit: BurnFit) -> FloatArray:
        """−2 ln p (t,) of burns with each of those that are tried, up to a constant, with their durations as they are,
        variance and hyperparameters those of a fit, and all else at its maximum.
        """
        return _WithNoise(self, fit.variance, fit.theta).duration_costs(others, tried, fit.bend)

    def known(self, fit: BurnFit) -> FloatArray:
        """The information on offsets, path and burns of a fit without noise, for known cells, and that of the prior."""
        matrix = fit.matrix[: -3 * self.cells, : -3 * self.cells] / fit.variance
        return np.asarray(matrix + np.diag(self.prior(fit.burns).precision(fit.theta[:-1])))

    def cost_of_noise(self, fit: BurnFit) -> float:
        """The deviation of the offsets over that without noise, burns being as they are."""
        own = slice(self.offsets)
        known = self.known(fit)
        quiet = solved(known, np.eye(len(known))[:, own])[own]
        return float(np.sqrt(np.trace(fit.covariance[own, own]) / np.trace(quiet)))

    @cached_property
    def _weighted(self) -> FloatArray:
        """The equations times the root of their weight."""
        rows = self.root @ self.rows
        return np.asarray(rows.reshape(-1, rows.shape[2]))

    @cached_property
    def gram(self) -> FloatArray:
        """The products of all columns of the weighted equations, what is observed being the last."""
        return np.asarray(self._weighted.T @ self._weighted)

    def burned(self, burns: tuple[Burn, ...], about: FloatArray | None = None) -> BurnedPath:
        """The path with burns; about: see `BurnedPath`."""
        return BurnedPath(self.base, self.orbit, burns, float(self.edges[0]), float(self.edges[-1]), about)

    def prior(self, burns: tuple[Burn, ...]) -> Prior:
        """The prior of offsets, path and burns."""
        return self.others.joined(Prior.known(self.burned(burns).variances)) if burns else self.others

    def whole_prior(self, burns: tuple[Burn, ...]) -> Prior:
        """The prior of all unknowns, with the white noise of the cells."""
        count, density = 3 * self.cells, Hyperparameter(DENSITY, optional=True)
        return self.prior(burns).joined(Prior(np.full(count, -np.log(self.width)), np.ones((count, 1)), (density,)))

    def _equations(self, burns: tuple[Burn, ...], bend: FloatArray | None) -> tuple[FloatArray, FloatArray, float]:
        """The normal equations (p, p) and (p,) of offsets, path, burns and cells; and Σ of the observed squares."""
        u, k, gram = len(self.others.offset), UNKNOWNS * len(burns), self.gram
        size, part = len(gram) - 1 + k, self.of_burns(burns, bend)
        places, own = np.concatenate([np.arange(u), np.arange(u + k, size)]), np.arange(u, u + k)
        matrix, rhs = np.zeros((size, size)), np.zeros(size)
        matrix[np.ix_(places, places)], rhs[places] = gram[:-1, :-1], part.others
        matrix[np.ix_(own, places)], rhs[own] = part.cross, part.rhs
        matrix[np.ix_(places, own)], matrix[np.ix_(own, own)] = part.cross.T, part.own
        return matrix, rhs, part.total

    def of_burns(self, burns: tuple[Burn, ...], bend: FloatArray | None) -> "_OfBurns":
        """What burns make of the normal equations."""
        gram, k = self.gram, UNKNOWNS * len(burns)
        if not burns:
            return _OfBurns(np.zeros((0, len(gram) - 1)), np.zeros((0, 0)), np.zeros(0), gram[:-1, -1], gram[-1, -1])
        columns = (self.root @ self.burned(burns).columns(self.time)[self.frame]).reshape(-1, k)
        cross, moved = columns.T @ self._weighted, np.zeros(len(columns))
        if bend is not None:
            moved = (self.root @ bend[self.frame][:, :, None]).ravel()
        by_others = moved @ self._weighted
        total = float(gram[-1, -1] + moved @ moved - 2 * by_others[-1])
        rhs = cross[:, -1] - moved @ columns
        return _OfBurns(cross[:, :-1], columns.T @ columns, rhs, gram[:-1, -1] - by_others[:-1], total)


@dataclass(frozen=True, eq=False)
class _OfBurns:
    """What k unknowns of burns make of the normal equations with o others, those of the cells last.

    cross (k, o), own (k, k): the information; rhs (k,) of the burns, others (o,) that of the others; total: Σ of the
    observed squares.
    """

    cross: FloatArray
    own: FloatArray
    rhs: FloatArray
    others: FloatArray
    total: float


@dataclass(frozen=True, eq=False)
class _WithNoise:
    """The equations with a variance and hyperparameters, which are held while the burns' times move.

    All but the burns then is factored once.
    """

    equations: BurnEquations
    variance: float
    theta: FloatArray

    @cached_property
    def _factor(self) -> FloatArray:
        """The Cholesky factor of the information and the prior of offsets, path and cells."""
        information = self.equations.gram[:-1, :-1] / self.variance
        linear, none = GaussianLikelihood(information, np.zeros(0), np.zeros(0)), self.equations.whole_prior(())
        return cholesky(information, held(linear, none, self.theta)[0])

    def posterior(self, burns: tuple[Burn, ...], bend: FloatArray | None) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Mean (k,) and covariance (k, k) of the unknowns of the burns, and the mean (p,) of the path's."""
        told, right, alone = self._of_burns(burns, bend)
        covariance = solved(told, np.eye(len(told)))
        mean = covariance @ right
        first = self.equations.offsets
        path = (alone[:, -1] - alone[:, :-1] @ mean)[first : first + self.equations.base.size]
        return mean, covariance, path

    def duration_costs(self, others: tuple[Burn, ...], tried: tuple[Burn, ...], bend: FloatArray | None) -> FloatArray:
        """See `BurnEquations.duration_costs`."""
        told, right, _ = self._of_burns((*others, *tried), bend)
        kept = np.arange(len(told)).reshape(-1, UNKNOWNS)[:, :-1]
        first, costs = kept[: len(others)].ravel(), []
        for own in kept[len(others) :]:
            index = np.concatenate([first, own])
            costs.append(-float(right[index] @ solved(told[np.ix_(index, index)], right[index, None])[:, 0]))
        return np.array(costs)

    def _of_burns(self, burns: tuple[Burn, ...], bend: FloatArray | None) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The information (k, k) on the unknowns of burns with that of their prior, its right-hand side (k,), and all
        other unknowns as they were without burns, by the burns' and by what is observed, (o, k + 1).
        """
        equations = self.equations
        part = equations.of_burns(burns, bend)
        right = np.column_stack([part.cross.T, part.others]) / self.variance
        alone = np.asarray(dpotrs(self._factor, right, lower=True)[0])
        told = (part.own - part.cross @ alone[:, :-1]) / self.variance
        told.flat[:: len(told) + 1] += 1 / equations.burned(burns).variances
        return (told + told.T) / 2, (part.rhs - part.cross @ alone[:, -1]) / self.variance, alone


def burn_equations(posed: Posed, time: FloatArray, base: Path, about: FloatArray, orbit: Orbit | None) -> BurnEquations:
    """The equations beside a path without process noise.

    time (n,) of all frames in s; about (p,): unknowns of the path, about which the equations are linear.
    """
    poses = posed.poses
    used, frame = np.unique(poses.rows, return_inverse=True)
    time = time[used]
    n = int(np.clip(len(time) // FRAMES_PER_CELL, FEWEST_CELLS, MOST_CELLS))
    edges = np.linspace(time.min(), time.max(), n + 1)
    sampled, x = base.at(time), about[: base.size]
    cells, smooth = _cells(base, orbit, edges, time), _smooth(orbit, edges)
    columns = np.concatenate([sampled.jacobian, cells @ smooth, cells], axis=2)
    known = sampled.position(x) - sampled.jacobian @ x
    own = np.zeros((len(frame), 3, posed.offsets.size))
    np.put_along_axis(own, (3 * poses.axes[:, None] + np.arange(3))[:, None], poses.attitude, axis=2)
    rows = np.concatenate([own, columns[frame], (poses.origin - known[frame])[:, :, None]], axis=2)
    free, slow = Prior.none(posed.offsets.size), Prior.known(np.full(smooth.shape[1], BROAD**2))
    others, root = free.joined(base.prior).joined(slow), np.tile(np.eye(3), (len(frame), 1, 1))
    return BurnEquations(posed, rows, frame, root, time, edges, base, orbit, others).weighted(posed.offsets)


def _cells(base: Path, orbit: Orbit | None, edges: FloatArray, time: FloatArray) -> FloatArray:
    """The responses (n, 3, 3 c) to a unit acceleration of the chaser in each of c cells, at times (n,), m."""
    panels = Panels.over(time, float(edges[0]), longest_on(orbit, float(edges[0]), float(edges[-1])), edges)
    at, c = panels.points, len(edges) - 1
    pushes = np.zeros((len(at), 3, c, 3))
    pushes[np.arange(len(at)), :, np.clip(np.searchsorted(edges, at, "right") - 1, 0, c - 1)] = -burn_axes(orbit, at)
    return LinearMotion.over(panels, base.gravity_gradient).forced(pushes.reshape(len(at), 3, -1)).position(time)


def _smooth(orbit: Orbit | None, edges: FloatArray) -> FloatArray:
    """The accelerations (3 c, 15) in c cells that are constant in LVLH, or turn once or twice in an orbit.

    They are no burns. Without an orbit there are none (3 c, 0): the path itself is smooth.
    """
    if orbit is None:
        return np.zeros((3 * (len(edges) - 1), 0))
    axes = lvlh_axes(target_states(orbit, (edges[1:] + edges[:-1]) / 2))
    along, ahead = axes[:, :, 0] @ axes[0, :, 0], axes[:, :, 0] @ axes[0, :, 1]
    angle = np.arctan2(ahead, along)
    shapes = [np.ones_like(angle), np.cos(angle), np.sin(angle), np.cos(2 * angle), np.sin(2 * angle)]
    return np.kron(np.array(shapes).T, np.eye(3))


def _limited(linear: GaussianLikelihood, prior: Prior, start: FloatArray | None, most: float) -> FloatArray:
    """The likeliest hyperparameters (h,), the last of which is limited."""
    theta = maximise(linear, prior, start)
    return theta if theta[-1] <= most else np.append(maximise(linear, prior.fixed(DENSITY, most), theta[:-1]), most)

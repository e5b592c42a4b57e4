"""The search for unknown burns in the linear equations of `equations`.

A burn is an acceleration of a variance of its own in some consecutive cells. The gain of all such windows in 2 ln p
follows from sums over the information on the cells (sparse Bayesian learning: Tipping and Faul 2003). The window of the
greatest gain becomes a burn, whose times are then fitted together with those of all others, and the noise anew. Of all
numbers of burns the likeliest is taken, at a price for each: that of the windows looked at.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.hyperparameters.evidence import RIDGE, solved
from baryscope.estimator.paths.burns import UNKNOWNS, Burn
from baryscope.estimator.pivot.burns.equations import FREE, NOISE_ROUNDS, BurnEquations, BurnFit, Limit

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

DURATIONS = 24  # at which the likelihood of a duration is looked at that is less than TOLD deviations
TOLD, RANGE = 12.0, 5.0  # and up to RANGE deviations above it
MOST_BURNS, MOST_HIDDEN = 32, 6  # with noise of any density, and with less of it than all burns need
MOST_WITHOUT_ORBIT = 8  # on a smooth path, as each takes seconds: a path that needs more is not smooth beside them
QUIETER = (1e-2, 1e-4)  # shares of the noise that stands for all burns
COSTLY = 10.0  # times as inaccurate as without noise are the offsets: then it is looked for burns once more
PATIENCE = 2  # burns that are added although they make the model less likely
ODDS, MORE = 1e3, 2.0  # against any burn before the tracks are looked at, and against one more
SIZES = np.exp(np.linspace(0.0, 16.0, 17))  # of a burn's variance, over that which the tracks just tell
WORTH_TRYING = 10.0  # gain of a window in 2 ln p, for noise that may have to stand for the burn as well


def price(count: int) -> float:
    """What so many burns must gain in 2 ln p by being there at all, at any time."""
    return 2 * float(np.log(ODDS) + count * np.log(MORE)) if count else 0.0


def likeliest(equations: BurnEquations) -> tuple[BurnEquations, BurnFit]:
    """The fit with the likeliest burns, and the equations with the weights that belong to it.

    Noise that has to stand for burns lets the path follow the body's rotation, which hides a wrong offset, and so
    the burns. If noise is left beside the burns, they are looked for once more with less of it. The frames' noise
    depends on the offset, so that solutions are compared with weights of their own.
    """
    none = equations.fitted((), equations.variance, NOISE_ROUNDS)
    own, best = equations, _extended(equations, none)
    if equations.cost_of_noise(best) >= COSTLY:
        own, best = _reweighted(equations, best, FREE)
        for share in QUIETER:
            limit = Limit(float(none.theta[-1] + np.log(share)))
            held = replace(limit, variance=equations.variance)
            found = _extended(equations, equations.fitted((), equations.variance, 1, held), held)
            other, found = _reweighted(equations, found, limit)
            if _total(other, found) < _total(own, best):
                own, best = other, found
    return own, _spread(own, best) if best.burns else best


def without(equations: BurnEquations, fit: BurnFit, indices: IntArray) -> BurnFit:
    """The fit without some of its burns."""
    rest = tuple(burn for index, burn in enumerate(fit.burns) if index not in indices)
    found = equations.settled(rest, fit)
    return _spread(equations, found) if rest else found


def _reweighted(equations: BurnEquations, fit: BurnFit, limit: Limit) -> tuple[BurnEquations, BurnFit]:
    """The equations with weights for the offsets of a fit, and the fit with these and with a free variance."""
    found = equations.weighted(fit.mean[: equations.offsets].reshape(-1, 3))
    return found, found.settled(fit.burns, replace(fit, variance=equations.variance), limit)


def _extended(equations: BurnEquations, start: BurnFit, limit: Limit = FREE) -> BurnFit:
    """The likeliest of a fit with no burn, one burn, and so on."""
    best = current = start
    most = MOST_BURNS if limit is FREE else MOST_HIDDEN
    most = most if equations.orbit is not None else min(most, MOST_WITHOUT_ORBIT)
    while len(current.burns) < min(most, len(best.burns) + PATIENCE):
        window = _window(equations, current)
        if window is None:
            break
        current = equations.settled((*current.burns, window), current, limit)
        if all(map(equations.may_be_one, current.burns)) and _total(equations, current) < _total(equations, best):
            best = current
    return best


def _total(equations: BurnEquations, fit: BurnFit) -> float:
    """The score and the price of the burns, that of the windows looked at included."""
    windows = equations.cells * max(equations.longest / equations.width, 1.0)
    return fit.score + price(len(fit.burns)) + 2 * len(fit.burns) * float(np.log(windows))


def _spread(equations: BurnEquations, fit: BurnFit) -> BurnFit:
    """The fit about the mean durations, which are held there with their deviations, where the tracks hardly tell them.

    The path is not linear in a duration that may be near zero, or that lies in a time without frames. The mean is
    that over the likelihood of a range of durations, with all else at its maximum but for the noise.
    """
    u, span = len(equations.others.offset), float(equations.edges[-1] - equations.edges[0])
    burns = list(fit.burns)
    for index, burn in enumerate(fit.burns):
        at = u + UNKNOWNS * index + UNKNOWNS - 1
        deviation = np.sqrt(fit.covariance[at, at]) / burn.speed
        middle, most = (burn.begin + burn.end) / 2, max(equations.longest, burn.slack[1])
        most = min(most, 2 * (middle - equations.edges[0]), 2 * (equations.edges[-1] - middle))
        flat = (span / np.sqrt(12), most / np.sqrt(12))
        burns[index] = replace(burn, slack=flat)
        if TOLD * deviation < burn.duration:
            continue
        step = min(most, burn.duration + RANGE * deviation) / DURATIONS
        durations = step * (np.arange(DURATIONS) + 0.5)
        tried = tuple(replace(burn, begin=middle - one / 2, end=middle + one / 2, slack=flat) for one in durations)
        costs = equations.duration_costs((*burns[:index], *burns[index + 1 :]), tried, fit)
        weight = np.exp(-(costs - costs.min()) / 2)
        weight /= weight.sum()
        mean = float(weight @ durations)
        spread = float(np.sqrt(weight @ (durations - mean) ** 2))
        begin, end = middle - mean / 2, middle + mean / 2
        burns[index] = replace(burn, begin=begin, end=end, slack=flat, untold=max(spread, step))
    return equations.fitted(tuple(burns), fit.variance, 1, bend=fit.bend, near=fit.theta)


def _window(equations: BurnEquations, fit: BurnFit) -> Burn | None:
    """The window of the greatest gain beside the burns of a fit; None if it gains too little to be tried."""
    first, last = _windows(equations.cells, max(int(equations.longest / equations.width), 1))
    information, score = _of_windows(equations, fit, first, last)
    values, vectors = np.linalg.eigh(information)
    shown = values[:, -1] > 0  # of the others nothing is left above the rounding
    if not shown.any():
        return None
    first, last, score, vectors = first[shown], last[shown], score[shown], vectors[shown]
    values = np.maximum(values[shown], 1e-12 * values[shown, -1:])
    along = np.einsum("kij,ki->kj", vectors, score)
    size = SIZES / values.mean(axis=1)[:, None]
    grown = 1 + size[:, :, None] * values[:, None]
    gain = ((along**2)[:, None] * size[:, :, None] / grown - np.log(grown)).sum(axis=2)
    k, s = np.unravel_index(int(np.argmax(gain)), gain.shape)
    if gain[k, s] <= WORTH_TRYING:
        return None
    begin, end = float(equations.edges[first[k]]), float(equations.edges[last[k]])
    acceleration = vectors[k] @ (along[k] * size[k, s] / grown[k, s])
    slack = max(equations.width, _gap(equations, begin, end))
    deviation = float(np.sqrt(size[k, s])) * (end - begin)
    return Burn(begin, end, acceleration * (end - begin), deviation, (slack, max(slack, (end - begin) / 2)))


def _of_windows(
    equations: BurnEquations, fit: BurnFit, first: IntArray, last: IntArray
) -> tuple[FloatArray, FloatArray]:
    """The information (k, 3, 3) on a constant acceleration in windows, and its right-hand side (k, 3).

    It is what is left beside all that a fit has. first, last (k,): the windows' cells, the last not included.
    """
    others, n = len(fit.rhs) - 3 * equations.cells, equations.cells
    matrix, rhs = fit.matrix / fit.variance, fit.rhs / fit.variance
    mixed = np.column_stack([matrix[:others, others:], rhs[:others]])
    gone = mixed[:, :-1].T @ solved(equations.known(fit), mixed)
    own = np.column_stack([matrix[others:, others:], rhs[others:]]) - gone
    own.flat[:: 3 * n + 2] += RIDGE * matrix.diagonal()[others:]  # what is left of the difference is above its rounding
    own -= own[:, :-1] @ solved(own[:, :-1] + equations.width / fit.density * np.eye(3 * n), own)
    sums = np.zeros((n + 1, n + 1, 3, 3))
    sums[1:, 1:] = np.moveaxis(own[:, :-1].reshape(n, 3, n, 3), 1, 2).cumsum(axis=0).cumsum(axis=1)
    ends = np.concatenate([np.zeros((1, 3)), own[:, -1].reshape(n, 3).cumsum(axis=0)])
    found = sums[last, last] - sums[first, last] - sums[last, first] + sums[first, first]
    return (found + np.swapaxes(found, 1, 2)) / 2, ends[last] - ends[first]


def _gap(equations: BurnEquations, begin: float, end: float) -> float:
    """The longest time without a frame that begin … end touch, s."""
    times = np.unique(equations.time[equations.frame])
    near = (times[1:] >= begin) & (times[:-1] <= end)
    return float(np.diff(times)[near].max(initial=0.0))


def _windows(cells: int, most: int) -> tuple[IntArray, IntArray]:
    """All windows of at most so many consecutive cells: the first (k,), and that after the last (k,)."""
    first, length = (one.ravel() for one in np.meshgrid(np.arange(cells), np.arange(1, most + 1), indexing="ij"))
    inside = first + length <= cells
    return first[inside], (first + length)[inside]

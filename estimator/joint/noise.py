"""Linear equations whose noise has any spectrum, and a part that is a function of the motion: restricted likelihood.

Along time, the equations are taken to the cosine transform (DCT-II), in which a stationary process is nearly diagonal,
so that its spectrum is a variance for each band of frequencies. What keeps time with the motion is not stationary
against it: it is a random combination of given functions of time. All variances are those of the greatest restricted
likelihood (Patterson and Thompson, Biometrika 58, 1971), by MacKay's fixed point (Neural Computation 4, 1992): the
squares of what is left, or of a coefficient, over how many of them are free. A band counts as one coefficient more, of
the variance of itself and its neighbours, so that none is taken for silent that the unknowns explain. The variance of a
group of functions may hang on the few combinations of them that the unknowns can't explain: the covariance is that over
its posterior, log-uniform up to functions as large as anything can be.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.fft import dct

from baryscope.estimator.tracks import FloatArray, IntArray

ROUNDS = 100
TAPER = 0.2  # share of the time in which the window rises or falls
CONVERGED = 1e-2  # in the logarithm of a variance
LEAST_BAND, WIDER = 3, 1.2  # coefficients in a band at least, and the ratio of its ends
ROUNDING = 1e-24  # of the squares of what is given: a variance below is rounding
AT_FIRST = 0.3  # share of the residuals' variance that a group of functions has at first
QUIETEST = 0.5  # variance of a band over the mean beyond the last one that is used
NEGLIGIBLE = 1e-6  # of the variance at first: a smaller one of a function counts as none
STEP = 2.0  # ratio of one variance of a group to the next, over which the covariance is integrated
MOST_STEPS, LEAST_SHARE = 24, 1e-4  # of them either way, and the share of the greatest likelihood at which they end


@dataclass(frozen=True, eq=False)
class Fit:
    """Unknowns (p,), their covariance (p, p), and the noise beside them.

    kept (k,): which coefficients of the cosine transform are used; spectrum (k,): their variances in a coordinate;
    locked (n, c): what keeps time with the motion; likelihood: the restricted one's logarithm, up to a constant.
    """

    found: FloatArray
    covariance: FloatArray
    kept: IntArray
    spectrum: FloatArray
    locked: FloatArray
    likelihood: float


def transformed(values: FloatArray) -> FloatArray:
    """The orthonormal cosine transform along the first axis, tapered at the ends: white noise keeps its variance.

    Without the taper the ends of a narrow line are seen at all frequencies.
    """
    window = _window(len(values)).reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray(dct(window * values, axis=0, norm="ortho"))


def _window(count: int) -> FloatArray:
    """Tukey's window, of the mean square 1."""
    from scipy.signal.windows import tukey  # slow to load, and other methods do without

    window = tukey(count + 2, TAPER)[1:-1]
    return np.asarray(window / np.sqrt(np.mean(window**2)))


def bands(count: int) -> IntArray:
    """Ends of the bands among so many coefficients: 0 and the ends of bands that grow with the frequency."""
    ends = [0]
    while ends[-1] < count:
        ends.append(min(count, max(ends[-1] + LEAST_BAND, int(np.ceil(ends[-1] * WIDER)))))
    if len(ends) > 2 and ends[-1] - ends[-2] < LEAST_BAND:
        ends.pop(-2)
    return np.array(ends)


def restricted_likelihood(
    design: FloatArray,
    wanted: FloatArray,
    functions: Sequence[FloatArray],
    kept: IntArray,
    largest: float | None = None,
) -> Fit:
    """Solve design @ x + noise = wanted from some coefficients along time.

    Args:
        design: (n, c, p), of c coordinates in n frames.
        wanted: (n, c).
        functions: groups (n, c, q) of functions of time, each of which may be in the noise with any coefficient; those
            of a group have one variance.
        kept: (k,), ascending, which coefficients of the transform are used.
        largest: rms that a group of functions may have in a coordinate at most, as wanted; None: the likeliest
            variances are taken for true.
    """
    c, p = design.shape[1:]
    b, F = transformed(wanted), transformed(design)
    first = np.linalg.lstsq(F.reshape(-1, p), b.ravel(), rcond=None)[0]
    left = F @ first - b
    least = ROUNDING * float(np.mean(wanted**2)) + 1e-300
    above = left[kept[-1] + 1 :]
    if len(above):  # what is white is in all bands
        least = max(least, QUIETEST * float(np.mean(above**2)))
    start = max(float(np.mean(left[kept] ** 2)), least)
    b = b[kept]
    slides = [transformed(group)[kept] for group in functions]
    X = np.concatenate([F[kept], *slides], axis=2)
    group = np.repeat(np.arange(-1, len(slides)), [p, *(slide.shape[2] for slide in slides)])
    ends = bands(len(kept))
    width = np.diff(ends)
    spectrum = np.full(len(kept), start)
    size = np.array([AT_FIRST * start * wanted.size / max(float(np.sum(one**2)), 1e-300) for one in functions])
    begun, flat = size.copy(), X.reshape(-1, X.shape[2])
    for _ in range(ROUNDS):
        found, covariance = _Reduced.of(flat, b, spectrum, group).posterior(size)
        left = ((flat @ found).reshape(b.shape) - b) ** 2
        leverage = np.sum((flat @ covariance) * flat, axis=1).reshape(b.shape) / spectrum[:, None]
        free = np.add.reduceat(np.maximum(1 - leverage, 0).sum(axis=1), ends[:-1])
        squares = np.add.reduceat(left.sum(axis=1), ends[:-1])
        around = _pooled(squares) / np.maximum(_pooled(free), 0.1 * c)
        new = np.repeat(np.maximum((squares + c * around) / (free + c), least), width)
        change = float(np.abs(np.log(new / spectrum)).max())
        spectrum = new
        for k in range(len(slides)):
            own = group == k
            told = own.sum() - np.trace(covariance[np.ix_(own, own)]) / size[k]
            value = max(float(np.sum(found[own] ** 2)) / max(told, 1e-3), NEGLIGIBLE * begun[k])
            if value > 10 * NEGLIGIBLE * begun[k]:
                change = max(change, abs(float(np.log(value / size[k]))))
            size[k] = value
        if change < CONVERGED:
            break
    reduced = _Reduced.of(flat, b, spectrum, group)
    of_noise = c * float(np.log(spectrum).sum()) + float(np.sum(b**2 / spectrum[:, None]))
    likelihood = reduced.likelihood(size, *reduced.posterior(size)) - 0.5 * of_noise
    locked = np.zeros_like(wanted)
    for k, functions_k in enumerate(functions):
        locked = locked + functions_k @ found[group == k]
    covariance = covariance[:p, :p]
    if largest is not None:
        for k, one in enumerate(functions):
            ceiling = largest**2 / (float(np.sum(one**2)) / wanted.size + 1e-300)
            covariance = covariance + reduced.growth(size, k, ceiling, p)
    wider = float(np.mean(_window(len(wanted)) ** 4))  # neighbours are correlated by the taper
    return Fit(found[:p], wider * covariance, kept, spectrum, locked, likelihood)


@dataclass(frozen=True, eq=False)
class _Reduced:
    """Normal equations of unknowns and coefficients (q,), for a spectrum, without what is known of coefficients.

    group (q,): whose coefficient it is, −1 for an unknown.
    """

    matrix: FloatArray
    rhs: FloatArray
    group: IntArray

    @classmethod
    def of(cls, flat: FloatArray, b: FloatArray, spectrum: FloatArray, group: IntArray) -> "_Reduced":
        """Those of flat (k c, q), b (k, c) and variances (k,) of the rows."""
        weighted = flat / np.repeat(spectrum, b.shape[1])[:, None]
        return cls(weighted.T @ flat, weighted.T @ b.ravel(), group)

    def posterior(self, size: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Mean (q,) and covariance (q, q) for variances (g,) of the groups."""
        known = np.zeros(len(self.group))
        known[self.group >= 0] = 1 / size[self.group[self.group >= 0]]
        covariance = np.linalg.inv(self.matrix + np.diag(known))
        return covariance @ self.rhs, np.asarray(covariance)

    def likelihood(self, size: FloatArray, mean: FloatArray, covariance: FloatArray) -> float:
        """The logarithm of their restricted likelihood, up to a constant of the spectrum, for the posterior."""
        of_groups = float(np.log(size[self.group[self.group >= 0]]).sum())
        return 0.5 * (float(mean @ self.rhs) + float(np.linalg.slogdet(covariance)[1]) - of_groups)

    def growth(self, size: FloatArray, index: int, ceiling: float, p: int) -> FloatArray:
        """By how much the covariance (p, p) of the unknowns grows as the variance of a group is not known.

        ceiling: its greatest variance.
        """
        middle, own = self.posterior(size)
        at_best = self.likelihood(size, middle, own)
        found = [(1.0, middle[:p], own[:p, :p])]
        for ratio in (STEP, 1 / STEP):
            other = size.copy()
            for _ in range(MOST_STEPS):
                other[index] *= ratio
                if other[index] > ceiling:
                    break
                mean, covariance = self.posterior(other)
                weight = float(np.exp(min(self.likelihood(other, mean, covariance) - at_best, 0.0)))
                if weight < LEAST_SHARE:
                    break
                found.append((weight, mean[:p], covariance[:p, :p]))
        total = sum(weight for weight, _, _ in found)
        second = sum(w * (of + np.outer(mean - middle[:p], mean - middle[:p])) for w, mean, of in found) / total
        values, vectors = np.linalg.eigh(second - own[:p, :p])
        return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T)


def _pooled(values: FloatArray) -> FloatArray:
    """The sum of each band and its neighbours."""
    padded = np.concatenate([[0.0], values, [0.0]])
    return np.asarray(padded[:-2] + padded[1:-1] + padded[2:])

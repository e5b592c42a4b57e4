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

ROUNDS = 100  # of spectrum and variances by turns, at most
TAPER = 0.2  # share of the time in which the window rises or falls
CONVERGED = 1e-2  # in the logarithm of a variance
LEAST_BAND, WIDER = 3, 1.2  # coefficients in a band at least, and the ratio of its ends
ROUNDING = 1e-24  # of the squares of what is given: a variance below is rounding
AT_FIRST = 0.3  # share of the residuals' variance that a group of functions has at first
QUIETEST = 0.5  # variance of a band over the mean beyond the last one that is used
KNOWN = -2  # the group of functions whose coefficients have the variance 1
NEGLIGIBLE = 1e-6  # of the variance at first: a smaller one of a function counts as none
STEP = 2.0  # ratio of one variance of a group to the next, over which the covariance is integrated
MOST_STEPS, LEAST_SHARE = 24, 1e-4  # of them either way, and the share of the greatest likelihood at which they end


@dataclass(frozen=True, eq=False)
class Fit:
    """Unknowns (p,), their covariance (p, p), and the noise beside them.

    kept (k,): which coefficients of the cosine transform are used; spectrum (k,): their variances in a coordinate;
    locked (n, c): what keeps time with the motion; variances (g,) of the coefficients of each group of functions, over
    all that the residuals allow where a largest one is given; likelihood: the restricted one's logarithm, up to a
    constant.
    """

    found: FloatArray
    covariance: FloatArray
    kept: IntArray
    spectrum: FloatArray
    locked: FloatArray
    variances: FloatArray
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


def band_variances(squares: FloatArray, free: FloatArray, ends: IntArray) -> FloatArray:
    """Variances (k,) of coefficients along time: of each band, squares (k, c) of residuals over how many of them are
    free, free (k, c), with one coefficient more, of the variance of the band and its neighbours.
    """
    c = squares.shape[1]
    total = np.add.reduceat(squares.sum(axis=1), ends[:-1])
    of_bands = np.add.reduceat(np.maximum(free, 0).sum(axis=1), ends[:-1])
    around = _pooled(total) / np.maximum(_pooled(of_bands), 0.1 * c)
    return np.repeat((total + c * around) / (of_bands + c), np.diff(ends))


def restricted_likelihood(
    design: FloatArray,
    wanted: FloatArray,
    functions: Sequence[FloatArray],
    kept: IntArray,
    largest: float | None = None,
    known: Sequence[FloatArray] = (),
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
        known: groups (n, c, q) of functions in the noise whose coefficients are of the variance 1.
    """
    p = design.shape[2]
    rows = _Rows.of(design, wanted, functions, kept, known)
    spectrum = np.full(len(kept), rows.start)
    squares = np.array([float(np.sum(one**2)) for one in functions])
    variances = AT_FIRST * rows.start * wanted.size / np.maximum(squares, 1e-300)
    least = NEGLIGIBLE * variances
    for _ in range(ROUNDS):
        mean, covariance = rows.reduced(spectrum).posterior(variances)
        before, were = spectrum, variances
        spectrum = rows.likelier_spectrum(mean, covariance, before)
        variances = rows.likelier_variances(mean, covariance, were, least)
        seen = variances > 10 * least  # a group that counts as none may go on towards none
        change = max(_change(spectrum, before), _change(variances[seen], were[seen]))
        if change < CONVERGED:
            break
    reduced = rows.reduced(spectrum)
    likelihood = reduced.likelihood(variances, *reduced.posterior(variances)) - 0.5 * rows.of_noise(spectrum)
    locked = np.zeros_like(wanted)
    for k, one in enumerate(functions):
        locked = locked + one @ mean[rows.group == k]
    if known:
        locked = locked + np.concatenate(known, axis=2) @ mean[rows.group == KNOWN]
    covariance = covariance[:p, :p]
    likely = variances.copy()
    if largest is not None:
        for k, ceiling in enumerate(largest**2 / (squares / wanted.size + 1e-300)):
            growth, likely[k] = reduced.over_variance(variances, k, float(ceiling), p)
            covariance = covariance + growth
    wider = float(np.mean(_window(len(wanted)) ** 4))  # neighbours are correlated by the taper
    return Fit(mean[:p], wider * covariance, kept, spectrum, locked, likely, likelihood)


def _change(new: FloatArray, old: FloatArray) -> float:
    """The greatest change of the logarithm of some variances."""
    return float(np.abs(np.log(new / old)).max(initial=0.0))


@dataclass(frozen=True, eq=False)
class _Rows:
    """The equations along the k coefficients that are used of the cosine transform, in c coordinates.

    matrix (k c, q): of unknowns and coefficients of functions; wanted (k, c); group (q,): whose coefficient it is, −1
    for an unknown, KNOWN for one of the variance 1; ends: of the bands among the k coefficients; start: the variance of
    every band at first, that of the residuals without any functions; least: that of a band at least.
    """

    matrix: FloatArray
    wanted: FloatArray
    group: IntArray
    ends: IntArray
    start: float
    least: float

    @classmethod
    def of(
        cls,
        design: FloatArray,
        wanted: FloatArray,
        functions: Sequence[FloatArray],
        kept: IntArray,
        known: Sequence[FloatArray],
    ) -> "_Rows":
        """The rows for the arguments of `restricted_likelihood`."""
        p = design.shape[2]
        b, F = transformed(wanted), transformed(design)
        residual = F @ np.linalg.lstsq(F.reshape(-1, p), b.ravel(), rcond=None)[0] - b
        least = ROUNDING * float(np.mean(wanted**2)) + 1e-300
        above = residual[kept[-1] + 1 :]
        if len(above):  # what is white is in all bands
            least = max(least, QUIETEST * float(np.mean(above**2)))
        start = max(float(np.mean(residual[kept] ** 2)), least)
        groups = [transformed(group)[kept] for group in functions]
        sure = [transformed(one)[kept] for one in known]
        matrix = np.concatenate([F[kept], *groups, *sure], axis=2)
        sizes = [p, *(group.shape[2] for group in groups), sum(one.shape[2] for one in sure)]
        owner = np.repeat([*range(-1, len(groups)), KNOWN], sizes)
        return cls(matrix.reshape(-1, matrix.shape[2]), b[kept], owner, bands(len(kept)), start, least)

    def reduced(self, spectrum: FloatArray) -> "_Reduced":
        """The normal equations for variances (k,)."""
        weighted = self.matrix / np.repeat(spectrum, self.wanted.shape[1])[:, None]
        return _Reduced(weighted.T @ self.matrix, weighted.T @ self.wanted.ravel(), self.group)

    def likelier_spectrum(self, mean: FloatArray, covariance: FloatArray, spectrum: FloatArray) -> FloatArray:
        """Likelier variances (k,) for a posterior (q,), (q, q) by the present ones."""
        shape = self.wanted.shape
        residual = ((self.matrix @ mean).reshape(shape) - self.wanted) ** 2
        leverage = np.sum((self.matrix @ covariance) * self.matrix, axis=1).reshape(shape) / spectrum[:, None]
        return np.maximum(band_variances(residual, 1 - leverage, self.ends), self.least)

    def likelier_variances(
        self, mean: FloatArray, covariance: FloatArray, variances: FloatArray, least: FloatArray
    ) -> FloatArray:
        """Likelier variances (g,) of the groups, by the present ones: squares over how many the rows determine."""
        found, each = np.empty_like(variances), covariance.diagonal()
        for k in range(len(variances)):
            own = self.group == k
            told = own.sum() - each[own].sum() / variances[k]
            found[k] = max(float(np.sum(mean[own] ** 2)) / max(told, 1e-3), least[k])
        return found

    def of_noise(self, spectrum: FloatArray) -> float:
        """−2 ln of the likelihood of the right side as noise alone of variances (k,), up to a constant."""
        coordinates: int = self.wanted.shape[1]
        return coordinates * float(np.log(spectrum).sum()) + float(np.sum(self.wanted**2 / spectrum[:, None]))


@dataclass(frozen=True, eq=False)
class _Reduced:
    """Normal equations of unknowns and coefficients (q,), for a spectrum, without what is known of coefficients.

    group (q,): whose coefficient it is, −1 for an unknown, KNOWN for one of the variance 1.
    """

    matrix: FloatArray
    rhs: FloatArray
    group: IntArray

    def posterior(self, variances: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Mean (q,) and covariance (q, q) for variances (g,) of the groups."""
        known = np.zeros(len(self.group))
        known[self.group == KNOWN] = 1.0
        known[self.group >= 0] = 1 / variances[self.group[self.group >= 0]]
        matrix = self.matrix.copy()
        matrix.flat[:: len(matrix) + 1] += known
        covariance = np.linalg.inv(matrix)
        return covariance @ self.rhs, np.asarray(covariance)

    def likelihood(self, variances: FloatArray, mean: FloatArray, covariance: FloatArray) -> float:
        """The logarithm of their restricted likelihood, up to a constant of the spectrum, for the posterior."""
        of_groups = float(np.log(variances[self.group[self.group >= 0]]).sum())
        return 0.5 * (float(mean @ self.rhs) + float(np.linalg.slogdet(covariance)[1]) - of_groups)

    def over_variance(self, variances: FloatArray, index: int, ceiling: float, p: int) -> tuple[FloatArray, float]:
        """By how much the covariance (p, p) of the unknowns grows as a group's variance is not known, and its mean.

        ceiling: its greatest variance. C is the covariance of all for the variance v; along the axes of the group's
        part of C, of variances s, w are its columns (q,). Another variance v′ moves the mean by −w δ/(1 + δ s) wᵀ rhs
        and the covariance by −w δ/(1 + δ s) wᵀ, with δ = 1/v′ − 1/v (Woodbury), and divides its determinant by 1 + δ s.
        """
        covariance = self.posterior(variances)[1]
        own = self.group == index
        s, axes = np.linalg.eigh(covariance[np.ix_(own, own)])
        s = np.clip(s, 0.0, variances[index])  # a posterior variance is between, but for rounding
        w = covariance[:, own] @ axes
        along = w.T @ self.rhs
        ratio = STEP ** np.arange(-MOST_STEPS, MOST_STEPS + 1.0)
        others = variances[index] * ratio
        delta = (1 / others - 1 / variances[index])[:, None]
        grown = 1 + delta * s
        lost = delta / grown
        gain = -0.5 * (lost @ along**2 + np.log(grown).sum(axis=1) + len(s) * np.log(ratio))
        weight = np.exp(np.minimum(gain, 0.0))
        ended = (others > ceiling) | (weight < LEAST_SHARE)
        below, above = np.flatnonzero(ended[:MOST_STEPS]), np.flatnonzero(ended[MOST_STEPS + 1 :])
        weight[: below.max(initial=-1) + 1] = 0.0
        weight[MOST_STEPS + 1 + above.min(initial=MOST_STEPS) :] = 0.0
        weight /= weight.sum()
        shift = lost @ (w[:p] * along).T
        growth = (shift.T * weight) @ shift - (w[:p] * (weight @ lost)) @ w[:p].T
        values, vectors = np.linalg.eigh(growth)
        return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T), float(weight @ others)


def _pooled(values: FloatArray) -> FloatArray:
    """The sum of each band and its neighbours."""
    padded = np.concatenate([[0.0], values, [0.0]])
    return np.asarray(padded[:-2] + padded[1:-1] + padded[2:])

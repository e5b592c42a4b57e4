"""Linear equations whose noise has any spectrum, and a part that is a function of the motion: restricted likelihood.

Along time, the equations are taken to the cosine transform (DCT-II), in which a stationary process is nearly diagonal,
so that its spectrum is a variance for each band of frequencies. What keeps time with the motion is not stationary
against it: it is a random combination of given functions of time. All variances are those of the greatest restricted
likelihood (Patterson and Thompson, Biometrika 58, 1971), by MacKay's fixed point (Neural Computation 4, 1992): the
squares of what is left, or of a coefficient, over how many of them are free. A band counts as one coefficient more, of
the variance of itself and its neighbours, so that none is taken for silent that the unknowns explain. The variance of a
group of functions may hang on the few combinations of them that the unknowns can't explain, and these may be of another
group as well: the covariance may be taken over all that the groups' variances may be together (`variances`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.fft import dct

from baryscope.estimator.geometry.symmetric import inverse_of_definite
from baryscope.estimator.joint.variances import KNOWN, UNKNOWN, possible_variances
from baryscope.estimator.tracks import FloatArray, IntArray

ROUNDS = 100  # of spectrum and variances by turns, at most
TAPER = 0.2  # share of the time in which the window rises or falls
CONVERGED = 1e-2  # in the logarithm of a variance
LEAST_BAND, WIDER = 3, 1.2  # coefficients in a band at least, and the ratio of its ends
ROUNDING = 1e-24  # of the squares of what is given: a variance below is rounding
AT_FIRST = 0.3  # share of the residuals' variance that a group of functions has at first
QUIETEST = 0.5  # variance of a band over the mean beyond the last one that is used
NEGLIGIBLE = 1e-6  # of the variance at first: a smaller one of a function counts as none


@dataclass(frozen=True, eq=False)
class Fit:
    """Unknowns (p,), their covariance (p, p), and the noise beside them.

    kept (k,): which coefficients of the cosine transform are used; spectrum (k,): their variances in a coordinate;
    locked (n, c): what keeps time with the motion; variances (g,) of the coefficients of each group of functions, and
    squares (g,), the mean square in a coordinate of all functions of a group; likelihood: the restricted one's
    logarithm, up to a constant; equations: the normal equations; wider: by how much the taper makes covariances larger.
    """

    found: FloatArray
    covariance: FloatArray
    kept: IntArray
    spectrum: FloatArray
    locked: FloatArray
    variances: FloatArray
    squares: FloatArray
    likelihood: float
    equations: "_Reduced"
    wider: float

    def over_variances(self, largest: float) -> "Fit":
        """With the covariance, and the mean variances, over all variances of the groups that the residuals allow.

        largest: rms that a group of functions may have in a coordinate at most, as what is wanted.
        """
        own = self.equations
        possible = possible_variances(own.matrix, own.rhs, own.group, largest**2 / (self.squares + 1e-300))
        covariance = self.wider * possible.about(self.found)
        return replace(self, covariance=covariance, variances=possible.weight @ possible.variances)


def transformed(values: FloatArray) -> FloatArray:
    """The orthonormal cosine transform along the first axis, tapered at the ends: white noise keeps its variance.

    Without the taper the ends of a narrow line are seen at all frequencies.
    """
    window = _window(len(values)).reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray(dct(window * values, axis=0, norm="ortho"))


@lru_cache(maxsize=1)
def _window(count: int) -> FloatArray:
    """Tukey's window, of the mean square 1."""
    from scipy.signal.windows import tukey  # slow to load, and other methods do without

    window = tukey(count + 2, TAPER)[1:-1]
    window = np.asarray(window / np.sqrt(np.mean(window**2)))
    window.setflags(write=False)
    return window


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
    known: Sequence[FloatArray] = (),
) -> Fit:
    """Solve design @ x + noise = wanted from some coefficients along time.

    Args:
        design: (n, c, p), of c coordinates in n frames.
        wanted: (n, c).
        functions: groups (n, c, q) of functions of time, each of which may be in the noise with any coefficient; those
            of a group have one variance.
        kept: (k,), ascending, which coefficients of the transform are used.
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
    wider = float(np.mean(_window(len(wanted)) ** 4))  # neighbours are correlated by the taper
    of_unknowns, squares = wider * covariance[:p, :p], squares / wanted.size
    return Fit(mean[:p], of_unknowns, kept, spectrum, locked, variances, squares, likelihood, reduced, wider)


def _change(new: FloatArray, old: FloatArray) -> float:
    """The greatest change of the logarithm of some variances."""
    return float(np.abs(np.log(new / old)).max(initial=0.0))


@dataclass(frozen=True, eq=False)
class _Rows:
    """The equations along the k coefficients that are used of the cosine transform, in c coordinates.

    matrix (k c, q): of unknowns and coefficients of functions; wanted (k, c); group (q,): whose coefficient it is, or
    UNKNOWN, or KNOWN for one of the variance 1; ends: of the bands among the k coefficients; start: the variance of
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
        owner = np.repeat([UNKNOWN, *range(len(groups)), KNOWN], sizes)
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

    group (q,): whose coefficient it is, or UNKNOWN, or KNOWN for one of the variance 1.
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
        covariance = inverse_of_definite(matrix)
        return covariance @ self.rhs, covariance

    def likelihood(self, variances: FloatArray, mean: FloatArray, covariance: FloatArray) -> float:
        """The logarithm of their restricted likelihood, up to a constant of the spectrum, for the posterior."""
        of_groups = float(np.log(variances[self.group[self.group >= 0]]).sum())
        return 0.5 * (float(mean @ self.rhs) + float(np.linalg.slogdet(covariance)[1]) - of_groups)


def _pooled(values: FloatArray) -> FloatArray:
    """The sum of each band and its neighbours."""
    padded = np.concatenate([[0.0], values, [0.0]])
    return np.asarray(padded[:-2] + padded[1:-1] + padded[2:])

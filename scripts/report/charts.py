"""Charts that several reports share: errors with what a covariance expects of them, and NEES."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from baryscope.report.document import Chart, Series
from baryscope.report.gaps import gaps_of
from baryscope.report.thinning import extremes

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

BAND = 0.95
TAIL = (1 - BAND) / 2
ONLINE = 5  # colour of the online estimate
SIGMAS = float(np.sqrt(chdtri(1, 1 - BAND)))  # of one axis


def curve(
    label: str,
    x: FloatArray,
    y: FloatArray,
    band: tuple[FloatArray, FloatArray] | None = None,
    *,
    gaps: IntArray | None = None,
    **how: Any,
) -> Series:
    """A curve with its band, thinned out.

    Args:
        label: in the legend.
        x: of its points, (n,).
        y: of its points, (n,).
        band: around it, two (n,) arrays.
        gaps: indices (k,) of the points after which it is broken off.
        how: other fields of `Series`.
    """
    lines = [x, y, *(band or ())]
    if gaps is not None and len(gaps):
        middle = (x[gaps] + x[gaps + 1]) / 2
        lines = [np.insert(one, gaps + 1, middle if one is x else np.nan) for one in lines]
    keep = extremes(lines[1])
    x, y, low, high, *_ = *(one[keep] for one in lines), None, None
    return Series(label, x, y, low=low, high=high, **how)


def expected_error(covariance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Between which the length of an error of covariance (n, 3, 3) is with a probability of BAND, two (n,) arrays.

    Its square is taken as a multiple of χ² that has its mean and variance (Satterthwaite 1946). That is exact where the
    variances are equal or zero; else fewer errors than TAIL are below the first.
    """
    mean = np.trace(covariance, axis1=1, axis2=2)
    squares = np.einsum("kij,kji->k", covariance, covariance)
    scale = np.divide(squares, mean, out=np.zeros_like(mean), where=mean > 0)
    degrees = np.divide(mean**2, squares, out=np.full_like(mean, 3.0), where=squares > 0)
    low, high = (np.sqrt(scale * chdtri(degrees, above)) for above in (1 - TAIL, TAIL))
    return low, high


def nees_of(error: FloatArray, covariance: FloatArray) -> FloatArray:
    """eᵀ P⁻¹ e (n,) of errors (n, 3) and covariances (n, 3, 3); NaN where P is singular or not known."""
    found = np.full(len(error), np.nan)
    known = np.flatnonzero(np.isfinite(error).all(axis=1) & np.isfinite(covariance).all(axis=(1, 2)))
    known = known[np.linalg.eigvalsh(covariance[known])[:, 0] > 0]
    if known.size:
        solved = np.linalg.solve(covariance[known], error[known][..., None])[..., 0]
        found[known] = np.einsum("ki,ki->k", error[known], solved)
    return found


def nees_chart(series: tuple[Series, ...], about: str, **how: Any) -> Chart:
    """NEES over time beside the band of a single draw; how: other fields of `Chart`."""
    low, high = chdtri(3, [1 - TAIL, TAIL])
    levels = ((float(low), "2.5 %"), (3.0, "mean 3"), (float(high), "97.5 %"))
    return Chart("NEES of the centre of mass", about, "eᵀ P⁻¹ e", series, log=True, levels=levels, **how)


def convergence_chart(label: str, time: FloatArray, error: FloatArray, covariance: FloatArray, **how: Any) -> Chart:
    """How an online estimate converges: a length (n,), m, in the band of its covariance (n, 3, 3), NaN where it waits.

    label: of the length; how: other fields of `Chart`, `about` among them.
    """
    known = np.isfinite(covariance).all(axis=(1, 2))
    band = tuple(np.full(len(time), np.nan) for _ in range(2))
    for side, expected in zip(band, expected_error(covariance[known]), strict=True):
        side[known] = 1e3 * expected
    claim = 1e3 * np.sqrt(np.trace(covariance, axis1=1, axis2=2))
    gaps = gaps_of(time)
    series = (
        curve(label, time, 1e3 * error, band, gaps=gaps, colour=ONLINE),  # type: ignore[arg-type]
        curve("claimed, ±1σ of three axes together", time, claim, gaps=gaps, style="dashed"),
    )
    return Chart("Convergence of the online estimate", y_label="mm", series=series, log=True, **how)


def axis_errors(time: FloatArray, error: FloatArray, covariance: FloatArray | None, axes: str, **how: Any) -> Chart:
    """The three coordinates of an error (n, 3), m, each in its ±95 % band; axes: of which they are."""
    names = {"LVLH": ("radial", "along-track", "cross-track")}.get(axes, ("x", "y", "z"))
    series = []
    for k, name in enumerate(names):
        band = None
        if covariance is not None:
            width = 1e3 * SIGMAS * np.sqrt(np.maximum(covariance[:, k, k], 0.0))
            band = (-width, width)
        series.append(curve(name, time, 1e3 * error[:, k], band, colour=(5, 4, 2)[k]))
    bands = "" if covariance is None else f" The bands hold {100 * BAND:.0f} % by its covariance."
    return Chart("Error along each axis", f"Estimate less truth, {axes} axes.{bands}", "mm", tuple(series), **how)

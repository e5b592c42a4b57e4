"""What a report says of one estimate, with or without a truth: residuals, coverage, observability, options."""

from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.details import ScrewDetails
from baryscope.estimator.document.document import document_of
from baryscope.estimator.observability import Observability
from baryscope.estimator.prediction import Prediction
from baryscope.estimator.prose import summary, untested, verdict
from baryscope.estimator.result import Estimate, Status
from baryscope.report.charts import SIGMAS, curve
from baryscope.report.document import Chart, Facts, Part, Series, Sheet, Timeline, Words
from baryscope.report.gaps import gaps_of
from baryscope.report.scene import MOST_FEATURES
from baryscope.report.thinning import evenly, shares

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

MOST_RESIDUALS = 3000
MOST_REJECTED = 1000
Verdict = tuple[Literal["good", "warn", "bad"], str]
STATUSES: dict[Status, Verdict] = {
    Status.GOOD: ("good", "The estimate can be used: its covariance describes its error."),
    Status.NOT_OBSERVABLE: ("warn", "The estimate can be used, but not in every direction is the position observable."),
    Status.NOT_CHECKED: ("bad", "The tracks do not check the estimate, for what is found below: do not trust it."),
    Status.NOT_CONVERGED: ("bad", "The method did not converge: do not trust the estimate."),
    Status.MODEL_DOES_NOT_FIT: ("bad", "A model does not fit the tracks: do not trust the estimate."),
}


def verdict_of(result: Estimate) -> Verdict:
    """Whether the estimate can be used, and what it claims.

    The screw methods do not test their models, so that they cannot be good.
    """
    state, words = STATUSES[result.status]
    if state != "bad" and isinstance(result.details, ScrewDetails):
        state, words = "warn", f"{untested(result.method)}."
    claim = "" if result.predicted_rmse is None else f" It claims ±{millimetres(result.predicted_rmse)} mm rms."
    return state, words + claim


def parts_of(result: Estimate, shades: tuple[tuple[float, float], ...] = ()) -> tuple[Part, ...]:
    """All that an estimate tells of itself."""
    parts: list[Part] = [Words("In words", (verdict_of(result)[1], *summary(result)))]
    parts += [residual_chart(result, shades), feature_sheet(result)]
    if result.observability is not None:
        parts.append(observability_sheet(result.observability))
    return *parts, options_of(result)


class _HasResiduals(Protocol):
    """What `Estimate` and `SampleResiduals` have: residuals (n, m, 3), m, and flags (n, m)."""

    @property
    def time(self) -> FloatArray: ...
    @property
    def labels(self) -> tuple[str, ...]: ...
    @property
    def residuals(self) -> FloatArray: ...
    @property
    def used(self) -> BoolArray: ...
    @property
    def rejected(self) -> BoolArray: ...
    @property
    def feature_rms(self) -> FloatArray: ...


FROM_ESTIMATE = "How far each observation is from where the estimate has its feature."


def residual_chart(
    result: _HasResiduals, shades: tuple[tuple[float, float], ...] = (), about: str = FROM_ESTIMATE
) -> Chart:
    """The lengths of residuals, those of rejected observations marked; thinned out evenly. about: what they are."""
    length = 1e3 * np.linalg.norm(result.residuals, axis=2)
    known = np.isfinite(length)
    series = (
        _points("used", result, length, known & ~result.rejected, MOST_RESIDUALS),
        _points("rejected", result, length, known & result.rejected, MOST_REJECTED),
    )
    words = f"{_count(result.rejected)} of {_count(result.used)} are rejected as outliers."
    lost = result.rejected & ~known
    if lost.any():
        words += f" {_count(lost)} of these have no residual, in frames whose attitude is not known without them."
    return Chart(
        "Residuals",
        f"{about} {words}",
        "mm",
        tuple(one for one in series if len(one.x)),
        log=True,
        shades=shades,
        shade="nothing seen",
        filter=result.labels[:MOST_FEATURES],
    )


def _points(label: str, result: _HasResiduals, length: FloatArray, flags: BoolArray, most: int) -> Series:
    frames, features = np.nonzero(flags)
    keep = evenly(len(frames), most)
    frames, features = frames[keep], features[keep]
    style, colour = ("cross", 3) if label == "rejected" else ("points", 5)
    values = np.maximum(length[frames, features], 1e-6)
    total = int(flags.sum())
    return Series(label, result.time[frames], values, colour, style, of=features, total=total)  # type: ignore[arg-type]


def _count(flags: BoolArray) -> str:
    return f"{int(flags.sum()):,}".replace(",", " ")


def feature_sheet(result: _HasResiduals) -> Sheet:
    """Observations, rejected ones and residuals of each feature."""
    used, rejected = result.used.sum(axis=0), result.rejected.sum(axis=0)
    rows = [
        (
            label,
            str(int(used[k])),
            str(int(rejected[k])),
            f"{100 * rejected[k] / max(used[k], 1):.2g} %",
            millimetres(result.feature_rms[k]),
        )
        for k, label in enumerate(result.labels)
    ]
    more = len(rows) - MOST_FEATURES
    about = f"The first {MOST_FEATURES} of {len(rows)} features." if more > 0 else ""
    headings = ("feature", "observations", "rejected", "share", "rms per axis, mm")
    return Sheet("Features", headings, tuple(rows[:MOST_FEATURES]), about)


def coverage(time: FloatArray, labels: tuple[str, ...], seen: BoolArray, rejected: BoolArray | None = None) -> Timeline:
    """Which feature is seen when, and where its observations are rejected."""
    most = slice(MOST_FEATURES)
    share = 100 * seen.mean()
    words = f"{share:.0f} % of {len(labels)} features × {len(time)} frames are seen"
    gaps = gaps_of(time)
    if len(gaps):
        words += f"; for {(time[gaps + 1] - time[gaps]).sum():.3g} s in between there are no frames"
    about = words + ("; red: observations that the estimate rejects." if rejected is not None else ".")
    return Timeline(
        "Which feature is seen when",
        about,
        float(time[0]),
        float(time[-1]),
        labels[most],
        shares(time, seen[:, most]),
        () if rejected is None else shares(time, rejected[:, most]),
    )


def observability_sheet(found: Observability, when: tuple[str, str] = ("body", "C, mean over time")) -> Sheet:
    """The principal axes of the CoM's covariance in body axes and in C; when: what these two are called."""
    rows = [
        (where, f"({', '.join(f'{value:.2f}' for value in direction)})", millimetres(deviation), verdict_)
        for where, axes in zip(when, (found.body, found.inertial), strict=True)
        for direction, deviation, verdict_ in zip(
            axes.directions.tolist(),
            axes.deviations.tolist(),
            ["yes" if one else "no" for one in found.observable] if axes is found.body else ["", "", ""],
            strict=True,
        )
    ]
    about = f"{verdict(found).capitalize()}. A direction is observable up to ±{found.threshold:.2g} m."
    return Sheet("Observability", ("axes", "direction", "±1σ, mm", "observable"), tuple(rows), about, left=2)


def options_of(result: Estimate) -> Facts:
    """Method, model, options as given or chosen, and version."""
    document = document_of(result)
    items = [("method", result.method), ("path", result.path), ("status", str(result.status))]
    items += [(name.replace("_", " "), _text(value)) for name, value in document.options.items() if value is not None]
    items += [("rounds", str(result.rounds)), ("time", f"{result.wall_time:.2f} s"), ("baryscope", result.version)]
    return Facts("Options and version", tuple(items))


def millimetres(metres: float) -> str:
    """A length's digits, without an exponent; - where there is none."""
    size = 1e3 * abs(metres)
    if not np.isfinite(size):
        return "-"
    if size >= 1e3:
        return f"{1e3 * metres:.0f}"
    return np.format_float_positional(1e3 * metres, 3, fractional=False, trim="-")


def _text(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def path_chart(result: Estimate, **how: Any) -> Chart:
    """The estimated path in C with its ±95 % band."""
    series, gaps = [], gaps_of(result.time)
    for k, name in enumerate("xyz"):
        position, band = result.position[:, k], None
        if result.covariance is not None:
            width = SIGMAS * np.sqrt(np.maximum(result.covariance[:, k, k], 0.0))
            band = (position - width, position + width)
        series.append(curve(name, result.time, position, band, gaps=gaps, colour=(5, 4, 2)[k]))
    about = "The centre of mass in frame C: origin at the chaser, axes that do not turn."
    return Chart("Path", about, "m", tuple(series), **how)


def deviation_chart(result: Estimate, **how: Any) -> Chart | None:
    """What the covariance says of the path over time: all three axes together, and the worst direction."""
    if result.covariance is None:
        return None
    series = _deviations(result.time, result.covariance)
    return Chart(
        "What the method claims", "±1σ of the centre of mass by its covariance.", "mm", series, log=True, **how
    )


def prediction_chart(found: Prediction, words: str) -> Chart:
    """What the covariance says of a predicted position; words: of which point it is, and how well known at the end."""
    series = _deviations(found.time, found.covariance[:, :3, :3])
    return Chart("Prediction", f"±1σ of the position by its covariance. {words}", "mm", series, log=True, timed=False)


def _deviations(time: FloatArray, covariance: FloatArray) -> tuple[Series, ...]:
    """Of positions, mm: of all three axes together, and in the worst direction."""
    greatest = np.sqrt(np.maximum(np.linalg.eigvalsh(covariance)[:, -1], 0.0))
    total = np.sqrt(np.trace(covariance, axis1=1, axis2=2))
    gaps = gaps_of(time)
    return (
        curve("rms of the three axes together", time, 1e3 * total, gaps=gaps, colour=5),
        curve("worst direction", time, 1e3 * greatest, gaps=gaps, colour=3, style="dashed"),
    )

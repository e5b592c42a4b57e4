"""The report of a comparison: every method's error with the band that it expects, and what each tells of itself."""

import numpy as np
from numpy.typing import NDArray

from baryscope import __version__
from baryscope.estimator.geometry.alignment import matrix_from_quaternion
from baryscope.estimator.online.course import OnlineCourse
from baryscope.fmu.units.estimator import STEREO_SIGMA
from baryscope.models.lvlh import lvlh_attitude
from baryscope.models.words import counted
from baryscope.report import Report
from baryscope.report.charts import axis_errors, curve, expected_error, nees_chart, nees_of
from baryscope.report.document import Chart, Facts, Part, Scene, Series, Sheet, Tabs, Words
from baryscope.report.estimates import coverage, parts_of
from baryscope.report.gaps import blackouts
from baryscope.report.online import course_chart, online_course
from baryscope.report.own_tracks import in_tracks
from baryscope.report.scene import Body, Shown, scene_of
from baryscope.study.comparison import Comparison, Outcome
from baryscope.study.flight import Flight
from baryscope.study.methods import COLOURS

LEAST = 1e-6  # mm
ONLINE = (
    "What the online estimator knows after each frame, of the frames so far: its error, and where 95 % of the errors "
    "should be by its covariance. It is told orbit and noise, as the methods above are, which see all frames."
)


def report_of_comparison(comparison: Comparison) -> Report:
    """The report of one flight and what every method makes of it."""
    scenario, time = comparison.scenario, comparison.flight.tracks.time
    parts, notes = parts_of_comparison(comparison)
    return Report(
        f"{scenario.name}: centre of mass by {counted(len(comparison.outcomes), 'method')}",
        f"{scenario.description} – {counted(len(time), 'frame')} over {time[-1]:.0f} s, seed {scenario.run.seed}",
        __version__,
        parts,
        notes=notes,
    )


def parts_of_comparison(comparison: Comparison, no_online: str = "") -> tuple[tuple[Part, ...], tuple[str, ...]]:
    """The parts of that report, and sentences on what is missing in it.

    no_online: why the online estimator shall not be asked, if it shall not.
    """
    flight, scenario = comparison.flight, comparison.scenario
    tracks = flight.tracks
    table = comparison.table()
    shades = blackouts(tracks.time, tracks.seen)
    parts: list[Part] = [
        Sheet("Methods side by side", table.headings, table.rows, _reading(comparison), table.left),
        scene_of_flight(comparison),
        error_chart(comparison),
    ]
    nees = _nees(comparison)
    if nees is not None:
        parts.append(nees)
    sigma = scenario.sensor.noise or STEREO_SIGMA
    course = no_online or online_course(tracks, scenario.orbit.of_simulation(), sigma)
    if not isinstance(course, str):
        parts.append(
            course_chart(course, flight.true_path, "the truth", about=ONLINE, shades=shades, shade="nothing seen")
        )
    parts.append(coverage(tracks.time, tracks.labels, tracks.seen))
    choices = tuple((outcome.label, _parts_of(outcome, flight, shades)) for outcome in comparison.outcomes)
    first = next((k for k, one in enumerate(comparison.outcomes) if one.predicted_rmse is not None), 0)
    about = "Residuals, rejected observations, observability and options."
    parts += [Tabs("Each method", choices, about, first), _flown(flight)]
    return tuple(parts), _missing(comparison.no_bound, course)


def _missing(no_bound: str, course: OnlineCourse | str) -> tuple[str, ...]:
    bound = (f"There is no Cramér–Rao bound: {no_bound}.",) if no_bound else ()
    return (*bound, f"There is no online estimate: {course}.") if isinstance(course, str) else bound


def _reading(comparison: Comparison) -> str:
    failed = [outcome.label for outcome in comparison.outcomes if outcome.failure]
    words = f" Could not be carried out: {', '.join(failed)}." if failed else ""
    words += f" {comparison.doubts}" if comparison.doubts else ""
    return (
        "RMSE and max are those of the error over all frames; the predicted RMSE is what the method's covariance says; "
        f"coverage is the share of the frames at which it has an attitude.{words}"
    )


def scene_of_flight(comparison: Comparison) -> Scene:
    """The true motion, and all estimates; rejected by the first that has a covariance or, if none has, by the first."""
    flight, tracks = comparison.flight, comparison.flight.tracks
    done = [(outcome.label, outcome.estimate) for outcome in comparison.outcomes if outcome.estimate is not None]
    shown = tuple(Shown(label, COLOURS[label], one.position, one.covariance) for label, one in done)
    telling = [(label, one) for label, one in done if one.covariance is not None] or done
    rejected, words = np.zeros_like(tracks.seen), ""
    if telling:
        label, first = telling[0]
        rejected = in_tracks(first.rejected, first.labels, tracks)
        words = f"True motion. Rejected observations are those of {label}."
    body = Body(
        time=tracks.time,
        path=flight.true_path,
        path_label="true centre of mass",
        attitude=_attitude(flight),
        labels=tracks.labels,
        features=flight.truth["features"],
        seen=tracks.seen,
        rejected=rejected,
    )
    return scene_of(body, shown, flight.scenario.orbit, words)


def _attitude(flight: Flight) -> NDArray[np.float64]:
    return matrix_from_quaternion(flight.truth["target.attitude"])


def error_chart(comparison: Comparison) -> Chart:
    """The length of every method's error, in the band that its covariance expects, and the bound."""
    time = comparison.flight.tracks.time
    series: list[Series] = []
    for outcome in comparison.outcomes:
        if outcome.error is None or outcome.estimate is None:
            continue
        covariance = outcome.estimate.covariance
        band = None if covariance is None else tuple(1e3 * one for one in expected_error(covariance))
        series.append(
            curve(
                f"{outcome.title}: RMSE {1e3 * (outcome.rmse or 0):.3g} mm",
                time,
                np.maximum(1e3 * outcome.error, LEAST),
                band,  # type: ignore[arg-type]
                colour=COLOURS[outcome.label],
                style="wide" if comparison.hidden(outcome) else "line",
            )
        )
    if comparison.bound is not None:
        least = np.sqrt(np.trace(comparison.bound.position_covariance, axis1=1, axis2=2))
        label = f"Cramér–Rao bound: {1e3 * comparison.bound.position_deviation:.3g} mm"
        series.append(curve(label, comparison.bound.time, 1e3 * least, style="dashed"))
    return Chart(
        "Error of the centre of mass",
        "Distance from the truth. A band is where 95 % of the errors should be by the method's own covariance; methods "
        "without a covariance have no band. Drag to enlarge, click to choose the time of the scene.",
        "mm",
        tuple(series),
        log=True,
        shades=blackouts(time, comparison.flight.tracks.seen),
        shade="nothing seen",
    )


def _nees(comparison: Comparison) -> Chart | None:
    flight, series = comparison.flight, []
    for outcome in comparison.outcomes:
        found = outcome.estimate
        if found is not None and found.covariance is not None:
            values = nees_of(found.position - flight.true_path, found.covariance)
            label = f"{outcome.label}: mean {np.nanmean(values):.3g}" if np.isfinite(values).any() else outcome.label
            style = "wide" if comparison.hidden(outcome) else "line"
            series.append(
                curve(label, found.time, np.maximum(values, 1e-4), colour=COLOURS[outcome.label], style=style)
            )
    if not series:
        return None
    about = (
        "The squared error in units of the method's covariance; 95 % of single values should be between the dotted "
        "lines. Values of one flight depend on each other, so that one flight tells little: see the command campaign."
    )
    return nees_chart(tuple(series), about)


def _parts_of(outcome: Outcome, flight: Flight, shades: tuple[tuple[float, float], ...]) -> tuple[Part, ...]:
    found = outcome.estimate
    if found is None:
        return (Words("In words", (f"Could not be carried out: {outcome.failure}.",)),)
    R = lvlh_attitude(flight.scenario.orbit, found.time)
    error = np.einsum("kji,kj->ki", R, found.position - flight.true_path)
    turned = None if found.covariance is None else np.swapaxes(R, 1, 2) @ found.covariance @ R
    return (
        axis_errors(found.time, error, turned, "LVLH", shades=shades, shade="nothing seen"),
        *parts_of(found, shades),
    )


def _flown(flight: Flight) -> Facts:
    scenario, tracks = flight.scenario, flight.tracks
    items = [
        ("scenario", scenario.name),
        ("duration", f"{scenario.duration:g} s"),
        ("sample time", f"{scenario.run.sample_time:g} s"),
        ("observations", str(int(tracks.seen.sum()))),
        ("nothing seen in", f"{100 * np.mean(~tracks.seen.any(axis=1)):.0f} % of the frames"),
        ("seed", str(scenario.run.seed)),
        ("baryscope", __version__),
    ]
    return Facts("What was flown", tuple(items))

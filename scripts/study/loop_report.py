"""The report of a flown loop: the scene, how the online estimate converges, and what the chaser does with it."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.geometry.alignment import FEWEST_POINTS, matrix_from_quaternion
from baryscope.estimator.geometry.extent import rms_radius
from baryscope.estimator.observability import UNOBSERVABLE, Observability, PrincipalAxes
from baryscope.models.approach.reckoning import RETREAT
from baryscope.models.lvlh import lvlh_attitude
from baryscope.models.words import counted
from baryscope.report import Report
from baryscope.report.charts import ONLINE, axis_errors, convergence_chart, curve, nees_chart
from baryscope.report.document import Chart, Facts, Part, Scene
from baryscope.report.estimates import Verdict, coverage, feature_sheet, observability_sheet, residual_chart
from baryscope.report.gaps import blackouts
from baryscope.report.scene import Body, Shown, body_points, scene_of
from baryscope.study.loop import Loop
from baryscope.study.loop_summary import QUANTITIES

FROM_MAP = (
    "How far the points of each sample were from where the map of the estimator, as it then was, had their features, "
    "in the pose that fits them best: the estimator leaves the attitude of each sample free. What does not fit with a "
    "probability of 10⁻⁴ it rejects."
)
VERDICTS = {
    "tracking": ("good", "At last the estimator tracks the target."),
    "doubtful": ("bad", "At last the estimator doubts its estimate."),
    "lost": ("bad", "At last the estimator has lost the target."),
}
FALSE = 0.05  # of the time of tracking, from which claims count as false: errors at neighbouring times are alike
OPTIONS = {"of": "scenario or system", "duration": "duration, s", "step": "step, s"}


def report_of_loop(loop: Loop, found: dict[str, Any], options: dict[str, Any]) -> Report:
    """The report of a flight.

    Args:
        loop: the flight.
        found: its summary, as in flight.json.
        options: of the flight; `of` names the scenario or system.
    """
    marks = marks_of(loop)
    shades = blackouts(loop.tracks.time, loop.tracks.seen)
    how: dict[str, Any] = {"shades": shades, "shade": "nothing seen", "marks": marks}
    residuals, observability = loop.residuals, observability_of(loop)
    rejected = np.zeros_like(loop.tracks.seen) if residuals is None else residuals.rejected
    parts: list[Part] = [scene_of_loop(loop, rejected), _convergence(loop, **how)]
    if loop.tracking.any():
        parts += [_axes(loop, **how), _nees(loop, found, **how)]
    parts += [
        _places(loop, marks),
        _commands(loop, marks),
        coverage(loop.tracks.time, loop.tracks.labels, loop.tracks.seen, None if residuals is None else rejected),
    ]
    if residuals is not None:
        parts += [residual_chart(residuals, shades, FROM_MAP), feature_sheet(residuals)]
    if observability is not None:
        parts.append(observability_sheet(observability, ("body, at last", "C, at last")))
    parts += [
        Facts(
            "What came of it",
            tuple((words, _text(found[name], unit, factor)) for name, (words, unit, factor) in QUANTITIES.items()),
        ),
        Facts("Options", tuple((OPTIONS.get(name, name), _text(value)) for name, value in options.items())),
    ]
    return Report(
        f"{options.get('of', 'A system')}: the loop on estimates alone",
        f"{loop.time[-1]:.6g} s in steps of {found['step']:g} s, {counted(len(loop.tracks.time), 'sample')} of the rig",
        found["version"],
        tuple(parts),
        verdict_of_loop(found),
    )


def verdict_of_loop(found: dict[str, Any]) -> Verdict:
    """Whether what came of a flight can be used, by its summary."""
    grade, *words = VERDICTS.get(found["status"], ("warn", f"At last the estimator is {found['status']}."))
    if found["tracking_since"] is None:
        grade, words = "bad", [f"The estimator never tracked the target: it is {found['status']}."]
    if found["last_claim"] is not None and found["last_claim"] > found["last_range"]:
        grade, words = "bad", [*words, "The centre of mass may be farther off than the target is away."]
    if found["retreating_since"] is not None:
        grade, words = "bad", [*words, "The chaser retreats."]
    if found["wrong_share"] is not None and found["wrong_share"] > FALSE:
        grade = "warn" if grade == "good" else grade
        words = [
            *words,
            f"Claims were too small for {100 * found['wrong_share']:.3g} % of the time in which it tracked.",
        ]
    return grade, " ".join(words)  # type: ignore[return-value]


def marks_of(loop: Loop) -> tuple[tuple[float, str], ...]:
    """When the target is first tracked, its tumble known, the goal turns with the body, and the chaser retreats."""
    flags = {
        "tracking": loop.tracking,
        "tumble known": loop.tumble,
        "synchronised": loop.synchronised,
        "retreat": loop.mode == RETREAT,
    }
    return tuple((float(loop.time[np.argmax(one)]), word) for word, one in flags.items() if one.any())


def scene_of_loop(loop: Loop, rejected: NDArray[np.bool_]) -> Scene:
    """The true motion and the online estimate; features are where the samples, turned into body axes, have them.

    rejected (n, m): which observations of the samples are.
    """
    place = np.clip(np.searchsorted(loop.tracks.time, loop.time + 1e-9) - 1, 0, None)
    fresh = np.abs(loop.tracks.time[place] - loop.time) < 1e-6
    R = matrix_from_quaternion(loop.truth["target.attitude"])
    path, tracks = loop.truth["target.position"], loop.tracks
    seen = tracks.seen[place]
    sampled = np.where((fresh[:, None] & seen)[..., None], tracks.position[place], np.nan)
    left_out = rejected[place]
    body = Body(loop.time, path, "true centre of mass", R, tracks.labels, sampled, seen, left_out)
    points = body_points(body)
    features = path[:, None] + np.einsum("kij,mj->kmi", R, points)
    waits = (loop.status == 0)[:, None]
    online = Shown(
        "online estimate",
        ONLINE,
        np.where(waits, np.nan, loop.position),
        np.where(waits[..., None], np.nan, loop.covariance),
    )
    whole = Body(loop.time, path, "true centre of mass", R, tracks.labels, features, seen, left_out)
    return scene_of(
        whole, (online,), loop.orbit, "True motion; features are the mean of what the rig has seen of them."
    )


def _convergence(loop: Loop, **how: Any) -> Chart:
    """Error and claim of the online estimate."""
    covariance = np.where((loop.status == 0)[:, None, None], np.nan, loop.covariance)
    about = "The error of the online estimate; the band is where 95 % of the errors should be by its covariance."
    return convergence_chart("error of the centre of mass", loop.time, loop.error, covariance, about=about, **how)


def observability_of(loop: Loop) -> Observability | None:
    """The principal axes of the covariance at last, in the axes of the map and in C; None while the estimator waits."""
    known = loop.map[np.isfinite(loop.map).all(axis=1)]
    if loop.status[-1] == 0 or len(known) < FEWEST_POINTS:
        return None
    R, P = matrix_from_quaternion(loop.attitude[-1:])[0], loop.covariance[-1]
    return Observability(PrincipalAxes.of(R.T @ P @ R), PrincipalAxes.of(P), 0, UNOBSERVABLE * rms_radius(known))


def _axes(loop: Loop, **how: Any) -> Chart:
    """From when the tumble is known, if it ever is: before, errors are of another size."""
    shown = loop.tracking & (np.cumsum(loop.tumble) > 0) if loop.tumble.any() else loop.tracking
    error = np.where(shown[:, None], loop.position - loop.truth["target.position"], np.nan)
    covariance = np.where(shown[:, None, None], loop.covariance, np.nan)
    R = lvlh_attitude(loop.orbit, loop.time)
    turned = np.swapaxes(R, 1, 2) @ covariance @ R
    return axis_errors(loop.time, np.einsum("kji,kj->ki", R, error), turned, "LVLH", **how)


def _nees(loop: Loop, found: dict[str, Any], **how: Any) -> Chart:
    mean = found["mean_nees"]
    label = "online estimate" + ("" if mean is None else f": mean of the second half {mean:.3g}")
    about = (
        "The squared error in units of the estimator's covariance; 95 % of single values are between the dotted lines."
    )
    return nees_chart((curve(label, loop.time, np.maximum(loop.nees, 1e-4), colour=ONLINE),), about, **how)


def _places(loop: Loop, marks: tuple[tuple[float, str], ...]) -> Chart:
    series = (
        curve("range to the centre of mass", loop.time, np.linalg.norm(loop.chaser, axis=1)),
        curve("from where it shall be", loop.time, np.maximum(loop.miss, 1e-4), colour=3),
    )
    about = "How far the chaser is from the target, and from its goal."
    return Chart("The chaser", about, "m", series, log=True, marks=marks)


def _commands(loop: Loop, marks: tuple[tuple[float, str], ...]) -> Chart:
    names = ("radial", "along-track", "cross-track")
    series = tuple(
        curve(name, loop.time, 1e3 * loop.command[:, k], colour=(5, 4, 2)[k]) for k, name in enumerate(names)
    )
    return Chart(
        "Commands", "Acceleration that the controller asks of the chaser, LVLH axes.", "mm/s²", series, marks=marks
    )


def _text(value: Any, unit: str = "", factor: float = 1) -> str:
    """A value of flight.json for readers."""
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    digits = str(value) if isinstance(value, str) else f"{factor * value:.5g}"
    return f"{digits} {unit}".rstrip()

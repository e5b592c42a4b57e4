"""The report of a joint: where each body has its centre, and how far each marker is off."""

import numpy as np
from numpy.typing import NDArray

from baryscope import __version__
from baryscope.estimator.joint import Joint
from baryscope.estimator.joint.bodies import Body, Pair
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.words import counted
from baryscope.report.charts import SIGMAS, curve
from baryscope.report.document import Chart, Facts, Part, Report, Series, Sheet, Timeline, Words
from baryscope.report.estimates import Verdict, coverage, millimetres
from baryscope.report.gaps import gaps_of
from baryscope.report.thinning import evenly

FloatArray = NDArray[np.float64]

MOST_RESIDUALS = 3000
COLOURS = (5, 4, 2)  # of x, y and z
METHODS = {"ml": "maximum likelihood", "score": "SCoRE"}


def report_of_joint(
    found: Joint, parent: FeatureTracks | None, child: FeatureTracks, words: tuple[str, ...], name: str
) -> Report:
    """The report of a joint of two bodies.

    Args:
        found: the joint, of these tracks.
        parent: the markers of one body; None for the room.
        child: those of the other.
        words: the result in sentences.
        name: of the tracks, for the title.
    """
    pair, bodies = found.pair, bodies_of(found, parent, child)
    parts: list[Part] = [Words("In words", words), *side_charts(found, pair, child.time)]
    for which, tracks, body in bodies:
        parts.append(marker_chart(which, tracks, body, pair.time))
    parts += [marker_sheet(bodies), covariance_sheet(found), coverage_of(bodies)]
    return Report(
        f"Joint from {name}",
        f"{counted(len(found.time), 'frame')} over {found.time[-1] - found.time[0]:.6g} s, "
        f"{' and '.join(f'{len(tracks.labels)} markers of the {which}' for which, tracks, _ in bodies)}, "
        f"by {METHODS[found.method]}",
        __version__,
        (*parts, facts_of(found)),
        verdict_of_joint(found),
    )


def bodies_of(
    found: Joint, parent: FeatureTracks | None, child: FeatureTracks
) -> list[tuple[str, FeatureTracks, Body]]:
    """The bodies of a joint, by their names, with their markers."""
    bodies = [("child", child, found.pair.child)]
    if parent is not None and found.pair.parent is not None:
        bodies.insert(0, ("parent", parent, found.pair.parent))
    return bodies


def verdict_of_joint(found: Joint) -> Verdict:
    """Whether there is a centre to be used."""
    claim = np.sqrt(np.linalg.eigvalsh(found.covariance[3:, 3:]))
    if found.hinge:
        across = f"±{millimetres(claim[1])} mm across it"
        return "warn", f"A hinge: along its axis the centre is hardly known, ±{millimetres(claim[2])} mm; {across}."
    if not found.observable:
        return "warn", f"A centre of rotation that is hardly known, ±{millimetres(claim[2])} mm in the worst direction."
    return "good", f"A centre of rotation, known to ±{millimetres(claim[2])} mm in the worst direction of the child."


def side_charts(found: Joint, pair: Pair, time: FloatArray) -> list[Chart]:
    """Where the other body has the centre, in the axes of each, less where it is on the whole; time (n,), s, of all
    frames: there are gaps where a body is not shown, or where there are no frames.
    """
    shown = np.isin(time, found.time)
    R_T_P, c = pair.parent_pose
    in_room = pair.child.rotation @ found.in_child + pair.child.place
    back = R_T_P @ found.in_parent + c
    sides = (
        ("child", "parent", R_T_P, in_room - c, found.in_parent, slice(0, 3)),
        ("parent", "child", pair.child.rotation, back - pair.child.place, found.in_child, slice(3, 6)),
    )
    charts, gaps = [], gaps_of(time)
    for other, own, R, arm, mean, block in sides:
        apart = np.full((len(time), 3), np.nan)
        apart[shown] = 1e3 * (np.einsum("kji,kj->ki", R, arm) - mean)
        width = 1e3 * SIGMAS * np.sqrt(np.maximum(np.diag(found.covariance)[block], 0.0))
        told = ", ".join(f"{name} ±{millimetres(1e-3 * size)}" for size, name in zip(width, "xyz", strict=True))
        charts.append(
            Chart(
                f"The centre in the {own}",
                f"Where the {other} has the joint's centre, in the {own}'s axes, less the centre that was found. What "
                f"is left is slack of the joint and skin that slides. The centre's own 95 % interval: {told} mm.",
                "mm",
                tuple(curve(name, time, apart[:, k], gaps=gaps, colour=COLOURS[k]) for k, name in enumerate("xyz")),
            )
        )
    return charts


def marker_chart(which: str, tracks: FeatureTracks, body: Body, time: FloatArray) -> Chart:
    """The lengths of the residuals of a body's markers, thinned out evenly."""
    length = 1e3 * np.linalg.norm(body.residual, axis=2)
    frames, markers = np.nonzero(np.isfinite(length))
    keep = evenly(len(frames), MOST_RESIDUALS)
    frames, markers = frames[keep], markers[keep]
    values = np.maximum(length[frames, markers], 1e-6)
    series = Series("residual", time[frames], values, 5, "points", of=markers)
    about = f"How far each marker of the {which} is from where a rigid body has it."
    return Chart(f"Markers of the {which}", about, "mm", (series,), log=True, filter=tracks.labels)


def marker_sheet(bodies: list[tuple[str, FeatureTracks, Body]]) -> Sheet:
    """Where each marker is in its body, how often it is seen, in how many frames left out, and how far it is off."""
    rows = [
        (
            which,
            label,
            *(f"{1e3 * value:.2f}" for value in body.markers[k].tolist()),
            str(int(body.weights[:, k].sum())),
            str(int(body.left_out[:, k].sum())),
            millimetres(float(body.rms[k])),
        )
        for which, tracks, body in bodies
        for k, label in enumerate(tracks.labels)
    ]
    headings = ("body", "marker", "x, mm", "y", "z", "frames", "left out", "off, mm rms per axis")
    about = (
        "x, y, z: from the markers' centroid in the axes of their body, in which its centre is told. frames: that show "
        "it, and both bodies. left out: seen, but off its body. off: from where the rigid body has it."
    )
    return Sheet("Markers", headings, tuple(rows), about, left=2)


def covariance_sheet(found: Joint) -> Sheet:
    """The principal axes of the centre's covariance in both bodies."""
    rows = []
    for which, block in (("parent", slice(0, 3)), ("child", slice(3, 6))):
        values, axes = np.linalg.eigh(found.covariance[block, block])
        for value, axis in zip(values.tolist(), axes.T.tolist(), strict=True):
            rows.append((which, _vector(axis), millimetres(float(np.sqrt(max(value, 0.0))))))
    return Sheet("How well the centre is known", ("in the axes of", "direction", "±1σ, mm"), tuple(rows), left=2)


def coverage_of(bodies: list[tuple[str, FeatureTracks, Body]]) -> Timeline:
    """Which marker is seen when, and where it is left out."""
    labels = tuple(label for _, tracks, _ in bodies for label in tracks.labels)
    seen = np.concatenate([tracks.seen for _, tracks, _ in bodies], axis=1)
    left_out = np.concatenate([body.left_out for _, _, body in bodies], axis=1)
    return coverage(bodies[0][1].time, labels, seen, left_out if left_out.any() else None)


def facts_of(found: Joint) -> Facts:
    """The numbers, and the version."""
    items = [
        ("method", METHODS[found.method]),
        ("centre in the parent, m", _vector(found.in_parent.tolist())),
        ("centre in the child, m", _vector(found.in_child.tolist())),
        ("independent frames", f"{found.effective_frames:.0f} of {len(found.time)}"),
        ("least over greatest motion", f"{found.ratio:.3g}"),
    ]
    if found.hinge_axis is not None:
        axis = found.hinge_axis
        items += [
            ("axis in the parent", _vector(axis.in_parent.tolist())),
            ("axis in the child", f"{_vector(axis.in_child.tolist())}, ±{np.rad2deg(axis.deviation):.2g}°"),
            ("turned across the axis, rms", f"{np.rad2deg(axis.residual):.2g}°"),
        ]
    if found.slide is not None:
        slide = found.slide
        items += [
            ("slide: white, mm", millimetres(slide.white)),
            ("slide: lasting, mm", millimetres(slide.correlated)),
            ("slide: with the motion, mm", millimetres(slide.locked)),
            ("slide: of the markers' own noise, mm", millimetres(slide.of_markers)),
        ]
    return Facts("Numbers and version", (*items, ("baryscope", __version__)))


def _vector(values: list[float]) -> str:
    return f"({', '.join(f'{value:.4f}' for value in values)})"

"""`baryscope joint`: the centre of rotation between two moving bodies, or of a probe in the room."""

import csv
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Annotated, Literal, TextIO

import numpy as np
from cyclopts import Parameter

from baryscope import __version__
from baryscope.estimator.formats import (
    MARKER_FORMS,
    Unit,
    read_tracks,
    refuse_unmarkable,
    with_marker,
    writable,
    writer_of_tracks,
)
from baryscope.estimator.geometry.symmetric import elements_of
from baryscope.estimator.joint import Joint, Method, joint
from baryscope.estimator.limits import FINEST
from baryscope.estimator.plausibility import doubted_mark, doubted_times, refuse_implausible, width_of
from baryscope.estimator.tables import COVARIANCE_COLUMNS
from baryscope.estimator.tracks import FeatureTracks, FloatArray
from baryscope.models.errors import ComputationError, InputError
from baryscope.models.files import Writer, check_outputs, write_together
from baryscope.models.words import counted, length
from baryscope.progress import stage
from baryscope.report import html_of, report_of_joint
from baryscope.report.joints import bodies_of, marker_sheet
from baryscope.scripts.cli.console import Show
from baryscope.scripts.cli.options.features import named_features
from baryscope.table import Table

FORMS = (".csv", *MARKER_FORMS)
LEAST = 3  # markers of a body
AXIS_COLUMNS = ("axis_x", "axis_y", "axis_z")  # of a hinge: a unit vector
WIDE = 20.0  # m; the longest arm with a joint, that of the International Space Station, is shorter
DIGITS = 4  # of metres and unit vectors, or more
UNSTEADY = 0.1  # rad, standard deviation of a body's attitudes that is worth a word


def find_joint(
    tracks: Path,
    *,
    child: str | None = None,
    parent: str | None = None,
    method: Method = "ml",
    units: Unit | None = None,
    report: bool = True,
    output: Annotated[Path | None, Parameter(alias="-o")] = None,
    show: Show | None = None,
) -> None:
    """Find the centre of rotation between two bodies that both move, as shoulder or hip, or a probe's tip.

    The centre is at rest in parent and child, but for the joint's slack and skin that slides. Without a parent the room
    is it: the calibration of a probe that turns about its tip. A hinge, as knee or elbow, is named, and its axis found
    (SARA): along it the centre is hardly known.

    Parameters
    ----------
    tracks
        The markers, a .csv, .parquet, .nc, .trc or .c3d file, as for `baryscope estimate`.
    child
        Labels of at least three markers of one body, separated by commas. Without it the labels of the file are told.
    parent
        Those of the other. Default: the room.
    method
        ml: maximum likelihood, with slack and skin as noise that lasts, has any rhythm, or keeps time with the motion.
        score: least squares as published (SCoRE), with a covariance for noise that lasts, and for skin in time with
            the motion.
    units
        Of the file's lengths. Default: metres, or what the file says.
    report
        With --output, write a .report.html file, too: the centre in both bodies over time and the markers' residuals.
    output
        The centre at every time that shows both bodies, and its covariance (the columns of an estimate of `baryscope
        estimate`), and a hinge's axis, axis_x, axis_y and axis_z, OUT.csv; or the recording with the centre as one more
        marker, OUT, for programs of motion capture, OUT.trc or OUT.c3d. The report goes beside it, OUT.report.html.
    """
    show = show or Show()
    written = []
    if output is not None:
        written = [writable(output, FORMS), output.with_suffix(".report.html")]
        check_outputs(written, [tracks])
    with show.progress() as progress:
        with stage(progress, f"reading {tracks}"):
            data = read_tracks(tracks, units)
        if child is None:
            raise InputError(f"--child: missing, expected at least {LEAST} of {', '.join(data.labels)}")
        moving = named_features(data, child, "--child", LEAST, "marker")
        ground = None if parent is None else named_features(data, parent, "--parent", LEAST, "marker")
        if ground is not None and (both := sorted(set(ground.labels) & set(moving.labels))):
            raise InputError(f"--parent and --child: found {both[0]} in both, expected markers of one body each")
        refuse_implausible(data, str(tracks))
        for doubt in (doubted_times(moving), doubted_mark(data)):
            if doubt is not None:
                show.remark(f"{tracks}: {doubt}")
        if output is not None and output.suffix in MARKER_FORMS:
            refuse_unmarkable(data, output)
        with stage(progress, "finding the joint"):
            try:
                found = joint(ground, moving, method=method)
            except ComputationError as error:
                raise ComputationError(f"{tracks}: {error}", error.reason) from error
    words = [*_words(found, len(moving.time)), *_doubted_unit(ground, moving)]
    if output is not None:
        page = html_of(report_of_joint(found, ground, moving, tuple(words), tracks.name)) if report else ""
        writers: list[Writer | None] = [
            _marker_writer(found, data, output) if output.suffix in MARKER_FORMS else partial(_write_path, found),
            (lambda stream: stream.write(page)) if report else None,
        ]
        write_together(dict(zip(written, writers, strict=True)))
    markers = marker_sheet(bodies_of(found, ground, moving))
    show.result(_values(found, ground, moving), *words, Table(markers.headings, markers.rows, left=markers.left))
    if output is not None:
        show.remark(f"the centre at every time: {output}")
        if report:
            show.remark(f"report, for a browser: {written[1]}")


def _marker_writer(found: Joint, data: FeatureTracks, output: Path) -> Writer:
    """What writes the recording with the centre as one more marker.

    Raises:
        InputError: a marker has its name, or the form cannot hold the recording.
        ComputationError: the centre is hardly known in a direction, which the form has no place to tell.
    """
    if not found.observable:
        form = output.suffix[1:].upper()
        raise ComputationError(
            f"{output}: the centre is hardly known along an axis, which {form} cannot tell; -o OUT.csv"
        )
    return writer_of_tracks(with_marker(data, output.stem, found.time, found.position, str(output)), output)


def _write_path(found: Joint, stream: TextIO) -> None:
    writer = csv.writer(stream, lineterminator="\n")
    cells = [found.time, found.position, elements_of(found.position_covariance)]
    names = ["time", "x", "y", "z", *COVARIANCE_COLUMNS]
    if (axis := found.axis_path) is not None:
        names, cells = [*names, *AXIS_COLUMNS], [*cells, axis]
    writer.writerow(names)
    writer.writerows(np.column_stack(cells).tolist())


def _words(found: Joint, frames: int) -> list[str]:
    """The result in a few lines; of a recording of so many frames."""
    kind = "a centre of rotation"
    if found.hinge:
        kind = "a hinge: along its axis its centre is hardly known"
    elif not found.observable:
        kind += ", hardly known: the bodies turn too little against each other, or as their skin slides"
    lines = [kind, _place_words(found, "parent"), _place_words(found, "child")]
    if found.hinge_axis is not None:
        axis = found.hinge_axis
        lines.append(
            f"  the axis in the child: ({_vector(axis.in_child)}), ±{np.rad2deg(axis.deviation):.2g}°; the bodies "
            f"turn across it by {np.rad2deg(axis.residual):.2g}° rms"
        )
        lines.append(
            "  skin that follows the angle looks like a centre elsewhere: 1 mm rms of it, "
            f"{axis.leverage:.2g} mm across the axis; the claim guesses it from the slide that shows"
        )
    for which, at in (("parent", found.parent_axes_time), ("child", found.child_axes_time)):
        if at is not None:
            lines.append(f"  the {which}'s axes are those of the file at {at:g} s; its markers in them, below")
    lines.append(
        f"  the two sides differ by {length(float(np.sqrt(np.mean(found.residual**2))))} rms per coordinate, for "
        f"{found.correlation_time:.2g} s at a time: {len(found.time)} frames weigh as {found.effective_frames:.0f}"
    )
    if frames > len(found.time):
        lines.append(
            f"  {frames - len(found.time)} of {frames} frames are not used: a body shows fewer than three markers "
            "there that are in their places"
        )
    if found.slide is not None:
        one = found.slide
        lines.append(
            f"  {length(one.white)} of that is white, {length(one.correlated)} lasts, {length(one.locked)} keeps time "
            f"with the motion; the markers' own noise explains {length(one.of_markers)}"
        )
    if (most := found.attitude_deviation) > UNSTEADY:
        lines.append(
            "  the markers of a body are too near to a line, or move too much by themselves: its attitudes are off by "
            f"{np.rad2deg(most):.0f}°, and what is said here hangs on them"
        )
    left_out = int(found.parent_left_out.sum() + found.child_left_out.sum())
    if left_out:
        lines.append(
            f"  {counted(left_out, 'position')} of markers that are off their body, as where labels are swapped, "
            f"{'is' if left_out == 1 else 'are'} left out"
        )
    return lines


def _place_words(found: Joint, which: Literal["parent", "child"]) -> str:
    """The centre in a body, or in the room, to two digits of its claim, and the claim along and across the direction in
    which it is least certain.
    """
    child, axis = which == "child", found.hinge_axis
    block = slice(3, 6) if child else slice(0, 3)
    values, axes = np.linalg.eigh(found.covariance[block, block])
    claim, weakest = np.sqrt(values), axes[:, 2]
    if axis is not None:
        weakest = np.copysign(1.0, weakest @ (axis.in_child if child else axis.in_parent)) * weakest
    where = f"in the {which}, from its markers' centroid"
    if not child and found.pair.parent is None:
        where = "in the room, in the file's axes"
    digits = max(DIGITS, 1 - int(np.floor(np.log10(max(claim[0], FINEST)))))
    return (
        f"  {where}: ({_vector(found.in_child if child else found.in_parent, digits)}) m, ±{length(claim[2])} along "
        f"({_vector(weakest)}), ±{length(claim[1])} across"
    )


def _doubted_unit(*bodies: FeatureTracks | None) -> list[str]:
    """What to say of a body that is wider than any with a joint, in a line."""
    widest = max(width_of(body) or 0.0 for body in bodies if body is not None)
    if widest < WIDE:
        return []
    return [f"  a body's markers are about {widest:.0f} m apart: in millimetres? Then --units mm"]


def _vector(values: FloatArray, digits: int = DIGITS) -> str:
    return ", ".join(f"{value:.{digits}f}" for value in values)


def _values(found: Joint, parent: FeatureTracks | None, child: FeatureTracks) -> dict[str, object]:
    """The numbers in SI units."""
    axis = found.hinge_axis
    return {
        "version": __version__,
        "epoch": child.epoch,
        "method": found.method,
        "parent": None if parent is None else list(parent.labels),
        "child": list(child.labels),
        "frames": len(found.time),
        "observable": found.observable,
        "hinge": found.hinge,
        "ratio": found.ratio,
        "axis": found.axis.tolist(),
        "in_parent": found.in_parent.tolist(),
        "in_child": found.in_child.tolist(),
        "covariance": found.covariance.tolist(),
        "parent_markers": found.parent_markers.tolist(),
        "child_markers": found.child_markers.tolist(),
        "residual_rms": float(np.sqrt(np.mean(found.residual**2))),
        "correlation_time": found.correlation_time,
        "effective_frames": found.effective_frames,
        "parent_rms": found.parent_rms.tolist(),
        "child_rms": found.child_rms.tolist(),
        "parent_left_out": found.parent_left_out.tolist(),
        "child_left_out": found.child_left_out.tolist(),
        "slide": None if found.slide is None else asdict(found.slide),
        "hinge_axis": None if axis is None else {name: np.asarray(one).tolist() for name, one in asdict(axis).items()},
    }

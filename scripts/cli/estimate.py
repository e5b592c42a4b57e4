"""`baryscope estimate`: the centre of mass from a file of tracks, without a unit and without truth."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter
from numpy.typing import NDArray

from baryscope.estimator.document.files import write_estimate
from baryscope.estimator.formats import MARKER_FORMS, WRITABLE, Unit, read_tracks, refuse_unmarkable, writable
from baryscope.estimator.methods import estimate
from baryscope.estimator.options import Options, PathOptions
from baryscope.estimator.plausibility import (
    doubted_attitude,
    doubted_log,
    doubted_mark,
    doubted_times,
    refuse_implausible,
)
from baryscope.estimator.prose import summary
from baryscope.estimator.result import Estimate
from baryscope.models.errors import InputError
from baryscope.models.files import check_outputs
from baryscope.models.words import counted, length
from baryscope.progress import stage
from baryscope.report import html_of, prediction_chart, report_of_estimate
from baryscope.scripts.cli.console import UNTRUSTED, Show
from baryscope.scripts.cli.options.features import named_features
from baryscope.scripts.cli.options.forces import ForceChoices
from baryscope.scripts.cli.options.frames import FrameChoices, Frames
from baryscope.scripts.cli.options.method import PathChoices, ScrewChoices, method_options
from baryscope.scripts.cli.options.prediction import AskedFor, PredictionChoices, Refused, prediction_path

LEAST_FEATURES = 2


def estimate_file(
    tracks: Path,
    /,
    *,
    units: Unit | None = None,
    features: str | None = None,
    method: str | None = None,
    frames: FrameChoices | None = None,
    path: PathChoices | None = None,
    forces: ForceChoices | None = None,
    screws: ScrewChoices | None = None,
    prediction: PredictionChoices | None = None,
    report: bool = True,
    output: Annotated[Path | None, Parameter(alias="-o")] = None,
    show: Show | None = None,
) -> int:
    """Estimate the path of the centre of mass from tracks of features.

    The exit code is 3 if the files are written but not to be trusted: not converged, a model does not fit, or
    too few frames to check it; or if the prediction that is asked for cannot be made, and only the others are.

    Parameters
    ----------
    tracks
        A CSV or Parquet file with the columns time,feature,x,y,z (s or UTC, m; chaser at the origin, inertial axes),
        and optionally cxx,cxy,cxz,cyy,cyz,czz (m², the covariance of each observation); markers in .trc or .c3d; or
        a .nc file or .zarr folder of xarray with position(time, feature, axis).
    units
        Of the lengths in that file. Default: what a .trc, .c3d, .nc or .zarr file says; metres.
    features
        Labels of those that are used, a,b,c: those of one body in a file of several. Default: all. One with a comma
        stands in quotes, '"a,b",c'.
    method
        pivot: least squares of path and points, attitudes free. ml: maximum a posteriori estimate of path, points and
        free tumble. ekf: iterated Kalman filter, smoothed. score: symmetrical centre of rotation, for a centre of mass
        at rest (with --orbit, in LVLH axes). screw-gpa: the published method. screw-ls: the same with least-squares
        screws. screw-raw: the same with three raw points. Default: pivot; screw-gpa with an option of the screw
        methods.
    report
        Write a .report.html file, too: scene in 3D, path, residuals and diagnostics, for a browser.
    output
        The path of the centre of mass and its covariance, a .csv, .parquet or .nc file or a .zarr folder; or the
        recording with the centre of mass as one more marker, EST, for programs of motion capture, EST.trc or EST.c3d.
        All else goes beside it, into a .json file, the report into a .report.html file, and a prediction into a
        .prediction.csv file. Default: the tracks' name with .estimate.csv.
    """
    show, frames, forces = show or Show(), frames or FrameChoices(), forces or ForceChoices()
    prediction = prediction or PredictionChoices()
    if not tracks.name:
        raise InputError(f"{tracks}: is a folder, expected feature tracks")
    output = writable(output or tracks.with_suffix(".estimate.csv"), (*WRITABLE, *MARKER_FORMS))
    given = path or PathChoices(), screws or ScrewChoices(), forces.chosen()
    method, options = method_options(method, *given, orbit=frames.orbit is not None)
    frames.check(forces.acceleration)
    prediction.check(method)
    diagnostics, report_file = output.with_suffix(".json"), output.with_suffix(".report.html")
    ahead = prediction_path(output)
    written = [output, diagnostics, ahead, report_file]
    read = [tracks, *frames.files(), *([] if forces.acceleration is None else [forces.acceleration])]
    check_outputs(written, read)
    with show.progress() as progress:
        with stage(progress, f"reading {tracks}"):
            data = recorded = read_tracks(tracks, units)
            if features is not None:
                data = named_features(data, features, "--features", LEAST_FEATURES)
            refuse_implausible(data, str(tracks))
            if frames.orbit is None and (doubt := doubted_times(data)) is not None:
                show.remark(f"{tracks}: {doubt}")
            if (mark := doubted_mark(data)) is not None:
                show.remark(f"{tracks}: {mark}")
            known = frames.read(data)
            if output.suffix in MARKER_FORMS:
                refuse_unmarkable(recorded, output)
            data = known.dated(data)
            options, request = forces.read_into(options, known.epoch, known.camera), prediction.of(data)
            for line in _doubts(frames, forces, known, options, data.time, request):
                show.remark(line)
        with stage(progress, f"estimating by {method}") as share:
            result = estimate(
                data, method=method, orbit=known.orbit, options=options, camera=known.camera, progress=share
            )
            result = replace(result, epoch=known.epoch or result.epoch)
    lines = summary(result)
    made = None if request is None else request.made(result)
    refused, predicted = (made, None) if isinstance(made, Refused) else (None, made)
    chart = None
    if predicted is not None:
        lines.append(prediction.line(predicted, ahead))
        chart = prediction_chart(predicted, lines[-1])
    page = None
    if report:
        page = html_of(report_of_estimate(result, known.inertial(data), known.orbit, tracks.name, chart))
        lines.append(f"report, for a browser: {report_file}")
    markers = None
    if output.suffix in MARKER_FORMS:
        markers = known.inertial(recorded)
        lines.append(_marker_line(result, output))
    write_estimate(result, output, predicted, {report_file: page}, markers)
    if refused is not None:
        show.warn(f"no prediction: {refused.reason}")
    lines.append(f"more in {diagnostics}")
    document = json.loads(diagnostics.read_text(encoding="utf-8"))
    show.result(document, _headline(result, output), *(f"  {line}" for line in lines))
    return 0 if result.status.trustworthy and refused is None else UNTRUSTED


def _doubts(
    frames: FrameChoices,
    forces: ForceChoices,
    known: Frames,
    options: Options,
    times: NDArray[np.float64],
    request: AskedFor | None,
) -> list[str]:
    """What to say of files beside the tracks whose times (n,), s, are hardly those of the tracks, in lines."""
    doubts: list[tuple[Path | None, str | None]] = []
    if isinstance(options, PathOptions) and options.acceleration is not None:
        asked = times if request is None else np.concatenate([times, request.time])
        doubts.append((forces.acceleration, doubted_log(options.acceleration, asked)))
    if known.camera is not None:
        doubts.append((frames.camera, doubted_attitude(known.camera.attitude, times)))
    return [f"{file}: {doubt}" for file, doubt in doubts if doubt is not None]


def _marker_line(result: Estimate, path: Path) -> str:
    """What a form of motion capture has, and the claim in the worst frame and direction, which it cannot tell."""
    known = ""
    if result.covariance is not None:
        deviation = np.sqrt(np.linalg.eigvalsh(result.covariance)[:, -1])
        worst = int(np.argmax(deviation))
        known = (
            f": ±{length(float(deviation[worst]))} in the worst direction where it is known least, at "
            f"{result.time[worst]:g} s"
        )
    return f"it is the marker {path.stem} of {path}, which has no place for its claim{known}"


def _headline(result: Estimate, path: Path) -> str:
    return (
        f"{path}: {counted(result.time.size, 'position')} from {counted(len(result.clusters), 'cluster')}, "
        f"{100 * result.coverage:.0f} % of the times covered"
    )

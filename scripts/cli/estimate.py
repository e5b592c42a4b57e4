"""`baryscope estimate`: the centre of mass from a file of tracks, without a unit and without truth."""

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

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
from baryscope.estimator.prediction import Prediction
from baryscope.estimator.prose import summary
from baryscope.estimator.result import Estimate
from baryscope.estimator.tracks import FeatureTracks
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
    show = show or Show()
    chosen = _Choices(frames or FrameChoices(), forces or ForceChoices(), prediction or PredictionChoices())
    if not tracks.name:
        raise InputError(f"{tracks}: is a folder, expected feature tracks")
    files = _Files(writable(output or tracks.with_suffix(".estimate.csv"), (*WRITABLE, *MARKER_FORMS)))
    given = path or PathChoices(), screws or ScrewChoices(), chosen.forces.chosen()
    method, options = method_options(method, *given, orbit=chosen.frames.orbit is not None)
    chosen.frames.check(chosen.others_in_utc)
    chosen.prediction.check(method)
    check_outputs(files.all, [tracks, *chosen.files])
    with show.progress() as progress:
        with stage(progress, f"reading {tracks}"):
            data = recorded = read_tracks(tracks, units)
            if features is not None:
                data = named_features(data, features, "--features", LEAST_FEATURES)
            refuse_implausible(data, str(tracks))
            if chosen.frames.orbit is None and (doubt := doubted_times(data)) is not None:
                show.remark(f"{tracks}: {doubt}")
            if (mark := doubted_mark(data)) is not None:
                show.remark(f"{tracks}: {mark}")
            read = _read(recorded, data, options, chosen, files)
            for line in _doubts(chosen, read):
                show.remark(line)
        with stage(progress, f"estimating by {method}") as share:
            known = read.known
            result = estimate(
                read.data, method=method, orbit=known.orbit, options=read.options, camera=known.camera, progress=share
            )
            result = replace(result, epoch=known.epoch or result.epoch)
    made = None if read.request is None else read.request.made(result)
    words = _write(result, read, made, chosen.prediction, files, tracks.name if report else None)
    if isinstance(made, Refused):
        show.warn(f"no prediction: {made.reason}")
    lines = [*summary(result), *words, f"more in {files.diagnostics}"]
    document = json.loads(files.diagnostics.read_text(encoding="utf-8"))
    show.result(document, _headline(result, files.estimate), *(f"  {line}" for line in lines))
    return 0 if result.status.trustworthy and not isinstance(made, Refused) else UNTRUSTED


@dataclass(frozen=True)
class _Choices:
    """What is chosen beside the method."""

    frames: FrameChoices
    forces: ForceChoices
    prediction: PredictionChoices

    @property
    def files(self) -> list[Path]:
        """The files that are read beside the tracks."""
        return [*self.frames.files(), *self._others]

    @property
    def others_in_utc(self) -> bool:
        """Whether files beside those of the frames may have UTC times."""
        return bool(self._others)

    @property
    def _others(self) -> list[Path]:
        return [one for one in (self.forces.acceleration, self.prediction.predict_at) if one is not None]


@dataclass(frozen=True)
class _Files:
    """The files that are written: that of the path, and those beside it."""

    estimate: Path

    @property
    def diagnostics(self) -> Path:
        return self.estimate.with_suffix(".json")

    @property
    def prediction(self) -> Path:
        return prediction_path(self.estimate)

    @property
    def report(self) -> Path:
        return self.estimate.with_suffix(".report.html")

    @property
    def all(self) -> list[Path]:
        return [self.estimate, self.diagnostics, self.prediction, self.report]


@dataclass(frozen=True, eq=False)
class _Read:
    """What an estimate is made of: the tracks as they are in their file, recorded; data, those of the features that are
    used, with the epoch that is known; orbit and camera; the method's options; and the prediction that is asked for.
    """

    recorded: FeatureTracks
    data: FeatureTracks
    known: Frames
    options: Options
    request: AskedFor | None


def _read(recorded: FeatureTracks, data: FeatureTracks, options: Options, chosen: _Choices, files: _Files) -> _Read:
    """What is read beside the tracks, and what it makes of them and of the options.

    Raises:
        InputError: a file is wrong, or the form of the output cannot hold the recording.
    """
    known = chosen.frames.read(data)
    if files.estimate.suffix in MARKER_FORMS:
        refuse_unmarkable(recorded, files.estimate)
    data = known.dated(data)
    options = chosen.forces.read_into(options, known.epoch, known.camera)
    return _Read(recorded, data, known, options, chosen.prediction.of(data, known.epoch))


def _write(
    result: Estimate,
    read: _Read,
    made: Prediction | Refused | None,
    prediction: PredictionChoices,
    files: _Files,
    title: str | None,
) -> list[str]:
    """Write the files; what they are, in lines. title: of the report, None without one.

    Raises:
        InputError, DiskError: a file cannot be written.
        ComputationError: the status of an estimate for motion capture is not good.
    """
    predicted = None if isinstance(made, Refused) else made
    lines, chart, page, markers = [], None, None, None
    if predicted is not None:
        lines.append(prediction.line(predicted, files.prediction))
        chart = prediction_chart(predicted, lines[-1])
    if title is not None:
        page = html_of(report_of_estimate(result, read.known.inertial(read.data), read.known.orbit, title, chart))
        lines.append(f"report, for a browser: {files.report}")
    if files.estimate.suffix in MARKER_FORMS:
        markers = read.known.inertial(read.recorded)
        lines.append(_marker_line(result, files.estimate))
    write_estimate(result, files.estimate, predicted, {files.report: page}, markers)
    return lines


def _doubts(chosen: _Choices, read: _Read) -> list[str]:
    """What to say of files beside the tracks whose times are hardly those of the tracks, in lines."""
    doubts: list[tuple[Path | None, str | None]] = []
    options, camera, times = read.options, read.known.camera, read.data.time
    if isinstance(options, PathOptions) and options.acceleration is not None:
        asked = times if read.request is None else np.concatenate([times, read.request.time])
        doubts.append((chosen.forces.acceleration, doubted_log(options.acceleration, asked)))
    if camera is not None:
        doubts.append((chosen.frames.camera, doubted_attitude(camera.attitude, times)))
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

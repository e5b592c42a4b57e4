"""`baryscope estimate`: the centre of mass from a file of tracks, without a unit and without truth."""

import json
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from baryscope.estimator.camera.camera import Camera
from baryscope.estimator.document import write_estimate
from baryscope.estimator.formats import Unit, read_tracks, writable
from baryscope.estimator.methods import METHODS, PREDICTING, TURNING, estimate
from baryscope.estimator.options import Axes, Burns, Noise, Options, Reference, Torque
from baryscope.estimator.plausibility import refuse_implausible
from baryscope.estimator.prediction import Prediction
from baryscope.estimator.prose import summary
from baryscope.estimator.result import Estimate
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.ephemeris.utc import utc_of, utc_text
from baryscope.models.errors import InputError
from baryscope.models.files import refuse_overwriting
from baryscope.models.scenario import load_orbit
from baryscope.models.words import counted
from baryscope.progress import stage
from baryscope.report import html_of, report_of_estimate
from baryscope.scripts.cli.console import UNTRUSTED, Show
from baryscope.scripts.cli.joint import chosen
from baryscope.scripts.cli.options.forces import ForceChoices
from baryscope.scripts.cli.options.prediction import PredictionChoices, Refused, prediction_path
from baryscope.scripts.cli.options.whole import Whole

# Options that bear on some of the methods only that have them; and choices that need an orbit.
BEARING = {
    "sigma": PREDICTING,
    "noise": PREDICTING,
    "process_noise": PREDICTING,
    "unknown_burns": PREDICTING,
    "torque": TURNING,
    "torque_noise": TURNING,
}
LEAST_FEATURES = 2
ON_ORBIT = {"axes": "lvlh", "trajectory": "relative-orbit", "torque": "gravity-gradient"}


@Parameter(name="*")
@dataclass(frozen=True)
class PathChoices:
    """What is known of path, noise and torque.

    Parameters
    ----------
    trajectory
        Model of the path (pivot, ml, ekf): fixed, polynomial (of a degree that the data choose), polynomial:N, or
        relative-orbit, which needs --orbit. Default: relative-orbit with an orbit, else polynomial. For score: fixed,
        at rest in inertial axes even with an orbit.
    sigma
        Standard deviation of an observation's coordinate (pivot, ml, ekf), m. If the tracks have covariances, a factor
        on their standard deviations. One that the residuals exceed is named and not used. Default: estimated from the
        residuals.
    noise
        Covariances of the tracks (pivot, ml, ekf): stereo, evaluated again at the estimated point since they grow with
        range; fixed, used as they are; or auto, as they tell themselves. Default: auto.
    torque
        Torque on the target (ml, ekf): none or gravity-gradient, which needs --orbit. Default: the likelier one;
        with ml both are in the covariance where the tracks do not decide.
    process_noise
        What the model of the path leaves out (pivot, ml, ekf), as white acceleration: its density in m²/s³; auto,
        estimated from the tracks; or none, the model holds exactly. Default: auto.
    unknown_burns
        Burns of the chaser that no log tells of (pivot, ml, ekf; on a relative orbit, or a polynomial whose degree the
        data choose): auto, found in the tracks and listed, their cost being in the covariance; or none. Default: auto.
    torque_noise
        What the model of the tumble leaves out (ml, ekf), as white angular acceleration: its density in rad²/s³; auto,
        estimated from the tracks; or none. Default: auto.
    """

    trajectory: str | None = None
    sigma: float | None = None
    noise: Noise | None = None
    torque: Torque | None = None
    process_noise: float | Literal["auto", "none"] | None = None
    unknown_burns: Burns | None = None
    torque_noise: float | Literal["auto", "none"] | None = None


@Parameter(name="*")
@dataclass(frozen=True)
class ScrewChoices:
    """Settings of the screw methods.

    Parameters
    ----------
    axes
        Axes in which the tracks are registered (screw methods): inertial, as published, or lvlh, which needs --orbit.
        Default: inertial.
    lag
        Time between the two poses of a screw, s (screw methods). Default: chosen from the data.
    cutoff
        Cut-off of the zero-phase low-pass, Hz (screw methods). Default: chosen from the data.
    degree
        Degree of the polynomial path (screw methods). Default: chosen from the data.
    reference
        What Procrustes analysis maps the poses of an interval to (screw methods): mean, their mean shape, or first, the
        first pose, as published. Default: mean.
    """

    axes: Axes | None = None
    lag: float | None = None
    cutoff: float | None = None
    degree: Whole | None = None
    reference: Reference | None = None


def estimate_file(
    tracks: Path,
    /,
    *,
    units: Unit | None = None,
    features: str | None = None,
    method: str | None = None,
    orbit: Path | None = None,
    epoch: str | None = None,
    camera: Path | None = None,
    rig: Path | None = None,
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
        Labels of those that are used, a,b,c: those of one body in a file of several. Default: all.
    method
        pivot: least squares of path and points, attitudes free. ml: maximum a posteriori estimate of path, points and
        free tumble. ekf: iterated Kalman filter, smoothed. score: symmetrical centre of rotation, for a centre of mass
        at rest (with --orbit, in LVLH axes). screw-gpa: the published method. screw-ls: the same with least-squares
        screws. screw-raw: the same with three raw points. Default: pivot; screw-gpa with an option of the screw
        methods.
    orbit
        The target's orbit: a TOML file with a table [orbit], which `baryscope simulate` writes beside its tracks, or a
        TLE, OMM or OEM. The axes of the tracks are those of the orbit: TEME for a TLE or OMM.
    epoch
        UTC of time 0, for a TLE, OMM, OEM, an orbit with an epoch, or a camera's attitude at UTC times. Default: that
        of tracks with UTC times.
    camera
        The camera's attitude, for tracks in camera axes: a CSV file with the columns time,qw,qx,qy,qz (s or UTC, unit
        quaternions, the scalar first) that turn camera axes into inertial ones. Rows span the tracks without gaps.
    rig
        Of --camera: a TOML file with a table [rig], the lever arm from the chaser's centre of mass to the camera, and
        what is uncertain about camera and attitude. Default: no lever arm, nothing uncertain.
    report
        Write a .report.html file, too: scene in 3D, path, residuals and diagnostics, for a browser.
    output
        The path of the centre of mass and its covariance, a .csv, .parquet or .nc file or a .zarr folder; all else goes
        beside it, into a .json file, the report into a .report.html file, and a prediction into a .prediction.csv file.
        Default: the tracks' name with .estimate.csv.
    """
    show = show or Show()
    if not tracks.name:
        raise InputError(f"{tracks}: is a folder, expected feature tracks")
    target = writable(output or tracks.with_suffix(".estimate.csv"))
    for_path, for_screws = asdict(path or PathChoices()), asdict(screws or ScrewChoices())
    forces = forces or ForceChoices()
    method, options = _choice(method, for_path | forces.chosen(), for_screws)
    for name, choice in ON_ORBIT.items():
        if (for_path | for_screws)[name] == choice and orbit is None:
            raise InputError(f"--{name} {choice}: needs the target's orbit, expected --orbit ORBIT.toml")
    if rig is not None and camera is None:
        raise InputError("--rig: needs the camera's attitude, expected --camera ATTITUDE.csv")
    if epoch is not None:
        utc_of(epoch, "--epoch")
        if orbit is None and forces.acceleration is None and camera is None:
            raise InputError(
                "--epoch: needs something that has a UTC, expected --orbit ORBIT, --acceleration A.csv or "
                "--camera ATTITUDE.csv"
            )
    read = [tracks, *(file for file in (orbit, camera, rig, forces.acceleration) if file is not None)]
    prediction = prediction or PredictionChoices()
    prediction.check(method)
    ahead = [] if prediction.predict is None else [prediction_path(target)]
    page = [target.with_suffix(".report.html")] if report else []
    refuse_overwriting([target, target.with_suffix(".json"), *ahead, *page], read)
    with show.progress() as progress:
        with stage(progress, f"reading {tracks}"):
            data = read_tracks(tracks, units)
            if features is not None:
                data = chosen(data, features, "--features", LEAST_FEATURES)
            refuse_implausible(data, str(tracks))
            epoch = _epoch(data, epoch)
            known_orbit = None if orbit is None else load_orbit(orbit, epoch)
            turned = None if camera is None else Camera.load(_csv(camera), rig)
            if turned is not None and turned.attitude.epoch is not None:
                data = replace(data, epoch=epoch)
            options, asked = forces.read_into(options, epoch, turned), prediction.of(data)
        with stage(progress, f"estimating by {method}") as share:
            result = estimate(data, method=method, orbit=known_orbit, options=options, camera=turned, progress=share)
            result = replace(result, epoch=epoch or result.epoch)
    lines = summary(result)
    found = None if asked is None else asked.made(result)
    if isinstance(found, Prediction):
        lines.append(prediction.line(found, ahead[0]))
    seen = data if turned is None else turned.inertial(data)
    pages = {path: html_of(report_of_estimate(result, seen, known_orbit, tracks.name)) for path in page}
    write_estimate(result, target, found if isinstance(found, Prediction) else None, pages)
    if isinstance(found, Refused):
        ahead[0].unlink(missing_ok=True)  # of an older estimate
        show.warn(f"no prediction: {found.reason}")
    diagnostics = target.with_suffix(".json")
    words = [_headline(result, target), *(f"  {line}" for line in lines)]
    words += [*(f"  report, for a browser: {path}" for path in page), f"  more in {diagnostics}"]
    show.result(json.loads(diagnostics.read_text(encoding="utf-8")), *words)
    return 0 if result.status.trustworthy and not isinstance(found, Refused) else UNTRUSTED


def _csv(path: Path) -> Path:
    """A path of a CSV file.

    Raises:
        InputError: its name doesn't end in .csv.
    """
    if path.suffix != ".csv":
        raise InputError(f"{path}: ends in {path.suffix!r}, expected .csv")
    return path


def _epoch(tracks: FeatureTracks, given: str | None) -> str | None:
    """The UTC of time 0 in ISO 8601, as given on the command line or by the tracks.

    Raises:
        InputError: both give it.
    """
    if given is not None and tracks.epoch is not None:
        raise InputError(f"--epoch: found {given} beside tracks with UTC times, expected one of the two")
    return tracks.epoch if given is None else utc_text(utc_of(given, "--epoch"))


def _choice(method: str | None, for_path: dict[str, Any], for_screws: dict[str, Any]) -> tuple[str, Options]:
    """The method, and its options from those that were given on the command line.

    Raises:
        InputError: there is no such method, or it has no such option, or has it without use.
    """
    if method is not None and method not in METHODS:
        raise InputError(f"--method: found {method!r}, expected one of {', '.join(METHODS)}")
    chosen = {name: value for name, value in (for_path | for_screws).items() if value is not None}
    first_for_screws = next((name for name in chosen if name in for_screws), None)
    default = "pivot" if first_for_screws is None else "screw-gpa"
    for name in chosen:
        having = BEARING.get(name) or _having(name)
        if (method or default) in having:
            continue
        name = name.replace("_", "-")
        if method is None and first_for_screws is None:
            raise InputError(f"--{name}: found with {default}, the default, expected --method {' or '.join(having)}")
        if method is None:
            raise InputError(
                f"--{name}: found beside --{first_for_screws}, expected one of the two: no method has both"
            )
        raise InputError(f"--{name}: found with --method {method}, expected one of {', '.join(having)}")
    chosen.pop("acceleration", None)  # which is still a file
    return method or default, METHODS[method or default].options(**chosen)


def _having(option: str) -> list[str]:
    """The methods that have an option."""
    return [method.name for method in METHODS.values() if option in {field.name for field in fields(method.options)}]


def _headline(result: Estimate, path: Path) -> str:
    return (
        f"{path}: {counted(result.time.size, 'position')} from {counted(len(result.clusters), 'cluster')}, "
        f"{100 * result.coverage:.0f} % of the times covered"
    )

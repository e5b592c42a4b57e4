"""`baryscope estimate`: the centre of mass from a file of tracks, without a unit and without truth."""

from dataclasses import fields
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from baryscope.estimator.document import write_estimate
from baryscope.estimator.methods import METHODS, estimate
from baryscope.estimator.options import Axes, Noise, Options, Reference, Torque
from baryscope.estimator.plausibility import refuse_implausible
from baryscope.estimator.prose import summary
from baryscope.estimator.result import Estimate
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import InputError
from baryscope.models.scenario import load_orbit
from baryscope.models.words import counted
from baryscope.scripts.cli.console import out, step
from baryscope.scripts.cli.simulate import csv_path

UNTRUSTED = 3  # exit code


def estimate_file(
    tracks: Path,
    /,
    *,
    method: str | None = None,
    trajectory: str | None = None,
    orbit: Path | None = None,
    sigma: float | None = None,
    noise: Noise | None = None,
    torque: Torque | None = None,
    axes: Axes | None = None,
    lag: float | None = None,
    cutoff: float | None = None,
    degree: int | None = None,
    reference: Reference | None = None,
    output: Annotated[Path | None, Parameter(alias="-o")] = None,
) -> int:
    """Estimate the path of the centre of mass from tracks of features.

    Ends with 3 where files were written but the result must not be trusted: not converged, or a model does not fit.

    Parameters
    ----------
    tracks
        A CSV file with the columns time,feature,x,y,z (s, m; chaser at the origin, inertial axes), and optionally
        cxx,cxy,cxz,cyy,cyz,czz (m², the covariance of each sighting).
    method
        pivot, the default: least squares of path and features, any motion; ml: maximum likelihood of a free tumble;
        ekf: iterated Kalman filter; score: fixed point; screw-gpa, the default where an option of the screw methods is
        given: the paper's; screw-ls: least-squares screws; screw-raw: three raw points.
    trajectory
        What is known of the path (pivot, ml, ekf): fixed, polynomial, polynomial:N or relative-orbit, which needs the
        orbit. relative-orbit with an orbit, else a polynomial whose degree the data choose, unless given.
    orbit
        The target's orbit, a TOML file with a table [orbit].
    sigma
        Standard deviation of a coordinate, m, if it is known (pivot, ml, ekf); with covariances in the tracks, a factor
        on theirs. Estimated from the residuals unless given.
    noise
        How covariances in the tracks are to be read (pivot, ml): stereo, which grow with range, or fixed.
    torque
        On the target (ml): none or gravity-gradient; the one that explains the tracks better unless given.
    axes
        Axes in which the tracks are registered (screw methods): inertial as published, or lvlh, which needs the orbit.
    lag
        Time between the two poses of a screw, s; chosen from the data unless given.
    cutoff
        Cut-off of the screw methods' zero-phase low-pass, Hz; chosen from the data unless given.
    degree
        Degree of the screw methods' polynomial path; chosen from the data unless given.
    reference
        What Procrustes maps an interval's poses to (screw methods): their mean shape, or the first pose, as published.
    output
        The estimate, a .csv file; the tracks' name with .estimate.csv unless given. Diagnostics go to the same
        name with .json.
    """
    path = csv_path(output or tracks.with_suffix(".estimate.csv"))
    for_path: dict[str, Any] = {"trajectory": trajectory, "sigma": sigma, "noise": noise, "torque": torque}
    for_screws: dict[str, Any] = {"axes": axes, "lag": lag, "cutoff": cutoff, "degree": degree, "reference": reference}
    method, options = _choice(method, for_path, for_screws)
    if axes == "lvlh" and orbit is None:
        raise InputError("--axes lvlh: needs the target's orbit, expected --orbit ORBIT.toml")
    if trajectory == "relative-orbit" and orbit is None:
        raise InputError("--trajectory relative-orbit: needs the target's orbit, expected --orbit ORBIT.toml")
    known_orbit = None if orbit is None else load_orbit(orbit)
    with step(f"reading {tracks}"):
        data = FeatureTracks.read_csv(csv_path(tracks))
        refuse_implausible(data, str(tracks))
    with step(f"estimating by {method}: {METHODS[method].summary}"):
        result = estimate(data, method=method, orbit=known_orbit, options=options)
    write_estimate(result, path)
    out.print("\n".join([_headline(result, path), *(f"  {line}" for line in summary(result))]), soft_wrap=True)
    out.print(f"  more in {path.with_suffix('.json')}", soft_wrap=True)
    return 0 if result.status.trustworthy else UNTRUSTED


def _choice(method: str | None, for_path: dict[str, Any], for_screws: dict[str, Any]) -> tuple[str, Options]:
    """The method, and its options from those that were given on the command line.

    Raises:
        InputError: there is no such method, or it has no such option.
    """
    if method is not None and method not in METHODS:
        raise InputError(f"--method: found {method!r}, expected one of {', '.join(METHODS)}")
    chosen = {name: value for name, value in (for_path | for_screws).items() if value is not None}
    first_for_screws = next((name for name in chosen if name in for_screws), None)
    default = "pivot" if first_for_screws is None else "screw-gpa"
    for name in chosen:
        having = [other.name for other in METHODS.values() if name in {field.name for field in fields(other.options)}]
        if (method or default) in having:
            continue
        if method is None:
            raise InputError(
                f"--{name}: found beside --{first_for_screws}, expected one of the two: no method has both"
            )
        raise InputError(f"--{name}: found with --method {method}, expected one of {', '.join(having)}")
    return method or default, METHODS[method or default].options(**chosen)


def _headline(result: Estimate, path: Path) -> str:
    return (
        f"{path}: {counted(result.time.size, 'position')} from {counted(len(result.clusters), 'cluster')}, "
        f"{100 * result.coverage:.0f} % of the times covered"
    )

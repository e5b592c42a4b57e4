"""`baryscope estimate`: the centre of mass from a file of tracks, without a unit and without truth."""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from baryscope.estimator.methods import METHODS, estimate
from baryscope.estimator.options import Axes, ScrewOptions
from baryscope.estimator.procrustes import Reference
from baryscope.estimator.result import Estimate
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import InputError
from baryscope.models.scenario import Orbit
from baryscope.scripts.console import out, step
from baryscope.scripts.simulate import csv_path

MethodName = Literal["screw-raw", "screw-ls", "screw-gpa"]


def estimate_file(
    tracks: Path,
    /,
    *,
    method: MethodName = "screw-gpa",
    axes: Axes = "inertial",
    orbit: Path | None = None,
    lag: float | None = None,
    cutoff: float | None = None,
    degree: int | None = None,
    reference: Reference = "mean",
    output: Annotated[Path | None, Parameter(alias="-o")] = None,
) -> None:
    """Estimate the path of the centre of mass from tracks of features.

    Parameters
    ----------
    tracks
        A CSV file with the columns time,feature,x,y,z (s, m; chaser at the origin, inertial axes).
    method
        screw-gpa: the paper's; screw-ls: least-squares screws; screw-raw: three raw points.
    axes
        Axes in which the tracks are registered: inertial as published, or lvlh, which needs the orbit.
    orbit
        The target's orbit, a TOML file with a table [orbit].
    lag
        Time between the two poses of a screw, s; chosen from the data unless given.
    cutoff
        Cut-off of the zero-phase low-pass, Hz; chosen from the data unless given.
    degree
        Degree of the polynomial path; chosen from the data unless given.
    reference
        What Procrustes maps an interval's poses to: their mean shape, or the first pose as in the paper.
    output
        The estimate, a .csv file; the tracks' name with .estimate.csv unless given. Diagnostics go to the same
        name with .json.
    """
    path = csv_path(output or tracks.with_suffix(".estimate.csv"))
    options = ScrewOptions(lag=lag, cutoff=cutoff, degree=degree, axes=axes, reference=reference)
    if axes == "lvlh" and orbit is None:
        raise InputError("--axes lvlh: needs the target's orbit, expected --orbit ORBIT.toml")
    known_orbit = None if orbit is None else Orbit.load(orbit)
    with step(f"reading {tracks}"):
        data = FeatureTracks.read_csv(csv_path(tracks))
    with step(f"estimating by {METHODS[method].summary}"):
        result = estimate(data, method=method, orbit=known_orbit, options=options)
    result.write(path)
    out.print(_summary(result, path), soft_wrap=True)


def _summary(result: Estimate, path: Path) -> str:
    facts = result.diagnostics
    chosen = facts["options"]
    return (
        f"{path}: {result.time.size} positions in {len(facts['clusters'])} intervals, "
        f"{100 * facts['covered_share']:.0f} % of the times covered\n"
        f"  lag {chosen['lag']:g} s, cut-off {chosen['cutoff']:.3g} Hz, degree {chosen['degree']}; "
        f"rms of the registration {facts['residual_rms']:.3g} m, of the path's fit {facts['fit_rms']:.3g} m\n"
        f"  more in {path.with_suffix('.json')}"
    )

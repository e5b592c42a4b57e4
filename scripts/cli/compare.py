"""`baryscope compare`: the main job, from the scenario to a table, a report, pictures and files."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from baryscope.estimator.methods import METHODS
from baryscope.models.errors import ComputationError
from baryscope.models.files import check_outputs
from baryscope.models.scenario import load_scenario, scenario_path
from baryscope.scripts.cli.console import Show
from baryscope.study import build_unit, write_comparison
from baryscope.study import compare as compare_methods
from baryscope.study.comparison_files import REPORT, comparison_paths
from baryscope.study.methods import labels_of
from baryscope.study.pictures import pictures_possible


def compare(
    *,
    scenario: str = "envisat",
    methods: str = ",".join(METHODS),
    output: Annotated[Path | None, Parameter(alias="-o")] = None,
    show: Show | None = None,
) -> None:
    """Build the unit, simulate a scenario, estimate with every method, and compare with the truth.

    Writes tracks, truth, orbit, estimates, the unit, report.html (the scene in 3D and all errors, for a browser),
    pictures of the errors and summary.md.

    Parameters
    ----------
    scenario
        A preset's name (see `baryscope scenarios`) or a scenario file, FILE.toml.
    methods
        Methods, separated by commas; screw-gpa runs in inertial and in LVLH axes.
    output
        Folder to write to. Default: out/ and the scenario's name.
    """
    show = show or Show()
    names = methods.split(",")
    labels = labels_of(names)
    flown = load_scenario(scenario)
    folder = output or Path("out") / flown.name
    fmu = folder / "TumblingTarget.fmu"
    check_outputs([fmu, *comparison_paths(folder, labels)], [scenario_path(scenario)])
    with show.progress() as progress:
        unit = build_unit(flown, fmu, progress)
        comparison = compare_methods(flown, names, unit=unit, progress=progress)
        summary = write_comparison(comparison, folder, progress)
    for outcome in comparison.outcomes:
        if outcome.failure:
            show.remark(f"{outcome.label}: {outcome.failure}")
        if outcome.doubt:
            show.remark(f"{outcome.label}: {outcome.doubt}: not to be trusted; {summary} says why")
    if comparison.no_bound:
        show.remark(f"no bound: {comparison.no_bound}")
    if not pictures_possible():
        show.remark("no pictures: they need matplotlib (pip install 'baryscope[report]')")
    report = folder / REPORT
    data = comparison.to_json() | {"folder": str(folder), "report": str(report)}
    show.result(data, comparison.table(), f"\nReport, for a browser: {report}", f"More in {summary}")
    if all(outcome.failure for outcome in comparison.outcomes):
        raise ComputationError(f"no method could be carried out; the first says: {comparison.outcomes[0].failure}")

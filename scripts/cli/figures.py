"""`baryscope figures`: the paper's figures from a run of ours."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from baryscope import __version__
from baryscope.models.files import check_outputs
from baryscope.models.scenario import load_scenario, scenario_path
from baryscope.scripts.cli.console import Show
from baryscope.study.figures import FIGURES, figure_paths, run_paper, write_figures


def figures(
    *,
    scenario: str = "envisat",
    output: Annotated[Path | None, Parameter(alias="-o")] = None,
    show: Show | None = None,
) -> None:
    """Draw the paper's figures 2 to 9 from a run of ours, each with a sentence on what ours shows.

    Visibility, trajectory, pseudo-intersections, error against velocity, Procrustes analysis, filtered axes, fit, and
    error. Writes a picture of each, and figures.md with all of them.

    Parameters
    ----------
    scenario
        A preset's name (see `baryscope scenarios`) or a scenario file, FILE.toml.
    output
        Folder to write to. Default: out/, the scenario's name, and figures.
    """
    show = show or Show()
    flown = load_scenario(scenario)
    folder = output or Path("out") / flown.name / "figures"
    check_outputs(figure_paths(folder), [scenario_path(scenario)])
    with show.progress() as progress:
        run = run_paper(flown, progress)
        page = write_figures(run, folder, progress)
    sentences = {figure.number: figure.sentence(run) for figure in FIGURES}
    data = {
        "version": __version__,
        "scenario": flown.name,
        "page": str(page),
        "figures": [
            {
                "number": figure.number,
                "title": figure.title,
                "file": str(folder / figure.file),
                "sentence": sentences[figure.number],
            }
            for figure in FIGURES
        ],
    }
    lines = [
        f"{figure.number}. {figure.title}: {folder / figure.file}\n   {sentences[figure.number]}" for figure in FIGURES
    ]
    show.result(data, *lines, f"\nAll of them: {page}")

"""The files of the figures: a picture each, and a page in Markdown with all of them."""

from pathlib import Path

from baryscope import __version__
from baryscope.models.errors import InputError
from baryscope.models.files import AnyPath, refuse_file, replacing
from baryscope.progress import Progress, stage
from baryscope.study.figures.listing import FIGURES
from baryscope.study.figures.run import PaperRun
from baryscope.study.pictures import pictures_possible, save

PAGE = "figures.md"


def figure_paths(folder: AnyPath) -> tuple[Path, ...]:
    """All files that are written, the page first.

    Raises:
        InputError: the folder is a file, or matplotlib is missing.
    """
    folder = Path(folder)
    refuse_file(folder)
    if not pictures_possible():
        raise InputError("the figures need matplotlib, which is not installed: pip install 'baryscope[report]'")
    return (folder / PAGE, *(folder / figure.file for figure in FIGURES))


def write_figures(run: PaperRun, folder: AnyPath, progress: Progress | None = None) -> Path:
    """Write the pictures and the page.

    Returns:
        The page.

    Raises:
        InputError: a file cannot be written, or matplotlib is missing.
    """
    page, *pictures = figure_paths(folder)
    with stage(progress, "drawing") as share:
        for k, (figure, path) in enumerate(zip(FIGURES, pictures, strict=True)):
            save(figure.draw(run), path)
            share((k + 1) / len(FIGURES))
    with replacing(page) as temporary:
        temporary.write_text(page_of(run), encoding="utf-8")
    return page


def page_of(run: PaperRun) -> str:
    """The page in Markdown: what is flown, and each figure with its sentence."""
    scenario = run.flight.scenario
    lines = [
        "# The paper, redone",
        "",
        "The figures 2 to 9 of Biondi, Mauro and Pastorelli, *Vision-based localization of the center of mass of large "
        "space debris via "
        "statistical shape analysis* (2017), from a run of ours. Theirs are of other tracks: compared is what they "
        "show, not curve by curve.",
        "",
        f"Made by `baryscope figures --scenario {scenario.name}` of baryscope {__version__}: {scenario.description}, "
        f"{len(run.flight.tracks.time)} frames over {scenario.duration:.0f} s, seed {scenario.run.seed}.",
    ]
    for figure in FIGURES:
        alt = figure.title[0].lower() + figure.title[1:]
        lines += ["", f"## {figure.number}. {figure.title}", "", f"![{alt}]({figure.file})", "", figure.sentence(run)]
    return "\n".join(lines) + "\n"

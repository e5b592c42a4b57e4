"""The files of a table of bounds: CSV, Markdown and pictures."""

import csv
from pathlib import Path

from baryscope import __version__
from baryscope.models.files import AnyPath, replacing
from baryscope.models.scenario import Scenario
from baryscope.study.bound_pictures import bound_figure
from baryscope.study.bounds import COLUMNS, BoundTable, millimetres
from baryscope.study.pictures import pictures_possible, save
from baryscope.table import Table

HEADINGS = {
    "features": "features", "baseline": "baseline, m", "rate_deg": "rate, °/s", "range": "range, m",
    "duration": "duration, s", "observations": "observations", "path_rmse": "path, mm", "com_rmse": "CoM, mm",
    "attitude_deg": "attitude, °", "angular_rate_deg": "rate, °/s", "inertia_over_trace": "inertia",
    "verdict": "verdict",
}  # fmt: skip


def bound_paths(folder: AnyPath) -> tuple[Path, ...]:
    """The files in a folder that a table of bounds may have."""
    folder = Path(folder)
    return folder / "bound.md", folder / "bound.csv", *sorted(folder.glob("bound*.png"))


def write_bounds(table: BoundTable, folder: AnyPath) -> tuple[Path, ...]:
    """Write bound.md, bound.csv and, where matplotlib is installed, a picture for each rig.

    Returns:
        The files, in this order.

    Raises:
        InputError: a file cannot be written.
    """
    folder = Path(folder)
    pictures = []
    if pictures_possible():
        rigs = list(table.rigs())
        for rig, cells in rigs:
            words = rig.replace(",", "").replace(" ", "-")
            pictures.append(folder / ("bound.png" if len(rigs) == 1 else f"bound-{words}.png"))
            save(bound_figure(f"{table.scenario.name}, {rig}", cells), pictures[-1])
    with replacing(folder / "bound.csv") as temporary, temporary.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows(["" if value is None else value for value in cell.values().values()] for cell in table.cells)
    with replacing(folder / "bound.md") as temporary:
        temporary.write_text(_markdown(table, pictures), encoding="utf-8")
    return folder / "bound.md", folder / "bound.csv", *pictures


def _markdown(table: BoundTable, pictures: list[Path]) -> str:
    """The table with what it is of."""
    scenario = table.scenario
    kept = [name for name in COLUMNS if name != "baseline" or scenario.sensor.stereo is not None]
    rows = [tuple(_shown(name, value) for name, value in cell.values().items() if name in kept) for cell in table.cells]
    lines = [
        f"# Cramér–Rao bound: {scenario.name}",
        "",
        f"{scenario.description}. Made by baryscope {__version__}, for a path known to be {table.trajectory}, at "
        f"{1 / scenario.run.sample_time:g} Hz, {noise_of(scenario)}.",
        "Root mean squared errors below which no unbiased estimate can be: of the path of the centre of mass over "
        "all frames, of the centre of mass (CoM), the attitude and the angular rate in the features' axes, and of the "
        "inertia over its trace.",
        "",
        *(f"![{picture.stem}]({picture.name})" for picture in pictures),
        "",
        Table(tuple(HEADINGS[name] for name in kept), tuple(rows), left=0).markdown(),
    ]
    return "\n".join(lines) + "\n"


def noise_of(scenario: Scenario) -> str:
    """The sensor's noise in words."""
    rig = scenario.sensor.stereo
    if rig is None:
        return f"noise {scenario.sensor.noise:g} m per axis at any range"
    return f"noise {rig.pixel_noise:g} px of a stereo rig"


def _shown(name: str, value: float | int | str | None) -> str:
    if value is None:
        return "-"
    if name in ("path_rmse", "com_rmse"):
        return millimetres(float(value))
    if isinstance(value, float):
        return f"{value:.6g}" if value >= 100 else f"{value:.3g}"
    return str(value).replace("|", "/")

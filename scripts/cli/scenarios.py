"""`baryscope scenarios`: the presets, a line each."""

from rich.table import Table

from baryscope.models.scenario import load_scenario, preset_names
from baryscope.scripts.cli.console import out


def scenarios() -> None:
    """List the presets, a line each."""
    table = Table(box=None, pad_edge=False)
    table.add_column("preset", no_wrap=True)
    table.add_column("features", justify="right")
    table.add_column("duration", justify="right", no_wrap=True)
    table.add_column("what it is")
    for name in preset_names():
        scenario = load_scenario(name)
        table.add_row(name, str(len(scenario.features.points)), f"{scenario.duration:.0f} s", scenario.description)
    out.print(table)

"""`baryscope scenarios`: the presets, and what each is."""

from rich.table import Table

from baryscope.models.scenario import load_scenario, preset_names
from baryscope.scripts.cli.console import Show


def scenarios(*, show: Show | None = None) -> None:
    """List the presets, and what each is."""
    presets = [(name, load_scenario(name)) for name in preset_names()]
    table = Table(box=None, pad_edge=False)
    table.add_column("preset", no_wrap=True)
    table.add_column("features", justify="right")
    table.add_column("duration", justify="right", no_wrap=True)
    table.add_column("what it is")
    for name, scenario in presets:
        table.add_row(name, str(len(scenario.features.points)), f"{scenario.duration:.0f} s", scenario.description)
    data = [
        {
            "name": name,
            "features": len(scenario.features.points),
            "duration": scenario.duration,
            "description": scenario.description,
        }
        for name, scenario in presets
    ]
    (show or Show()).result(data, table)

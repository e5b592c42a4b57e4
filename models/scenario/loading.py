"""Scenarios from files, and the presets of the package."""

from importlib.resources import files
from pathlib import Path

from baryscope.models.errors import InputError
from baryscope.models.files import AnyPath
from baryscope.models.scenario.scenario import Scenario
from baryscope.models.scenario.schema import read_toml


def preset_names() -> list[str]:
    """Names of the presets, sorted."""
    folder = files("baryscope.models") / "presets"
    return sorted(item.name.removesuffix(".toml") for item in folder.iterdir() if item.name.endswith(".toml"))


def load_scenario(name_or_path: AnyPath) -> Scenario:
    """A preset by name, or a scenario file by its path (any text with a folder or the ending .toml, any path object).

    Raises:
        InputError: one line that says where, what was found, what was expected.
    """
    path = scenario_path(name_or_path)
    data = read_toml(path, "a scenario in TOML")
    if set(data) == {"orbit"}:
        raise InputError(f"{path}: holds an orbit alone, expected a scenario, with [target], [features], [chaser] …")
    return Scenario.parse({"name": path.stem} | data, str(path))


def scenario_path(name_or_path: AnyPath) -> Path:
    """The file that `load_scenario` reads: a preset's or the user's.

    Raises:
        InputError: a name that is not one of a preset.
    """
    path = Path(name_or_path)
    if isinstance(name_or_path, str) and path.suffix != ".toml" and len(path.parts) <= 1:
        names = preset_names()
        if name_or_path not in names:
            raise InputError(
                f"scenario {name_or_path!r}: not a preset, expected one of {', '.join(names)} or a FILE.toml"
            )
        path = Path(str(files("baryscope.models") / "presets" / f"{name_or_path}.toml"))
    return path

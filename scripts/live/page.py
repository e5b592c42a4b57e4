"""The HTML file of the page: modules, presets and scripts inside, and nothing from elsewhere."""

import json
from importlib.resources import files
from pathlib import Path

from baryscope.live.chains import Tell, chains_data
from baryscope.models.files import AnyPath
from baryscope.models.scenario import load_scenario, preset_names
from baryscope.report.page import DRAWING, STYLE, page_file, page_text, write_page

TITLE = "baryscope, live"
FIRST = "envisat"  # of the presets
STEPPING = {"unit.mjs": "runtime", "master.mjs": "system"}
"""Scripts of baryscope.fmu that step units, and their rooms."""
SCRIPTS = ("run.js", "sliders.js", "settings.js", "live.js")


def live_page(tell: Tell | None = None) -> str:
    """The text of the page, with the chains of all presets.

    Args:
        tell: told the name of each unit that has to be compiled, which takes seconds.

    Raises:
        ComputationError: ziglang, which compiles the units to WebAssembly, is not installed, or fails.
    """
    chains = chains_data([load_scenario(name) for name in preset_names()], FIRST, tell)
    data = json.dumps(chains, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
    scripts = [page_file(name) for name in DRAWING]
    scripts += [(files("baryscope.fmu") / room / name).read_text(encoding="utf-8") for name, room in STEPPING.items()]
    scripts += [own_file(name) for name in SCRIPTS]
    return page_text(TITLE, data, scripts, [page_file(STYLE), own_file("live.css")], wasm=True)


def write_live_page(path: AnyPath, tell: Tell | None = None) -> Path:
    """Write the page; tell is that of `live_page`.

    Raises:
        ComputationError: as of `live_page`.
        InputError, DiskError: it cannot be written.
    """
    return write_page(live_page(tell), path)


def own_file(name: str) -> str:
    """The text of a script or style of this page alone."""
    return (files("baryscope.live") / "page" / name).read_text(encoding="utf-8")

"""HTML files that need nothing from elsewhere: a template with style, script and data inside. A report is one."""

import base64
import hashlib
import html
import json
import re
from collections.abc import Sequence
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from baryscope.models.files import AnyPath, write_together
from baryscope.report.document import Part, Report, data_of, plain

STYLE = "page.css"
DRAWING = ("drawing.js", "theme.js", "chart.js", "turning.js", "moment.js", "lettering.js", "stage.js")
"""What draws on any page."""
SCRIPTS = (*DRAWING, "timeline.js", "scene.js", "page.js")
UNSAFE = {ord(character): f"\\u{ord(character):04x}" for character in "<>&\u2028\u2029"}


def page_text(title: str, data: str, scripts: Sequence[str], styles: Sequence[str], *, wasm: bool = False) -> str:
    """The text of a page whose script finds its data, JSON, in the element `data`, and fills the element `page`.

    Words are data in it and never become markup; only the page's own script may run.

    Args:
        title: of the page.
        data: JSON.
        scripts: their texts, which become one module.
        styles: their texts.
        wasm: whether the script may compile WebAssembly.
    """
    script = "\n".join(scripts)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    allowed = f"'sha256-{digest}'" + (" 'wasm-unsafe-eval'" if wasm else "")
    filled = {
        "title": html.escape(title),
        "policy": f"default-src 'none'; script-src {allowed}; style-src 'unsafe-inline'; img-src data:",
        "style": "\n".join(styles),
        "data": data.translate(UNSAFE),
        "script": script,
    }
    return re.sub(r"\{\{(\w+)\}\}", lambda found: filled[found[1]], page_file("page.html"))


@cache
def page_file(name: str) -> str:
    """The text of a file of page/."""
    return (files("baryscope.report") / "page" / name).read_text(encoding="utf-8")


@cache
def palette() -> tuple[str, ...]:
    """The colours of curves on light paper, as #rrggbb: those of the page's style."""
    light = page_file(STYLE).partition("}")[0]
    return tuple(re.findall(r"--c\d+: (#[0-9a-f]{6});", light))


def html_of(report: Report) -> str:
    """The text of a report's file."""
    return page_text(report.title, _json(data_of(report)), [page_file(name) for name in SCRIPTS], [page_file(STYLE)])


def weight_of(parts: Sequence[Part]) -> int:
    """How many bytes parts are of a report's file."""
    return len(_json(plain(list(parts))).translate(UNSAFE).encode())


def _json(data: Any) -> str:
    return json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":"))


def write_page(text: str, path: AnyPath) -> Path:
    """Write a page.

    Raises:
        InputError, DiskError: it cannot be written.
    """
    write_together({Path(path): lambda stream: stream.write(text)})
    return Path(path)


def write_report(report: Report, path: AnyPath) -> Path:
    """Write a report's file; errors are those of `write_page`."""
    return write_page(html_of(report), path)

"""The HTML file of a report: the page's template with style, script and data inside, and nothing from elsewhere."""

import base64
import hashlib
import html
import json
import re
from functools import cache
from importlib.resources import files
from pathlib import Path

from baryscope.models.files import AnyPath, write_together
from baryscope.report.document import Report, data_of

SCRIPTS = ("drawing.js", "chart.js", "timeline.js", "turning.js", "scene.js", "page.js")
UNSAFE = {ord(character): f"\\u{ord(character):04x}" for character in "<>&\u2028\u2029"}


def html_of(report: Report) -> str:
    """The text of the file. Words are data in it and never become markup; only the page's own script may run."""
    data = json.dumps(data_of(report), ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    script = "(() => {\n" + '"use strict";\n' + "\n".join(map(_file, SCRIPTS)) + "})();\n"
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    filled = {
        "title": html.escape(report.title),
        "policy": f"default-src 'none'; script-src 'sha256-{digest}'; style-src 'unsafe-inline'; img-src data:",
        "style": _file("page.css"),
        "data": data.translate(UNSAFE),
        "script": script,
    }
    return re.sub(r"\{\{(\w+)\}\}", lambda found: filled[found[1]], _file("page.html"))


def write_report(report: Report, path: AnyPath) -> Path:
    """Write the file.

    Raises:
        InputError, DiskError: it cannot be written.
    """
    text = html_of(report)
    write_together({Path(path): lambda stream: stream.write(text)})
    return Path(path)


@cache
def _file(name: str) -> str:
    return (files("baryscope.report") / "page" / name).read_text(encoding="utf-8")

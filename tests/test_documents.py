"""What the documents tell users to run, run."""

import re
import shlex

import pytest

from baryscope.scripts.cli import app
from documents import DOCUMENTS, ROOT, python_blocks


@pytest.mark.parametrize("document", DOCUMENTS)
def test_python_examples_run_one_after_the_other(document, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    blocks = python_blocks(document)
    assert blocks
    names = {"__name__": "example"}
    for block in blocks:
        exec(compile(block, document, "exec"), names)  # noqa: S102  our own documents
    assert capsys.readouterr().out


def test_shell_examples_of_the_readme_run(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    section = text[text.index("## Five minutes in the shell") : text.index("## Five minutes in Python")]
    commands = [shlex.split(line, comments=True) for line in re.findall(r"^    (baryscope .*)$", section, re.MULTILINE)]
    assert len(commands) >= 5
    for command in commands:
        assert app.main(command[1:]) == 0, command
    assert {"slow.csv", "slow.truth.csv", "com.csv", "com.json", "tiangong.fmu", "out"} <= {
        path.name for path in tmp_path.iterdir()
    }


FRONT = ["README.md", "CHANGELOG.md", "CONTRIBUTING.md"]
PAGES = sorted(path.relative_to(ROOT).as_posix() for path in (ROOT / "docs").rglob("*.md"))


@pytest.mark.parametrize("document", [*FRONT, *PAGES])
def test_links_lead_somewhere(document):
    """And those of a page to what is below docs/, for the site has nothing else. `make site` looks at anchors, too."""
    path = ROOT / document
    for link in re.findall(r"\]\((?!https:)([^)#]+)\)", path.read_text(encoding="utf-8")):
        target = (path.parent / link).resolve()
        assert target.exists(), link
        assert document in FRONT or ROOT / "docs" in target.parents, link


def test_the_site_has_all_pages():
    listed = re.findall(r"[\w/]+\.md", (ROOT / "mkdocs.yml").read_text(encoding="utf-8"))
    assert sorted(f"docs/{name}" for name in listed) == PAGES

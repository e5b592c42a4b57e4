"""What the documents tell users to run, run."""

import re

import pytest

from baryscope.scripts.cli import app
from documents import FRONT, PAGES, ROOT, WITH_COMMANDS, WITH_PYTHON, blocks_with_output, commands, text_of

ROOMS = ["models", "fmu", "estimator", "scripts", "tests"]


@pytest.mark.parametrize("document", sorted({*WITH_PYTHON, *WITH_COMMANDS}))
def test_examples_run_one_after_the_other(document, tmp_path, monkeypatch, capsys):
    """In one folder, as a reader would: what an example needs, one above it has left."""
    monkeypatch.chdir(tmp_path)
    for command in commands(document):
        assert app.main(smaller(command)[1:]) == 0, command
    names = {"__name__": "example"}
    capsys.readouterr()
    for block, output in blocks_with_output(document):
        exec(compile(block, document, "exec"), names)  # noqa: S102  our own documents
        printed = capsys.readouterr().out
        assert not output or printed == output


def smaller(command):
    """The command with one draw of one scenario, where a campaign would take its hours."""
    if "campaign" not in command:
        return command
    command = ["1" if before == "--draws" else word for before, word in zip(["", *command], command, strict=False)]
    if "--suite" in command:
        command += [] if "--scenario" in command else ["--scenario", "slow-stereo"]
        command += [] if "--draws" in command else ["--draws", "1"]
    return command


@pytest.mark.parametrize("document", [*FRONT, *PAGES])
def test_links_lead_somewhere(document):
    """And those of a page to what is below docs/, for the site has nothing else. `make site` looks at anchors, too."""
    path = ROOT / document
    for link in re.findall(r"\]\((?!https:)([^)#]+)\)", text_of(document)):
        target = (path.parent / link).resolve()
        assert target.exists(), link
        assert document in FRONT or ROOT / "docs" in target.parents, link


@pytest.mark.parametrize("document", PAGES + FRONT)
def test_source_files_that_are_cited_exist(document):
    """With a folder, seen from the repository's root; a name alone is that of a file anywhere in the rooms."""
    for name, function in re.findall(r"`([\w./-]+\.(?:py|c|h|mjs))(?:::(\w+))?`", text_of(document)):
        found = [ROOT / name] if "/" in name else [path for room in ROOMS for path in (ROOT / room).rglob(name)]
        assert found, name
        assert all(path.is_file() for path in found), name
        assert not function or f"def {function}(" in found[0].read_text(encoding="utf-8"), function


def test_the_site_has_all_pages():
    listed = re.findall(r"[\w/]+\.md", (ROOT / "mkdocs.yml").read_text(encoding="utf-8"))
    assert sorted(f"docs/{name}" for name in listed) == PAGES

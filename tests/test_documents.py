"""What the documents tell users to run, run."""

import csv
import json
import re
import shutil
from itertools import dropwhile
from typing import get_args

import numpy as np
import pytest

from baryscope.estimator.bound import cramer_rao_bound
from baryscope.estimator.findings import MISFITS, UNCHECKED, Finding
from baryscope.estimator.result import Status
from baryscope.models.scenario import load_scenario
from baryscope.scripts.cli import app
from baryscope.study import pictures
from baryscope.study.campaign import flown, run_one
from baryscope.study.campaign.engines import LocalEngine
from documents import (
    FRONT,
    LANGUAGES,
    PAGES,
    ROOT,
    WITH_COMMANDS,
    WITH_PYTHON,
    blocks_with_output,
    commands,
    fences,
    text_of,
)

MAIN_JOB = ["baryscope", "compare"]
LONG_FLIGHT = 300.0  # s
ROOMS = ["models", "fmu", "estimator", "scripts", "tests"]
SOURCES = {".py", ".c", ".h", ".js", ".mjs"}


@pytest.mark.parametrize("document", [*FRONT, *PAGES])
def test_every_block_says_what_it_is(document):
    """Python and the shell are run by these tests; whatever is not to be run says so."""
    found, rest = fences(document)
    assert {language for language, _ in found} <= LANGUAGES
    assert not re.search(r"\n\n(    |\t)\S", rest), "an indented block: expected a fence that names its language"


@pytest.mark.parametrize("document", sorted({*WITH_PYTHON, *WITH_COMMANDS}))
def test_examples_run_one_after_the_other(document, tmp_path, monkeypatch, capsys):
    """In one folder, as a reader would: what an example needs, one above it has left. Campaigns are carried out here:
    a worker takes longer to start. Their draws are not flown again, as tests/scripts/report/test_campaign.py has others
    flown, nor are pictures of comparisons drawn, as tests/scripts/cli/test_main_job.py has others drawn.
    """
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(LocalEngine, "carry_out", lambda _, cases: (run_one(case) for case in cases))
    monkeypatch.setattr(flown, "SECONDS", 0.0)
    monkeypatch.setattr(flown, "FURTHER", 0.0)
    for name in re.findall(r"\]\(([\w.-]+\.trc)\)", text_of(document)):  # recordings that the page offers
        shutil.copy((ROOT / document).parent / name, tmp_path)
    for command in commands(document):
        if command[0] == "pythonfmu":
            packed(command)
        else:
            with monkeypatch.context() as patch:
                if command[:2] == MAIN_JOB:
                    patch.setattr(pictures, "find_spec", lambda _: None)
                assert app.main(smaller(command)[1:]) == 0, command
    names = {"__name__": "example"}
    capsys.readouterr()
    for block, output in blocks_with_output(document):
        exec(compile(block, document, "exec"), names)  # noqa: S102  our own documents
        printed = capsys.readouterr().out
        assert not output or printed == output
    if document == "README.md":
        check_the_estimates(tmp_path)
        check_the_table(tmp_path / "out" / "envisat" / "summary.md")


def packed(command):
    """What `pythonfmu build -f FILE` does, with a file of the repository."""
    assert command[:3] == ["pythonfmu", "build", "-f"]
    builder = pytest.importorskip("pythonfmu.builder", reason="pythonfmu, which a page uses, is not installed")
    builder.FmuBuilder.build_FMU(ROOT / command[3])


def check_the_estimates(folder):
    """One draw of the six numbers of the path: within 2.5 times the bound in all but 1 of 10⁴ draws. A polynomial has
    more numbers to find, and no orbit to find them with."""
    bound = cramer_rao_bound(load_scenario("envisat-slow")).position_deviation
    truth = positions(folder / "slow.truth.csv")
    for name, factor in (("ml.csv", 2.5), ("com.csv", 20)):
        assert np.sqrt(np.mean((positions(folder / name) - truth) ** 2) * 3) < factor * bound
    assert json.loads((folder / "ml.json").read_text(encoding="utf-8"))["status"] == "good"


def positions(path):
    with path.open(encoding="utf-8", newline="") as stream:
        return np.array([[float(row[axis]) for axis in "xyz"] for row in csv.DictReader(stream)])


def check_the_table(summary):
    """The README shows what the main job prints, but for the times; a last digit may differ with the processor."""
    row = re.compile(r"^\| (\S.*) \|$", re.MULTILINE)
    shown, printed = (
        row.findall(text.split("RMSE and max are")[0])
        for text in (text_of("README.md").split("`make demo` prints")[1], summary.read_text(encoding="utf-8"))
    )
    assert len(shown) == len(printed) == 11
    for ours, its in zip(shown, printed, strict=True):
        for mine, other in zip(ours.split(" | ")[:-1], its.split(" | ")[:-1], strict=True):
            number = re.fullmatch(r"\d+\.\d\d", mine)
            assert float(mine) == pytest.approx(float(other), abs=0.011, rel=1e-4) if number else mine == other


def smaller(command):
    """The command with one draw of one scenario, where a campaign would take its hours, and of a suite by one method;
    long flights are cut short.
    """
    if "fly" in command and float(command[command.index("--duration") + 1]) > LONG_FLIGHT:
        return ["60" if before == "--duration" else word for before, word in zip(["", *command], command, strict=False)]
    if "campaign" not in command:
        return command
    command = ["1" if before == "--draws" else word for before, word in zip(["", *command], command, strict=False)]
    if "--scenario" in command:
        others = command.index("--scenario") + 2
        command = [*command[:others], *dropwhile(lambda word: not word.startswith("-"), command[others:])]
    if "--suite" in command:
        command += [] if "--methods" in command else ["--methods", "pivot"]
        command += ["--scenario", "slow-stereo"] if "reach" in command and "--scenario" not in command else []
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


def test_documents_that_sources_cite_exist():
    """A page by its path or its name alone, or one of the two that commands write."""
    known = {*FRONT, *PAGES, *(page.rpartition("/")[2] for page in PAGES), "bound.md", "summary.md"}
    sources = [path for room in ROOMS for path in (ROOT / room).rglob("*") if path.suffix in SOURCES]
    cited = {
        (path, name) for path in sources for name in re.findall(r"[\w/-]+\.md\b", path.read_text(encoding="utf-8"))
    }
    assert len(cited) > 20
    assert not sorted((str(path), name) for path, name in cited if name.strip("/") not in known)


def test_every_finding_has_its_row_and_its_place_in_the_reference():
    names = {finding.__name__ for finding in get_args(Finding)}
    listed = text_of("docs/reference/estimator.md").split("estimator.findings")[1].split(":::")[0]
    assert set(re.findall(r"- (\w+)", listed)) == names
    fields, guide = text_of("docs/estimate.md").split("## What to do about a finding")
    rows = re.findall(r"^\| `([\w-]+)` \| ([\w ]+) \|", guide, re.MULTILINE)[1:]  # without the heads of the columns
    statuses = dict.fromkeys(map(_kind, get_args(Finding)), "stays")
    statuses |= dict.fromkeys(map(_kind, get_args(MISFITS)), Status.MODEL_DOES_NOT_FIT.value)
    statuses |= dict.fromkeys(map(_kind, get_args(UNCHECKED)), Status.NOT_CHECKED.value)
    assert sorted(rows) == sorted(statuses.items())
    assert set(statuses) <= set(re.findall(r"^\| `([\w-]+)` \|", fields, re.MULTILINE))


def _kind(finding):
    """As EST.json names it."""
    return re.sub("(?<=[a-z])(?=[A-Z])", "-", finding.__name__).lower()


def test_the_first_screen_shows_the_scene_the_commands_and_the_three_paths():
    """Before the first heading, with no other picture: a chart and the whole scene had them two screens down."""
    first = text_of("README.md").split("\n## ")[0]
    assert re.findall(r"""<img src="([^"]+)"|!\[[^\]]*\]\(([^)]+)\)""", first) == [("docs/report.png", "")]
    assert (ROOT / "docs" / "report.png").exists()
    for command in ("make demo", "make test"):
        assert f"\n{command} " in first
    for page in ("tutorial", "tutorial-cosimulation", "tutorial-motion-capture"):
        assert f"](docs/{page}.md)" in first


def test_the_site_opens_with_the_picture_of_the_readme():
    """With the errors of all methods over time it did, and the scene in 3D was a page away."""
    shown = re.findall(r"!\[[^\]]*\]\(([^)]+)\)", text_of("docs/index.md"))
    assert shown == ["report.png", "comparison.png"]


def test_the_gallery_has_every_picture_once():
    shown = re.findall(r"\[!\[[^\]]+\]\(([\w./-]+)\)\]\([\w./#-]+\)", text_of("docs/gallery.md"))
    docs = ROOT / "docs"
    assert sorted(shown) == sorted(path.relative_to(docs).as_posix() for path in docs.rglob("*.png"))


def test_the_site_has_all_pages():
    listed = re.findall(r"[\w/-]+\.md", (ROOT / "mkdocs.yml").read_text(encoding="utf-8"))
    assert sorted(f"docs/{name}" for name in listed) == PAGES

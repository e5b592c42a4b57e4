"""The report of a campaign in a browser: each scenario's tab has a flight to look at."""

from pathlib import Path

import pytest

from baryscope.scripts.cli import app
from baryscope.study.campaign import flown, run_one
from baryscope.study.campaign.engines import LocalEngine
from browser import PROGRAM, Browser
from malformed import GOOD_SCENARIO

pytestmark = pytest.mark.skipif(PROGRAM is None, reason="needs Chromium (Debian's package chromium)")

SHORT = GOOD_SCENARIO.replace("duration = 100.0", "duration = 40.0").split("[tracking]")[0]
DRAWS = 3
PANEL = "[...document.querySelectorAll('[role=tabpanel]')].filter((one) => one.checkVisibility())"
OF_SCENARIO = "section[aria-label='Each scenario'] > [role=tablist] > button"


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """The report of a campaign of two scenarios that last 100 and 40 s, opened in a browser."""
    folder = tmp_path_factory.mktemp("campaign")
    sensor = GOOD_SCENARIO[GOOD_SCENARIO.index("[sensor]") :].replace("duration = 100.0", "duration = 40.0")
    (folder / "long.toml").write_text(GOOD_SCENARIO, encoding="utf-8")
    (folder / "short.toml").write_text(SHORT + sensor, encoding="utf-8")
    options = ["--methods", "pivot", "--draws", str(DRAWS), "--flights", "1e9", "-o", str(folder / "out"), "-q"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(LocalEngine, "carry_out", lambda _, cases: (run_one(case) for case in cases))
        patch.setattr(flown, "at_hand", lambda: True)  # it is compiled for other tests, too
        scenarios = [str(folder / f"{name}.toml") for name in ("long", "short")]
        assert app.main(["campaign", "--scenario", *scenarios, *options]) == 0
    browser = Browser(folder / "profile")
    browser.open(folder / "out" / "report.html")
    yield browser
    complaints = browser.complaints
    browser.close()
    assert complaints == []


def shown(page, selector, what="textContent"):
    """A property of each element that is seen."""
    seen = f"[...document.querySelectorAll({selector!r})].filter((one) => one.checkVisibility())"
    return page.value(f"{seen}.map((one) => one.{what})")


def pick(page, index):
    page.value(f"document.querySelectorAll({OF_SCENARIO!r})[{index}].click()")
    page.value("new Promise(requestAnimationFrame)")


def slide(page, share):
    """Move the slider that is seen, as by hand."""
    page.value(f"""(() => {{ const all = [...document.querySelectorAll('input[type=range]')];
        const one = all.find((one) => one.checkVisibility());
        one.value = Math.round({share} * one.max); one.dispatchEvent(new Event('input')); }})()""")


INK = "[...document.querySelectorAll('canvas')].find((one) => one.checkVisibility()).toDataURL()"


def test_each_scenario_has_a_draw_with_all_that_a_comparison_shows(page):
    for index, tabs in enumerate(["long", "short"]):
        pick(page, index)
        titles = shown(page, "section[aria-label='A draw of it'] section", "ariaLabel")
        assert titles[:4] == ["Which draw", "Methods side by side", "Scene", "Error of the centre of mass"]
        expected = {
            "NEES of the centre of mass",
            "Convergence of the online estimate",
            "Which feature is seen when",
            "Residuals",
            "Observability",
            "What was flown",
            "Any other draw",
        }
        assert expected <= set(titles)
        (code,) = shown(page, "pre")
        assert f"plan.case('{tabs}', " in code
        assert shown(page, "section[aria-label='Which draw'] li")[0].startswith("Draw ")
    assert page.nameless == 0


def test_the_slider_moves_the_scene_of_its_scenario(page):
    """And its charts; the other scenario's shows the same time when it is opened, as far as it lasts."""
    pick(page, 0)
    slide(page, 0.0)
    (before,), ink = shown(page, ".scene-reading"), page.value(INK)
    slide(page, 0.9)
    (after,) = shown(page, ".scene-reading")
    assert before.startswith("t = 0 s")
    assert after.startswith("t = 90 s")
    assert page.value(INK) != ink
    lines = shown(page, "section[aria-label='A draw of it'] svg .now[visibility=visible]", "getAttribute('x1')")
    assert len(lines) >= 4
    pick(page, 1)
    (other,) = shown(page, ".scene-reading")
    assert other.startswith("t = 40 s")


def test_a_scene_that_is_played_stops_when_another_scenario_is_opened(page):
    """Both had gone on, and moved each other's time."""
    pick(page, 0)
    slide(page, 0.0)
    page.value("[...document.querySelectorAll('button.play')].find((one) => one.checkVisibility()).click()")
    page.value("new Promise((done) => setTimeout(done, 200))")
    assert shown(page, "button.play") == ["‖ pause"]
    pick(page, 1)
    page.value("new Promise((done) => setTimeout(done, 100))")
    pressed = page.value("[...document.querySelectorAll('button.play')].map((one) => one.ariaPressed)")
    assert pressed == ["false"] * 2
    (before,) = shown(page, ".scene-reading")
    page.value("new Promise((done) => setTimeout(done, 200))")
    assert shown(page, ".scene-reading") == [before]


def test_a_scene_that_is_opened_later_shows_the_time_of_the_others(page):
    """It showed its first frame, beside charts that were elsewhere."""
    page.open(Path(page.value("decodeURI(location.pathname)")))
    slide(page, 0.3)
    assert shown(page, ".scene-reading")[0].startswith("t = 30 s")
    pick(page, 1)
    assert shown(page, ".scene-reading")[0].startswith("t = 30 s")


def test_paper_has_the_draws_of_every_scenario(page):
    page.open(Path(page.value("decodeURI(location.pathname)")))
    page.call("Page.printToPDF")
    page.call("Emulation.setEmulatedMedia", media="print")
    names = [text for text in shown(page, ".only-paper") if text.startswith(("Each scenario", "A draw of it"))]
    assert len(shown(page, "canvas", "ariaLabel")) >= 2
    assert [name for name in names if name.startswith("Each scenario")] == [
        "Each scenario: long",
        "Each scenario: short",
    ]
    assert sum(name.startswith("A draw of it: draw ") for name in names) >= 2
    page.call("Emulation.setEmulatedMedia", media="")

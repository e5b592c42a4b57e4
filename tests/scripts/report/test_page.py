"""Reports in a browser: they draw without a complaint, ask for nothing, and do what mouse and keys tell them."""

import itertools
import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from baryscope.report import write_report
from baryscope.report.page import page_file
from baryscope.study import compare
from baryscope.study.comparison_report import report_of_comparison
from browser import PROGRAM, Browser
from malformed import GOOD_SCENARIO

pytestmark = pytest.mark.skipif(PROGRAM is None, reason="needs Chromium (Debian's package chromium)")

SLIDER, CANVAS, READING = "input[type=range]", "canvas", ".scene-reading"
INK = "document.querySelector('canvas').toDataURL()"
EMPTY = """(() => { const one = document.querySelector('canvas'), two = document.createElement('canvas');
    two.width = one.width; two.height = one.height; return two.toDataURL(); })()"""


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """A report whose labels are markup, and a browser that has opened it."""
    folder = tmp_path_factory.mktemp("report")
    text = GOOD_SCENARIO.replace("noise = 0.02", "noise = 0.002").replace('"d"', '"<script>window.evil=1</script>"')
    (folder / "small.toml").write_text(text, encoding="utf-8")
    comparison = compare(folder / "small.toml", methods=["screw-raw", "pivot"])
    path = write_report(report_of_comparison(comparison), folder / "report.html")
    browser = Browser(folder / "profile")
    browser.open(path)
    yield browser
    complaints = browser.complaints
    browser.close()
    assert complaints == []


def text_of(page, selector):
    return page.value(f"document.querySelector({selector!r}).textContent")


def pick(page, which, index):
    """Choose an entry of one of the scene's lists: view, axes, pace."""
    page.value(
        f"(() => {{ const one = document.querySelectorAll('section[aria-label=Scene] select')[{which}]; "
        f"one.selectedIndex = {index}; one.dispatchEvent(new Event('change')); }})()"
    )


def test_all_parts_are_there_and_words_are_words(page):
    kinds = page.value("[...document.querySelectorAll('main > section')].map((one) => one.ariaLabel)")
    assert kinds[:4] == ["Methods side by side", "Scene", "Error of the centre of mass", "NEES of the centre of mass"]
    assert "<script>window.evil=1</script>" in page.value("document.body.innerText")
    assert page.value("window.evil") is None
    assert page.value("document.querySelectorAll('svg path.curve').length") >= 6
    assert page.value("document.querySelectorAll('svg path.band').length") >= 1


def test_everything_that_acts_has_a_name_and_takes_the_focus(page):
    assert page.nameless == 0
    assert page.value("[...document.querySelectorAll('svg[role=img], canvas')].every((one) => one.ariaLabel)")
    levels = page.heading_levels
    assert levels[0] == 1
    assert max(np.diff(levels)) == 1


def test_the_slider_moves_the_scene_and_the_charts(page):
    before, ink = text_of(page, READING), page.value(INK)
    page.click(SLIDER)
    assert text_of(page, READING) != before
    assert page.value(INK) not in (page.value(EMPTY), ink)
    now = page.value("document.querySelector('svg .now').getAttribute('x1')")
    page.key("ArrowRight", 39)
    assert page.value("document.querySelector('svg .now').getAttribute('x1')") != now


def test_play_moves_on_and_stops(page):
    page.value("document.querySelector('input[type=range]').value = 0")
    page.value("document.querySelector('input[type=range]').dispatchEvent(new Event('input'))")
    pick(page, 2, 0)
    page.click("button.play")
    page.value("new Promise((done) => setTimeout(done, 500))")
    page.click("button.play")
    at = page.value(f"Number(document.querySelector('{SLIDER}').value)")
    assert at > 0
    page.value("new Promise((done) => setTimeout(done, 200))")
    assert page.value(f"Number(document.querySelector('{SLIDER}').value)") == at


def test_play_shows_what_is_between_two_frames(page):
    """The picture changes though the slider stands."""
    pick(page, 2, 2)
    page.click("button.play")
    seen = page.value(f"""(async () => {{ const found = [];
        for (let k = 0; k < 12; k += 1) {{ await new Promise(requestAnimationFrame);
            found.push([document.querySelector('{SLIDER}').value, {INK}]); }} return found; }})()""")
    page.click("button.play")
    pairs = list(itertools.pairwise(seen))
    assert any(one[0] == other[0] and one[1] != other[1] for one, other in pairs)


def test_between_two_frames_the_body_turns_about_one_axis(page):
    """As scipy has it; features and path go with it, and a turn that could be either way is not guessed."""
    rng = np.random.default_rng(3)
    source = page_file("turning.js") + page_file("moment.js")
    body, ends = rng.normal(size=(2, 3)), Rotation.from_rotvec([[0.2, -0.4, 0.1], [0.7, 0.9, -0.6]])
    for turn, share in ((ends, 0.3), (ends, 0.8), (Rotation.from_rotvec([[0, 0, 0], [0, 0, 2.5]]), 0.8)):
        moments = [
            {
                "path": [k, 2.0, 3.0],
                "features": [*one.apply(body).tolist(), [None, None, None]],
                "state": "110",
                "attitude": (one.as_quat(scalar_first=True) * (-1) ** k).tolist(),
                "orbit": None,
                "ghosts": [],
            }
            for k, one in enumerate(turn)
        ]
        found = page.value(f"(() => {{ {source}; return between(...{json.dumps(moments)}, {share}) }})()")
        near = (turn[1] * turn[0].inv()).magnitude() < 2
        expected = Slerp([0, 1], turn)(share) if near else turn[round(share)]
        assert (Rotation.from_quat(found["attitude"], scalar_first=True) * expected.inv()).magnitude() < 1e-7
        np.testing.assert_allclose(found["features"][:2], expected.apply(body), atol=1e-14)
        assert found["features"][2] in (None, [None, None, None])
        assert found["path"] == pytest.approx([share, 2.0, 3.0])


def test_dragging_and_keys_turn_and_enlarge_the_scene(page):
    pictures = [page.value(INK)]
    x, y = page.middle(CANVAS)
    page.mouse((x, y), (x + 60, y + 20))
    pictures.append(page.value(INK))
    for name, code, text in (("ArrowLeft", 37, ""), ("+", 187, "+")):
        page.value(f"document.querySelector('{CANVAS}').focus()")
        page.key(name, code, text)
        pictures.append(page.value(INK))
    for view in (1, 2):
        pick(page, 0, view)
        pictures.append(page.value(INK))
    assert len(set(pictures)) == len(pictures)
    assert page.value(EMPTY) not in pictures


BOXES = """(() => {
    const pen = CanvasRenderingContext2D.prototype, plain = pen.fillText;
    window.words = [];
    pen.fillText = function (text, x, y) {
        const { clientWidth, clientHeight } = this.canvas;
        window.words.push([text, x, x + this.measureText(text).width, y, clientWidth, clientHeight]);
        plain.call(this, text, x, y);
    };
})()"""
LETTERS = 9.0  # px, that a capital of 12 px is high


def test_words_of_the_scene_are_apart_and_inside_however_it_is_turned(page):
    """`radial` stood on `chaser`, and the hull over both, where the axes of the orbit point to the reader."""
    page.value(BOXES)
    turns = np.random.default_rng(5).uniform(-3.0, 3.0, (60, 2))
    for view in range(3):
        pick(page, 0, view)
        seen = page.value(f"""(() => {{ const found = [], canvas = document.querySelector('{CANVAS}');
            const told = (kind, x, y) => canvas.dispatchEvent(
                new PointerEvent(kind, {{ clientX: x, clientY: y, pointerId: 1, bubbles: true }}));
            canvas.setPointerCapture = () => null;
            for (const [right, up] of {json.dumps(turns.tolist())}) {{
                told("pointerdown", 0, 0); window.words = []; told("pointermove", 150 * right, 150 * up);
                told("pointerup", 0, 0); found.push(window.words); }}
            return found; }})()""")
        assert len(seen) == 60
        assert {"radial", "along-track", "cross-track"} < {word[0] for picture in seen for word in picture}
        for picture in seen:
            for text, left, right, base, width, height in picture:
                assert left >= 0, text
                assert right <= width, text
                assert LETTERS <= base <= height, text
            for one, other in itertools.combinations(picture, 2):
                apart = one[2] <= other[1] or other[2] <= one[1] or abs(one[3] - other[3]) >= LETTERS
                assert apart, (view, one, other)


def test_legends_hide_curves(page):
    count = "document.querySelectorAll('main > section:nth-of-type(3) path.curve').length"
    key = "main > section:nth-of-type(3) button.key"
    before = page.value(count)
    page.click(key)
    assert page.value(count) == before - 1
    assert page.value(f"document.querySelector('{key}').ariaPressed") == "false"
    page.click(key)
    assert page.value(count) == before


def test_dragging_over_a_chart_enlarges_it(page):
    x, y = page.middle("main > section:nth-of-type(3) svg")
    ticks = "document.querySelector('main > section:nth-of-type(3) svg').textContent"
    whole = page.value(ticks)
    page.mouse((x - 80, y), (x, y), (x + 80, y))
    assert page.value(ticks) != whole
    page.click("main > section:nth-of-type(3) .controls > button.only-screen")
    assert page.value(ticks) == whole


def test_tabs_show_one_method_at_a_time(page):
    visible = "[...document.querySelectorAll('[role=tabpanel]')].map((one) => !one.hidden)"
    assert page.value(visible) == [False, True]
    page.click("[role=tab]", 0)
    assert page.value(visible) == [True, False]
    page.key("ArrowRight", 39)
    assert page.value(visible) == [False, True]
    names = page.value(
        "[...document.querySelectorAll('[role=tabpanel]:not([hidden]) h3')].map((one) => one.textContent)"
    )
    assert {"Residuals", "Observability", "Options and version"} <= set(names)


def test_light_and_dark_and_print(page, tmp_path):
    colour = "getComputedStyle(document.documentElement).backgroundColor"
    light = page.value(colour)
    page.click("button.theme")
    assert page.value(colour) != light
    page.click("button.theme")
    assert page.value(colour) == light
    assert page.call("Page.printToPDF")["data"].startswith("JVBER")  # %PDF in base 64


def test_no_heading_stays_behind_at_the_foot_of_a_page(page):
    """What stands before a part's picture goes with it, tab's name and all: of compare it was alone, a page before."""
    page.call("Page.printToPDF")
    page.call("Emulation.setEmulatedMedia", media="print")
    breaks = "[...document.querySelectorAll('main h2, main h3, main .about, .only-paper')]"
    assert page.value(f"{breaks}.length") > 10
    assert page.value(f"[...new Set({breaks}.map((one) => getComputedStyle(one).breakAfter))]") == ["avoid"]
    page.call("Emulation.setEmulatedMedia", media="")


def test_paper_has_the_parts_of_every_tab(page):
    """Also of those that were never opened, each under its name; the screen has one at a time again."""
    page.open(Path(page.value("decodeURI(location.pathname)")))
    panels = "[...document.querySelectorAll('[role=tabpanel]')]"
    visible = f"{panels}.map((one) => one.checkVisibility() && one.querySelectorAll('section').length)"
    closed, opened = page.value(visible)
    assert closed is False
    page.call("Page.printToPDF")
    page.call("Emulation.setEmulatedMedia", media="print")
    assert min(page.value(visible)) >= 4
    assert page.value(f"{panels}.map((one) => one.innerText.split('\\n')[0])") == [
        "Each method: screw-raw",
        "Each method: pivot",
    ]
    page.call("Emulation.setEmulatedMedia", media="")
    assert page.value(visible) == [False, opened]
    assert "Each method: " not in page.value("document.querySelector('main').innerText")

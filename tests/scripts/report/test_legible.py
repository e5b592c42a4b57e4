"""Reports are legible: on a phone as on a desk, with long names, long numbers, and points at the edges."""

import itertools
import json

import numpy as np
import pytest

from baryscope.report import Report, write_report
from baryscope.report.charts import nees_chart
from baryscope.report.document import Chart, Facts, Series, Sheet, Timeline
from browser import PROGRAM, Browser

pytestmark = pytest.mark.skipif(PROGRAM is None, reason="needs Chromium (Debian's package chromium)")

HALO = 1.5  # px, around letters in pictures (page.css): it hides what of a line is nearer
TIME = 1.7e9 + np.arange(0.0, 100.0)
NAMES = tuple(f"Subject of the first session: marker number {k}" for k in range(12))


def report():
    """Charts of times since 1970, of tiny numbers, of numbers that differ in their eighth digit, and of long names."""
    small = Series("small", TIME, 2e-5 + 1e-7 * (TIME - TIME[0]), 5)
    alike = Series("alike", TIME, 10 + 1e-6 * (TIME - TIME[0]), 4)
    points = Series("points", TIME, np.full(100, 3.0), 5, "points", of=np.arange(100) % 12, total=5000)
    alone = Series("alone", np.arange(5.0), np.array([1.0, np.nan, 2.0, np.nan, 1.0]), 3)
    steps = Series("steps", np.repeat([1.0, 3.0, 30.0], 2), np.repeat(np.arange(4.0), 2)[1:-1] / 3, 5)
    parts = (
        Chart("Small", "", "mm", (small,)),
        Chart("Alike", "", "m", (alike,)),
        Chart("Points", "", "mm", (points,), filter=NAMES),
        nees_chart((Series("nees", TIME, np.geomspace(1e-3, 5.0, 100), 5),), ""),
        Chart(
            "Alone",
            "",
            "m",
            (alone,),
            marks=((0.1, "early"), (3.95, "a mark that is late")),
            shades=((-2.0, 0.0),),
            shade="dark",
        ),
        Chart("Steps", "", "share", (steps,), x_label="mm", log_x=True, timed=False),
        Sheet("Table", ("scenario", *["middle"] * 12), (("a" * 120, *["1"] * 12),)),
        Timeline("Bars", "", float(TIME[0]), float(TIME[-1]), NAMES, ("9" * 400,) * 12),
        Facts("Facts", (("what is told in so many words that no telephone has them in one line", "0.000123 m"),)),
    )
    return Report("Centre of mass from " + "a" * 80 + ".csv", "", "0", parts)


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """A browser, and the report's file."""
    folder = tmp_path_factory.mktemp("legible")
    browser = Browser(folder / "profile")
    yield browser, write_report(report(), folder / "report.html")
    complaints = browser.complaints
    browser.close()
    assert complaints == []


def words_of(browser, title):
    """The words of a part's picture and their boxes, (left, top, right, bottom), and the picture's own."""
    return browser.value(
        f"""(() => {{ const picture = document.querySelector('section[aria-label={json.dumps(title)}] svg');
        const box = (one) => {{ const b = one.getBoundingClientRect(); return [b.left, b.top, b.right, b.bottom]; }};
        return {{ words: [...picture.querySelectorAll('text')].map((one) => [one.firstChild.textContent, box(one)]),
            picture: box(picture), size: picture.getScreenCTM().a }}; }})()"""
    )


@pytest.mark.parametrize("width", [360, 768, 1280])
def test_nothing_is_wider_than_the_screen_and_words_are_apart(page, width):
    browser, path = page
    browser.call("Emulation.setDeviceMetricsOverride", width=width, height=800, deviceScaleFactor=1, mobile=False)
    browser.open(path)
    assert browser.value("document.documentElement.scrollWidth") == width
    for title in ("Small", "Alike", "Points", "NEES of the centre of mass", "Alone", "Bars"):
        found = words_of(browser, title)
        assert found["size"] > 0.95  # letters are 12 px high
        left, top, right, bottom = found["picture"]
        for text, box in found["words"]:
            assert box[0] > left - 1, text
            assert box[1] > top - 1, text
            assert box[2] < right + 1, text
            assert box[3] < bottom + 1, text
        for (one, a), (other, b) in itertools.combinations(found["words"], 2):
            apart = a[2] < b[0] + 1 or b[2] < a[0] + 1 or a[3] < b[1] + 4 or b[3] < a[1] + 4
            assert apart, (title, one, other)


@pytest.mark.parametrize(("least", "most"), [(1.0, 5.0), (1e-3, 5.0), (1e-6, 100.0), (1e-2, 1e6), (1e-7, 1e-1)])
def test_words_of_levels_are_between_their_lines(page, tmp_path, least, most):
    """Over up to eight decades, where the upper two of three lines are thirteen pixels apart."""
    browser, _ = page
    chart = nees_chart((Series("nees", TIME, np.geomspace(least, most, 100), 5),), "")
    browser.open(write_report(Report("NEES", "", "0", (chart,)), tmp_path / "report.html"))
    found = words_of(browser, chart.title)
    words = [(text, box) for text, box in found["words"] if text in {"2.5 %", "mean 3", "97.5 %"}]
    assert len(words) == 3
    lines = browser.value("[...document.querySelectorAll('svg line.level')].map((o) => o.getBoundingClientRect().top)")
    for (text, (_, top, _, bottom)), y in itertools.product(words, lines):
        assert not top - HALO < y < bottom + HALO, (text, top, y, bottom)
    for (one, a), (other, b) in itertools.combinations(words, 2):
        assert a[3] < b[1] + 2 or b[3] < a[1] + 2, (one, other)
    frame = browser.value(
        "(({ top, bottom }) => [top, bottom])(document.querySelector('svg rect.axis').getBoundingClientRect())"
    )
    for text, (_, top, _, bottom) in words:
        assert frame[0] <= top < bottom <= frame[1], text


@pytest.mark.parametrize("width", [360, 1280])
@pytest.mark.parametrize(
    ("title", "named"),
    [("NEES of the centre of mass", {"2.5 %", "mean 3", "97.5 %"}), ("Alone", {"early", "a mark that is late"})],
)
def test_words_of_levels_and_marks_hide_no_curve(page, width, title, named):
    """They stood inside of the frame, over the curves: "3 expected" on the last tenth of each NEES."""
    browser, path = page
    browser.call("Emulation.setDeviceMetricsOverride", width=width, height=800, deviceScaleFactor=1, mobile=False)
    browser.open(path)
    frame = browser.value(
        f"""(() => {{ const box = document.querySelector('section[aria-label={json.dumps(title)}] rect.axis')
            .getBoundingClientRect(); return [box.left, box.top, box.right, box.bottom]; }})()"""
    )
    boxes = {text: box for text, box in words_of(browser, title)["words"] if text in named}
    assert set(boxes) == named
    for text, (left, top, right, bottom) in boxes.items():
        assert right < frame[0] or left > frame[2] or bottom < frame[1] + 1 or top > frame[3], text


def test_facts_keep_both_columns_on_a_phone(page):
    """The first column took what its longest name does in one line: the report of a flight was 623 px wide on 390."""
    browser, path = page
    browser.call("Emulation.setDeviceMetricsOverride", width=360, height=800, deviceScaleFactor=1, mobile=False)
    browser.open(path)
    name, value = (
        browser.value(
            f"(({{ left, right }}) => [left, right])(document.querySelector('{one}').getBoundingClientRect())"
        )
        for one in ("dt", "dd")
    )
    assert 0 < name[0] < name[1] < value[0] < value[1] < 360


def test_names_that_differ_at_their_ends_are_told_apart(page):
    browser, path = page
    browser.open(path)
    names = [text for text, _ in words_of(browser, "Bars")["words"]]
    assert len(set(names)) == len(names)


@pytest.mark.parametrize("width, hides", [(360, True), (1280, False)])
def test_keys_scroll_a_table_that_is_wider_than_the_screen(page, width, hides):
    browser, path = page
    browser.call("Emulation.setDeviceMetricsOverride", width=width, height=800, deviceScaleFactor=1, mobile=False)
    browser.open(path)
    browser.value("new Promise(requestAnimationFrame)")
    box = "document.querySelector('.scroll')"
    assert browser.value(f"[{box}.getAttribute('tabindex'), {box}.ariaLabel]") == (
        ["0", "Table"] if hides else [None] * 2
    )
    hint = "document.querySelector('section[aria-label=Table] .hint')"
    assert browser.value(f"{hint}.checkVisibility()") == hides
    assert "scroll sideways" in browser.value(f"{hint}.textContent")
    browser.value(f"{box}.focus()")
    browser.key("ArrowRight", 39)
    browser.value("new Promise((done) => setTimeout(done, 300))")
    assert (browser.value(f"{box}.scrollLeft") > 0) == hides


def test_paper_has_no_hint_to_scroll(page):
    browser, path = page
    browser.call("Emulation.setDeviceMetricsOverride", width=360, height=800, deviceScaleFactor=1, mobile=False)
    browser.open(path)
    browser.value("new Promise(requestAnimationFrame)")
    browser.call("Emulation.setEmulatedMedia", media="print")
    assert not browser.value("document.querySelector('.hint').checkVisibility()")
    browser.call("Emulation.setEmulatedMedia", media="")


def test_paper_has_the_colours_of_a_legend(page):
    """Without backgrounds, as browsers print unless told otherwise, the dots of estimates and points were gone."""
    browser, path = page
    browser.open(path)
    browser.call("Emulation.setEmulatedMedia", media="print")
    adjust = "getComputedStyle(document.querySelector('button.key.points'), '::before').printColorAdjust"
    assert browser.value(adjust) == "exact"
    browser.call("Emulation.setEmulatedMedia", media="")


def test_steps_at_the_ends_of_a_distribution_are_inside_of_the_frame(page):
    browser, path = page
    browser.open(path)
    picture = "document.querySelector('section[aria-label=Steps] svg')"
    frame, curve = (
        browser.value(f"(({{ x, width }}) => [x, x + width])({picture}.querySelector('{one}').getBBox())")
        for one in ("rect.axis", "path.curve")
    )
    assert frame[0] + 5 < curve[0] < curve[1] < frame[1] - 5


def test_what_is_shaded_is_told_where_something_is(page):
    browser, path = page
    browser.open(path)
    assert "shaded" not in browser.value("document.querySelector('section[aria-label=Alone]').textContent")


def test_words_of_headings_are_whole(page):
    browser, path = page
    browser.open(path)
    rows = """[...document.querySelectorAll('th')].map((one) => { const range = document.createRange();
        range.selectNodeContents(one); return new Set([...range.getClientRects()].map((box) => box.top)).size })"""
    assert set(browser.value(rows)) == {1}


def test_single_points_of_a_curve_are_drawn(page):
    """A frame between two gaps, and the first and last."""
    browser, path = page
    browser.open(path)
    length = "document.querySelector('section[aria-label=Alone] path.curve').getTotalLength()"
    assert browser.value(length) == pytest.approx(9, abs=0.2)


def test_a_legend_says_how_many_points_are_drawn(page):
    browser, path = page
    browser.open(path)
    keys = "[...document.querySelectorAll('section[aria-label={}] button.key')].map((one) => one.textContent)"
    assert browser.value(keys.format("Points")) == ["points, 100 of 5000 drawn"]
    assert browser.value(keys.format("Small")) == ["small"]

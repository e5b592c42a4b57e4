"""The report of a joint, in a browser."""

from itertools import pairwise

import numpy as np
import pytest

from baryscope.estimator.joint import joint
from baryscope.estimator.joint.bodies import Pair
from baryscope.estimator.tracks import FeatureTracks
from baryscope.report import report_of_joint, write_report
from baryscope.report.document import data_of
from browser import PROGRAM, Browser
from joints import TIME, recording


@pytest.fixture(scope="module")
def knee():
    """A hinge whose child has a marker with a name that is markup, unseen in some frames."""
    parent, child, _ = recording(np.random.default_rng(1), 0.001, 0.5, hinge=True)
    position = child.position.copy()
    position[100:130, 1] = np.nan
    child = FeatureTracks(TIME, position, ("e", "<b>f</b>", "g", "h"))
    return joint(parent, child), parent, child


def test_both_sides_differ_by_the_joint_s_residual(knee):
    """Of parent and child, in whichever axes; and each marker's residuals are the table's."""
    found, parent, child = knee
    report = report_of_joint(found, parent, child, ("a hinge",), "knee.trc")
    assert report.verdict[0] == "warn"
    charts = {part.title: part for part in report.parts if part.kind == "chart"}
    for title in ("The centre in the parent", "The centre in the child"):
        apart = np.column_stack([series.y for series in charts[title].series])
        np.testing.assert_allclose(
            np.linalg.norm(apart, axis=1), 1e3 * np.linalg.norm(found.residual, axis=1), rtol=1e-9
        )
    points = charts["Markers of the child"].series[0]
    assert len(points.x) == 4 * len(TIME) - 30
    second = points.of == 1
    assert not ((points.x[second] > TIME[99]) & (points.x[second] < TIME[130])).any()
    assert np.sqrt(np.mean(points.y[second] ** 2) / 3) == pytest.approx(1e3 * found.child_rms[1], rel=1e-9)
    assert np.sqrt(np.nanmean(Pair.of(parent, child).child.residual[:, 1] ** 2)) == pytest.approx(found.child_rms[1])


def test_gaps_are_gaps_and_what_is_left_out_is_red():
    """Curves were drawn across, and swapped labels stood as if they had been used."""
    parent, child, _ = recording(np.random.default_rng(1), 0.001, 0.5)
    position = child.position.copy()
    position[100:150, :2] = np.nan
    position[300:350, [0, 1]] = position[300:350, [1, 0]]
    child = FeatureTracks(TIME, position, child.labels)
    found = joint(parent, child)
    report = report_of_joint(found, parent, child, (), "gaps.trc")
    (chart,) = (part for part in report.parts if part.title == "The centre in the child")
    for series in chart.series:
        np.testing.assert_array_equal(series.x, TIME)
        np.testing.assert_array_equal(np.isnan(series.y), ~np.isin(TIME, found.time))
        assert np.isnan(series.y).sum() == 100
    (timeline,) = (part for part in report.parts if part.kind == "timeline")
    assert "red: " in timeline.about
    assert all("9" in row for row in timeline.rejected[4:6])
    assert set("".join(timeline.rejected[:4])) == {"0"}


def test_a_probe_has_no_markers_of_a_parent(knee):
    _, _, child = knee
    data = data_of(report_of_joint(joint(None, child), None, child, (), "probe.trc"))
    assert "Markers of the parent" not in [part["title"] for part in data["parts"]]


@pytest.mark.skipif(PROGRAM is None, reason="needs Chromium (Debian's package chromium)")
def test_the_page_draws_without_a_complaint(knee, tmp_path):
    path = write_report(report_of_joint(*knee, ("a hinge",), "knee.trc"), tmp_path / "report.html")
    browser = Browser(tmp_path / "profile")
    try:
        browser.open(path)
        assert browser.value("document.querySelectorAll('svg path.curve').length") >= 6
        assert "<b>f</b>" in browser.value("document.body.innerText")
        assert "chaser" not in browser.value("document.body.innerText")
        assert browser.nameless == 0
        levels = browser.heading_levels
        assert levels[0] == 1
        assert all(after - before <= 1 for before, after in pairwise(levels))
        complaints = browser.complaints
    finally:
        browser.close()
    assert complaints == []

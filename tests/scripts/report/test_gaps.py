"""Gaps of tracks whose blackouts have no frames, as those of a CSV file."""

import numpy as np
import pytest

from baryscope.estimator import FeatureTracks, estimate
from baryscope.report import report_of_estimate, write_report
from baryscope.report.document import data_of
from baryscope.report.gaps import MOST_SHADES, blackouts, gaps_of
from baryscope.report.thinning import shares
from browser import PROGRAM, Browser
from synthetic import attitude, box_features, make_case

STEADY = np.arange(100) * 0.5


@pytest.mark.parametrize(
    "time, expected",
    [
        (STEADY, []),
        (np.concatenate([STEADY, STEADY[-1] + 20 + STEADY]), [99]),
        (np.array([0.0, 1, 2, 50, 51]), [2]),
        (np.array([0.0, 10.0]), []),
        (np.concatenate([np.arange(100) * 0.1, 10 + np.arange(100)]), []),  # another rate
        (np.delete(STEADY, [20, 40, 41]), []),  # a frame or two that are dropped
        (np.delete(STEADY, [*range(20, 40), *range(41, 60)]), [19, 20]),  # one frame between two gaps
    ],
)
def test_gaps_are_steps_far_longer_than_usual(time, expected):
    assert gaps_of(time).tolist() == expected


def test_frames_at_random_have_few():
    """Of exponential steps 1 or 2 % are longer than thrice the upper quartile, by exp(-3 ln 4)."""
    time = np.cumsum(np.random.default_rng(1).exponential(size=10_000))
    assert len(gaps_of(time)) < 0.02 * len(time)


def test_blackouts_with_frames_and_without_are_one():
    time = np.delete(STEADY, range(50, 70))
    seen = np.ones((80, 2), dtype=bool)
    seen[48:52] = False
    assert blackouts(time, seen) == ((24.0, 36.0),)
    seen[:3], seen[-2:] = False, False
    assert blackouts(time, seen) == ((0.0, 1.5), (24.0, 36.0), (49.0, 49.5))


def test_of_very_many_blackouts_the_longest_are_kept():
    seen = np.ones((4 * MOST_SHADES, 1), dtype=bool)
    seen[::2] = False
    seen[-9:-3] = False
    kept = blackouts(np.arange(len(seen), dtype=float), seen)
    assert len(kept) == MOST_SHADES
    assert max(end - begin for begin, end in kept) == 6 + 1
    assert list(kept) == sorted(kept)


def test_bars_have_gaps():
    time = np.concatenate([np.arange(0, 10), np.arange(30, 40)]).astype(float)
    (row,) = shares(time, np.ones((20, 1), dtype=bool), 39)
    assert row == "9" * 10 + "0" * 20 + "9" * 9


@pytest.fixture(scope="module")
def report():
    """Of tracks without frames from 60 s to 99 s."""
    time = np.delete(np.arange(150.0), range(60, 100))
    R = attitude(np.diag([2.0, 3.0, 4.0]), np.array([0.04, 0.03, 0.02]), time)
    com = np.stack([8 + 0.01 * time, -18 + 0.005 * time, 6 - 0.002 * time], axis=1)
    position = make_case(time, R, com, box_features(5, (2, 2, 3), 1), noise=0.005).tracks.position
    tracks = FeatureTracks(time, position, "abcde")
    return report_of_estimate(estimate(tracks), tracks, None, "gap.csv")


def test_a_report_shows_no_feature_where_there_are_no_frames(report):
    """The bars went on through the gap, nothing was shaded, and curves ran straight across."""
    parts = data_of(report)["parts"]
    charts = {part["title"]: part for part in parts}
    assert charts["Scene"]["gaps"] == [59]
    for title in ("Path", "What the method claims"):
        assert charts[title]["shades"] == [[59, 100]]
        for series in charts[title]["series"]:
            gap = [y is None for y in series["y"]]
            assert sum(gap) == 1
            assert series["x"][gap.index(True)] == 79.5
            assert series["low"] is None or series["low"][gap.index(True)] is None
    assert charts["Residuals"]["shades"] == [[59, 100]]
    timeline = charts["Which feature is seen when"]
    assert "for 41 s in between there are no frames" in timeline["about"]
    assert all("0" * 100 in row for row in timeline["seen"])


@pytest.mark.skipif(PROGRAM is None, reason="needs Chromium (Debian's package chromium)")
def test_the_scene_is_not_played_in_a_gap(report, tmp_path):
    """It turned there for as long as the gap is, evenly and far too slowly."""
    browser = Browser(tmp_path / "profile")
    browser.open(write_report(report, tmp_path / "report.html"))
    times = browser.value("""(async () => {
        const found = [], slider = document.querySelector('input[type=range]');
        const pace = document.querySelectorAll('select')[2];
        slider.value = 50; slider.dispatchEvent(new Event('input'));
        pace.selectedIndex = 0; pace.dispatchEvent(new Event('change'));
        const now = () => Number(document.querySelector('svg .now').getAttribute('x1'));
        document.querySelector('button.play').click();
        const frame = document.querySelector('svg rect.axis').getBBox();
        for (let k = 0; k < 3000 && Number(slider.value) < 65; k += 1) {
            await new Promise(requestAnimationFrame);
            found.push(149 * (now() - frame.x) / frame.width);
        }
        return found; })()""")
    complaints = browser.complaints
    browser.close()
    assert complaints == []
    assert min(times) < 59
    assert max(times) > 100
    assert not [time for time in times if 59.1 < time < 99.9]

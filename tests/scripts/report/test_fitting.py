"""Reports that are made lighter: they fit, and what is left of them is still true."""

import numpy as np
import pytest

from baryscope.report import Report, html_of
from baryscope.report.document import Chart, Ghost, Scene, Series, Sheet, Tabs
from baryscope.report.fitting import LEAST_FRAMES, LEAST_POINTS, fitted, thinned
from baryscope.report.page import weight_of

FRAMES, FEATURES = 1200, 10


def heavy(seed=1):
    """A scene, a curve with a band and a gap, and points, in tabs."""
    rng, time = np.random.default_rng(seed), np.arange(float(FRAMES))
    y = rng.random(FRAMES)
    y[500:520] = np.nan
    curve = Series("<curve>", time, y, low=y - 0.1, high=y + 0.1)
    points = Series("points", time, rng.random(FRAMES), style="points", of=np.arange(FRAMES) % FEATURES, total=9000)
    covariance = rng.random((FRAMES, 6))
    scene = Scene(
        time=time,
        path=rng.random((FRAMES, 3)),
        path_label="truth",
        labels=tuple("abcdefghij"),
        features=rng.random((FRAMES, FEATURES, 3)),
        state=tuple(f"{frame:010d}" for frame in range(FRAMES)),
        faces=np.empty((0, 3), dtype=np.intp),
        ghosts=(Ghost("pivot", 1, rng.random((FRAMES, 3)), covariance), Ghost("gpa", 2, rng.random((FRAMES, 3)))),
        attitude=rng.random((FRAMES, 4)),
        every=2.0,
    )
    return (
        scene,
        Tabs("Each", (("one", (Chart("Both", "", "m", (curve, points)),)),)),
        Sheet("Sheet", ("a",), (("1",),)),
    )


def test_the_weight_is_that_in_the_file():
    """Bytes, of what is escaped and beyond ASCII, too."""
    parts = (Sheet("<Größe>", ("a & b",), (("µ",),)), heavy()[1])
    without, both = (len(html_of(Report("", "", "0", some)).encode()) for some in ((), parts))
    assert both - without == weight_of(parts) - len("[]")


@pytest.mark.parametrize("room", [2_000_000, 400_000, 150_000, 60_000])
def test_parts_fit_and_use_the_room(room):
    parts = heavy()
    lighter, weight = fitted(parts, room)
    assert weight_of(lighter) == weight <= room
    assert weight > 0.7 * min(room, weight_of(parts))


def test_what_cannot_be_made_lighter_is_as_light_as_it_can_be():
    """And tells how heavy that is."""
    lighter, weight = fitted(heavy(), 5_000)
    assert weight == weight_of(lighter) > 5_000
    assert len(lighter[0].time) == LEAST_FRAMES


@pytest.mark.parametrize("share", [0.5, 0.1, 0.001])
def test_what_is_left_stands_where_it_stood(share):
    """Frames with all that belongs to them, extremes of curves, and how many there were."""
    whole, ((_, (chart,)),) = heavy()[0], heavy()[1].choices
    scene, tabs, sheet = thinned(heavy(), share)
    assert max(LEAST_FRAMES, share * FRAMES * 0.9) <= len(scene.time) <= max(LEAST_FRAMES, share * FRAMES)
    assert scene.every == pytest.approx(2.0 * FRAMES / len(scene.time))
    place = scene.time.astype(int)
    assert scene.state == tuple(whole.state[k] for k in place)
    np.testing.assert_array_equal(scene.features, whole.features[place])
    np.testing.assert_array_equal(scene.attitude, whole.attitude[place])
    np.testing.assert_array_equal(scene.ghosts[0].covariance, whole.ghosts[0].covariance[place])
    assert scene.ghosts[1].covariance is None
    ((_, (found,)),) = tabs.choices
    for one, before in zip(found.series, chart.series, strict=True):
        place = one.x.astype(int)
        assert place[0] == 0
        assert place[-1] == FRAMES - 1
        np.testing.assert_array_equal(one.y, before.y[place])
        assert LEAST_POINTS / 2 <= len(one.x) < FRAMES
    curve, points = found.series
    assert (np.nanmin(curve.y), np.nanmax(curve.y)) == (np.nanmin(chart.series[0].y), np.nanmax(chart.series[0].y))
    assert np.isnan(curve.y).any()
    np.testing.assert_array_equal(curve.high, chart.series[0].high[curve.x.astype(int)])
    np.testing.assert_array_equal(points.of, points.x.astype(int) % FEATURES)
    assert (curve.total, points.total) == (None, 9000)
    assert sheet.rows == (("1",),)

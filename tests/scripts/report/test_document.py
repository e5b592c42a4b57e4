"""What a report holds: its numbers against definitions and draws, its size, and words that are not markup."""

import json
import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator import FeatureTracks, PathOptions, estimate
from baryscope.estimator.details import TumbleDetails
from baryscope.estimator.online import OnlineEstimator
from baryscope.report import html_of, online, report_of_estimate
from baryscope.report.charts import expected_error, nees_of
from baryscope.report.document import data_of, plain
from baryscope.report.estimates import millimetres, residual_chart
from baryscope.report.page import page_file, palette
from baryscope.report.scene import Body, Shown, scene_of
from baryscope.report.thinning import evenly, extremes, shares
from baryscope.study.methods import COLOURS
from synthetic import attitude, box_features, make_case

HOSTILE = [
    "<script>window.evil = 1</script>",
    "</script><img src=x onerror=alert(1)>",
    "a & b \u2028 é",
    '"quoted"',
    "e",
]


@pytest.fixture(scope="module")
def hostile():
    """A report of own tracks whose labels are markup; feature 4 lies 1 m off in three frames."""
    time = np.arange(120.0)
    com = np.stack([8 + 0.01 * time, -18 + 0.005 * time, 6 - 0.002 * time], axis=1)
    R = attitude(np.diag([2.0, 3.0, 4.0]), np.array([0.04, 0.03, 0.02]), time)
    case = make_case(
        time,
        R,
        com,
        box_features(5, (2, 2, 3), 1),
        noise=0.005,
        clusters=[(0, 50, [0, 1, 2, 3, 4]), (60, 120, [0, 1, 2, 3, 4])],
    )
    position = case.tracks.position.copy()
    position[20:23, 4] += 1.0
    position[50:60] = np.nan
    tracks = FeatureTracks(time, position, HOSTILE)
    return report_of_estimate(estimate(tracks), tracks, None, "<b>mine.csv</b>")


def data_in(page):
    """The JSON of a page, as a browser finds it."""
    (text,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    return json.loads(text)


def test_words_are_data_and_never_markup(hostile):
    page = html_of(hostile)
    assert page.count("<script") == page.count("</script") == 2
    assert "<title>Centre of mass from &lt;b&gt;mine.csv&lt;/b&gt;</title>" in page
    assert data_in(page) == data_of(hostile)
    assert next(part for part in data_in(page)["parts"] if part["kind"] == "scene")["labels"] == HOSTILE
    assert not re.search(r"(src|href)=\"?https?:", page)


def test_own_tracks_tell_what_was_rejected_and_when(hostile):
    parts = {part["kind"]: part for part in data_of(hostile)["parts"]}
    bins = [set(np.flatnonzero([int(digit) for digit in row])) for row in parts["timeline"]["rejected"]]
    assert bins[:4] == [set()] * 4
    assert {int(one * 119 / 400) for one in bins[4]} <= {19, 20, 21, 22, 23}
    assert len(bins[4]) >= 3
    assert [state[4] for state in parts["scene"]["state"][19:24]] == ["1", "2", "2", "2", "1"]
    assert data_of(hostile)["verdict"][0] == "good"


def test_own_tracks_have_the_online_estimate_beside_that_of_all_frames(monkeypatch):
    """Their report told nothing of it: with no truth there, how far it is from the path that all frames tell."""
    time = np.arange(200.0)
    R = attitude(np.diag([2.0, 3.0, 4.0]), np.array([0.04, 0.03, 0.02]), time)
    com = np.array([8.0, -18.0, 6.0]) + 0.01 * time[:, None]
    tracks = make_case(time, R, com, box_features(5, (2, 2, 3), 1), noise=0.005).tracks
    result = estimate(tracks)
    parts = {part["title"]: part for part in data_of(report_of_estimate(result, tracks, None, "mine"))["parts"]}
    distance, claim = parts["Convergence of the online estimate"]["series"]
    assert distance["label"] == "distance from the path by pivot"
    last = OnlineEstimator(result.noise.a_posteriori)
    for moment, points in zip(time.tolist(), tracks.position, strict=True):
        state = last.update(moment, points)
    assert distance["y"][-1] == pytest.approx(1e3 * np.linalg.norm(state.position - result.position[-1]), rel=1e-3)
    assert claim["y"][-1] < 0.1 * claim["y"][20]  # it converges
    monkeypatch.setattr(online, "MOST_FRAMES", 199)
    data = data_of(report_of_estimate(result, tracks, None, "mine"))
    assert "Convergence of the online estimate" not in [part["title"] for part in data["parts"]]
    assert data["notes"] == ["There is no online estimate: 200 frames are more than the 199 that a report has it for."]


def test_rejected_observations_without_a_residual_are_counted():
    """Without the one that is rejected, two features are left, which have no attitude: the chart had "0 of" as many."""
    time = np.arange(100.0)
    com = np.stack([8 + 0.01 * time, -18 + 0.005 * time, 6 - 0.002 * time], axis=1)
    R = attitude(np.diag([2.0, 3.0, 4.0]), np.array([0.04, 0.03, 0.02]), time)
    clusters = [(0, 30, [0, 1, 2]), (30, 101, [0, 1, 2, 3, 4])]
    case = make_case(time, R, com, box_features(5, (2, 2, 3), 1), noise=0.005, clusters=clusters)
    position = case.tracks.position.copy()
    position[[10, 50], 1] += 1.0
    tracks = FeatureTracks(time, position, "abcde")
    result = estimate(tracks)
    assert np.argwhere(result.rejected).tolist() == [[10, 1], [50, 1]]
    parts = {part.title: part for part in report_of_estimate(result, tracks, None, "few.csv").parts}
    assert f"2 of {result.used.sum()} are rejected as outliers. 1 of these have no residual" in parts["Residuals"].about
    assert sum(int(row[2]) for row in parts["Features"].rows) == 2


@pytest.mark.parametrize("method, verdict", [("score", "good"), ("screw-gpa", "warn")])
def test_methods_that_do_not_test_their_models_are_never_good(method, verdict):
    """Not even where they are right, with a centre of mass at rest and the status good."""
    time = np.arange(0.0, 300.0)
    com = np.tile([8.0, -18.0, 6.0], (300, 1))
    R = attitude(np.diag([2.0, 3.0, 4.0]), np.array([0.04, 0.03, 0.02]), time)
    case = make_case(time, R, com, box_features(6, (2, 2, 3), 1), noise=0.002)
    result = estimate(case.tracks, method=method)
    assert result.status == "good"
    state, words = report_of_estimate(result, case.tracks, None, "rest.csv").verdict
    assert state == verdict
    assert words.startswith(f"{method} does not test its models") == (verdict == "warn")


def test_hidden_features_are_where_the_estimate_has_them():
    """ml knows all features in one body's axes; each is seen in half of the time or more. Noise 1 mm, bodies of 2 m."""
    time = np.arange(0.0, 200.0, 2.0)
    com = np.array([8.0, -18.0, 6.0]) + 0.01 * time[:, None] * [1, -1, 0.5]
    R = attitude(np.diag([2.0, 3.0, 4.0]), np.array([0.04, 0.03, 0.02]), time)
    features = box_features(6, (2, 2, 3), 1)
    clusters = [(0, 120, [0, 1, 2, 3]), (80, 201, [2, 3, 4, 5])]
    case = make_case(time, R, com, features, noise=0.001, clusters=clusters)
    result = estimate(case.tracks, method="ml", options=PathOptions(trajectory="polynomial:1"))
    assert isinstance(result.details, TumbleDetails)
    scene = data_of(report_of_estimate(result, case.tracks, None, "two.csv"))["parts"][0]
    shown = np.array(scene["features"], dtype=float).reshape(len(time), -1, 3) + np.reshape(scene["path"], (-1, 1, 3))
    true = com[:, None] + np.einsum("kij,mj->kmi", R, features)
    hidden = ~case.tracks.seen
    assert hidden.sum() > 100
    np.testing.assert_allclose(shown[hidden], true[hidden], atol=0.01)
    assert len(scene["faces"]) == 3 * 8  # a polyhedron of triangles with six corners


def test_own_tracks_have_a_shape_whenever_a_cluster_is_seen():
    """Clusters of `pivot` have no common axes; of the hull of both hardly a face was drawn."""
    time = np.arange(0.0, 200.0, 2.0)
    R = attitude(np.diag([2.0, 3.0, 4.0]), np.array([0.04, 0.03, 0.02]), time)
    clusters = [(0, 100, [0, 1, 2, 3]), (100, 201, [3, 4, 5, 6])]
    com = np.broadcast_to([8.0, -18.0, 6.0], (len(time), 3))
    case = make_case(time, R, com, box_features(7, (2, 2, 3), 1), noise=0.001, clusters=clusters)
    result = estimate(case.tracks, options=PathOptions(trajectory="fixed"))
    scene = data_of(report_of_estimate(result, case.tracks, None, "two.csv"))["parts"][0]
    known = np.array(scene["features"], dtype=float).reshape(len(time), -1, 3)
    faces = np.reshape(scene["faces"], (-1, 3))
    drawn = np.isfinite(known[:, faces]).all(axis=(2, 3)).sum(axis=1)
    assert drawn.min() >= 4  # the faces of a tetrahedron


def test_a_hundred_thousand_frames_are_small():
    """Of 12 features; the estimate is of 1000 frames, repeated: only its arrays count here."""
    time = np.arange(100_000.0)
    rng = np.random.default_rng(3)
    path = np.array([0.0, 20.0, 0.0]) + rng.standard_normal((len(time), 3))
    features = path[:, None] + rng.standard_normal((1, 12, 3))
    seen = rng.random(features.shape[:2]) < 0.8
    covariance = np.tile(1e-6 * np.eye(3), (len(time), 1, 1))
    R = np.tile(np.eye(3), (len(time), 1, 1))
    labels = tuple(f"F{k}" for k in range(12))
    body = Body(time, path, "truth", R, labels, features, seen, seen & (rng.random(seen.shape) < 0.01))
    ghosts = tuple(Shown(f"m{k}", k, path + 1e-3 * rng.standard_normal(path.shape), covariance) for k in range(8))
    text = json.dumps(plain(scene_of(body, ghosts, None)))
    assert len(text) < 2_500_000
    assert len(json.loads(text)["time"]) == 1500
    assert max(map(len, shares(time, seen))) == 400
    assert len(extremes(path[:, 0])) <= 902


def test_thinned_curves_keep_extremes_and_gaps():
    y = np.sin(np.linspace(0, 50, 20_000))
    y[7777], y[3333], y[11_000:11_100] = 9.0, -9.0, np.nan
    keep = extremes(y, 500)
    assert {0, 3333, 7777, 19_999} <= set(keep)
    assert len(keep) <= 502 + 3
    assert np.isnan(y[keep]).any()
    np.testing.assert_array_equal(extremes(y[:400], 500), np.arange(400))
    np.testing.assert_array_equal(evenly(10, 4), [0, 3, 6, 9])


def test_shares_of_a_bin():
    """Frames 0 … 7 in four bins of two; the third column is seen in three quarters of the time."""
    flags = np.array([[1, 0, 1], [1, 0, 1], [1, 0, 0], [0, 0, 1], [0, 0, 1], [0, 0, 1], [0, 0, 1], [1, 1, 0]], bool)
    assert shares(np.arange(8.0), flags, 4) == ("9404", "0004", "9494")


def test_shares_fill_bins_without_a_frame():
    assert shares(np.array([0.0, 10.0]), np.array([[True], [False]]), 5) == ("99990",)


@pytest.mark.parametrize(
    "deviations, exact", [([1, 1, 1], True), ([1, 0, 0], True), ([3, 2, 1], False), ([5, 1, 0.1], False)]
)
def test_the_band_holds_95_percent_of_errors(deviations, exact):
    """Against 40 000 draws, whose shares have a deviation of 0.0008. Of unequal variances fewer are below the band."""
    rng = np.random.default_rng(5)
    R = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    low, high = expected_error((R @ np.diag(np.square(deviations)) @ R.T)[None])
    size = np.linalg.norm(rng.standard_normal((40_000, 3)) * deviations, axis=1)
    assert np.mean(size > high) == pytest.approx(0.025, abs=0.0035)
    below = np.mean(size < low)
    assert below == pytest.approx(0.025, abs=0.0035) if exact else below < 0.025


def test_nees_is_that_of_the_definition_and_none_where_it_has_no_meaning():
    error = np.array([[1.0, 2, 3], [1, 2, 3], [np.nan, 0, 0]])
    covariance = np.array([np.diag([1.0, 4, 9]), np.zeros((3, 3)), np.eye(3)])
    np.testing.assert_allclose(nees_of(error, covariance), [3, np.nan, np.nan], rtol=1e-12)


def test_numbers_are_short_and_gaps_are_null():
    assert plain(np.array([1.23456789, np.nan, 2.0, 1e-12])) == [1.2346, None, 2, 1e-12]
    assert plain({"x": 1}) == {"x": 1}
    json.dumps(plain((np.inf, "a", (1.5,))), allow_nan=False)


@pytest.mark.parametrize("digits", [5, 8, 13])
def test_arrays_are_rounded_as_single_numbers_are(digits):
    """But where a number lies half way between two decimals, of which either may be taken."""
    rng = np.random.default_rng(7)
    far = rng.standard_normal(4000) * 10 ** rng.uniform(-40, 40, 4000)
    near = rng.standard_normal(4000) * 10 ** rng.uniform(-6, 6, 4000)
    values = np.concatenate([far, near, np.round(near), [0.0, -0.0, 1e15, 99999.6, -7.0, 1e16, 1000.0]])
    found = plain(values, digits)
    expected = [float(f"{one:.{digits}g}") for one in values.tolist()]
    np.testing.assert_allclose(np.array(found, dtype=float), expected, rtol=1.01 * 10.0 ** (1 - digits))
    assert np.mean([one != other for one, other in zip(found, expected, strict=True)]) < 2e-3
    assert max(len(repr(abs(one)).split("e")[0].replace(".", "").strip("0")) for one in found) <= digits
    assert all(isinstance(one, int) == (one == int(one) and abs(one) < 1e15) for one in found)
    assert plain(np.array([np.nan, -np.inf, 1.0]), digits) == [None, None, 1]


@pytest.mark.parametrize(
    "metres, digits",
    [(3.54321e-8, "0.0000354"), (0.0, "0"), (1.23456e-4, "0.123"), (-0.016, "-16"), (12.3456, "12346"), (np.nan, "-")],
)
def test_millimetres_have_no_exponent(metres, digits):
    assert millimetres(metres) == digits


def test_every_method_has_its_own_colour_in_pictures():
    """Those of the page on light paper, of which no two are alike."""
    colours = [palette()[place] for place in COLOURS.values()]
    assert len(set(colours)) == len(COLOURS)
    assert all(colour in page_file("page.css").partition("}")[0] for colour in colours)


def test_of_many_residuals_an_even_sample_is_drawn():
    """How many they are stands beside; the page's legend says so."""
    rng, time = np.random.default_rng(1), np.arange(1000.0)
    turn = Rotation.from_euler("xy", 0.5 * np.sin(time[:, None] * [0.08, 0.13])).as_matrix()
    points = rng.uniform(-1, 1, (5, 3)) @ np.swapaxes(turn, 1, 2) + [1.0, -20.0, 3.0]
    tracks = FeatureTracks(time, points + 0.001 * rng.standard_normal(points.shape), "abcde")
    chart = residual_chart(estimate(tracks, method="score"))
    drawn = chart.series[0]
    assert (drawn.label, drawn.total) == ("used", 5000)
    assert 1500 <= len(drawn.x) <= 3000

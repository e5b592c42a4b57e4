"""Flights and comparisons as a notebook calls them: values, tables, figures, and nothing printed."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator import METHODS, FeatureTracks, read_tracks
from baryscope.estimator.bound import cramer_rao_bound
from baryscope.estimator.online import OnlineEstimator, OnlineStatus
from baryscope.models.errors import ComputationError, InputError
from baryscope.models.scenario import Scenario, load_orbit
from baryscope.report import online
from baryscope.report.document import data_of
from baryscope.study import (
    Grid,
    bound_table,
    compare,
    comparison_figure,
    fly,
    outcome_figure,
    report_of_comparison,
    write_flight,
)
from baryscope.study.comparison_files import summary_text
from malformed import GOOD_SCENARIO


@pytest.fixture(scope="module")
def scenario(tmp_path_factory):
    path = tmp_path_factory.mktemp("scenario") / "small.toml"
    path.write_text(GOOD_SCENARIO.replace("noise = 0.02", "noise = 0.002"), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def told():
    """What a progress callback is told."""
    return []


@pytest.fixture(scope="module")
def comparison(scenario, told):
    return compare(scenario, methods=["pivot", "screw-gpa"], progress=lambda work, share: told.append((work, share)))


def test_nothing_is_printed(scenario, capfd):
    compare(scenario, methods=["pivot"]).table()
    bound_table(scenario, Grid(durations=[50.0, 100.0]))
    assert capfd.readouterr() == ("", "")


def test_a_comparison_holds_its_numbers(comparison):
    """Against the definitions, from the paths themselves."""
    assert [outcome.label for outcome in comparison.outcomes] == ["pivot", "screw-gpa", "screw-gpa-lvlh"]
    assert repr(comparison).startswith(
        "<Comparison of pivot, screw-gpa, screw-gpa-lvlh: <Flight of small: <FeatureTracks: "
    )
    assert max(map(len, map(repr, (comparison, *comparison.outcomes)))) < 500
    truth = comparison.flight.truth["target.position"]
    for outcome in comparison.outcomes:
        squares = ((outcome.estimate.position - truth) ** 2).sum(axis=1)
        assert outcome.rmse == pytest.approx(np.sqrt(squares.mean()))
        assert outcome.max_error == pytest.approx(np.sqrt(squares.max()))
        assert 0 < outcome.coverage <= 1
        assert outcome.wall_time > 0
    pivot = comparison["pivot"]
    assert pivot.predicted_rmse == pytest.approx(np.sqrt(np.trace(pivot.estimate.covariance, axis1=1, axis2=2).mean()))
    assert comparison["screw-gpa"].predicted_rmse is None
    assert comparison.bound.position_deviation == cramer_rao_bound(comparison.scenario).position_deviation
    with pytest.raises(InputError, match="ml: not compared, expected one of pivot, screw-gpa, screw-gpa-lvlh"):
        comparison["ml"]


def test_its_table_shows_them(comparison):
    table = comparison.table()
    assert table.headings == (
        "method", "axes or path", "RMSE, mm", "max, mm", "predicted RMSE, mm", "coverage", "time",
    )  # fmt: skip
    assert [row[:2] for row in table.rows] == [
        ("pivot", "relative-orbit"), ("screw-gpa", "inertial"), ("screw-gpa", "lvlh"),
        ("Cramér–Rao bound", "relative-orbit"),
    ]  # fmt: skip
    for row, outcome in zip(table.rows, comparison.outcomes, strict=False):
        assert row[2] == f"{1000 * outcome.rmse:.2f}"
        assert row[5] == f"{100 * outcome.coverage:.0f} %"
    assert table.rows[1][4] == "-"


def test_a_table_in_markdown_and_in_columns(comparison):
    table = comparison.table()
    lines = table.markdown().splitlines()
    assert lines[1] == "| --- | --- | ---: | ---: | ---: | ---: | ---: |"
    assert [tuple(line[2:-2].split(" | ")) for line in [lines[0], *lines[2:]]] == [table.headings, *table.rows]
    title, *columns = str(table).splitlines()
    assert title == "Error of the centre of mass, small, 100 s"
    assert [tuple(re.split(r" {2,}", line.strip())) for line in columns] == [table.headings, *table.rows]
    assert table._repr_markdown_() == f"{title}\n\n{table.markdown()}"


def test_methods_that_are_not_to_be_trusted_are_named(comparison, scenario):
    """score, for which the chaser's drift is none, stood in the tables with a narrow claim like all others."""
    drifting = scenario.read_text(encoding="utf-8").replace(
        "[0.0, -10.0, 0.0]", "[0.0, -10.0, 0.0]\nvelocity = [0.1, 0, 0]"
    )
    path = scenario.with_name("drifting.toml")
    path.write_text(drifting, encoding="utf-8")
    drift = compare(path, methods=["score", "pivot"])
    assert [one.doubt for one in drift.outcomes] == ["model does not fit", ""]
    assert [one["status"] for one in drift.to_json()["methods"]] == ["model does not fit", "good"]
    sentence = "Not to be trusted, as they say themselves: score (model does not fit)."
    assert report_of_comparison(drift).parts[0].about.endswith(sentence)
    assert sentence in summary_text(drift, [])
    assert comparison.doubts == ""


def test_words_in_figures_are_no_formulas(comparison, tmp_path):
    """A description with dollars ended the command with an internal error, when all was estimated."""
    words = r"a body for \$3 or $\foo$, which is told in so many words that they do not fit into one line of a title"
    of = comparison.flight.scenario.model_copy(update={"description": words, "name": "$x_1$"})
    flight = replace(comparison.flight, scenario=of)
    figure = comparison_figure(replace(comparison, flight=flight))
    figure.savefig(tmp_path / "all.png")
    width = figure.axes[0].title.get_window_extent().width
    assert width < figure.bbox.width
    assert words in figure.axes[0].title.get_text().replace("\n", " ")
    outcome_figure(flight, comparison["pivot"]).savefig(tmp_path / "one.png")


def test_figures_show_all_methods(comparison):
    legend = comparison_figure(comparison).axes[0].get_legend_handles_labels()[1]
    methods = ["pivot, relative-orbit", "screw-gpa, inertial axes", "screw-gpa, lvlh axes"]
    assert [label.split(":")[0] for label in legend[:3]] == methods
    assert any(label.startswith("Cramér–Rao bound on path RMSE") for label in legend)
    assert len(comparison_figure(comparison).axes[0].collections) == 1  # the band of the one that has a covariance
    panels = outcome_figure(comparison.flight, comparison["pivot"]).axes
    np.testing.assert_array_equal(panels[0].lines[0].get_ydata(), comparison.flight.true_path[:, 0])


def test_a_curve_that_another_covers_is_told(comparison):
    pivot, gpa, lvlh = comparison.outcomes
    assert [comparison.hidden(one) for one in (pivot, lvlh)] == [False, False]
    near = replace(pivot, label="near", error=1.05 * pivot.error)
    both = replace(comparison, outcomes=(pivot, gpa, near))
    assert [both.hidden(one) for one in both.outcomes] == [True, False, False]


def test_the_report_shows_the_errors_and_the_truth(comparison):
    """Against the definitions, at the frames of the scene, which left out methods without covariance."""
    data = data_of(report_of_comparison(comparison))
    parts = {part["kind"]: part for part in reversed(data["parts"])}
    scene, flight = parts["scene"], comparison.flight
    np.testing.assert_allclose(scene["time"], flight.tracks.time)
    np.testing.assert_allclose(np.reshape(scene["path"], (-1, 3)), flight.true_path, rtol=1e-6, atol=1e-9)
    assert [ghost["label"] for ghost in scene["ghosts"]] == ["pivot", "screw-gpa", "screw-gpa-lvlh"]
    assert [ghost["covariance"] is None for ghost in scene["ghosts"]] == [False, True, True]
    for ghost in scene["ghosts"]:
        offsets = np.array(ghost["offset"], dtype=float).reshape(-1, 3)
        np.testing.assert_allclose(np.linalg.norm(offsets, axis=1), comparison[ghost["label"]].error, rtol=1e-3)
    arms = np.linalg.norm(np.reshape(scene["features"], (-1, 4, 3)), axis=2)
    np.testing.assert_allclose(arms, np.tile([1, 1, 1, np.sqrt(1.25)], (len(arms), 1)), rtol=1e-4)
    seen = np.array([list(state) for state in scene["state"]]) != "0"
    np.testing.assert_array_equal(seen, flight.tracks.seen)
    assert np.unique(scene["faces"]).tolist() == [0, 1, 2, 3]
    R = Rotation.from_quat(np.reshape(scene["orbit"], (-1, 4)), scalar_first=True).as_matrix()
    chaser_L = np.einsum("kji,kj->ki", R, -flight.true_path)
    np.testing.assert_allclose(chaser_L, flight.truth["chaser.position"], atol=1e-3)
    errors = next(part for part in data["parts"] if part["title"] == "Error of the centre of mass")
    labels = [one["label"].split(":")[0] for one in errors["series"]]
    assert labels == ["pivot, relative-orbit", "screw-gpa, inertial axes", "screw-gpa, lvlh axes", "Cramér–Rao bound"]
    np.testing.assert_allclose(errors["series"][0]["y"], 1e3 * comparison["pivot"].error, rtol=1e-4)
    assert [one["low"] is None for one in errors["series"]] == [False, True, True, True]
    assert parts["sheet"]["rows"] == [list(row) for row in comparison.table().rows]
    assert "`" not in json.dumps(data)  # the page shows texts as they are
    assert [name for name, _ in parts["tabs"]["choices"]] == [one.label for one in comparison.outcomes]


def test_the_report_shows_how_the_online_estimate_converges(comparison, monkeypatch):
    """Against the filter itself, on the same tracks; the report had the batch methods alone."""
    parts = {part["title"]: part for part in data_of(report_of_comparison(comparison))["parts"]}
    chart, flight = parts["Convergence of the online estimate"], comparison.flight
    error, claim = chart["series"]
    filter = OnlineEstimator(flight.scenario.sensor.noise, flight.scenario.orbit)
    states = [filter.update(float(t), p) for t, p in zip(flight.tracks.time, flight.tracks.position, strict=True)]
    shown = np.array(error["y"], dtype=float)
    true = [np.linalg.norm(one.position - path) for one, path in zip(states, flight.true_path, strict=True)]
    np.testing.assert_array_equal(np.isnan(shown), [one.status is OnlineStatus.WAITING for one in states])
    known = np.isfinite(shown)
    np.testing.assert_allclose(shown[known], 1e3 * np.array(true)[known], rtol=1e-4)
    deviations = [np.sqrt(np.trace(one.covariance[:3, :3])) for one in states]
    np.testing.assert_allclose(np.array(claim["y"], dtype=float)[known], 1e3 * np.array(deviations)[known], rtol=1e-4)
    assert (np.array(error["low"], dtype=float) < np.array(error["high"], dtype=float))[known].all()

    def refuse(*_, **__):
        raise ComputationError("no C compiler found")

    monkeypatch.setattr(online, "OnlineEstimator", refuse)
    data = data_of(report_of_comparison(comparison))
    assert "Convergence of the online estimate" not in [part["title"] for part in data["parts"]]
    assert data["notes"] == ["There is no online estimate: no C compiler found."]


def test_progress_has_a_beginning_and_an_end_for_each_piece_of_work(comparison, told):
    """And the whole of the methods has shares in between, from which the time left follows."""
    works = list(dict.fromkeys(work for work, _ in told))
    assert any(work.startswith("simulating 100 s") for work in works)
    assert {"estimating by pivot", "estimating by screw-gpa-lvlh", "Cramér–Rao bound"} <= set(works)
    for work in works:
        shares = [share for name, share in told if name == work]
        assert shares[0] == 0
        assert shares[-1] == 1
        assert shares == sorted(shares)
        assert shares.count(1) == 1
    between = [share for work, share in told if work == "estimating by 3 methods"]
    assert between == pytest.approx([0, 1 / 3, 2 / 3, 1])


def test_a_method_that_cannot_is_a_value(scenario):
    still = Scenario.parse(
        fly(scenario).scenario.model_dump(mode="json", exclude_unset=True)
        | {"target": {"inertia": [[2, 0, 0], [0, 2, 0], [0, 0, 2]], "angular_rate_deg": [0, 0, 0]}},
        "still",
    )
    outcome = compare(still, methods=["screw-raw"])["screw-raw"]
    assert outcome.estimate is None
    assert outcome.failure
    assert (outcome.rmse, outcome.coverage, outcome.axes) == (None, None, "inertial")
    with pytest.raises(InputError, match="screw-raw: has no result to draw"):
        outcome_figure(fly(still), outcome)


@pytest.mark.parametrize("methods, words", [(["magic"], "found 'magic'"), ([], "found none")])
def test_unknown_methods(methods, words):
    with pytest.raises(InputError, match=f"methods: {words}, expected some of {', '.join(METHODS)}"):
        compare("envisat", methods=methods)


def test_a_flight_is_written_as_it_is(scenario, tmp_path):
    flight = fly(scenario)
    tracks, truth, orbit = write_flight(flight, tmp_path / "small.csv")
    assert [path.name for path in (tracks, truth, orbit)] == ["small.csv", "small.truth.csv", "small.orbit.toml"]
    np.testing.assert_array_equal(FeatureTracks.read_csv(tracks).position, flight.tracks.position)
    assert load_orbit(orbit) == flight.scenario.orbit.of_simulation()
    columns = np.loadtxt(truth, delimiter=",", skiprows=1)
    np.testing.assert_array_equal(columns[:, 1:4], flight.true_path)
    with pytest.raises(InputError, match=r"ends in '\.txt', expected \.csv, \.parquet, \.nc or \.zarr"):
        write_flight(flight, "small.txt")
    parquet, *_ = write_flight(flight, tmp_path / "small.parquet")
    np.testing.assert_array_equal(read_tracks(parquet).position, flight.tracks.position)

"""The smoother and the lines of the world suite."""

from dataclasses import replace

import numpy as np
import pytest

from baryscope.estimator import PathOptions
from baryscope.study.population.consistency import nees
from baryscope.study.population.information import rms
from baryscope.study.population.motion import relative_motion
from baryscope.study.world.__main__ import main
from baryscope.study.world.forces import Burn
from baryscope.study.world.judging import can_be_told, judged, prepared, told
from baryscope.study.world.lasting_bound import lasting_bound
from baryscope.study.world.report import band, table
from baryscope.study.world.scenes import displaced, lasting, rows_of, scene
from baryscope.study.world.smoother import smoothed
from baryscope.study.world.told_bound import unknown_of_told
from baryscope.study.world.worlds import WORLDS


def test_the_smoother_is_a_least_squares_fit_without_process_noise():
    """A fixed pivot: c_k = g + R_k d, linear; the smoother's answer lies within its own deviation of that fit."""
    made, _ = prepared("pivot slips", 3, 0)
    found = smoothed(made.time, made.tracks.position, None)
    centroid = made.tracks.position.mean(axis=1)
    design = np.concatenate([np.tile(np.eye(3), (len(centroid), 1, 1)), made.attitude], axis=2)
    best, *_ = np.linalg.lstsq(design.reshape(-1, 6), centroid.ravel(), rcond=None)
    deviation = np.sqrt(np.trace(found.covariance[0]))
    assert np.linalg.norm(found.position[0] - best[:3]) < deviation / 3
    assert found.density == pytest.approx(WORLDS["pivot slips"].slip ** 2, rel=0.3)


def test_the_smoother_finds_the_density_of_white_acceleration():
    made, bounds = prepared("white 1e-10", 3, 0)
    found = smoothed(made.time, made.tracks.position, made.orbit)
    assert 1e-11 < found.density < 1e-9
    middle = len(made.time) // 2
    assert nees(found.position[middle] - made.path[middle], found.covariance[middle]) < 16.3
    assert bounds["free"] < np.sqrt(np.trace(found.covariance, axis1=1, axis2=2).mean()) < 3 * bounds["free"]


def test_bounds_of_white_acceleration_are_those_of_the_equations():
    """A prototype of the posterior bound, in numpy alone, gave these for another draw at 3.5 °/s."""
    for name, expected in (("as modelled", 0.65e-3), ("white 1e-12", 0.89e-3), ("white 1e-10", 2.2e-3)):
        _, bounds = prepared(name, 1, 1)
        assert bounds["tumble"] == pytest.approx(expected, rel=0.1)
        assert bounds["tumble"] <= bounds["free"]


def test_what_a_force_that_is_told_must_cost():
    """A factor more among six unknowns of a path costs √(7/6) if all weigh alike; what is known costs nothing."""
    for name in ("400 km, drag", "geostationary, light"):
        _, bounds = prepared(name, 1, 1)
        for kind in ("free", "tumble"):
            assert bounds[f"{kind} told"] == pytest.approx(bounds[kind] * np.sqrt(7 / 6), rel=0.03)
    _, bounds = prepared("J2", 1, 1)
    assert bounds["free told"] == bounds["free"]


def test_what_is_not_known_of_a_log_and_of_an_orbit():
    """Columns of what is told explain what it is off by, to the second order."""
    made, _ = prepared("thrust logged to 1 %", 1, 1)
    true = prepared("thrust logged", 1, 1)[0]
    columns = unknown_of_told(made).columns
    errors = np.concatenate([t.acceleration / b.acceleration - 1 for t, b in zip(true.burns, made.burns, strict=True)])
    assert np.abs(errors).max() < 0.04
    logged = replace(true, burns=made.burns)
    flown = [unknown_of_told(replace(made, burns=one.burns)).columns.sum(axis=2) for one in (true, logged)]
    change = np.abs(flown[0] - flown[1]).max()
    np.testing.assert_allclose(columns @ errors, flown[0] - flown[1], atol=1e-3 * change)

    wrong, right = (prepared(name, 1, 1)[0] for name in ("orbit file wrong", "J2"))
    shift, axis = np.array([300.0, -200.0, 400.0]), np.array([0.004, 0.002, -0.006])
    column = unknown_of_told(wrong).columns @ np.concatenate([shift, axis])
    start = np.array([[0.0, -20, 0, 0, 0, 0]])
    moved, here = (
        relative_motion(orbit, start, wrong.time)[0][0, :, :3]
        for orbit in (displaced(wrong.orbit, shift, axis), wrong.orbit)
    )
    np.testing.assert_allclose(column, here - moved, atol=0.02 * np.abs(moved - here).max())
    assert unknown_of_told(right) is None


def test_the_bound_of_errors_that_last_is_that_of_white_ones_where_they_do_not():
    made, bounds = prepared("as modelled", 1, 2)
    white = replace(made, world=replace(made.world, error_time=1e-9))
    for turn, expected in ((None, bounds["free"]), (made.turn, bounds["tumble"])):
        path = made.jacobian @ lasting_bound(white, turn) @ np.swapaxes(made.jacobian, 1, 2)
        assert rms(path) == pytest.approx(expected, rel=1e-9)


def test_the_bound_of_errors_that_last_a_little_is_that_of_fewer_frames():
    """Errors that are much shorter than the turn cost as much as white ones of 1 + 2 Σ keep^k times the variance."""
    lasts, white = prepared("errors last 5 s", 1, 2)[1], prepared("as modelled", 1, 2)[1]
    keep = np.exp(-600 / 599 / 5)
    for kind in ("free", "tumble"):
        assert lasts[kind] == pytest.approx(white[kind] * np.sqrt((1 + keep) / (1 - keep)), rel=0.05)


def test_errors_last_as_long_as_they_shall():
    time = np.arange(20_000.0)
    found = lasting(np.random.default_rng(1).standard_normal((len(time), 3)), time, 5.0)
    # A correlation of n values is known to √((1 + a²)/(1 − a²)/n) at most.
    assert np.mean(found[1:] * found[:-1]) == pytest.approx(np.exp(-1 / 5), abs=4 * np.sqrt(5 / 60_000))
    assert np.var(found) == pytest.approx(1.0, abs=4 * np.sqrt(2 * 5 / 60_000))
    assert np.array_equal(lasting(found, time, 0.0), found)


def test_the_band_is_that_of_chi_square():
    low, high = band(100)
    assert low < 3 < high
    assert high - low == pytest.approx(2 * 1.96 * np.sqrt(6 / 100), rel=0.01)


def test_a_row_is_the_mean_of_its_lines():
    lines = [judged("pivot slips", 1, draw, "pivot") for draw in range(2)]
    made = table(lines)
    row = dict(zip(made.headings, made.rows[0], strict=True))
    expected = 1e3 * np.sqrt(np.mean([line["rmse"] ** 2 for line in lines]))
    assert float(row["rms error mm"]) == pytest.approx(expected, rel=5e-3)
    assert float(row["NEES"]) == pytest.approx(np.mean([line["nees"] for line in lines]), rel=5e-3)


def test_a_world_without_answers_has_a_row():
    refusal = {"world": "J2", "method": "ml", "failure": "other", "wall": 1.0, "bound": 1e-3}
    made = table([refusal, refusal])
    row = dict(zip(made.headings, made.rows[0], strict=True))
    assert (row["draws"], row["refused"], row["rms error mm"], row["announced"]) == ("2", "2", "-", "-")


def test_a_run_is_resumed_and_reported(tmp_path, in_process, capsys):
    output = str(tmp_path / "worlds.jsonl")
    for _ in range(2):
        main(["run", "--draws", "1", "--worlds", "pivot slips", "--methods", "pivot,pivot told", "-o", output])
    assert main(["report", output]) == 0
    assert capsys.readouterr().out.count("| pivot |") == 1


def test_a_log_holds_the_sum_of_burns_that_overlap():
    one, other = Burn(1.0, 4.0, np.array([1.0, 0, 0])), Burn(3.0, 5.0, np.array([0, 2.0, 0]))
    time, held = rows_of((one, other), 10.0)
    np.testing.assert_array_equal(time, [0, 1, 3, 4, 5, 10])
    np.testing.assert_array_equal(held[:, :2], [[0, 0], [1, 0], [1, 2], [0, 2], [0, 0], [0, 0]])


def test_what_can_be_told_is_told():
    names = {name for name, world in WORLDS.items() if can_be_told(world)}
    assert "thrust not logged" not in names
    for name in names:
        made = scene(WORLDS[name], 1, 0)
        orbit, options = told(made, PathOptions())
        assert orbit.j2 is not None or options != PathOptions() or made.camera is not None
        assert orbit.accuracy == (None if made.world.wrong_orbit else 0)


def test_burns_are_not_left_to_a_camera_that_shakes():
    """Frames that may be anywhere by a decimetre fit any burns: their freedom counts. Bounds are of known burns."""
    line = judged("thrust not logged", 1, 7, "pivot")
    assert [name.split()[0] for name in line["findings"]] == 3 * ["UnknownBurn"]
    assert line["rmse"] < 4 * line["bound"]

"""`baryscope bound`: the scenario's own, and the table over its variants."""

import csv
import re

import numpy as np
import pytest
from matplotlib.image import imread

from baryscope import __version__
from baryscope.estimator.bound import cramer_rao_bound
from baryscope.estimator.camera.rig import Rig
from baryscope.estimator.prose import verdict
from baryscope.models.errors import InputError
from baryscope.models.scenario import Scenario, load_scenario
from baryscope.scripts.cli import app
from baryscope.study.bounds import Grid, Variant, bound_table, variant_of
from malformed import GOOD_SCENARIO

RIG = "stereo = { focal_length = 1911.0, baseline = 1.0, pixel_noise = 0.5 }"


@pytest.fixture
def scenario_file(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(GOOD_SCENARIO, encoding="utf-8")
    return path


@pytest.fixture
def stereo_file(tmp_path):
    path = tmp_path / "rig.toml"
    path.write_text(GOOD_SCENARIO.replace("noise = 0.02", RIG), encoding="utf-8")
    return path


def rows(path):
    with path.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def test_the_scenario_itself_in_a_few_lines(scenario_file, capsys):
    assert app.main(["bound", "--scenario", str(scenario_file)]) == 0
    text = capsys.readouterr().out
    found = cramer_rao_bound(load_scenario(str(scenario_file)))
    assert f"Cramér–Rao bound on path RMSE  {1000 * found.position_deviation:.3g} mm" in text
    assert f"attitude                       {np.rad2deg(found.attitude_deviation):.3g}°" in text
    assert f"angular rate                   {np.rad2deg(found.rate_deviation):.3g} °/s" in text
    assert verdict(found.observability) in text
    assert len(text.splitlines()) < 10


def test_forces_that_the_bound_leaves_out_are_named(tmp_path, capsys):
    path = tmp_path / "drag.toml"
    drag = "\n[drag]\ndensity = 1e-13\nscale_height = 7e4\ntarget = 0.02\nchaser = 0.03\n"
    path.write_text(GOOD_SCENARIO + drag, encoding="utf-8")
    assert app.main(["bound", "--scenario", str(path)]) == 0
    assert f"{path}: the bound takes no account of its drag\n" in capsys.readouterr().err


def test_a_variant_is_what_a_file_with_these_numbers_is(stereo_file):
    base = load_scenario(str(stereo_file))
    changed = Variant(features=3, baseline=0.5, rate=7.0, range=30.0, duration=80.0).of(base)
    np.testing.assert_allclose(changed.chaser.position, [0, -30, 0])
    np.testing.assert_allclose(np.linalg.norm(changed.target.angular_rate_deg), 7.0)
    np.testing.assert_allclose(np.cross(changed.target.angular_rate_deg, base.target.angular_rate_deg), 0, atol=1e-12)
    assert (changed.duration, changed.sensor.stereo.baseline) == (80.0, 0.5)
    assert changed.features.labels == ("a", "b", "c")
    assert [interval.features for interval in changed.tracking.intervals] == [("a", "b", "c"), ("b", "c")]
    assert variant_of(base).of(base).model_dump(exclude={"run"}) == base.model_dump(exclude={"run"})


def test_intervals_in_which_nothing_is_left(stereo_file):
    text = GOOD_SCENARIO.replace('features = ["a", "b", "c"]', 'features = ["d"]').replace('["b", "c", "d"]', '["d"]')
    stereo_file.write_text(text, encoding="utf-8")
    base = load_scenario(str(stereo_file))
    with pytest.raises(InputError, match="none of which an interval of tracking names"):
        Variant(3, None, 1.0, 10.0, 100.0).of(base)


def test_a_velocity_is_scaled_with_the_range(scenario_file):
    base = load_scenario(str(scenario_file))
    moving = Scenario.parse(base.model_dump() | {"chaser": {"position": (0, -10, 0), "velocity": (0.01, 0, 0)}}, "here")
    assert Variant(4, None, 1.0, 40.0, 100.0).of(moving).chaser.velocity == pytest.approx((0.04, 0, 0))


def test_the_table_holds_the_bound_of_each_variant(stereo_file, tmp_path, capsys):
    folder = tmp_path / "out"
    lists = ["--durations", "50,100", "--ranges", "20,10", "--rates", "2,4", "--features", "3,4", "--baselines", "1"]
    assert app.main(["bound", "--scenario", str(stereo_file), *lists, "-o", str(folder)]) == 0
    table = rows(folder / "bound.csv")
    assert len(table) == 16
    assert [float(row["duration"]) for row in table[:4]] == [50, 100, 50, 100]
    assert [float(row["range"]) for row in table[:4]] == [10, 10, 20, 20]
    base = load_scenario(str(stereo_file))
    for row in (table[0], table[7], table[15]):
        variant = Variant(
            int(row["features"]), 1.0, float(row["rate_deg"]), float(row["range"]), float(row["duration"])
        )
        found = cramer_rao_bound(variant.of(base))
        assert float(row["path_rmse"]) == pytest.approx(found.position_deviation, rel=1e-12)
        assert float(row["attitude_deg"]) == pytest.approx(np.rad2deg(found.attitude_deviation), rel=1e-12)
        assert row["verdict"] == verdict(found.observability)
    assert {path.name for path in folder.iterdir()} == {
        "bound.csv", "bound.md", "bound-3-features-baseline-1-m.png", "bound-4-features-baseline-1-m.png",
    }  # fmt: skip
    assert imread(folder / "bound-4-features-baseline-1-m.png")[..., :3].std() > 0.05
    text = (folder / "bound.md").read_text(encoding="utf-8")
    assert text.count("\n| ") == 18
    assert f"baryscope {__version__}" in text
    assert max(len(line) for line in capsys.readouterr().out.splitlines()[:-1]) <= 80


def test_more_of_everything_makes_the_bound_lower(stereo_file):
    base = load_scenario(str(stereo_file))

    def path(*variant):
        return cramer_rao_bound(Variant(*variant).of(base)).position_deviation

    usual = path(4, 1.0, 3.7, 10.0, 100.0)
    assert path(4, 1.0, 3.7, 10.0, 40.0) > usual
    assert path(4, 1.0, 3.7, 20.0, 100.0) > usual
    assert path(4, 1.0, 0.5, 10.0, 100.0) > usual
    assert path(4, 0.5, 3.7, 10.0, 100.0) > usual
    assert path(3, 1.0, 3.7, 10.0, 100.0) > usual


def test_what_is_not_observable_has_a_verdict_instead_of_a_number(scenario_file, tmp_path, capsys):
    """A turn of 0.1 degrees in 10 s shows no centre of mass; one of 300 degrees does."""
    folder = tmp_path / "out"
    arguments = ["--durations", "10,100", "--rates", "0.01,3", "-o", str(folder)]
    assert app.main(["bound", "--scenario", str(scenario_file), *arguments]) == 0
    first, *_, last = rows(folder / "bound.csv")
    assert (first["path_rmse"], first["com_rmse"]) == ("", "")
    assert "not observable" in first["verdict"]
    assert float(last["path_rmse"]) < 0.1
    printed = capsys.readouterr().out
    assert re.search(r"10 s\s+unobservable", printed)
    assert "unobservable: the centre of mass is not observable" in printed
    assert (folder / "bound.png").exists()


def test_a_variant_that_is_not_possible_does_not_spoil_the_others(scenario_file, capsys):
    """The features reach 1.1 m from the centre of mass; in 1 s there are 2 samples, and 3 are needed."""
    assert app.main(["bound", "--scenario", str(scenario_file), "--durations", "1,100"]) == 0
    printed = capsys.readouterr().out
    assert re.search(r"1 s\s+none", printed)
    assert "none: mine, 1 s at 10 m" in printed


def test_if_none_is_possible_the_reason_is_the_error(scenario_file, capsys):
    assert app.main(["bound", "--scenario", str(scenario_file), "--durations", "0.5,1"]) == 2
    assert "mine, 0.5 s at 10 m" in capsys.readouterr().err


def test_without_noise_there_is_no_bound(scenario_file, tmp_path, capsys):
    scenario_file.write_text(GOOD_SCENARIO.replace("noise = 0.02", "noise = 0.0"), encoding="utf-8")
    for extra in ([], ["--rates", "1,2", "-o", str(tmp_path / "out")]):
        assert app.main(["bound", "--scenario", str(scenario_file), *extra]) == 1
        assert "sensor.noise is 0" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_table_without_lists_takes_the_usual_ones(scenario_file, stereo_file, capsys):
    for path in (scenario_file, stereo_file):  # fewer samples, to be fast
        path.write_text(path.read_text(encoding="utf-8").replace("sample_time = 1.0", "sample_time = 10.0"), "utf-8")
    assert app.main(["bound", "--scenario", str(scenario_file), "--table"]) == 0
    plain = capsys.readouterr().out
    assert app.main(["bound", "--scenario", str(stereo_file), "--table"]) == 0
    stereo = capsys.readouterr().out
    assert "1200 s" in plain
    assert "80 m" in stereo
    assert "80 m" not in plain  # noise that does not grow with range


@pytest.mark.parametrize("arguments, words", [
    (["--durations", "60,x"], "--durations: found '60,x', expected numbers above 0"),
    (["--durations", ""], "--durations: found '', expected numbers above 0"),
    (["--ranges", "-5"], "--ranges: found '-5'"),
    (["--rates", "inf"], "--rates: found 'inf'"),
    (["--features", "3.5"], "--features: found '3.5', expected whole numbers"),
    (["--features", "2,4"], "features: found 2,4, expected 3 to the scenario's 4"),
    (["--features", "5"], "features: found 5, expected 3 to the scenario's 4"),
    (["--baselines", "1"], "baselines: found with a scenario without sensor.stereo"),
    (["--trajectory", "spiral"], "spiral"),
    (["--trajectory", "polynomial"], "expected its degree"),
])  # fmt: skip
def test_wrong_arguments(scenario_file, tmp_path, capsys, arguments, words):
    before = sorted(tmp_path.iterdir())
    joined = [arguments[0] + "=" + arguments[1]]
    assert app.main(["bound", "--scenario", str(scenario_file), *joined]) == 2
    assert words in capsys.readouterr().err.splitlines()[-1]
    assert sorted(tmp_path.iterdir()) == before


def test_a_target_that_does_not_turn_has_no_rate_to_scale(scenario_file, capsys):
    text = GOOD_SCENARIO.replace("angular_rate_deg = [1.0, 2.0, 3.0]", "angular_rate_deg = [0.0, 0.0, 0.0]")
    scenario_file.write_text(text, encoding="utf-8")
    assert app.main(["bound", "--scenario", str(scenario_file), "--rates", "1"]) == 2
    assert "a target that does not turn" in capsys.readouterr().err
    own = bound_table(str(scenario_file), Grid())
    assert not own.cells[0].observable
    assert app.main(["bound", "--scenario", str(scenario_file), "--table"]) == 0
    assert "0 °/s" in capsys.readouterr().out


def test_with_process_noise_a_camera_and_a_prediction(scenario_file, tmp_path, capsys):
    rig = tmp_path / "camera.toml"
    rig.write_text("[rig]\nscale_deviation = 1e-3\n", encoding="utf-8")
    command = ["bound", "--scenario", str(scenario_file), "--process-noise", "1e-8", "--rig", str(rig)]
    assert app.main([*command, "--predict", "30"]) == 0
    text = capsys.readouterr().out
    consider = Rig(scale_deviation=1e-3)
    found = cramer_rao_bound(load_scenario(str(scenario_file)), process_noise=1e-8, consider=consider, predict=30.0)
    assert "path relative-orbit with process noise of 1e-08 m²/s³" in text
    assert f"path RMSE  {1000 * found.position_deviation:.3g} mm" in text
    assert f"centre of mass 30 s ahead  {1000 * found.predicted_deviation:.3g} mm" in text
    assert app.main([*command, "--durations", "60", "--predict", "30"]) == 2
    assert "--predict: found with a table, expected the scenario alone" in capsys.readouterr().err

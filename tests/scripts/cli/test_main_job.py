"""compare, simulate, build and estimate on real, short runs."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread
from scipy.spatial.transform import Rotation

from baryscope import __version__
from baryscope.estimator.bound import cramer_rao_bound
from baryscope.estimator.methods import METHODS
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.scenario import load_scenario
from baryscope.scripts.cli import app
from baryscope.study import pictures

SHORT = """
[target]
inertia = [[17023.3, 397.1, -2171.4], [397.1, 124825.7, 344.2], [-2171.4, 344.2, 129112.2]]
angular_rate_deg = [3.38, 0.45, 0.77]

[features]
points = [
    { label = "a", position = [-6.1, 1.4, -1.2], normal = [-1, 1, -1] },
    { label = "b", position = [3.9, 1.4, 0.9], normal = [1, 1, 1] },
    { label = "c", position = [-1.1, -1.4, -1.2], normal = [0, 0, -1] },
    { label = "d, hinge", position = [3.9, 0.2, 0.5], normal = [1, 0, 0] },
]

[orbit]
semi_major_axis = 7150e3
eccentricity = 0.001
inclination_deg = 98.55

[chaser]
position = [0.0, -20.0, 0.0]

[tracking]
intervals = [
    { start = 0, end = 170, features = ["a", "b", "c"] },
    { start = 200, end = 400, features = ["a", "b", "c", "d, hinge"] },
]

[sensor]
noise = 0.01

[run]
duration = 400
"""


def rows(path):
    with path.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def path_of(table):
    return np.array([[float(row[c]) for c in "xyz"] for row in table])


@pytest.fixture(scope="module")
def scenario_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("scenario") / "short.toml"
    path.write_text(SHORT)
    return path


@pytest.fixture(scope="module")
def compared(scenario_file, tmp_path_factory):
    folder = tmp_path_factory.mktemp("compared") / "out"
    assert app.main(["compare", "--scenario", str(scenario_file), "-o", str(folder)]) == 0
    return folder


SCREWS = ("screw-raw", "screw-ls", "screw-gpa", "screw-gpa-lvlh")
STEMS = (*SCREWS, *(method for method in METHODS if method not in SCREWS))


def test_compare_writes_what_it_promises_and_nothing_else(compared):
    expected = {
        "TumblingTarget.fmu",
        "tracks.csv",
        "tracks.truth.csv",
        "tracks.orbit.toml",
        "summary.md",
        "report.html",
        "comparison.png",
    }
    expected |= {f"{stem}{suffix}" for stem in STEMS for suffix in (".csv", ".json", ".png")}
    assert {path.name for path in compared.iterdir()} == expected


def test_the_table_holds_the_errors_of_the_files(compared, scenario_file, capsys):
    app.main(["compare", "--scenario", str(scenario_file), "-o", str(compared), "--methods", "screw-gpa"])
    printed = capsys.readouterr().out
    truth = path_of(rows(compared / "tracks.truth.csv"))
    for stem in ("screw-gpa", "screw-gpa-lvlh"):
        error = np.linalg.norm(path_of(rows(compared / f"{stem}.csv")) - truth, axis=1)
        for number in (np.sqrt(np.mean(error**2)), error.max()):
            assert f"{1000 * number:.2f}" in printed
            assert f" {1000 * number:.2f} " in (compared / "summary.md").read_text(encoding="utf-8")


def test_lvlh_axes_take_the_bias_away(compared):
    truth = path_of(rows(compared / "tracks.truth.csv"))
    error = {stem: np.sqrt(np.mean((path_of(rows(compared / f"{stem}.csv")) - truth) ** 2) * 3) for stem in SCREWS}
    assert error["screw-gpa"] > 0.2
    assert error["screw-gpa-lvlh"] < error["screw-gpa"] / 20


def test_pivot_and_ml_come_near_the_bound_and_say_so(compared, scenario_file):
    """One draw: six numbers of the path, so that its error is within 2.5 times the bound in all but 1 of 10⁴ draws."""
    truth = path_of(rows(compared / "tracks.truth.csv"))
    bound = cramer_rao_bound(load_scenario(str(scenario_file))).position_deviation
    for stem, worse in (("pivot", 1.5), ("ml", 1.0)):
        error = np.sqrt(np.mean((path_of(rows(compared / f"{stem}.csv")) - truth) ** 2) * 3)
        facts = json.loads((compared / f"{stem}.json").read_text(encoding="utf-8"))
        assert error < 2.5 * worse * bound
        assert 0.95 * bound < facts["predicted_rmse"] < 1.2 * worse * bound
        assert facts["converged"]
        assert facts["observability"]["verdict"].startswith("observable")


def test_pictures_show_something(compared):
    for stem in STEMS:
        picture = imread(compared / f"{stem}.png")
        assert min(picture.shape[:2]) > 500
        assert picture[..., :3].std() > 0.05


def test_the_summary_says_what_made_it(compared):
    text = (compared / "summary.md").read_text(encoding="utf-8")
    for words in (f"baryscope {__version__}", "seed 1", "noise 0.01 m", "401 frames", "chosen from the data: lag"):
        assert words in text


def test_estimate_repeats_what_compare_did_from_its_files(compared, tmp_path, capsys):
    for extra, stem in (
        (["--method", "screw-gpa"], "screw-gpa"),
        (["--axes", "lvlh", "--orbit", str(compared / "tracks.orbit.toml")], "screw-gpa-lvlh"),
        (["--orbit", str(compared / "tracks.orbit.toml")], "pivot"),
        (["--method", "ml", "--orbit", str(compared / "tracks.orbit.toml")], "ml"),
    ):
        output = tmp_path / f"{stem}.csv"
        assert app.main(["estimate", str(compared / "tracks.csv"), *extra, "-o", str(output)]) == 0
        np.testing.assert_allclose(path_of(rows(output)), path_of(rows(compared / f"{stem}.csv")), atol=1e-9)
        facts = json.loads(output.with_suffix(".json").read_text(encoding="utf-8"))
        assert facts["version"] == __version__
        assert stem.startswith(facts["method"])
    assert "401 positions from 2 clusters" in capsys.readouterr().out


def test_options_of_estimate_reach_the_method(compared, tmp_path):
    output = tmp_path / "e.csv"
    chosen = ["--lag", "12", "--cutoff", "0.05", "--degree", "3", "--reference", "first"]
    assert app.main(["estimate", str(compared / "tracks.csv"), *chosen, "-o", str(output)]) == 0
    facts = json.loads(output.with_suffix(".json").read_text(encoding="utf-8"))
    options = facts["options"]
    assert (options["lag"], options["cutoff"], options["degree"], options["reference"]) == (12, 0.05, 3, "first")
    assert facts["details"]["chosen_from_data"] == []


def test_estimate_takes_tracks_of_somebody_else(tmp_path, monkeypatch):
    """A body on a turntable that itself is turned, at 50 Hz, with labels of any kind; no orbit, no unit."""
    monkeypatch.chdir(tmp_path)
    time = np.arange(0, 8, 0.02)
    markers = np.array([[0.3, 0.1, 0.0], [-0.2, 0.25, 0.1], [0.0, -0.3, 0.2], [0.1, 0.1, -0.3]])
    turn = Rotation.from_rotvec(np.outer(1.5 * time, [0, 0, 1])) * Rotation.from_rotvec(np.outer(0.9 * time, [1, 0, 0]))
    positions = np.array([1.0, 2.0, 3.0]) + np.stack([turn.apply(marker) for marker in markers], axis=1)
    with Path("mocap.csv").open("w", encoding="utf-8") as stream:
        stream.write("time,feature,x,y,z\n")
        for k, t in enumerate(time):
            for label, (x, y, z) in zip(("épaule", "2", "a b", "#"), positions[k], strict=True):
                stream.write(f"{t},{label},{x},{y},{z}\n")
    assert app.main(["estimate", "mocap.csv", "--degree", "0"]) == 0
    np.testing.assert_allclose(path_of(rows(Path("mocap.estimate.csv"))), [[1, 2, 3]] * time.size, atol=1e-6)


def test_simulate_takes_a_unit_that_was_built_before(scenario_file, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert app.main(["build", "--scenario", str(scenario_file)]) == 0
    assert app.main(["simulate", "--scenario", str(scenario_file), "--fmu", "short.fmu", "-o", "one.csv"]) == 0
    assert app.main(["simulate", "--scenario", str(scenario_file), "-o", "two.csv"]) == 0
    assert Path("one.csv").read_bytes() == Path("two.csv").read_bytes()
    tracks = FeatureTracks.read_csv(Path("one.csv"))
    assert tracks.time.size == 401
    assert not tracks.seen[(tracks.time >= 170) & (tracks.time < 200)].any()
    assert "observations at 401 times" in capsys.readouterr().out


def test_a_unit_with_another_number_of_features_is_refused(scenario_file, envisat_fmu, tmp_path, capsys):
    arguments = ["simulate", "--scenario", str(scenario_file), "--fmu", str(envisat_fmu), "-o", str(tmp_path / "x.csv")]
    assert app.main(arguments) == 2
    said = capsys.readouterr().err
    assert "target.features: found shape (4, 3), expected (12, 3)" in said
    assert f"baryscope: short in {envisat_fmu}: target" in said
    assert list(tmp_path.iterdir()) == []


def test_what_cannot_be_computed_exits_with_1(tmp_path, capsys):
    tracks = tmp_path / "two.csv"
    tracks.write_text("time,feature,x,y,z\n" + "".join(f"{t},a,1,2,{t}\n{t},b,2,1,{t}\n" for t in range(10)))
    assert app.main(["estimate", str(tracks)]) == 1
    assert "at least 3 are needed" in capsys.readouterr().err.splitlines()[-1]
    assert [path.name for path in tmp_path.iterdir()] == ["two.csv"]


def test_compare_goes_on_when_a_method_cannot(scenario_file, tmp_path, capsys):
    text = SHORT.replace("angular_rate_deg = [3.38, 0.45, 0.77]", "angular_rate_deg = [0.0, 0.0, 0.0]")
    still = tmp_path / "still.toml"
    still.write_text(text)
    folder = tmp_path / "out"
    methods = ["--methods", "screw-raw,screw-gpa"]
    assert app.main(["compare", "--scenario", str(still), *methods, "-o", str(folder)]) == 1
    captured = capsys.readouterr()
    assert "no method could be carried out" in captured.err.splitlines()[-1]
    assert "Could not be carried out" in (tmp_path / "out" / "summary.md").read_text(encoding="utf-8")


def test_without_matplotlib_there_are_no_pictures_but_everything_else(scenario_file, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(pictures, "find_spec", lambda name: None)
    folder = tmp_path / "out"
    assert app.main(["compare", "--scenario", str(scenario_file), "--methods", "screw-gpa", "-o", str(folder)]) == 0
    assert capsys.readouterr().err.count("baryscope[report]") == 1
    assert {path.suffix for path in folder.iterdir()} == {".fmu", ".csv", ".html", ".json", ".md", ".toml"}
    assert ".png" not in (folder / "summary.md").read_text(encoding="utf-8")


def test_a_stereo_rig_with_outliers_from_simulate_to_estimate(tmp_path, capsys):
    """The covariances go through the file, and what was drawn wrong is what is rejected."""
    rig = (
        "stereo = { focal_length = 1911.0, baseline = 1.0, pixel_noise = 0.5 }\noutliers = { share = 0.1, size = 3.0 }"
    )
    path, tracks = tmp_path / "stereo.toml", tmp_path / "tracks.csv"
    path.write_text(SHORT.replace("noise = 0.01", rig))
    assert app.main(["simulate", "--scenario", str(path), "-o", str(tracks)]) == 0
    assert FeatureTracks.read_csv(tracks).covariance is not None
    orbit = tmp_path / "tracks.orbit.toml"
    truth = path_of(rows(tmp_path / "tracks.truth.csv"))
    bound = cramer_rao_bound(load_scenario(str(path))).position_deviation
    for method in ("pivot", "ml"):
        output = tmp_path / f"{method}.csv"
        chosen = ["--method", method, "--orbit", str(orbit), "-o", str(output)]
        assert app.main(["estimate", str(tracks), *chosen]) == 0
        error = np.sqrt(np.mean((path_of(rows(output)) - truth) ** 2) * 3)
        facts = json.loads(output.with_suffix(".json").read_text(encoding="utf-8"))
        assert error < 4 * bound  # one draw of six numbers; pivot has three and four features to find attitudes from
        noise = {"a_priori": None, "a_posteriori": pytest.approx(1, abs=0.075), "unit": "1", "lasting": 1.0}
        assert facts["noise"] == noise
        # Of 1,311 observations 131 ± 11 are off by 3 m rms; of these some are too near to tell from the rig's 0.15 m.
        assert facts["rejected"]["share"] == pytest.approx(0.095, abs=0.03)
    assert "times that of the tracks' covariances" in capsys.readouterr().out

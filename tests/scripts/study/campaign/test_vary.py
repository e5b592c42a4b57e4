"""Numbers of a scenario over ranges: how they are named, refused, drawn and set."""

import json
import tomllib

import numpy as np
import pytest
from scipy.stats import kstest

from baryscope.models.errors import InputError
from baryscope.models.scenario import Scenario
from baryscope.models.scenario.schema import lists_to_tuples
from baryscope.scripts.cli import app
from baryscope.study.campaign import drawn, plan_of
from baryscope.study.campaign.vary import (
    hypercube,
    items_of,
    items_of_table,
    prepared,
    ranges_of,
    values_at,
    with_values,
)
from documents import fences, text_of
from malformed import GOOD_SCENARIO

STUDY = """\
base = "./small.toml"
methods = ["pivot"]
draws = 7
seed = 5
[vary]
attitude = true
anomaly = false
sensor.noise = [0.01, 0.1, "log"]
chaser.position = [5, 20]
"""


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("vary") / "small.toml"
    path.write_text(GOOD_SCENARIO, encoding="utf-8")
    return str(path)


def varied(file, *items, draws=50):
    return plan_of([file], methods=["pivot"], draws=draws, vary=items)


@pytest.mark.parametrize("item, words", [
    ("sensor.noise=0.1", "vary: found 'sensor.noise=0.1', expected none or some of attitude, anomaly and FIELD="),
    ("sensor.noise=0.1:0.05", "vary sensor.noise: found 0.1:0.05, expected two numbers, the smaller first"),
    ("sensor.noise=0.1:far", "vary sensor.noise: found 0.1:far, expected two numbers"),
    ("sensor.noise=0.1:inf", "vary sensor.noise: found 0.1:inf, expected two numbers"),
    ("sensor.noise=0:0.1:log", "vary sensor.noise: found 0:0.1:log, expected numbers above 0 for log"),
    ("sensor.nose=0:1", "vary sensor.nose: unknown field, expected noise in m"),
    ("colour=0:1", "vary colour: unknown field, expected one of name, description, target"),
    ("sensor.noise.2=0:1", "vary sensor.noise[2]: unknown field, expected a value without fields"),
    ("target.angular_rate_deg.x=0:1", "vary target.angular_rate_deg.x: unknown field, expected a place in its list"),
    ("target.angular_rate_deg.3=0:1", "small has no target.angular_rate_deg.3, expected a field that is there"),
    ("sensor.stereo.baseline=1:2", "small has no sensor.stereo, expected a field that is there"),
    ("target.gravity_gradient=0:1", "is no number in small, expected a number or a vector of three"),
    ("target.inertia=0:1", "is no number in small"),
    ("chaser.velocity=0:1", "is zero in small, expected a vector with a direction to keep"),
    ("target.angular_rate_deg=-1:1", "found -1, expected a length of at least 0 for a vector"),
    ("sensor.outliers.sliding=0.5:2", "is a whole number, expected whole limits and no log"),
    ("run.seed=1:9", "vary run.seed: each draw has its own, expected another field"),
    ("sensor.noise=-0.1:0.1", "small with sensor.noise = -0.1: sensor.noise: found -0.1, expected a value of at"),
    ("sensor.dropout=0:1.5", "small with sensor.dropout = 1.5: sensor.dropout: found 1.5, expected a value below 1"),
    ("target.inertia.0.0=0.5:2", "small with target.inertia.0.0 = 0.5: target.inertia: found largest principal moment"),
    ("chaser.position=0:10", "small with chaser.position = 0: chaser.position: found range in m 0"),
    ("orbit.j2=0.001:0.002", "small with orbit.j2 = 0.001: orbit"),
])  # fmt: skip
def test_what_cannot_vary_is_refused_before_anything_runs(file, item, words, tmp_path, capsys):
    code = app.main(["campaign", "--scenario", file, "--vary", item, "-o", str(tmp_path / "none")])
    error = capsys.readouterr().err
    assert code == 2
    assert words in error
    assert error.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("items, words", [
    (["sensor/noise=1:2"], "vary: found 'sensor/noise=1:2', expected none or some of"),
    (["target.attitude.0=0:1", "attitude"], "vary target.attitude: found beside attitude"),
    (["orbit.true_anomaly_deg=0:90", "anomaly"], "orbit.true_anomaly_deg: found beside anomaly, expected one of them"),
    (["chaser.position.1=1:2", "chaser.position[1]=3:4"], "chaser.position.1: stands 2 times, expected each"),
])  # fmt: skip
def test_items_that_contradict_each_other(items, words):
    with pytest.raises(InputError) as refusal:
        items_of(items)
    assert words in str(refusal.value)


def test_corners_that_only_together_make_no_scenario_are_refused(file):
    """Each range is right where the others are in their middle; the longest axis and the flattest ellipse are not."""
    ranges = ["orbit.semi_major_axis=6.6e6:7.4e6", "orbit.eccentricity=0.0:0.055"]
    with pytest.raises(InputError, match=r"small with orbit\.semi_major_axis = 6600000, orbit\.eccentricity = 0\.055"):
        varied(file, *ranges)


def test_each_part_of_a_range_has_one_draw(file):
    """A Latin hypercube: of n draws one in each nth of the range; in its logarithm, where that is asked."""
    plan = varied(
        file, "attitude", "sensor.noise=0.001:0.1:log", "sensor.dropout=0.1:0.3", "sensor.outliers.sliding=0:4"
    )
    draws = [drawn(plan.case("small", number)) for number in range(50)]
    noise = np.log10([draw.sensor.noise for draw in draws])
    assert sorted(np.floor((noise + 3) / 2 * 50)) == list(range(50))
    assert sorted(np.floor((np.array([draw.sensor.dropout for draw in draws]) - 0.1) / 0.2 * 50)) == list(range(50))
    sliding = [draw.sensor.outliers.sliding for draw in draws]
    assert [sliding.count(count) for count in range(5)] == [10] * 5
    assert len({draw.target.attitude for draw in draws}) == 50
    assert {draw.orbit for draw in draws} == {draws[0].orbit}
    assert abs(np.corrcoef(noise, sliding)[0, 1]) < 0.5  # 3.5 of its standard deviations


def test_draws_of_a_hypercube_depend_on_the_seed_alone():
    ranges = ranges_of(("sensor.noise=0:1", "sensor.dropout=0:1"))
    shares = hypercube(ranges, 1000, 4)
    np.testing.assert_array_equal(shares, hypercube(ranges, 1000, 4))
    assert np.abs(shares - hypercube(ranges, 1000, 5)).max() > 0.5
    assert kstest(shares[:, 1], "uniform").pvalue > 0.99  # stratified: nearer to uniform than random numbers are
    assert [value for _, value in values_at([0.0, 1.0], ranges)] == [0.0, 1.0]


def test_vectors_keep_their_direction_and_tensors_stay_symmetric(file):
    ranges = ranges_of(("target.angular_rate_deg=1:8", "target.inertia.0.1=0:0.2", "chaser.velocity.2=0:1"))
    base = plan_of([file]).entries[0].data
    before = json.dumps(base)
    data = prepared(base, ranges, "small")
    changed = with_values(
        data, (("target.angular_rate_deg", 7.0), ("target.inertia.0.1", 0.15), ("chaser.velocity.2", 0.5))
    )
    scenario = Scenario.parse(changed, "changed")
    assert scenario.target.angular_rate_deg == pytest.approx(7 / np.sqrt(14) * np.array([1, 2, 3]))
    assert scenario.target.inertia == ((2.0, 0.15, 0.0), (0.15, 3.0, 0.2), (0.0, 0.2, 4.0))
    assert scenario.chaser.velocity == (0.0, 0.0, 0.5)
    assert json.dumps(base) == before


def test_a_run_says_its_values(file):
    plan = varied(file, "anomaly", "sensor.noise=0.01:0.02", draws=3)
    assert plan.command.endswith("--vary anomaly sensor.noise=0.01:0.02")
    case = plan.case("small", 2)
    assert dict(case.values) == {"sensor.noise": drawn(case).sensor.noise}
    with pytest.raises(InputError, match="small, draw 3: found no such draw, expected 0 to 2 of small"):
        plan.case("small", 3)


def test_a_study_is_one_file(tmp_path):
    """Its base is another file here, seen from its own folder; options go before what it says."""
    study = tmp_path / "study.toml"
    base = tmp_path / "small.toml"
    base.write_text(GOOD_SCENARIO, encoding="utf-8")
    study.write_text(STUDY, encoding="utf-8")
    plan = plan_of((), str(study))
    assert (plan.draws, plan.seed, plan.methods) == (7, 5, ("pivot",))
    assert plan.vary == ("attitude", "sensor.noise=0.01:0.1:log", "chaser.position=5:20")
    assert [entry.name for entry in plan.entries] == ["small"]
    assert plan.entries[0].digest == plan_of([str(base)]).entries[0].digest
    other = plan_of((), str(study), draws=9, seed=6, vary=[])
    assert (other.draws, other.seed, other.vary) == (9, 6, ())
    assert plan.name == "campaign-study"


def test_the_study_that_comes_along_is_the_documents():
    plan = plan_of((), "ranges")
    assert (plan.draws, plan.methods, len(plan.ranges)) == (1000, ("pivot", "ml"), 4)
    page = text_of("docs/campaign.md")
    shown = tomllib.loads(next(block for language, block in fences("docs/campaign.md")[0] if language == "toml"))
    assert items_of_table(lists_to_tuples(shown["vary"]), "docs") == plan.vary
    assert "--suite ranges" in page

"""The study of approaches: its draws, the published method on board, the lines of flights and what is made of them."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from baryscope.estimator.options import ScrewOptions
from baryscope.fmu.system import build_system
from baryscope.models.lvlh import lvlh_attitude
from baryscope.models.scenario import load_scenario
from baryscope.study.approach import flying
from baryscope.study.approach.__main__ import main
from baryscope.study.approach.draws import PLACE, RATE, SPEED, drawn
from baryscope.study.approach.onboard import OnBoard
from baryscope.study.approach.report import WORDS, ends, over_time
from baryscope.study.approach.thrusters import ExecutionErrors, WrongThrusters
from baryscope.study.loop import fly_loop
from baryscope.study.population import command
from oracles import com_in_chaser_frame


def test_draws_have_their_sizes_and_come_from_seed_and_number():
    preset, draws = load_scenario("envisat"), [drawn(7, number) for number in range(200)]
    again = drawn(7, 3)
    assert again.parameters().keys() == draws[3].parameters().keys()
    assert again.target == draws[3].target
    assert again.chaser == draws[3].chaser
    assert len({draw.run.seed for draw in draws}) == len({draw.target.attitude for draw in draws}) == 200
    rates = np.array([draw.target.angular_rate_deg for draw in draws])
    size = np.linalg.norm(rates, axis=1) / np.linalg.norm(preset.target.angular_rate_deg) - 1
    places = np.array([draw.chaser.position for draw in draws]) - preset.chaser.position
    velocities = np.array([draw.chaser.velocity for draw in draws])
    # A deviation of 200 normal deviates is within 4/√400 of its own, that of 600 within 4/√1200.
    assert size.std() == pytest.approx(RATE, rel=0.2)
    assert places.std() == pytest.approx(PLACE, rel=0.12)
    assert velocities.std() == pytest.approx(SPEED, rel=0.12)
    Scenario = type(preset)
    assert Scenario.parse(draws[0].model_dump(), "draw").target.attitude == pytest.approx(draws[0].target.attitude)


class Watching(OnBoard):
    """Tells the controller nothing, so that the online estimator flies."""

    def _tell(self, units):
        self.truth = [*getattr(self, "truth", []), units["target"].vector("target.position")]


@pytest.fixture(scope="module")
def system(envisat, tmp_path_factory):
    return build_system(envisat, tmp_path_factory.mktemp("approach") / "chain.ssp")


def test_without_what_commands_do_the_target_moves_freely(system, envisat):
    """What is left of the true path is the difference of two Kepler orbits, while the chaser is pushed by decimetres a
    second. The method, which sees this path at rest in LVLH, is right to centimetres."""
    pilot = Watching(envisat.orbit, "screw-gpa", ScrewOptions(lag=15.0, degree=2, axes="lvlh"))
    loop = fly_loop(system, duration=240.0, approach=True, pilot=pilot)
    displaced = np.array([point.displaced[:3] for point in pilot._points[1:]])
    assert np.linalg.norm(displaced[-1]) > 5.0
    free = com_in_chaser_frame(envisat, loop.time)
    np.testing.assert_allclose(loop.truth["target.position"] - displaced, free, atol=1e-4)
    told = np.array(pilot.told)
    assert np.isnan(told[:98]).all()
    assert np.isfinite(told[100:]).all()
    error = np.linalg.norm(told - pilot.truth, axis=1)
    assert error[-100:].max() < 0.5
    assert np.median(error[-100:]) < 0.1
    assert (pilot.runs, pilot.refused) == (15, 0)


@pytest.mark.parametrize("draw", [20, 79])
def test_what_is_the_same_whenever_a_side_is_seen_tells_no_size_twice(draw, tmp_path):
    """Draw 20 of seed 1: one of twelve features is out of view from 145 to 312 s, and comes back near the camera.

    Of what is seen of the map then, half the error of the size is that of before: as if it were another one, on top of
    that, the size was told from how far the place jumped, and the CoM was wrong from there on.

    Draw 79: depths weigh the features otherwise from each side, and so do their errors, alike in each turn. As noise
    that is new in each node they averaged out: the size was claimed three times too well known, NEES was 30.

    The mean of the NEES every 100 s is below the 99.9 % quantile of one χ², as errors of the size stay.
    """
    loop = fly_loop(build_system(drawn(1, draw), tmp_path / "chain.ssp"), duration=900.0, approach=True)
    assert loop.tracking[[*range(399, 900, 100)]].all()
    assert loop.nees[[*range(399, 900, 100)]].mean() < chi2.ppf(0.999, 3)


@pytest.fixture(scope="module")
def exact(system):
    """On thrusters that are right."""
    return fly_loop(system, duration=900.0, approach=True)


@pytest.mark.parametrize("scale, turn", [(0.03, 0.0), (0.0, np.deg2rad(2.0))])
def test_on_thrusters_that_are_wrong_the_chaser_arrives(system, envisat, exact, scale, turn):
    """It stayed away, and the centre of mass was centimetres off: now the estimator finds what thrust is wrong by.

    The controller is told, and by the last 90 s the chaser is where right thrusters have it: nearer to that than it is
    to its goal by then, for which it is closing in. Not told, it missed by several times as much.
    """
    misalignment = turn * np.array([0.6, -0.64, 0.48])
    loop = fly_loop(system, duration=900.0, approach=True, pilot=WrongThrusters(envisat.orbit, scale, misalignment))
    assert np.linalg.norm(loop.chaser - exact.chaser, axis=1)[-90:].max() < exact.to_grapple[-90:].max()
    late = loop.time > 150.0
    assert loop.tracking[late].mean() > 0.95
    assert loop.error[late].max() < 0.02
    if scale:
        assert np.mean(loop.nees[late] > 16.27) < 0.02  # 0.1 % where claims are true; neighbours have the same errors


class Board:
    """A unit whose values are in a dict, by name."""

    def __init__(self, **values):
        self.values = {name.replace("__", "."): value for name, value in values.items()}

    def vector(self, name):
        return self.values[name]

    def scalars(self, name):
        return name

    def set(self, name, value):
        self.values[name] = value


def test_wrong_thrusters_are_wrong_in_the_axes_of_the_middle_of_a_step(envisat):
    """Of a camera that turns ever faster about an axis of LVLH, which turns, too: closed form.

    They were wrong in LVLH of the step's beginning, and in axes that turn on steadily. An estimator soon knows thrust
    better than that, and its true claims seemed wrong.
    """
    scale, misalignment, command = 0.03, np.array([0.02, -0.01, 0.015]), np.array([0.03, -0.02, 0.01])
    wrong, rate, faster = WrongThrusters(envisat.orbit, scale, misalignment), np.array([0.02, 0.05, -0.01]), 0.02

    def axes(time):
        return Rotation.from_rotvec(rate * (time + 0.5 * faster * time**2))

    for time in np.arange(1.0, 30.0):
        R_I_L = Rotation.from_matrix(lvlh_attitude(envisat.orbit, np.array([time]))[0])
        view = (R_I_L * axes(time)).as_quat(scalar_first=True)
        target, controller = Board(), Board(camera__attitude=view, command__acceleration=command)
        wrong({"target": target, "controller": controller}, time)
        if time > 2:
            middle = axes(time + 0.5)
            pushed = (middle * Rotation.from_rotvec(misalignment) * middle.inv()).apply(command)
            np.testing.assert_allclose(target.values["chaser.acceleration"], (1 + scale) * pushed, rtol=0, atol=1e-12)


def test_each_push_has_errors_of_its_own(envisat):
    """Of 500 pushes along an axis of the camera, at rest: means and deviations to within 4.5 of their own."""
    count, size, direction = 500, 0.01, 0.02
    errors = ExecutionErrors(size, direction, np.random.default_rng(5))
    wrong, pushes = WrongThrusters(envisat.orbit, execution=errors), []
    for time in np.arange(count) * 1e-6:  # at once: LVLH hardly turns
        R_I_L = Rotation.from_matrix(lvlh_attitude(envisat.orbit, np.array([time]))[0])
        view = R_I_L.as_quat(scalar_first=True)
        target = Board()
        wrong({"target": target, "controller": Board(camera__attitude=view, command__acceleration=np.eye(3)[0])}, time)
        pushes.append(target.values["chaser.acceleration"])
    off = np.array(pushes) - [1 - direction**2, 0.0, 0.0]
    deviation = np.array([size, direction, direction])
    assert (np.abs(off.mean(axis=0)) < 4.5 * deviation / np.sqrt(count)).all()
    assert (np.abs(off.std(axis=0) / deviation - 1) < 4.5 / np.sqrt(2 * count) + direction**2).all()


@pytest.fixture
def short(envisat, monkeypatch):
    """Flights of the preset itself, whose units are there, as far as the method has told something."""
    monkeypatch.setattr(flying, "drawn", lambda seed, draw: envisat)
    monkeypatch.setattr(flying, "DURATION", 130.0)


@pytest.mark.parametrize("loop", flying.LOOPS)
def test_a_line_has_the_flight(loop, short):
    line = json.loads(json.dumps(flying.flown(1, 0, loop)))
    assert (line["loop"], line["seed"], line["draw"]) == (loop, 1, 0)
    assert line["time"] == list(np.arange(10.0, 131.0, 10.0))
    assert all(6 < miss < 40 for miss in line["miss"])
    known = [value is not None for value in line["error"]]
    online = loop.startswith("online")
    assert known == [True] * 13 if online else [False] * 9 + [True] * 4
    assert line["error"][-1] < {"pivot": 0.1, "screw-gpa-lvlh": 0.5, "screw-gpa": 5.0}.get(loop, 0.1)
    assert line["arrived"] is None
    assert (line["body_error"] is None) == online
    assert (line["nees"] is None) != online
    assert 15 < line["nearest"] < 21


def made(loop, draw, miss, error):
    """A line of three times."""
    return {
        "loop": loop, "seed": 1, "draw": draw, "time": [150.0, 300.0, 450.0], "miss": [20.0, 2.0, miss],
        "error": [None, 0.1, error], "arrived": 400.0 + draw if miss < 0.1 else None, "velocity_change": 12.0,
        "nearest": 8.0, "body_error": None, "refused": 1, "wall": 2.0,
    }  # fmt: skip


def test_tables_and_picture(tmp_path, capsys):
    pytest.importorskip("matplotlib")
    lines = [made("online", draw, 0.01 * (draw + 1), 1e-3 * draw) for draw in range(11)]
    lines += [made("screw-gpa", 0, 0.5, 0.4), {"loop": "screw-gpa", "seed": 1, "draw": 1, "failure": "killed"}]
    first, second, third, *_ = over_time(lines).rows
    assert first == (WORDS["online"], "150", "20", "20–20", "-", "-")
    assert second[2:] == ("2", "2–2", "100", "100–100")
    assert third[2:] == ("0.06", "0.02–0.1", "5", "1–9")
    online, published = ends(lines).rows
    assert online[:7] == (WORDS["online"], "11", "9", "404", "0.06", "0.11", "5")
    assert published[:4] == (WORDS["screw-gpa"], "1", "0", "-")
    path = tmp_path / "lines.jsonl"
    path.write_text("".join(json.dumps(line) + "\n" for line in lines), encoding="utf-8")
    assert main(["report", str(path), "--picture", str(tmp_path / "a.png")]) == 0
    assert "1 flight failed" in capsys.readouterr().out
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    path.write_text(json.dumps(lines[-1]) + "\n", encoding="utf-8")
    with pytest.raises(SystemExit):
        main(["report", str(path)])
    assert "has no flight that ended" in capsys.readouterr().err


def test_the_command_runs_what_it_is_told(monkeypatch, tmp_path):
    given = {}
    monkeypatch.setattr(command, "fill", lambda options, function, names, groups: given.update(locals()))
    path = str(tmp_path / "lines.jsonl")
    assert main(["run", "--draws", "2", "--seed", "5", "--loops", "online", "screw-gpa", "-o", path]) == 0
    assert given["groups"] == [[(5, draw, "online"), (5, draw, "screw-gpa")] for draw in range(2)]
    assert given["names"] == ("seed", "draw", "loop")
    assert given["function"] is flying.flown

"""The closed loop on estimates alone: what it records, its files, an approach, and what is refused."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator import FeatureTracks, estimate
from baryscope.fmu.system import build_system
from baryscope.models.approach.reckoning import RECKONING, RETREAT
from baryscope.models.errors import InputError
from baryscope.models.scenario.tables import Outliers
from baryscope.models.sensor.navigation import STATUSES
from baryscope.report.document import data_of
from baryscope.scripts.cli import fly
from baryscope.scripts.cli.app import main
from baryscope.scripts.cli.fly import _words
from baryscope.study import report_of_loop
from baryscope.study.loop import MOST_STEPS, fly_loop, inside_hull
from baryscope.study.loop_files import loop_paths, write_loop
from baryscope.study.loop_report import marks_of, observability_of
from baryscope.study.loop_summary import QUANTITIES, summary_of
from systems import rewritten


def test_a_hold_on_estimates(held):
    """At 20 m within centimetres; the claim is true, and the command small."""
    found = summary_of(held)
    assert len(held.time) == found["samples"] == 400
    assert found["tracking_since"] < 60 < found["tumble_known_since"] < 200
    assert found["synchronised_since"] is None
    assert found["position_rmse"] < 0.02
    # The NEES of 200 s of one flight: as if of five independent times, 3 ± 4 √(6/5).
    assert found["mean_nees"] < 3 + 4 * np.sqrt(6 / 5)
    assert held.miss[-100:].max() < 0.05
    assert found["velocity_change"] < 0.2
    np.testing.assert_allclose(np.linalg.norm(held.chaser - [0, -20, 0], axis=1), held.miss)
    assert found["untracked"] < 10
    assert found["untracked_since"] is None


def test_tracks_and_truth_are_of_one_flight(held, envisat):
    """The batch finds the centre of mass in the rig's samples; both are in frame C. Sample k is of time k."""
    tracks = held.tracks
    np.testing.assert_array_equal(tracks.time, np.arange(400.0))
    assert not tracks.seen[0].any()  # the camera's attitude is not there yet
    found = estimate(tracks, orbit=envisat.orbit)
    error = found.position[1:] - held.truth["target.position"][:-1]
    squares = np.einsum("ki,ki->k", error, np.linalg.solve(found.covariance[1:], error[..., None])[..., 0])
    assert np.median(squares) < 10


def test_an_approach_comes_to_the_feature(system):
    """With commands of centimetres per second squared the estimate stays true; steps are shorter than the rig's period.

    A command that counted on the period would miss by 6 cm.
    """
    loop = fly_loop(system, duration=900.0, step=0.5, approach=True)
    found = summary_of(loop)
    assert found["synchronised_since"] == pytest.approx(found["tumble_known_since"], abs=2.0)
    assert found["largest_miss"] < 0.03
    assert found["position_rmse"] < 0.005
    assert found["mean_nees"] < 3 + 4 * np.sqrt(6 / 5)
    assert np.linalg.norm(loop.command, axis=1).max() > 0.01
    assert found["nearest_feature"] == pytest.approx(2.0, abs=0.05)  # the standoff, and nothing has come nearer


@pytest.mark.filterwarnings("always:steps of")
@pytest.mark.parametrize("step, stable", [(4.0, True), (6.0, False)])
def test_steps_that_are_too_long_for_the_controller_are_warned_of(system, step, stable, tmp_path, capsys):
    """At 0.22 1/s less than 4.55 s; the chaser of longer steps swings by metres."""
    main(["fly", str(system), "--duration", "900", "--step", str(step), "-o", str(tmp_path / "out"), "-q", "--json"])
    out, err = capsys.readouterr()
    assert err.count("warning: steps of 6 s: expected less than 4.55 s") == (not stable)
    assert (json.loads(out)["largest_miss"] < 0.1) == stable


def test_a_frame_that_does_not_fit_moves_no_goal(system):
    """For a step nothing is known of the target: the chaser goes on to where it went, by dead reckoning."""

    def confused(units, time):
        if time == 390.0:
            points = units["estimator"].scalars("points")
            units["estimator"].set(points, np.random.default_rng(1).uniform(5.0, 50.0, len(points)))

    loop = fly_loop(system, duration=400.0, approach=True, pilot=confused)
    lost = np.flatnonzero(~loop.tracking[300:]) + 300
    assert len(lost) == 1
    assert loop.synchronised[300:].all()
    assert (loop.mode[lost + 1] == RECKONING).all()
    assert summary_of(loop)["reckoned"] == (loop.mode == RECKONING).sum() >= 1
    assert summary_of(loop)["retreated"] == 0
    np.testing.assert_array_equal(loop.miss[300:], loop.to_grapple[300:])


@pytest.mark.parametrize(("until", "words"), [(350, "\n"), (400, ", at last since 301 s; the estimator is lost\n")])
def test_a_chaser_that_is_told_nothing_any_more_is_told_of(held, until, words):
    """Exit code 3 stood beside `tracking since`, and nothing said why the chaser had flown off."""
    status = np.where(held.time < held.time[held.tracking][0], 1, STATUSES.index("tracking"))
    status[300:until] = STATUSES.index("lost")
    found = summary_of(replace(held, status=status, mode=np.full(400, np.nan)))  # of another controller
    assert found["untracked"] == until - 300
    told = f"not tracking for {until - 300} s after that: the controller is told nothing"
    assert told + words in "\n".join(_words(found))


@pytest.fixture(scope="module")
def blinded(system):
    """The estimate is lost for good while the chaser glides to the grapple point."""

    def blind(units, time):
        if time >= 400.0:
            units["controller"].set(["navigation.valid"], np.zeros(1))

    return fly_loop(system, duration=900.0, approach=True, pilot=blind)


def test_a_chaser_that_loses_its_navigation_retreats_and_it_is_told(blinded):
    """It drifted on with 0.3 m/s, without a word; it goes back to the 20 m from which it came."""
    found = summary_of(blinded)
    assert (blinded.mode[400:420] == RECKONING).all()
    assert (blinded.mode[420:] == RETREAT).all()
    assert (found["reckoned"], found["retreated"], found["retreating_since"]) == (
        20 + (blinded.mode[:400] == RECKONING).sum(),
        480,
        421,
    )
    assert "retreat for 480 s, at last since 421 s" in "\n".join(_words(found))
    distance = np.linalg.norm(blinded.chaser, axis=1)
    assert distance[-1] == pytest.approx(20.0, abs=1.0)
    assert np.linalg.norm(np.diff(blinded.chaser[-50:], axis=0), axis=1).max() < 0.01
    assert found["synchronised_since"] < 400
    np.testing.assert_array_equal(blinded.miss[420:], blinded.to_grapple[420:])  # where it shall be all the same
    assert (421.0, "retreat") in marks_of(blinded)
    page = data_of(report_of_loop(blinded, found, {}))
    assert page["verdict"] == ["bad", "At last the estimator tracks the target. The chaser retreats."]


def test_a_flight_that_ends_in_a_retreat_has_that_exit_code(system, blinded, tmp_path, capsys, monkeypatch):
    """The estimator tracks, and the approach was given up."""
    monkeypatch.setattr(fly, "fly_loop", lambda *_, **__: blinded)
    assert blinded.tracking[-1]
    assert main(["fly", str(system), "-o", str(tmp_path / "out"), "-q", "--json"]) == 3
    assert json.loads(capsys.readouterr().out)["retreating_since"] == 421.0


def test_a_chaser_in_the_target_is_told_of(held):
    """Once there, `nearest` to the centre of mass alone did not tell."""
    points = np.array([[x, y, z] for x in (-1, 1) for y in (-2, 2) for z in (-3, 3)], dtype=float)
    places = np.array([[0.9, 1.9, 2.9], [1.1, 0.0, 0.0], [0.0, 0.0, 3.1]])
    np.testing.assert_array_equal(inside_hull(points, places), [True, False, False])
    assert not inside_hull(points[:4], places).any()  # in a plane
    assert not held.inside.any()
    found = summary_of(replace(held, inside=held.time > 390))
    assert (found["inside"], found["inside_since"]) == (10, 391)
    assert "for 10 s, since 391 s: it may have hit the target" in "\n".join(_words(found))


def test_files_hold_the_flight(held, envisat, tmp_path):
    files = write_loop(held, tmp_path, {"of": "envisat"})
    assert files == loop_paths(tmp_path)
    back = FeatureTracks.read_csv(tmp_path / "tracks.csv")
    assert back.position[5:].shape == held.tracks.position[5:].shape
    assert back.labels == held.tracks.labels == envisat.features.labels
    with (tmp_path / "estimate.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [len(rows), rows[0]["x"]] == [400, ""]
    assert [float(rows[-1][name]) for name in "xyz"] == held.position[-1].tolist()
    with (tmp_path / "truth.csv").open(newline="") as stream:
        truth = list(csv.DictReader(stream))
    assert float(truth[-1]["x"]) == held.truth["target.position"][-1, 0]
    summary = json.loads((tmp_path / "flight.json").read_text())
    assert summary["options"] == {"of": "envisat"}
    assert summary["position_rmse"] == summary_of(held)["position_rmse"]


def test_a_batch_estimate_takes_the_files(held, tmp_path):
    """With the orbit and the commands that are beside the tracks, of which there were none.

    Of this hold the path is off by 0.7 mm rms with both, by 5 mm with the orbit alone, and by 8 cm with neither.
    """
    write_loop(held, tmp_path, {})
    tracks, orbit, thrust, found = (
        str(tmp_path / name) for name in ("tracks.csv", "tracks.orbit.toml", "tracks.acceleration.csv", "batch.csv")
    )
    options = ["--orbit", orbit, "--acceleration", thrust, "--acceleration-axes", "lvlh", "--quiet"]
    assert main(["estimate", tracks, *options, "-o", found]) == 0
    with (tmp_path / "batch.csv").open(newline="") as stream:
        path = {float(row["time"]): [float(row[name]) for name in "xyz"] for row in csv.DictReader(stream)}
    truth = zip(held.time.tolist(), held.truth["target.position"], strict=True)
    errors = [np.linalg.norm(path[time] - true) for time, true in truth if time in path]
    assert len(errors) > 390
    assert np.sqrt(np.mean(np.square(errors))) < 2e-3


def test_the_report_shows_the_flight(held, envisat):
    """Features, found from samples with noise, are as far from the centre of mass as in the scenario."""
    assert held.orbit == envisat.orbit
    parts = {part["title"]: part for part in data_of(report_of_loop(held, summary_of(held), {}))["parts"]}
    scene, found = parts["Scene"], summary_of(held)
    keep = np.searchsorted(held.time, scene["time"])
    (online,) = scene["ghosts"]
    offset = np.array(online["offset"], dtype=float).reshape(-1, 3)
    waiting = held.status[keep] == 0
    np.testing.assert_array_equal(np.isnan(offset[:, 0]), waiting)
    np.testing.assert_allclose(np.linalg.norm(offset, axis=1), held.error[keep], rtol=1e-3)
    points = np.array(scene["features"], dtype=float).reshape(len(keep), -1, 3)
    true = np.array([point.position for point in envisat.features.points])
    np.testing.assert_allclose(np.linalg.norm(points[-1], axis=1), np.linalg.norm(true, axis=1), atol=0.1)
    assert parts["Convergence of the online estimate"]["marks"] == [
        [found["tracking_since"], "tracking"],
        [found["tumble_known_since"], "tumble known"],
    ]
    assert "LVLH axes" in parts["Error along each axis"]["about"]


@pytest.fixture(scope="module")
def blundering(envisat, tmp_path_factory):
    """A hold on a rig of which one point in thirty is a metre or so off."""
    sensor = envisat.sensor.model_copy(update={"outliers": Outliers(share=1 / 30, size=3.0)})
    path = tmp_path_factory.mktemp("loop") / "blundering.ssp"
    return fly_loop(build_system(envisat.model_copy(update={"sensor": sensor}), path), duration=300.0)


def test_the_report_has_residuals_and_what_is_rejected_by_feature(blundering, envisat):
    """The report of a flight had neither; the truth tells which points of the rig are off."""
    loop, body = blundering, np.array([point.position for point in envisat.features.points])
    R = Rotation.from_quat(loop.truth["target.attitude"], scalar_first=True).as_matrix()
    tracks = loop.tracks
    rows = np.searchsorted(loop.time, tracks.time[1:])  # sample k is of time k, the first of the flight's start
    true = loop.truth["target.position"][rows, None] + np.einsum("kij,mj->kmi", R[rows], body)
    error = (tracks.position[1:] - true)[..., None]
    weight = np.linalg.inv(np.where(tracks.seen[1:, :, None, None], tracks.covariance[1:], np.eye(3)))
    squares = (np.swapaxes(error, 2, 3) @ weight @ error)[..., 0, 0]
    found = loop.residuals
    np.testing.assert_array_equal(found.time, tracks.time)
    made = ~found.used.any(axis=1)  # the map, by a first sample, or the next if that shows the attitude far better
    assert made[0]
    assert made[-1]  # the last sample comes when the flight has ended
    assert made.sum() <= 3
    rejected, used = found.rejected[1:], found.used[1:]
    far, near = used & (squares > 100), used & (squares < 12)  # of the gate at 21; the pose takes a part
    assert far.sum() > 50
    assert rejected[far].mean() > 0.97
    assert rejected[near].mean() < 0.01
    # Of the points that fit, squares are χ² of three for each, less six for each sample: in five σ, and 2 % for the
    # errors of the map, which after half of the flight are those of a mean of many samples.
    fits = used & ~rejected
    fits[: len(fits) // 2] = False
    residual = np.where(fits[..., None], found.residuals[1:], 0.0)[..., None]
    sum_of_squares = float((np.swapaxes(residual, 2, 3) @ weight @ residual).sum())
    degrees = 3 * fits.sum() - 6 * fits.any(axis=1).sum()
    assert sum_of_squares == pytest.approx(degrees, abs=5 * np.sqrt(2 * degrees) + 0.02 * degrees)
    parts = {part["title"]: part for part in data_of(report_of_loop(loop, summary_of(loop), {}))["parts"]}
    labels = [one["label"].split(",")[0] for one in parts["Residuals"]["series"]]
    assert labels == ["used", "rejected"]
    assert parts["Residuals"]["filter"] == list(tracks.labels)
    rows_ = parts["Features"]["rows"]
    assert [int(row[2]) for row in rows_] == found.rejected.sum(axis=0).tolist()
    assert any(set(row) - {"0"} for row in parts["Which feature is seen when"]["rejected"])
    assert any("2" in state for state in parts["Scene"]["state"])


def test_the_report_has_the_observability_of_the_estimate(held):
    """Principal axes of what it claims at last; along the axis of the target's spin it knows least."""
    parts = {part["title"]: part for part in data_of(report_of_loop(held, summary_of(held), {}))["parts"]}
    rows = parts["Observability"]["rows"]
    assert [row[0] for row in rows] == 3 * ["body, at last"] + 3 * ["C, at last"]
    deviations = np.sqrt(np.linalg.eigvalsh(held.covariance[-1]))
    np.testing.assert_allclose([float(row[2]) for row in rows], 2 * (1e3 * deviations).tolist(), rtol=0.01)
    # Axes of the body and of C are those of one covariance, which the estimated attitude turns.
    R = Rotation.from_quat(held.attitude[-1], scalar_first=True).as_matrix()
    found = observability_of(held)
    along = np.abs(np.einsum("ki,ki->k", found.body.directions @ R.T, found.inertial.directions))
    np.testing.assert_allclose(along, 1.0, atol=1e-6)
    # The attitude is that of the axes of C at the first sample: from there the body has turned as it truly has.
    turn = [Rotation.from_quat(held.truth["target.attitude"][k], scalar_first=True) for k in (0, -1)]
    assert (Rotation.from_matrix(R) * (turn[1] * turn[0].inv()).inv()).magnitude() < 0.05
    assert observability_of(replace(held, status=0 * held.status)) is None


def test_the_report_of_a_flight_that_knows_nothing_has_no_residuals(held):
    loop = replace(held, map=np.full_like(held.map, np.nan), residuals=None, status=0 * held.status)
    titles = [part["title"] for part in data_of(report_of_loop(loop, summary_of(loop), {}))["parts"]]
    assert not {"Residuals", "Features", "Observability"} & set(titles)


def test_the_report_tells_what_came_of_it_in_words(held):
    """Every number of the summary, under a name of its own that is no field's, in its unit."""
    found = summary_of(held)
    options = {"of": "envisat", "duration": 400.0, "step": None, "approach": False}
    parts = {part["title"]: part for part in data_of(report_of_loop(held, found, options))["parts"]}
    told = dict(parts["What came of it"]["items"])
    assert list(QUANTITIES) == list(found)
    assert len(told) == len(found)
    assert not any("_" in name for name in told)
    assert told["estimator at last"] == "tracking"
    assert told["in retreat at last, since"] == "-"
    assert told["target tracked since"] == f"{found['tracking_since']:.5g} s"
    assert float(told["RMSE of the centre of mass, second half"].removesuffix(" mm")) == pytest.approx(
        1000 * found["position_rmse"], rel=1e-4
    )
    assert parts["Options"]["items"] == [
        ["scenario or system", "envisat"],
        ["duration, s", "400"],
        ["step, s", "-"],
        ["approach", "no"],
    ]


def test_the_command(system, tmp_path, capsys):
    assert main(["fly", str(system), "--duration", "30", "-o", str(tmp_path / "out"), "-q"]) == 0
    out = capsys.readouterr().out
    assert "30 s in steps of 1 s, 30 samples of the rig" in out
    assert "tumble not known" in out
    assert {path.name for path in (tmp_path / "out").iterdir()} == {path.name for path in loop_paths("x")}


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["{system}", "--scenario", "envisat"], "found two, expected a system or a scenario"),
        (["{system}", "--duration", "0"], "duration: found 0 s, expected more than 0 s"),
        (["{system}", "--duration", "0.5"], "duration: found 0.5 s, expected 1 s or more"),
        (["{system}", "--duration", "1e300"], f"in steps of that size, and {MOST_STEPS:g} s at most"),
        (["{system}", "--step", "-1"], "step: found -1 s, expected at least 1e-06 s"),
        (["no.ssp"], "no.ssp: No such file or directory, expected a system of FMI 2.0 units"),
    ],
)
def test_what_is_refused_in_a_line(arguments, line, system, tmp_path, capsys):
    given = [argument.replace("{system}", str(system)) for argument in arguments]
    assert main(["fly", *given, "-o", str(tmp_path / "out")]) == 2
    assert line in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["--duration", "-5"], "duration: found -5 s, expected more than 0 s"),
        (["--duration", "nan"], "duration: found nan s, expected more than 0 s"),
        (["--duration", "1", "--step", "2"], "duration: found 1 s, expected 2 s, a step, or more"),
        (["--step", "0"], "step: found 0 s, expected at least 1e-06 s"),
    ],
)
def test_a_flight_that_cannot_be_is_refused_before_units_are_built(arguments, line, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(fly, "build_system", lambda *_, **__: pytest.fail("units were built"))
    assert main(["fly", *arguments, "-o", str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err == f"baryscope: {line}\n"


def test_a_unit_alone_is_no_system(envisat_fmu):
    with pytest.raises(InputError, match=r"expected a system of FMI 2\.0 units"):
        fly_loop(envisat_fmu)


def test_a_flight_that_ends_before_it_tracks_has_that_exit_code_too(system, tmp_path, capsys):
    """Nothing of it is to be trusted yet; the command says that it starts."""
    assert main(["fly", str(system), "--duration", "5", "-o", str(tmp_path / "out"), "-q"]) == 3
    assert "the estimator never tracked the target: it is starting" in capsys.readouterr().out


def test_an_estimate_that_is_doubted_has_its_own_exit_code(system, tmp_path, capsys):
    """Nine of ten observations are off by metres: files are written, and the command says so."""
    wrong = rewritten(
        system,
        tmp_path / "wrong.ssp",
        (r'(name="outliers\.share">\s*<ssv:Real value=")0\.0', r"\g<1>0.9"),
        (r'(name="outliers\.size">\s*<ssv:Real value=")[^"]*', r"\g<1>3.0"),
    )
    assert main(["fly", str(wrong), "--duration", "120", "-o", str(tmp_path / "out"), "-q", "--json"]) == 3
    found = json.loads(capsys.readouterr().out)
    assert found["status"] in ("doubtful", "lost")
    assert (tmp_path / "out" / "estimate.csv").exists()

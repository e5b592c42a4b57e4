"""CentreOfMassEstimator: against the filter called from Python, behind the target and a rig, with late samples."""

from dataclasses import replace

import fmpy
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from baryscope.estimator.online import OnlineEstimator
from baryscope.fmu import build_fmu
from baryscope.fmu.units import blueprint_of
from baryscope.models.errors import InputError
from baryscope.models.lvlh import lvlh_attitude
from baryscope.models.orbit import EARTH_J2, EARTH_RADIUS
from baryscope.models.scenario import Run, Sensor, StereoRig
from baryscope.models.sensor.directions import axes_along
from baryscope.models.sensor.navigation import STATUSES
from importer import Stepped

UPPER = ([0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2])
ARM = np.array([0.4, -0.2, 1.1])
COUNT, PERIOD = 8, 1.0


@pytest.fixture(scope="module")
def watched(envisat):
    """Eight features of Envisat, a rig."""
    run = Run(duration=300.0, sample_time=PERIOD, seed=5)
    points = envisat.features.points[:COUNT]
    features = envisat.features.model_copy(update={"points": points})
    sensor = Sensor(stereo=StereoRig(focal_length=1911.0, baseline=1.0, pixel_noise=0.5))
    tracking = envisat.tracking.model_copy(update={"intervals": (), "visibility": "all"})
    return envisat.model_copy(update={"features": features, "sensor": sensor, "run": run, "tracking": tracking})


@pytest.fixture(scope="module")
def units(watched, tmp_path_factory):
    folder = tmp_path_factory.mktemp("units")
    return {unit: build_fmu(watched, folder / f"{unit}.fmu", unit=unit) for unit in ("target", "rig", "estimator")}


@pytest.fixture
def started(units, opened):
    return lambda unit, **parameters: opened(Stepped, units[unit], **parameters)


def test_more_features_than_the_map_holds_are_refused(watched):
    many = watched.features.model_copy(update={"points": watched.features.points[:1] * 33})
    with pytest.raises(InputError, match=r"features: found 33, expected at most 32 for the unit CentreOfMassEstimator"):
        blueprint_of("estimator", watched.model_copy(update={"features": many}))


@pytest.mark.parametrize("orbit", [{}, {"j2": EARTH_J2, "equatorial_radius": EARTH_RADIUS}], ids=["plain", "oblate"])
def test_it_is_the_filter_that_python_calls(watched, started, orbit):
    """Points in camera axes, with covariances, a lever arm and features out of sight; to rounding of the turns."""
    rng = np.random.default_rng(4)
    oblateness = {"orbit__j2": orbit["j2"], "orbit__equatorialRadius": orbit["equatorial_radius"]} if orbit else {}
    settings = {"filter__offset": 3.0, "filter__speed": 2.0, "prediction__horizon": 30.0}
    unit = started("estimator", camera__leverArm=ARM, **settings, **oblateness)
    alone = OnlineEstimator(1.0, replace(watched.orbit, **orbit), offset_radii=3.0, speed_std=2.0)
    body = rng.uniform(-3, 3, (COUNT, 3))
    spread_V = 0.02 * rng.normal(size=(COUNT, 3, 3))
    covariance_V = spread_V @ np.swapaxes(spread_V, 1, 2) + 1e-4 * np.eye(3)
    for k in range(160):
        R = Rotation.from_euler("ZXZ", [0.05 * k, 0.6, 0.03 * k]).as_matrix()
        camera = Rotation.from_rotvec([0.3, 0.01 * k, -0.2])
        there_C = np.array([2.0, 17.0, -5.0]) + body @ R.T + 0.02 * rng.normal(size=(COUNT, 3))
        seen = rng.random(COUNT) < 0.8
        unit["points"], unit["seen"] = camera.inv().apply(there_C) - ARM, seen
        unit["covariances"] = covariance_V[:, UPPER[0], UPPER[1]]
        unit["camera.attitude"] = 2.5 * camera.as_quat(scalar_first=True)  # of any length
        unit["sample.time"], unit["sample.number"] = k * PERIOD, k + 1
        unit.step()
        C = camera.as_matrix()
        alone.update(k * PERIOD, there_C, seen, covariance=C @ covariance_V @ C.T)
        now, ahead = alone.predict(unit.time), alone.predict(unit.time + 30.0)
        assert STATUSES[int(unit["status"][0])] == now.status
        for name, value in {
            "target.position": now.position,
            "target.velocity": now.velocity,
            "target.positionCovariance": now.covariance[:3, :3][UPPER],
            "target.velocityCovariance": now.covariance[3:, 3:][UPPER],
            "predicted.position": ahead.position,
            "predicted.positionCovariance": ahead.covariance[:3, :3][UPPER],
            "processNoise": now.density,
            "noiseRatio": now.noise_ratio,
            "noiseLasting": now.lasting,
            "samples": k + 1,
        }.items():
            # The unit goes through communication points, whose white acceleration is that of a straight line.
            rtol = 1e-4 if name.endswith("Covariance") else 1e-6
            np.testing.assert_allclose(unit[name], value, rtol=rtol, atol=rtol * np.abs(value).max(), err_msg=name)
    assert unit["navigation.valid"].all()
    tumbles(unit, alone)
    known = alone.features()
    np.testing.assert_allclose(unit["body.features"].reshape(-1, 3)[known.names], known.position, atol=1e-6)
    upper = known.covariance[:, UPPER[0], UPPER[1]]
    found = unit["body.covariances"].reshape(-1, 6)[known.names]
    np.testing.assert_allclose(found, upper, rtol=1e-3, atol=1e-3 * np.abs(upper).max())
    np.testing.assert_array_equal(np.flatnonzero(unit["body.known"]), np.sort(known.names))
    sight = alone.residuals()
    assert unit["sight.time"] == 159 * PERIOD
    np.testing.assert_allclose(unit["sight.residuals"].reshape(-1, 3)[sight.names], sight.residual, atol=1e-9)
    np.testing.assert_array_equal(np.flatnonzero(unit["sight.fits"]), np.sort(sight.names[sight.fits]))
    np.testing.assert_array_equal(np.flatnonzero(unit["sight.rejected"]), np.sort(sight.names[~sight.fits]))


def tumbles(unit, alone):
    """The turn of the points is a free one, that of a symmetric top."""
    now, ahead = alone.tumble(unit.time), alone.tumble(unit.time + 30.0)
    assert unit["tumble.known"].all()
    for name, attitude in (("target.attitude", now.attitude), ("predicted.attitude", ahead.attitude)):
        found = Rotation.from_quat(unit[name], scalar_first=True).as_matrix()
        np.testing.assert_allclose(found, attitude, atol=1e-7, err_msg=name)
    np.testing.assert_allclose(unit["target.angularRate"], now.rate, atol=1e-9)
    np.testing.assert_allclose(unit["target.attitudeCovariance"], now.attitude_covariance[UPPER], rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(unit["target.angularRateCovariance"], now.rate_covariance[UPPER], rtol=1e-6, atol=1e-14)
    diagonal = ([0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2])
    np.testing.assert_allclose(unit["target.inertia"], now.inertia[diagonal], atol=1e-9)


def chain(watched, started, latency, told, duration=300, parts=1):
    """Target, rig and estimator over 1 s steps, one step's delay between them, under a known thrust.

    The estimator takes each step in parts. Returns the errors in position and velocity at the end, and their NEES.
    """
    target, rig = started("target"), started("rig", sampling__latency=latency)
    unit = started("estimator", camera__leverArm=np.zeros(3))
    push = np.array([2e-4, -1e-4, 3e-4])
    for k in range(duration):
        outputs = {name: target[name] for name in ("features", "normals", "target.position")}
        sample = {name: rig[name] for name in ("points", "covariances", "seen", "sample.time", "sample.number")}
        measured = rig["camera.measuredAttitude"]
        target["chaser.acceleration"] = np.sin(0.05 * k) * push
        rig["features"], rig["normals"] = outputs["features"], outputs["normals"]
        (axes,) = axes_along(outputs["target.position"][None])
        rig["camera.attitude"] = Rotation.from_matrix(axes).as_quat(scalar_first=True)
        for name, value in sample.items():
            unit[name] = value
        unit["camera.attitude"] = measured
        unit["chaser.acceleration"] = np.sin(0.05 * k) * push * told
        for one in (target, rig):
            one.step()
        for _ in range(parts):
            unit.step(1.0 / parts)
    error = unit["target.position"] - target["target.position"]
    covariance = np.zeros((3, 3))
    covariance[UPPER] = unit["target.positionCovariance"]
    covariance = covariance + np.triu(covariance, 1).T
    return np.linalg.norm(error), error @ np.linalg.solve(covariance, error), unit


@pytest.mark.parametrize("latency", [0.0, 3.0])
def test_behind_a_rig_it_finds_the_centre_of_mass_under_thrust(watched, started, latency):
    """Estimates are of the step's end, though samples are one step late, and by their latency; 3 degrees of freedom."""
    error, nees, unit = chain(watched, started, latency, told=1.0)
    assert unit["navigation.valid"].all()
    assert nees < 21.1  # p = 1e-4
    assert error < 0.05
    assert unit["samples"] == 299 - max(latency - PERIOD, 0.0)  # one step late, whatever their latency


def test_a_command_that_is_not_told_is_taken_for_process_noise(watched, started):
    told, untold = (chain(watched, started, 0.0, share)[2]["processNoise"][0] for share in (1.0, 0.0))
    assert untold > 30 * told


def test_no_command_is_forgotten_however_short_the_steps_are(watched, started):
    """100 steps from sample to sample, more than the unit remembers: it takes neighbours together."""
    whole, parts = (chain(watched, started, 3.0, 1.0, duration=60, parts=parts)[2] for parts in (1, 100))
    for name in ("target.position", "target.velocity", "target.positionCovariance", "processNoise"):
        np.testing.assert_allclose(parts[name], whole[name], rtol=1e-3, atol=1e-3 * np.abs(whole[name]).max())


@pytest.mark.parametrize("step, steps", [(4.0, 25), (2.0, 500)])
def test_commands_that_turn_displace_the_chaser_as_they_do_the_target_unit(watched, started, step, steps):
    """Two flights from one sample, with and without commands that turn with a body: their difference is the truth's.

    A command is at rest in LVLH over a step. Taken for one constant acceleration in C it would misplace the chaser by
    dR/dt u h³/12 in each step, 0.2 mm with h = 4 s. Of 500 steps most are taken together with their neighbours; with
    nothing but the change of the velocity kept of them, the place goes astray.
    """
    flights = [(started("target"), started("estimator", camera__leverArm=np.zeros(3))) for _ in range(2)]
    for _, unit in flights:
        points = np.random.default_rng(2).uniform(-2, 2, (COUNT, 3))
        unit["points"] = points + np.array([0.0, 0.0, 20.0])
        unit["seen"], unit["sample.number"] = np.ones(COUNT), 1
    for k in range(steps):
        angle = 0.06 * k * step
        command = 0.03 * np.array([np.cos(angle), np.sin(angle), np.sin(angle)])
        for share, flight in enumerate(flights):
            for unit in flight:
                unit["chaser.acceleration"] = share * command
                unit.step(step)
        truth, told = (flights[1][side]["target.position"] - flights[0][side]["target.position"] for side in range(2))
        assert np.linalg.norm(told - truth) < 2e-5 + 1e-5 * np.linalg.norm(truth)


def test_while_it_is_lost_nothing_is_valid_and_another_map_goes_on_with_the_path(started):
    """Where points are no longer those of the body it is lost, for ten samples, or as long as they are in a line."""
    rng, body = np.random.default_rng(8), np.random.default_rng(2).uniform(-2, 2, (COUNT, 3))
    unit, said = started("estimator", onOrbit=False), []
    for k in range(130):
        R = Rotation.from_euler("ZXZ", [0.1 * k, 0.7, 0.06 * k]).as_matrix()
        shape = body if k < 100 else np.outer(np.arange(COUNT), [1.0, 2.0, 3.0]) if k < 115 else -body[::-1]
        unit["points"] = [0.0, 0.0, 20.0] + shape @ R.T + 0.01 * rng.normal(size=(COUNT, 3))
        unit["seen"], unit["sample.time"], unit["sample.number"] = np.ones(COUNT), float(k), k + 1
        unit.step()
        said.append((STATUSES[int(unit["status"][0])], bool(unit["navigation.valid"][0])))
    assert said[99] == ("tracking", True)
    assert said[105] == said[114] == ("lost", False)
    assert said[115] == said[-1] == ("tracking", True)
    assert np.linalg.norm(unit["target.position"] - [0.0, 0.0, 20.0]) < 0.01  # that of a point, of which there are many
    assert all(valid == (status == "tracking") for status, valid in said)


def test_it_begins_again_where_it_has_no_finite_state(started):
    """Points that fly by at 20 km/s: no orbit is closed there. A unit on board goes on, and tracks what comes then."""
    rng, body = np.random.default_rng(3), np.random.default_rng(2).uniform(-2, 2, (COUNT, 3))
    unit = started("estimator", filter__speed=1e5)
    for k in range(250):
        R = Rotation.from_euler("ZXZ", [0.08 * k, 0.7, 0.05 * k]).as_matrix()
        away = 20.0 + (2e4 * k if k < 10 else 0.0)
        unit["points"] = [0.0, 0.0, away] + body @ R.T + 0.01 * rng.normal(size=(COUNT, 3))
        unit["seen"], unit["sample.time"], unit["sample.number"] = np.ones(COUNT), float(k), k + 1
        unit.step()
        assert np.isfinite(unit["target.position"]).all()
    said = [message for message in unit.messages if "has no finite state" in message]
    assert len(said) == 1
    assert "it begins again" in said[0]
    assert unit["navigation.valid"].all()
    assert np.linalg.norm(unit["target.position"] - [0.0, 0.0, 20.0]) < 0.1


@pytest.mark.parametrize("horizon", [1e7, -1.0])
def test_predictions_have_an_end(started, horizon):
    """At 1e12 s all numbers had overflowed, and the message spoke of points of other than metres."""
    unit = started("estimator")
    unit.refused(lambda: unit.set("prediction.horizon", horizon), f"found value {horizon:g}, expected 0 to 1e+06 s")


@pytest.mark.parametrize("name", ["thrust.error", "thrust.deviation"])
def test_what_thrusters_are_wrong_by_is_no_quaternion(units, name):
    """A vector of four without names of its own is one, w to z, in the descriptions that importers show."""
    told = {v.name: v.description for v in fmpy.read_model_description(str(units["estimator"])).modelVariables}
    words = [told[f"{name}[{k}]"].rsplit(": ", 1)[1] for k in (1, 2, 3, 4)]
    assert words == ["scale", "x, along the baseline", "y", "z, boresight"]


TURNS, DARK = 60, 90  # frames under thrust in which something is seen, and nothing


def turned_by_thrust(started, orbit, seed, dark=0):
    """A unit whose thrusters are 2° off, on a chaser whose rate changes by 2°/s²; by what they are, and the true place.

    A command holds from frame to frame, in LVLH axes, though the target is on no orbit; the thrusters are where a
    closed form has the camera's axes in the middle. The target is a symmetric top that moves in a straight line but
    for the thrust; noise is 2 mm on each coordinate.
    """
    rng = np.random.default_rng(seed)
    wrong = np.deg2rad(2.0) * np.array([0.0, 1.0, -0.6, 0.8]) / np.sqrt(2.0)
    unit = started("estimator", camera__leverArm=np.zeros(3), onOrbit=0.0, filter__sigma=0.002)
    place, speed, body = np.array([2.0, 17.0, -5.0]), np.zeros(3), rng.uniform(-2, 2, (COUNT, 3))
    for k in range(130 + TURNS + dark):
        R = Rotation.from_euler("ZXZ", [0.05 * k, 0.7, 0.03 * k])
        camera, middle = (Rotation.from_euler("ZXZ", [0.2 * t, 1.0, 0.2 * t]) for t in (k, k + 0.5))
        push = R.apply([0.02, -0.01, 0.005]) if k >= 130 else np.zeros(3)
        there = place + R.apply(body) + 0.002 * rng.standard_normal((COUNT, 3))
        unit["points"], unit["seen"] = camera.inv().apply(there), np.full(COUNT, k < 130 + TURNS)
        unit["camera.attitude"] = camera.as_quat(scalar_first=True)
        unit["sample.time"], unit["sample.number"] = k, k + 1
        unit["chaser.acceleration"] = lvlh_attitude(orbit, np.array([k + 0.5]))[0].T @ push
        unit.step()
        pushed = (middle * Rotation.from_rotvec(wrong[1:]) * middle.inv()).apply(push)
        place, speed = place + speed - 0.5 * pushed, speed - pushed
    return unit, wrong, place


def test_thrusters_are_in_the_axes_between_two_samples(started, watched):
    """Halfway between two attitudes they are where no turn of the chaser is that changes: off by four deviations.

    Squares over the draws are below the 99.9 % quantile of χ².
    """
    nees = []
    for seed in range(6):
        unit, wrong, _ = turned_by_thrust(started, watched.orbit, seed)
        nees.append(((unit["thrust.error"] - wrong)[3] / unit["thrust.deviation"][3]) ** 2)
    assert sum(nees) < chi2.ppf(0.999, len(nees))


def test_a_command_is_in_lvlh_where_the_target_is_free_too(started, watched):
    """It was taken for inertial axes: of 2° nothing was found, as if there were no thrust but process noise.

    The claims are 8e-5 at most; 1e-3 is what the target's orbit turns LVLH by in a step.
    """
    unit, wrong, place = turned_by_thrust(started, watched.orbit, 0)
    assert np.linalg.norm(unit["target.position"] - place) < 0.002
    assert np.abs(unit["thrust.error"] - wrong).max() < 1e-3
    assert unit["thrust.deviation"].max() < 1e-3


def test_thrusters_turn_with_the_chaser_where_nothing_is_seen(started, watched):
    """Samples without points tell of the camera's attitude. They were passed over, so that the thrusters kept the axes
    of the last one with points: after 90 of them the centre of mass was 1.3 m off, as if nothing were known of them.
    """
    for seed in range(2):
        unit, wrong, place = turned_by_thrust(started, watched.orbit, seed, DARK)
        assert np.linalg.norm(unit["target.position"] - place) < 0.01
        assert np.linalg.norm(wrong[1:]) > np.deg2rad(1.0)

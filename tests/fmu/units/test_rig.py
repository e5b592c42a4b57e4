"""StereoRig: against the campaigns' sensor on the same draws; samples, latency, light, saved states."""

import re
from functools import partial

import fmpy
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import forces
from baryscope.fmu import build_fmu
from baryscope.fmu.check import check_unit
from baryscope.models.errors import InputError
from baryscope.models.scenario import Run, Sensor, StereoRig, Tracking
from baryscope.models.sensor import observe
from baryscope.models.sensor.directions import axes_along
from baryscope.scripts.cli.app import main
from importer import Importer, Stepped
from mutations import flag, mutated, variable

COUNT, PERIOD = 3, 0.5
RIG = StereoRig(focal_length=900.0, baseline=0.8, pixel_noise=0.4)
POINTS = np.array([[0.3, -0.2, 9.0], [-1.0, 0.5, 11.0], [0.8, 0.9, 10.0]])  # camera axes
SIGMAS = 5.0  # a statistic may be off by so many of its own standard deviations


@pytest.fixture(scope="module")
def watched(small):
    """Three features, a rig, a seed; neither dropout nor outliers nor limits."""
    run = Run(duration=60.0, sample_time=PERIOD, seed=12345)
    return small.model_copy(update={"sensor": Sensor(stereo=RIG), "run": run, "tracking": Tracking()})


@pytest.fixture(scope="module")
def rig_fmu(watched, tmp_path_factory):
    return build_fmu(watched, tmp_path_factory.mktemp("rig") / "rig.fmu", unit="rig")


class Rig(Stepped):
    """An instance that sees points of its own, with matrices of a row for each."""

    step_size = PERIOD

    def __init__(self, path, folder, **parameters):
        super().__init__(path, folder, **parameters)
        self.put(POINTS, -POINTS / np.linalg.norm(POINTS, axis=1, keepdims=True))

    def put(self, features, normals, attitude=(1, 0, 0, 0)):
        for name, value in (("features", features), ("normals", normals), ("camera.attitude", attitude)):
            self[name] = value

    def __getitem__(self, name):
        values = super().__getitem__(name)
        return values.reshape(COUNT, -1) if name in ("pixels", "points", "covariances") else values

    @property
    def all(self):
        names = ("pixels", "points", "covariances", "seen", "camera.measuredAttitude", "sample.time", "sample.number")
        return np.concatenate([self[name].ravel() for name in names])


@pytest.fixture
def rig(rig_fmu, opened):
    return partial(opened, Rig, rig_fmu)


def test_it_measures_what_a_campaign_does(watched, opened, tmp_path):
    """On the same draws: a camera that follows the target, noise, edges, dropout, blunders, faces that look away."""
    frames, rng = 60, np.random.default_rng(1)
    rig, outliers = RIG.model_copy(update={"resolution": (300, 200)}), {"share": 0.3, "size": 1.5}
    sensor = Sensor.model_validate({"stereo": rig, "dropout": 0.2, "outliers": outliers})
    tracking = Tracking(visibility="facing", max_incidence_deg=70.0)
    flown = watched.model_copy(update={"sensor": sensor, "tracking": tracking})
    one = opened(Rig, build_fmu(flown, tmp_path / "rig.fmu", unit="rig"))

    target_C = Rotation.from_rotvec(np.arange(frames)[:, None] * [0.02, -0.05, 0.03]).apply([10.0, 3.0, -2.0])
    features_C = target_C[:, None] + rng.uniform(-1, 1, (frames, COUNT, 3))
    normals_C = Rotation.from_rotvec(rng.normal(0, 0.7, (frames * COUNT, 3))).apply(
        -np.repeat(target_C, COUNT, axis=0) / np.linalg.norm([10.0, 3.0, -2.0])
    )
    normals_C = normals_C.reshape(features_C.shape)
    expected = observe(flown, PERIOD * np.arange(frames), features_C, normals_C, target_C=target_C)
    assert 0.3 < expected.seen.mean() < 0.8
    assert expected.wrong[expected.seen].mean() > 0.1

    for k, R in enumerate(axes_along(target_C)):
        one.put(features_C[k], normals_C[k], 3.0 * Rotation.from_matrix(R).as_quat(scalar_first=True))  # of any length
        one.step()
        seen = expected.seen[k]
        np.testing.assert_array_equal(one["seen"], seen)
        np.testing.assert_allclose(one["points"][seen], expected.position[k, seen] @ R, rtol=1e-9, atol=1e-10)
        covariances = R.T @ expected.covariance[k, seen] @ R
        upper = covariances[:, [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]
        np.testing.assert_allclose(one["covariances"][seen], upper, rtol=1e-8, atol=1e-12)
        u_l, v, u_r = one["pixels"][seen].T - [[150], [100], [150]]
        np.testing.assert_allclose(
            0.8 / (u_l - u_r) * np.array([u_l, v, 900 + 0 * v]), one["points"][seen].T, rtol=1e-9
        )
        for name in ("pixels", "points", "covariances"):
            assert not one[name][~seen].any()
        assert one["sample.time"] == k * PERIOD
        assert one["sample.number"] == k + 1


def test_the_lever_arm_and_the_principal_point(rig):
    """p_C = R (p_V + arm); pixels count from the corner."""
    one = rig(camera__pixelNoise=1e-9, camera__leverArm=[0.5, -0.3, 1.0], camera__principalPoint=[640.0, 512.0])
    turn = Rotation.from_rotvec([0.3, -0.2, 0.5])
    one.put(turn.apply(POINTS + np.array([0.5, -0.3, 1.0])), np.zeros((COUNT, 3)), turn.as_quat(scalar_first=True))
    one.step()
    np.testing.assert_allclose(one["points"], POINTS, atol=1e-7)
    x, y, z = POINTS[0]
    np.testing.assert_allclose(one["pixels"][0], [640 + 900 * x / z, 512 + 900 * y / z, 640 + 900 * (x - 0.8) / z])


def test_samples_are_the_same_whatever_the_steps(rig):
    """Steps of 0.1 s, of one and of seven periods: sample k of each."""
    short, whole, long = rig(), rig(), rig()
    for k in range(1, 29):
        whole.step()
        for _ in range(5):
            short.step(0.1)
        assert whole["sample.number"] == k
        np.testing.assert_array_equal(short.all, whole.all)
        if k % 7 == 0:
            found, seventh = long.step(7 * PERIOD).all, whole.all
            seventh[-2] = (k - 7) * PERIOD  # its inputs are of the step's beginning
            np.testing.assert_array_equal(found, seventh)


@pytest.mark.parametrize("latency", [0.0, 0.9])
@pytest.mark.parametrize("step", [0.35, 0.5 / 3, 0.8])
def test_a_sample_bears_the_time_of_its_inputs(rig, step, latency):
    """Where steps do not divide the period: points that move show when they were seen, of later inputs every time."""
    one, seen = rig(camera__pixelNoise=0.0, sampling__latency=latency), []
    for _ in range(60):
        one.put(np.add(POINTS, [0.01 * one.time, 0, 0]), -POINTS)
        one.step(step)
        if one["sample.number"] > 0:
            seen.append(one["sample.time"][0])
            np.testing.assert_allclose(one["points"], np.add(POINTS, [0.01 * seen[-1], 0, 0]), rtol=1e-9)
            assert -1e-9 <= (one["sample.number"][0] - 1) * PERIOD - seen[-1] <= step + 1e-9
    assert len(set(seen)) > 15


@pytest.mark.parametrize("start", [-1e4, 1.7e9])
def test_a_time_of_a_calendar_is_as_good_as_0(rig, monkeypatch, start):
    """Seconds since 1970: sample k has the inputs of k T, with what is added up for the time, and is out at its end."""
    from_zero = rig()
    monkeypatch.setattr(Rig, "start_time", start)
    late = rig()
    for k in range(40):
        for one in (from_zero, late):
            one.put(POINTS + 0.01 * k, -POINTS)
            for _ in range(3):
                one.step(PERIOD / 3)
        assert late["sample.time"] - start == from_zero["sample.time"] == k * PERIOD
        np.testing.assert_array_equal(late.all[:-2], from_zero.all[:-2])
    late.refused(lambda: late.fmu.doStep(late.time + 0.2 * PERIOD, PERIOD), "currentCommunicationPoint")


@pytest.mark.parametrize("step", [PERIOD, 0.2, 100 * PERIOD])
@pytest.mark.parametrize("latency", [0.0, 0.7, 15 * PERIOD])
def test_latency(rig, latency, step):
    """At time t the newest sample k with k T before t and k T + latency up to t is out; 15 may wait."""
    late, prompt = rig(sampling__latency=latency), rig()
    shown = {0: late.all}
    for _ in range(400):
        prompt.step()
        shown[int(prompt["sample.number"][0])] = prompt.all
    for k in range(1, 1 + min(40, round(200 / step))):
        number = int(min(np.floor((k * step - latency) / PERIOD + 1e-9) + 1, np.ceil(k * step / PERIOD - 1e-9)))
        late.step(step)
        assert late["sample.number"] == max(0, number)
        bearing = shown[max(0, number)].copy()
        if number > 0:  # the time of its inputs, which are of the beginning of a step
            bearing[-2] = step * np.floor((number - 1) * PERIOD / step + 1e-9)
        np.testing.assert_allclose(late.all, bearing, rtol=1e-15)


def test_a_restored_state_draws_the_same(rig):
    one = rig(sampling__latency=1.2, dropout=0.3, camera__attitudeNoise=0.01)
    for _ in range(10):
        one.step()
    state = one.fmu.getFMUstate()
    content = one.fmu.serializeFMUstate(state)
    first = [one.step().all for _ in range(20)]
    one.fmu.setFMUstate(state)
    one.time = 10 * PERIOD
    np.testing.assert_array_equal([one.step().all for _ in range(20)], first)
    other = rig(seed=3.0)
    other.fmu.setFMUstate(other.fmu.deSerializeFMUstate(content))
    other.time = 10 * PERIOD
    np.testing.assert_array_equal([other.step().all for _ in range(20)], first)


def test_dark_is_what_the_central_body_shades(rig):
    one = rig(sun__shadowRadius=6378e3)
    assert one.step()["seen"].all()  # the position is not connected
    one["sun.direction"] = [5.0, 0.0, 0.0]
    for position, lit in (([-7000e3, 0, 0], False), ([7000e3, 0, 0], True), ([-7000e3, 6400e3, 0], True)):
        one["orbit.position"] = position
        assert one.step()["seen"].all() == lit
        assert one["seen"].any() == lit
    one["orbit.position"] = [-7000e3, 0, 0]
    one.step()
    assert one["sample.number"] == 5  # samples of nothing are samples
    bright = rig()  # without a sphere
    bright["orbit.position"] = [-7000e3, 0, 0]
    assert bright.step()["seen"].all()


def test_images_and_ranges_have_ends(rig):
    """The right image of the second feature starts at 900 (−1 − 0.8)/11 = −147 px; ranges are 9.0, 11.1 and 10.1 m."""
    assert rig().step()["seen"].all()
    wide = rig(camera__resolution=[400.0, 400.0], camera__principalPoint=[200.0, 200.0]).step()
    narrow = rig(camera__resolution=[200.0, 400.0], camera__principalPoint=[100.0, 200.0]).step()
    low = rig(camera__resolution=[0.0, 100.0], camera__principalPoint=[0.0, 50.0]).step()
    np.testing.assert_array_equal(wide["seen"], [True, True, True])
    np.testing.assert_array_equal(narrow["seen"], [True, False, True])
    np.testing.assert_array_equal(low["seen"], [True, True, False])
    np.testing.assert_array_equal(rig(visibility__maxRange=10.5).step()["seen"], [True, False, True])
    np.testing.assert_array_equal(rig(visibility__minRange=9.5).step()["seen"], [False, True, True])
    behind = rig()
    behind.put(-POINTS, np.zeros((COUNT, 3)))
    assert not behind.step()["seen"].any()


def test_the_measured_attitude(rig):
    """Turned about the camera's axes by angles of the standard deviation, unit, the points in true axes."""
    sigma, n = 0.01, 1500
    one, exact = rig(camera__attitudeNoise=sigma), rig()
    turn = Rotation.from_rotvec([0.3, -0.2, 0.5])
    for each in (one, exact):
        each.put(turn.apply(POINTS), np.zeros((COUNT, 3)), turn.as_quat(scalar_first=True))
    np.testing.assert_array_equal(one.step()["points"], exact.step()["points"])
    np.testing.assert_allclose(exact["camera.measuredAttitude"], turn.as_quat(scalar_first=True), atol=1e-15)
    found = Rotation.from_quat([one.step()["camera.measuredAttitude"] for _ in range(n)], scalar_first=True)
    angles = (turn.inv() * found).as_rotvec() / sigma
    np.testing.assert_allclose(np.cov(angles.T), np.eye(3), atol=SIGMAS * np.sqrt(2 / n))
    np.testing.assert_allclose(angles.mean(axis=0), 0, atol=SIGMAS / np.sqrt(n))


def test_parameters_are_tuned_in_mid_run(rig):
    one = rig()
    assert one.step()["seen"].all()
    one["visibility.maxRange"] = 1.0
    assert one["seen"].all()
    assert not one.step()["seen"].any()
    one.refused(lambda: one.set("dropout", 1.0), "dropout: found value 1, expected a share from 0 to below 1")
    one.refused(lambda: one.set("sampling.period", 2.0), "sampling.period is fixed")


@pytest.mark.parametrize(
    "name, value, words",
    [
        ("camera.focalLength", 0.0, "expected a length in px above 0"),
        ("camera.baseline", -1.0, "expected a length in m above 0"),
        ("sampling.period", 1e-9, "expected at least 1e-06 s"),
        ("sampling.latency", 16 * PERIOD, "expected 0 to 15 periods"),
        ("seed", 0.5, "expected a whole number"),
        ("outliers.share", 1.0, "expected a share"),
        ("visibility.maxRange", -1.0, "expected at least visibility.minRange"),
    ],
)
def test_what_cannot_be_is_refused(rig_fmu, opened, name, value, words):
    importer = opened(Importer, rig_fmu)
    importer.fmu.setReal([importer.references[name]], [value])
    importer.refused(importer.initialise, name, words)


def test_inputs_without_a_direction_are_refused(rig):
    one = rig()
    before = one.all
    for name, value in (
        ("camera.attitude", np.full(4, 1e-60)),
        ("camera.attitude", np.full(4, 1e60)),  # longer than 1e50
        ("sun.direction", np.zeros(3)),
        ("sun.direction", np.full(3, 1e60)),
    ):
        kept = one[name]
        one[name] = value
        one.refused(one.step, f"{name}: found length {np.linalg.norm(value):g}")
        one[name] = kept
    np.testing.assert_array_equal(one.all, before)
    assert one.step()["sample.number"] == 1


def test_a_camera_without_an_attitude_sees_nothing(rig):
    """Some masters hand zeros to all connected inputs in their first step."""
    one = rig()
    one.put(POINTS, -POINTS, attitude=np.zeros(4))
    assert not one.step()["seen"].any()
    np.testing.assert_array_equal(one["camera.measuredAttitude"], [1, 0, 0, 0])
    one.put(POINTS, -POINTS)
    assert one.step()["seen"].all()


def test_a_time_too_far_for_the_period_is_refused(rig):
    one = rig(sampling__period=1e-6)
    one.refused(lambda: one.step(1e10), "sampling.period: found 1e-06 s")
    assert one.step()["sample.number"] == 500000


def test_starts_are_the_scenario_s(watched, tmp_path):
    sensor = Sensor.model_validate({"stereo": RIG, "dropout": 0.1, "outliers": {"share": 0.05, "size": 3.0}})
    tracking = Tracking(visibility="facing", max_incidence_deg=60.0)
    changed = watched.model_copy(update={"sensor": sensor, "tracking": tracking, "light": forces.LIGHT})
    description = fmpy.read_model_description(str(build_fmu(changed, tmp_path / "rig.fmu", unit="rig", fmi=3)))
    starts = {v.name: [float(x) for x in str(v.start).split()] for v in description.modelVariables if v.start}
    expected = {
        "camera.focalLength": 900.0, "camera.baseline": 0.8, "camera.pixelNoise": 0.4, "sampling.period": PERIOD,
        "dropout": 0.1, "outliers.share": 0.05, "outliers.size": 3.0, "visibility.maxIncidence": np.deg2rad(60.0),
        "sun.shadowRadius": forces.LIGHT.shadow_radius, "seed": 12345.0,
    }  # fmt: skip
    assert {name: starts[name] for name in expected} == {name: [value] for name, value in expected.items()}
    assert starts["sun.direction"] == list(forces.LIGHT.sun)


def test_a_seed_that_no_real_holds_is_refused(watched, tmp_path):
    large = watched.model_copy(update={"run": Run(duration=60.0, seed=2**53)})
    with pytest.raises(InputError, match=r"run\.seed: found 9007199254740992, expected below 2\*\*53"):
        build_fmu(large, tmp_path / "rig.fmu", unit="rig")
    with pytest.raises(InputError, match="unit: found 'lens', expected one of target, rig"):
        build_fmu(watched, tmp_path / "rig.fmu", unit="lens")


def test_the_command_names_it_after_its_scenario(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["build", "--scenario", "cubesat-class", "--unit", "rig"]) == 0
    assert "cubesat-class-rig.fmu: 10 features" in capsys.readouterr().out
    assert fmpy.read_model_description(str(tmp_path / "cubesat-class-rig.fmu")).modelName == "StereoRig"


def _continuous(root):
    variable(root, "points[2,1]").set("variability", "continuous")


@pytest.mark.parametrize(
    "mutate, words",
    [
        (_continuous, r"points\[2,1\]: is a continuous output, expected a discrete output"),
        (
            flag("CoSimulation", "maxOutputDerivativeOrder", "1"),
            "maxOutputDerivativeOrder: is declared, but .* sampled",
        ),
        (flag("CoSimulation", "canInterpolateInputs", "true"), "canInterpolateInputs: is declared, but .* sampled"),
        (flag("CoSimulation", "providesDirectionalDerivative", "true"), "sampled"),
    ],
    ids=["variability", "output derivatives", "input derivatives", "directional derivatives"],
)
def test_a_declaration_that_is_not_true_is_found(rig_fmu, tmp_path, mutate, words):
    found = [str(finding) for finding in check_unit(mutated(rig_fmu, tmp_path / "m.fmu", mutate), isolated=False)]
    assert any(re.search(words, line) for line in found), found

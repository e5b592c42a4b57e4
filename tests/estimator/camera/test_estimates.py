"""Estimates through a camera that turns: errors as large as claimed, and closed forms of what each error adds."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from baryscope.estimator.camera.attitude import AttitudeSeries
from baryscope.estimator.camera.camera import Camera
from baryscope.estimator.camera.rig import Rig
from baryscope.estimator.findings import Departure, UnknownPush
from baryscope.estimator.methods import attempt, estimate
from baryscope.estimator.options import PathOptions
from baryscope.estimator.prose import sentence
from baryscope.estimator.result import Estimate, Status
from free_paths import CHASER, ORBIT, at_rest, in_orbit
from oracles import inertial_states, propagate_kepler
from synthetic import ENVISAT, MU, attitude, make_case
from turning_camera import ARM, POINTS, RATE, scalar_first, turning_camera, uncertain_rig

pytestmark = pytest.mark.usefixtures("shared_pivot")

TIME = 4.0 * np.arange(120.0)
PATH = in_orbit(TIME)
BAND = (0.001, 0.999)  # of χ²


def nees(error, covariance):
    return float(error @ np.linalg.solve(covariance, error))


def through(seen, method, **options):
    return estimate(seen.tracks, method=method, orbit=ORBIT.model(), camera=seen.camera, options=PathOptions(**options))


def up_at(time):
    """Unit vectors (n, 3) from the Earth to the target, in C."""
    place = np.array([propagate_kepler(*inertial_states(ORBIT.model(), *CHASER)[0], MU, t)[0] for t in time], float)
    return place / np.linalg.norm(place, axis=1, keepdims=True)


def of_offset(found):
    """The normalised squared error of the centre of mass in the features' axes."""
    cluster = found.clusters[0]
    points = POINTS[cluster.features]
    turn = Rotation.align_vectors(cluster.points, points - points.mean(axis=0))[0]
    return nees(cluster.centre_of_mass + turn.apply(points.mean(axis=0)), cluster.covariance)


@pytest.mark.parametrize(("method", "draws"), [("pivot", 8), ("ml", 4), ("ekf", 4)])
def test_errors_are_as_large_as_claimed(method, draws):
    """On an orbit, where the motion tells a part of the boresight's error."""
    path, offset, predicted = [], [], []
    for seed in range(draws):
        seen = turning_camera(TIME, PATH, uncertain_rig(), noise=0.02, seed=seed)
        found = through(seen, method)
        assert found.status is Status.GOOD
        path.append(nees(found.position[60] - PATH[60], found.covariance[60]))
        offset.append(of_offset(found))
        predicted.append(found.predicted_rmse)
    low, high = chi2.ppf(BAND, 3 * draws)
    assert low < sum(path) < high
    assert low < sum(offset) < high
    assert np.median(predicted) < 0.026  # of 0.032, 1e-3 · 19 m across the line of sight and 0.01 m of each axis


def test_noise_of_the_attitude_alone():
    """It is 2 cm at the target in every frame, four times that of the features."""
    rig, sums = Rig(lever_arm=tuple(ARM), attitude_noise=1e-3), []
    for seed in range(8):
        found = through(turning_camera(TIME, PATH, rig, noise=0.005, seed=seed), "pivot", process_noise="none")
        assert found.noise.a_posteriori == pytest.approx(0.005, rel=0.05)
        sums.append(nees(found.position[60] - PATH[60], found.covariance[60]))
    low, high = chi2.ppf(BAND, 24)
    assert low < sum(sums) < high


@pytest.mark.parametrize(("method", "draws"), [("pivot", 12), ("ml", 4), ("ekf", 4)])
def test_frames_between_two_rows_of_the_attitude_share_its_noise(method, draws):
    """As of a star tracker that is slower than the camera, eight frames a row. Taken for new in every frame, it made
    these normalised squares three to four times as many as there are degrees of freedom."""
    rig, time, every, sums = Rig(attitude_noise=3e-4), 2.0 * np.arange(241.0), 8, []
    for seed in range(draws):
        path = in_orbit(time)
        seen = turning_camera(time, path, rig, noise=0.005, seed=seed, turn=Rotation.identity(len(time)))
        dense = seen.camera.attitude
        rows = Camera(AttitudeSeries(dense.time[::every], dense.quaternion[::every]), rig)
        found = through(replace(seen, camera=rows), method, process_noise="none")
        sums += [nees(found.position[k] - path[k], found.covariance[k]) for k in (20, 120, 220)]
    # Three times of a flight are not independent: as if they were one.
    low, high = chi2.ppf(BAND, 3 * draws)
    assert low < np.sum(sums) / 3 < high


def test_a_camera_that_swings_from_row_to_row_of_its_attitude_is_followed():
    """By 3° in a minute, with a row every 3 s, of which each frame is in the middle: 5e-4 rad off the great circle, the
    same in every frame as it is at the same time of the swing, 1 cm at the target, with a NEES of 42.
    """
    time, rig = 60.0 * np.arange(30.0) + 1.5, Rig(lever_arm=tuple(ARM))

    def swing(moments):
        return Rotation.from_rotvec(np.outer(np.deg2rad(3.0) * np.cos(2 * np.pi * (moments - 1.5) / 60), [0.6, 0.8, 0]))

    path, rows = in_orbit(time), np.arange(0.0, 1750.0, 3.0)
    seen = turning_camera(time, path, rig, noise=0.005, seed=1, turn=swing(time))
    camera = Camera(AttitudeSeries(rows, scalar_first(swing(rows))), rig)
    found = through(replace(seen, camera=camera), "pivot", process_noise="none")
    assert found.status is Status.GOOD
    assert max(nees(found.position[k] - path[k], found.covariance[k]) for k in (0, 15, -1)) < chi2.isf(1e-4, 3)


@pytest.mark.parametrize("told", [False, True], ids=["without covariances", "with covariances"])
def test_the_filter_knows_noise_of_the_attitude(told):
    """It is 2 cm at the target, far more than that of the features, and neither theirs nor a motion.

    The filter took it for process noise of 9e-5 m²/s³ and for noise of the features, 5.6 to 5.8 mm, and claimed 2.3 to
    2.5 m, where `pivot` claims 3.8 mm and `ml` 3.4.
    """
    rig, sums = Rig(lever_arm=tuple(ARM), attitude_noise=1e-3), []
    for seed in range(4):
        seen = turning_camera(TIME, PATH, rig, noise=0.005, seed=seed)
        if told:
            alike = np.where(seen.tracks.seen[..., None, None], 0.005**2 * np.eye(3), np.nan)
            seen = replace(seen, tracks=replace(seen.tracks, covariance=alike))
        found = through(seen, "ekf")
        assert found.noise.a_posteriori == pytest.approx(1.0 if told else 0.005, rel=0.05)
        assert found.process_noise.density == 0.0
        assert found.predicted_rmse < 0.005
        sums.append(nees(found.position[60] - PATH[60], found.covariance[60]))
    low, high = chi2.ppf(BAND, 3 * 4)
    assert low < sum(sums) < high


def still(rig):
    """A camera that turns with known errors, and a centre of mass at rest, almost without noise."""
    return turning_camera(TIME, at_rest(TIME), rig, noise=1e-4, turn=Rotation.identity(len(TIME)), errors=False)


METHODS = ["pivot", "ml", "ekf", "score"]


def at_rest_through(rig, method):
    seen = still(rig)
    return estimate(seen.tracks, method=method, camera=seen.camera, options=PathOptions(trajectory="fixed"))


@pytest.mark.parametrize("method", METHODS)
def test_a_scale_error_stands_along_the_line_of_sight(method):
    """σ_s² g gᵀ on the path and σ_s² d dᵀ on the offset, where nothing tells the scale."""
    found = at_rest_through(Rig(scale_deviation=1e-3), method)
    g = at_rest(TIME)[0]
    np.testing.assert_allclose(found.covariance[30], 1e-6 * np.outer(g, g), atol=2e-2 * 1e-6 * (g @ g))
    d = found.clusters[0].centre_of_mass
    expected = 1e-6 * np.outer(d, d)
    np.testing.assert_allclose(found.clusters[0].covariance, expected, atol=0.05 * np.trace(expected))


@pytest.mark.parametrize("method", METHODS)
def test_a_boresight_error_stands_across_the_line_of_sight(method):
    """σ² (r² 1 − g gᵀ), where the camera does not turn."""
    found = at_rest_through(Rig(boresight_deviation=1e-3), method)
    g = at_rest(TIME)[0]
    expected = 1e-6 * (g @ g * np.eye(3) - np.outer(g, g))
    np.testing.assert_allclose(found.covariance[30], expected, atol=2e-2 * np.trace(expected))
    assert [(one.name, one.unit) for one in found.forces] == [(f"boresight {axis}", "rad") for axis in "xyz"]


def test_a_lever_arm_that_is_forgotten_is_an_error_of_its_size():
    rig = Rig(lever_arm=tuple(ARM), lever_arm_deviation=0.01)
    seen = still(rig)
    found = at_rest_through(rig, "pivot")
    np.testing.assert_allclose(found.position, at_rest(TIME), atol=1e-3)
    np.testing.assert_allclose(found.covariance[30], 1e-4 * np.eye(3), atol=1e-6)
    options = PathOptions(trajectory="fixed")
    forgotten = estimate(seen.tracks, camera=replace(seen.camera, rig=Rig()), options=options)
    np.testing.assert_allclose(at_rest(TIME) - forgotten.position, np.tile(ARM, (len(TIME), 1)), atol=1e-3)


def test_a_forgotten_lever_arm_of_a_camera_that_looks_at_the_target_is_named_as_a_push():
    """A metre that stays where it is in LVLH, as of a camera that turns with the line of sight, takes 3 n² m/s² outward
    (Clohessy and Wiltshire 1960), of which the tracks tell no more: "something pushes" was all that was said of an
    answer 1 m off by more than 100 deviations.
    """
    orbit, time = ORBIT.model(), 4.0 * np.arange(250.0)
    path, up = in_orbit(time), up_at(time)
    case = make_case(time, attitude(ENVISAT, RATE, time), path - up, POINTS, noise=0.02)
    found = estimate(case.tracks, orbit=orbit)
    (push,) = found.findings
    assert isinstance(push, UnknownPush)
    outward, *others = np.abs(push.acceleration)
    mean_motion = np.sqrt(orbit.gravitational_parameter / orbit.semi_major_axis**3)
    assert outward == pytest.approx(3 * mean_motion**2, rel=0.1)  # of an orbit that is nearly a circle
    assert max(others) < 0.1 * outward
    assert nees(found.position[125] - path[125], found.covariance[125]) > 100**2
    assert "or the orbit or the camera's place is not as told" in sentence(push)


def test_a_prediction_of_the_filter_has_the_velocity_errors_of_its_camera():
    """A velocity is one, however it is asked for, and is off by as much as is claimed together with the position.

    A lever arm that turns with the camera moves what is seen, not the path. As if it did, the velocity's covariance was
    1.0e-9 m²/s², against 1.8e-11, and the sums, of 24 degrees of freedom, 800 to 2600, as errors of both were claimed
    to be tied to each other.
    """
    rig, squares = Rig(lever_arm=tuple(ARM), lever_arm_deviation=0.01), []
    true = np.concatenate([PATH, (in_orbit(TIME + 0.01) - in_orbit(TIME - 0.01)) / 0.02], axis=1)
    for seed in range(4):
        seen = turning_camera(TIME, PATH, rig, noise=0.005, seed=seed)
        found = through(seen, "ekf", process_noise="none")
        predicted = found.predict(TIME)
        np.testing.assert_allclose(
            found.motion.velocity_covariance, predicted.covariance[:, 3:, 3:], atol=1e-3 * predicted.covariance[0, 3, 3]
        )
        error = np.concatenate([predicted.position, predicted.velocity], axis=1) - true
        squares.append([nees(error[at], predicted.covariance[at]) for at in (0, 60, -1)])
    low, high = chi2.ppf(BAND, 6 * 4)
    total = np.sum(squares, axis=0)
    assert (total > low).all()
    assert (total < high).all(), total


@pytest.mark.parametrize("rig", [Rig(boresight_deviation=3e-3), Rig(scale_deviation=1e-2)], ids=["boresight", "scale"])
def test_a_prediction_of_a_feature_has_the_errors_of_its_camera(rig):
    """The body is seen turned, or grown: its features are elsewhere and move otherwise, with the path's own errors."""
    squares, times = [], np.array([10.3, TIME[-1] + 20.0])
    around = (times[:, None] + [-1e-3, 0.0, 1e-3]).ravel()
    arms = (attitude(ENVISAT, RATE, np.append(0.0, around))[1:] @ POINTS[4]).reshape(2, 3, 3)
    true = np.concatenate([at_rest(times) + arms[:, 1], (arms[:, 2] - arms[:, 0]) / 2e-3], axis=1)
    for seed in range(4):
        seen = turning_camera(TIME, at_rest(TIME), rig, noise=0.005, seed=seed, turn=Rotation.identity(len(TIME)))
        options = PathOptions(trajectory="fixed", process_noise="none", torque_noise="none")
        found = estimate(seen.tracks, method="ekf", camera=seen.camera, options=options).predict(times, "F4")
        error = np.concatenate([found.position, found.velocity], axis=1) - true
        squares.append([nees(one, own) for one, own in zip(error, found.covariance, strict=True)])
    low, high = chi2.ppf(BAND, 6 * 4)
    total = np.sum(squares, axis=0)
    assert (total > 0.5 * low).all()
    assert (total < 1.3 * high).all(), total


@pytest.mark.parametrize("method", ["pivot", "ml", "ekf"])
def test_features_have_their_true_size_where_the_motion_tells_the_scale(method):
    """A camera that turns with a lever arm of 1.2 m sees a point at rest move by its scale's error times that arm.

    `pivot` and `ml` told the features' places as they are seen, 1.6 % too small, which is 60 deviations, and `ml`
    predicted them there.
    """
    rig, time = Rig(lever_arm=tuple(ARM), scale_deviation=0.02), 4.0 * np.arange(60.0)
    turn = Rotation.from_rotvec(time[:, None] * [0.02, -0.015, 0.01])
    seen = turning_camera(time, at_rest(time), rig, noise=1e-3, seed=1, turn=turn)
    options = PathOptions(trajectory="fixed", process_noise="none")
    found = estimate(seen.tracks, method=method, camera=seen.camera, options=options)
    (scale,) = found.forces
    assert abs(scale.value) > 20 * scale.deviation
    cluster = found.clusters[0]
    spans = [np.linalg.norm(one - one.mean(axis=0)) for one in (cluster.points, POINTS[cluster.features])]
    assert abs(spans[0] / spans[1] - 1) < 4 * scale.deviation
    assert of_offset(found) < chi2.ppf(0.999, 3)
    assert found.feature_rms.max() < 1.3e-3  # of residuals, which are those of what is seen
    if method != "pivot":
        predicted = found.predict(time[[20, -1]], "F4")
        true = at_rest(time) + attitude(ENVISAT, RATE, time) @ POINTS[4]
        for k, frame in enumerate((20, -1)):
            assert nees(predicted.position[k] - true[frame], predicted.covariance[k, :3, :3]) < chi2.ppf(0.999, 3)


@pytest.mark.parametrize("method", ["pivot", "ml"])
def test_an_attitude_that_is_forgotten_is_announced(method):
    seen = turning_camera(TIME, PATH, Rig(lever_arm=tuple(ARM)), noise=0.02)
    found = attempt(seen.tracks, method=method, orbit=ORBIT.model())
    if isinstance(found, Estimate):
        departs = any(isinstance(finding, Departure) for finding in found.findings)
        assert departs or not found.status.trustworthy


def test_screws_tell_what_they_do_not_hold():
    seen = turning_camera(TIME, PATH, uncertain_rig(), noise=0.02)
    found = estimate(seen.tracks, method="screw-gpa", camera=seen.camera)
    assert found.covariance is None
    assert [one.deviation for one in found.forces] == [1e-3] * 3 + [1e-4] + [0.01] * 3

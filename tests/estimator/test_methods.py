"""Requirements for `pivot` and `ml`; the true values come from tests/synthetic.py."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator.methods import CLAIMING, METHODS, PREDICTING, TURNING, estimate
from baryscope.estimator.options import PathOptions
from baryscope.estimator.prose import verdict
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import ComputationError, InputError
from free_paths import (
    BOTH,
    CLUSTERS,
    FEATURES,
    NOISE,
    PATHS,
    RATE,
    TEN,
    assert_as_few_frames,
    assert_good,
    at_rest,
    fixed_case,
    found_by,
    on_parabola,
    rms,
    squared_error_of_cluster,
    turning,
    with_positions,
)
from synthetic import ENVISAT, Case, attitude, make_case

pytestmark = pytest.mark.usefixtures("shared_pivot")


@pytest.mark.parametrize("path", PATHS)
@BOTH
def test_exact_without_noise(method, path):
    """Through clusters and gaps, with a tenth of the observations missing."""
    time, R = turning(240)
    case = make_case(time, R, PATHS[path][0](time), TEN, clusters=CLUSTERS)
    position = case.tracks.position.copy()
    position[np.random.default_rng(0).random(position.shape[:2]) < 0.1] = np.nan
    found = found_by(method, with_positions(case, position), path)
    np.testing.assert_allclose(found.position, case.com, atol=1e-7)
    np.testing.assert_array_equal(found.time, time)
    assert verdict(found.observability).startswith("observable")
    assert list(found.rejected_features) == []
    for index in range(len(found.clusters)):
        cluster = found.clusters[index]
        members = [case.tracks.labels.index(label) for label in cluster.labels]
        centroid = TEN[members].mean(axis=0)
        assert np.linalg.norm(cluster.centre_of_mass) == pytest.approx(np.linalg.norm(centroid), abs=1e-6)


@pytest.mark.parametrize("method", METHODS)
def test_a_method_gives_what_the_list_says(method):
    """A covariance, predictions of the centre of mass, and those of points, or none of them."""
    time, R = turning(120)
    case = make_case(time, R, at_rest(time), FEATURES, noise=NOISE, seed=1)
    found = estimate(case.tracks, method=method)
    assert (found.covariance is not None) == (method in CLAIMING)
    for point, able in ((None, PREDICTING), (case.tracks.labels[0], TURNING)):
        if method in able:
            assert np.isfinite(found.predict([time[-1] + 1.0], point).position).all()
        else:
            with pytest.raises((InputError, ComputationError), match=r"predict|attitude"):
                found.predict([time[-1] + 1.0], point)


@pytest.mark.parametrize("path", PATHS)
@BOTH
def test_clusters_and_gaps_with_noise(method, path):
    time, R = turning(240)
    case = make_case(time, R, PATHS[path][0](time), TEN, noise=NOISE, seed=1, clusters=CLUSTERS)
    found = found_by(method, case.tracks, path)
    assert_good(found, case)
    assert rms(found, case) < 0.005
    shapes = [sorted(cluster.labels) for cluster in found.clusters]
    assert sorted(shapes, key=len) == [["F2", "F8", "F9"], [f"F{k}" for k in range(8)]]
    for index in range(2):
        assert squared_error_of_cluster(found, case, index) < 4.5**2
    # 220 frames with 5 features: 3,000 numbers, of which the residuals' deviation is known to 1.3 %.
    assert found.noise.a_posteriori == pytest.approx(NOISE, rel=0.06)


@BOTH
def test_the_estimate_follows_a_rigid_motion_of_the_frame(method):
    time, R = turning(200)
    case = make_case(time, R, on_parabola(time), FEATURES, noise=NOISE, seed=3)
    turn, shift = Rotation.from_rotvec([0.4, -1.0, 2.0]).as_matrix(), np.array([100.0, -50.0, 7.0])
    moved = FeatureTracks(time + 1000.0, case.tracks.position @ turn.T + shift, case.tracks.labels)
    before, after = (found_by(method, tracks, "polynomial:2") for tracks in (case.tracks, moved))
    # Convergence is to a share of the standard deviation of 1 mm: `pivot` to 1e-5 of its first step, `ml` to 1 %.
    np.testing.assert_allclose(after.position, before.position @ turn.T + shift, atol=2e-5)
    np.testing.assert_allclose(after.covariance, turn @ before.covariance @ turn.T, atol=2e-3 * before.covariance.max())


@BOTH
def test_order_of_features_does_not_matter(method):
    tracks = fixed_case(seed=4).tracks
    order = [5, 2, 7, 0, 1, 3, 6, 4]
    other = FeatureTracks(tracks.time, tracks.position[:, order], tuple(tracks.labels[i] for i in order))
    one, two = (found_by(method, each) for each in (tracks, other))
    np.testing.assert_allclose(two.position, one.position, atol=2e-5)
    assert set(two.clusters[0].labels) == set(tracks.labels)


SAMPLINGS = {
    "three features": lambda: fixed_case(features=FEATURES[[0, 2, 5]], seed=1),
    "coplanar features": lambda: fixed_case(features=FEATURES * [1, 1, 0] + [0, 0, 0.3]),
    "50 frames at 0.1 Hz": lambda: fixed_case(50, step=10.0, relative_rate=0.3),
    "50 frames at 0.1 Hz, 70° apart": lambda: fixed_case(50, step=10.0, features=FEATURES[:5]),
    "5000 frames at 100 Hz": lambda: fixed_case(5000, step=0.01, features=FEATURES[:5]),
}


@pytest.mark.parametrize("name", SAMPLINGS)
@BOTH
def test_few_features_and_different_sampling_rates(method, name):
    case = SAMPLINGS[name]()
    found = found_by(method, case.tracks)
    assert_good(found, case)
    assert found.predicted_rmse < 0.004


def irregular(kind):
    rng = np.random.default_rng(5)
    return {
        "jittered": np.arange(200.0) + rng.uniform(-0.4, 0.4, 200),
        "at random": np.sort(rng.uniform(0, 200, 200)),
        "long gaps": np.cumsum(rng.exponential(1.0, 200) ** 2),
    }[kind]


@pytest.mark.parametrize("kind", ["jittered", "at random", "long gaps"])
@BOTH
def test_irregular_times(method, kind):
    time = irregular(kind)
    case = make_case(time, attitude(ENVISAT, RATE, time), at_rest(time), FEATURES, noise=NOISE, seed=2)
    assert_as_few_frames(found_by(method, case.tracks), case, share=1.0)


def subsampled(kind):
    """Positions of a case of 200 frames and 5 features, and the share of frames left."""
    case, rng = fixed_case(features=FEATURES[:5], seed=6), np.random.default_rng(6)
    position = case.tracks.position.copy()
    if kind == "40 % of the frames with none to two features":
        for k in np.nonzero(rng.random(200) < 0.4)[0]:
            position[k, rng.permutation(5)[rng.integers(0, 3) :]] = np.nan
        return case, position, 0.6
    every, first = {"every tenth frame empty": (10, 0), "every third frame empty": (3, 0)}.get(kind, (2, 2))
    position[::every, first:] = np.nan
    return case, position, 1 - 1 / every


@pytest.mark.parametrize(
    "kind",
    [
        "40 % of the frames with none to two features",
        "every tenth frame empty",
        "every third frame empty",
        "every other frame with two features",
    ],
)
@BOTH
def test_frames_without_an_attitude_are_bridged(method, kind):
    """Also intervals of a single frame."""
    case, position, share = subsampled(kind)
    found = found_by(method, with_positions(case, position))
    assert len(found.position) == 200
    assert_as_few_frames(found, case, share * 5 / 8)


@BOTH
def test_empty_frames_agree_with_missing_frames(method):
    case = fixed_case(features=FEATURES[:5])
    kept = np.arange(200) % 3 > 0
    position = case.tracks.position.copy()
    position[~kept] = np.nan
    whole = found_by(method, with_positions(case, position))
    part = found_by(method, FeatureTracks(case.tracks.time[kept], position[kept], case.tracks.labels))
    np.testing.assert_allclose(part.position, whole.position[kept], atol=2e-5)


@BOTH
def test_two_clusters_with_three_collinear_tie_points(method):
    """They share no other feature: the relative rotation of the bodies about the line is undetermined."""
    features = FEATURES.copy()
    features[2:5] = np.array([0.5, 1, 2]) + np.outer([1.0, 2, 3], [1, 0.5, -0.3])
    clusters = [(0, 100, [0, 1, 2, 3, 4]), (100, 200, [2, 3, 4, 5, 6])]
    case = fixed_case(features=features, clusters=clusters, seed=2)
    assert_good(found_by(method, case.tracks), case)


@BOTH
def test_a_known_deviation_scales_the_covariance_and_nothing_else(method):
    case = fixed_case()
    plain, known = found_by(method, case.tracks), found_by(method, case.tracks, sigma=0.05)
    np.testing.assert_allclose(known.position, plain.position, atol=1e-12)
    factor = (0.05 / plain.noise.a_posteriori) ** 2
    # Not exactly in proportion, as the spurious information depends on the noise, too.
    np.testing.assert_allclose(known.covariance, factor * plain.covariance, rtol=0.01, atol=1e-8)
    # The residuals have another noise than the given one.
    assert (known.noise.a_priori, plain.noise.a_priori) == (0.05, None)
    assert known.noise.a_posteriori == pytest.approx(NOISE, rel=0.06)
    assert known.options.sigma == 0.05


@BOTH
def test_given_covariances_determine_the_weights(method):
    """Every other feature is ten times as noisy, with its covariance; all given deviations are twice the true ones."""
    case, rng = fixed_case(noise=0.0), np.random.default_rng(7)
    deviation = np.where(np.arange(8) % 2, 0.2, 0.02)[:, None, None]
    position = case.tracks.position + deviation[..., 0] * rng.normal(size=case.tracks.position.shape)
    covariance = np.broadcast_to(4 * deviation**2 * np.eye(3), (*position.shape, 3))
    tracks = FeatureTracks(case.tracks.time, position, case.tracks.labels, covariance)
    found = found_by(method, tracks, noise="fixed")
    assert_good(found, case)
    # 4,800 numbers: 2 % of a variance is a standard deviation.
    assert found.noise.a_posteriori**2 == pytest.approx(0.25, rel=0.1)
    blind = found_by(method, with_positions(case, position))
    assert found.predicted_rmse < 0.7 * blind.predicted_rmse
    known = found_by(method, tracks, noise="fixed", sigma=0.5)
    assert known.noise.a_priori == 0.5
    assert known.noise.a_posteriori == pytest.approx(0.5, rel=0.05)


@BOTH
def test_covariances_that_do_not_vary_are_not_taken_for_a_rigs(method):
    """0.3 m in depth at 20 m, whatever the range: evaluated at the estimated point they move it by 6 σ²/r, 3 cm."""
    errors, claims = [], []
    for seed in range(4):
        case, rng = fixed_case(noise=0.0), np.random.default_rng([seed, 9])
        ahead = case.com[0] / np.linalg.norm(case.com[0])
        along = ahead[:, None] * ahead
        covariance = 0.01**2 * (np.eye(3) - along) + 0.3**2 * along
        noise = rng.multivariate_normal(np.zeros(3), covariance, case.tracks.position.shape[:2])
        position = case.tracks.position + noise
        told = np.broadcast_to(covariance, (*position.shape, 3))
        found = found_by(method, FeatureTracks(case.tracks.time, position, case.tracks.labels, told))
        errors.append((found.position[0] - case.com[0]) @ ahead)
        claims.append(ahead @ found.covariance[0] @ ahead)
    # The mean of four errors has half the deviation of one.
    assert abs(np.mean(errors)) < 3 * np.sqrt(np.mean(claims)) / 2 < 0.015


@BOTH
def test_invalid_combinations_of_options_are_refused(method):
    tracks = fixed_case(20).tracks
    with pytest.raises(InputError, match="needs the target's orbit"):
        estimate(tracks, method=method, options=PathOptions(trajectory="relative-orbit"))
    with pytest.raises(InputError, match="trajectory is 'magic'"):
        estimate(tracks, method=method, options=PathOptions(trajectory="magic"))


@pytest.mark.parametrize(
    "options, expected",
    [
        ({"sigma": 0.0}, "sigma is 0.0"),
        ({"sigma": float("nan")}, "sigma is nan"),
        ({"sigma": float("inf")}, "sigma is inf"),
        ({"noise": "white"}, "noise is 'white', expected one of auto, stereo, fixed"),
        ({"torque": "drag"}, "torque is 'drag', expected one of none, gravity-gradient"),
        ({"sigma": "0.1"}, "sigma is '0.1', expected a standard deviation of 1e-09 to 1e+09 m"),
        ({"sigma": True}, "sigma is True"),
        ({"sigma": np.array([0.1, 0.2])}, "sigma is array([0.1, 0.2])"),
        ({"process_noise": None}, "process_noise is None, expected auto, none or a density above 0 to 1e+06 m²/s³"),
        ({"process_noise": 0.0}, "process_noise is 0.0, expected auto, none or a density above 0"),
        ({"torque_noise": [1e-9]}, "torque_noise is [1e-09], expected auto, none or a density above 0"),
        ({"trajectory": 2}, "trajectory is 2, expected a text as polynomial:2"),
        ({"noise": np.array([1, 2])}, "noise is array([1, 2]), expected one of auto, stereo, fixed"),
        ({"acceleration": "thrust.csv"}, "acceleration: found str, expected KnownAcceleration"),
    ],
)
def test_wrong_options_are_refused(options, expected):
    """A number in quotes, as read from a file of settings, was a TypeError of ours."""
    with pytest.raises(InputError, match="expected") as caught:
        PathOptions(**options)
    assert expected in str(caught.value)


def test_other_kinds_of_arguments_are_named_with_what_makes_them():
    """An array of positions and the name of an orbit file, as newcomers try, ended in an AttributeError of ours."""
    tracks = make_case(*turning(20), at_rest(np.arange(20)), FEATURES).tracks
    for arguments, expected in (
        ((tracks.position,), "tracks: found ndarray, expected FeatureTracks, as of read_tracks, tracks_of or"),
        ((None,), "tracks: found NoneType, expected FeatureTracks"),
        ((tracks, {"orbit": "target.toml"}), "orbit: found str, expected Orbit, as of load_orbit"),
        ((tracks, {"camera": "attitude.csv"}), r"camera: found str, expected Camera, as of Camera\.load"),
    ):
        with pytest.raises(InputError, match=f"^{expected}"):
            estimate(arguments[0], **(arguments[1] if len(arguments) > 1 else {}))


def test_the_list_of_methods_and_the_default():
    assert METHODS["pivot"].options is METHODS["ml"].options is PathOptions
    assert estimate(fixed_case(20).tracks).method == "pivot"
    with pytest.raises(InputError, match="ml takes PathOptions, found ScrewOptions"):
        estimate(fixed_case(20).tracks, method="ml", options=METHODS["screw-gpa"].options())


def test_cases_are_frozen_truths():
    """The tests above share their cases, which no test may change."""
    case = fixed_case(noise=0.0)
    assert isinstance(case, Case)
    seen = case.com[:, None] + FEATURES @ np.swapaxes(case.R_I_B, 1, 2)
    np.testing.assert_allclose(case.tracks.position, seen, atol=1e-12)


@pytest.mark.parametrize("method", [name for name in METHODS if name in CLAIMING])
def test_a_feature_that_is_seen_once_changes_nothing(method):
    """It has a place of its own, and tells of nothing else; but it counted, and moved answers by up to 2.5 claims."""
    time, R = turning(60)
    case = make_case(time, R, at_rest(time), FEATURES, noise=NOISE, seed=2)
    position = np.full((60, len(FEATURES) + 1, 3), np.nan)
    position[:, :-1], position[20, -1] = case.tracks.position, case.tracks.position[20, 0] + [0.5, 0.1, -0.2]
    plain = estimate(case.tracks, method=method)
    found = estimate(FeatureTracks(time, position, (*case.tracks.labels, "glimpsed")), method=method)
    # Sums over one feature more are rounded otherwise, by which `ekf` may end another step away.
    deviations = np.sqrt(np.diagonal(plain.covariance, axis1=1, axis2=2))
    assert (np.abs(found.position - plain.position) < 1e-3 * deviations).all()
    scale = deviations[:, :, None] * deviations[:, None]
    assert (np.abs(found.covariance - plain.covariance) < 2e-3 * scale).all()
    assert not found.used[:, -1].any()

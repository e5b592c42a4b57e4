"""What both methods of free paths, `pivot` and `ml`, must do; the truth is that of tests/synthetic.py."""

from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from baryscope.estimator.bound import cramer_rao_bound
from baryscope.estimator.methods import METHODS, estimate
from baryscope.estimator.options import PathOptions
from baryscope.estimator.rotation import Rotation as Tumbling
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import ComputationError, InputError
from baryscope.models.scenario import Chaser, FeaturePoint, Features, Run, Scenario, Sensor, Target
from oracles import inertial_states, propagate_kepler
from synthetic import ENVISAT, MU, Case, Orbit, attitude, box_features, make_case

BOTH = pytest.mark.parametrize("method", ["pivot", "ml"])
RATE = np.deg2rad([2.4, 4.4, 4.8])
ORBIT = Orbit()
CHASER = (np.array([-4.0, -18.0, 3.0]), np.array([0.004, -0.007, 0.01]))
FEATURES = box_features(8, (10, 5, 5), seed=3, centre=(1, 0.5, 0))
NOISE = 0.02
# Four clusters, gaps, features that return; the first three share three features with another one, the last does not.
TEN = box_features(10, (10, 5, 5), seed=4, centre=(1, 0.5, 0))
CLUSTERS = [
    (0.0, 80.0, [0, 1, 2, 3, 4]),
    (90.0, 150.0, [2, 3, 4, 5, 6]),
    (155.0, 200.0, [0, 3, 5, 6, 7]),
    (205.0, 240.0, [2, 8, 9]),
]


@cache
def turning(count, step=1.0, pace=1.0):
    """Times and attitudes of Envisat, turning at 7 °/s or a part of it."""
    time = step * np.arange(float(count))
    return time, attitude(ENVISAT, pace * RATE, time)


def at_rest(time):
    return np.tile([4.0, -19.0, 3.0], (len(time), 1))


def on_parabola(time):
    s = time[:, None] / 200
    return np.array([4.0, -19, 3]) + s * [0.5, 0.2, -0.3] + s**2 * [-0.2, 0.1, 0.1]


def in_orbit(time):
    """By two Kepler orbits."""
    target, chaser = inertial_states(ORBIT.model(), *CHASER)
    difference = [propagate_kepler(*target, MU, t)[0] - propagate_kepler(*chaser, MU, t)[0] for t in time]
    return np.array(difference, dtype=float)


PATHS = {
    "fixed": (at_rest, "fixed", None),
    "polynomial:2": (on_parabola, "polynomial:2", None),
    "relative-orbit": (in_orbit, None, ORBIT.model()),
}


def found_by(method, tracks, path="fixed", **options):
    _, trajectory, orbit = PATHS[path]
    return estimate(tracks, method=method, orbit=orbit, options=PathOptions(trajectory=trajectory, **options))


def fixed_case(count=200, *, step=1.0, pace=1.0, noise=NOISE, seed=0, features=FEATURES, clusters=None):
    time, R = turning(count, step, pace)
    return make_case(time, R, at_rest(time), features, noise=noise, seed=seed, clusters=clusters)


def with_positions(case, position):
    return FeatureTracks(case.tracks.time, position, case.tracks.labels)


def rms(found, case):
    return float(np.sqrt(np.mean(np.sum((found.position - case.com) ** 2, axis=1))))


def squared_error(found, case):
    """The normalised squared error in the middle of the time, χ²₃."""
    k = len(case.com) // 2
    error = found.position[k] - case.com[k]
    return float(error @ np.linalg.solve(found.covariance[k], error))


def squared_error_of_cluster(found, case, index=0):
    """The same of the centre of mass in axes that a cluster's features hold: the truth is turned to them by scipy."""
    cluster = found.diagnostics["clusters"][index]
    members = [case.tracks.labels.index(label) for label in cluster["features"]]
    centroid = case.features[members].mean(axis=0)
    shape = np.array(list(cluster["features"].values()))
    turn = Rotation.align_vectors(shape, case.features[members] - centroid)[0].as_matrix()
    error = np.array(cluster["centre_of_mass"]) + turn @ centroid
    return float(error @ np.linalg.solve(cluster["centre_of_mass_covariance"], error))


def assert_good(found, case, deviations=4.5):
    """Observable, settled, nothing to remark, and the errors what the covariance says: χ₃ beyond 4.5 is 1 in 6,000."""
    assert found.diagnostics["verdict"].startswith("observable")
    assert found.diagnostics["converged"]
    assert found.diagnostics["remarks"] == []
    assert squared_error(found, case) < deviations**2


def assert_as_few_frames(found, case, share):
    """Good, and hardly worse than if nothing were wrong, but for the share of frames that tell."""
    assert_good(found, case)
    assert found.diagnostics["position_deviation"] < 1.3 * 0.001 / np.sqrt(share)


@pytest.mark.parametrize("path", PATHS)
@BOTH
def test_exact_without_noise(method, path):
    """Through clusters and gaps, with a tenth of the sightings missing."""
    time, R = turning(240)
    case = make_case(time, R, PATHS[path][0](time), TEN, clusters=CLUSTERS)
    position = case.tracks.position.copy()
    position[np.random.default_rng(0).random(position.shape[:2]) < 0.1] = np.nan
    found = found_by(method, with_positions(case, position), path)
    np.testing.assert_allclose(found.position, case.com, atol=1e-7)
    np.testing.assert_array_equal(found.time, time)
    assert found.diagnostics["verdict"].startswith("observable")
    assert found.diagnostics["rejected_features"] == []
    for index in range(len(found.diagnostics["clusters"])):
        cluster = found.diagnostics["clusters"][index]
        members = [case.tracks.labels.index(label) for label in cluster["features"]]
        centroid = TEN[members].mean(axis=0)
        assert np.linalg.norm(cluster["centre_of_mass"]) == pytest.approx(np.linalg.norm(centroid), abs=1e-6)


@pytest.mark.parametrize("path", PATHS)
@BOTH
def test_clusters_and_gaps_with_noise(method, path):
    time, R = turning(240)
    case = make_case(time, R, PATHS[path][0](time), TEN, noise=NOISE, seed=1, clusters=CLUSTERS)
    found = found_by(method, case.tracks, path)
    assert_good(found, case)
    assert rms(found, case) < 0.005
    shapes = [sorted(cluster["features"]) for cluster in found.diagnostics["clusters"]]
    assert sorted(shapes, key=len) == [["F2", "F8", "F9"], [f"F{k}" for k in range(8)]]
    for index in range(2):
        assert squared_error_of_cluster(found, case, index) < 4.5**2
    # 220 frames with 5 features: 3,000 numbers, of which the residuals' deviation is known to 1.3 %.
    assert found.diagnostics["residual_rms"] == pytest.approx(NOISE, rel=0.06)


@BOTH
def test_a_rigid_motion_of_the_frame_moves_the_estimate_along(method):
    time, R = turning(200)
    case = make_case(time, R, on_parabola(time), FEATURES, noise=NOISE, seed=3)
    turn, shift = Rotation.from_rotvec([0.4, -1.0, 2.0]).as_matrix(), np.array([100.0, -50.0, 7.0])
    moved = FeatureTracks(time + 1000.0, case.tracks.position @ turn.T + shift, case.tracks.labels)
    before, after = (found_by(method, tracks, "polynomial:2") for tracks in (case.tracks, moved))
    # An estimate settles to a part of its deviation of 1 mm only: `pivot` to 1e-5 of its first step, `ml` to 1 %.
    np.testing.assert_allclose(after.position, before.position @ turn.T + shift, atol=2e-5)
    np.testing.assert_allclose(after.covariance, turn @ before.covariance @ turn.T, atol=2e-3 * before.covariance.max())


@BOTH
def test_order_of_features_does_not_matter(method):
    tracks = fixed_case(seed=4).tracks
    order = [5, 2, 7, 0, 1, 3, 6, 4]
    other = FeatureTracks(tracks.time, tracks.position[:, order], tuple(tracks.labels[i] for i in order))
    one, two = (found_by(method, each) for each in (tracks, other))
    np.testing.assert_allclose(two.position, one.position, atol=2e-5)
    assert set(two.diagnostics["clusters"][0]["features"]) == set(tracks.labels)


SAMPLINGS = {
    "three features": lambda: fixed_case(features=FEATURES[[0, 2, 5]], seed=1),
    "coplanar features": lambda: fixed_case(features=FEATURES * [1, 1, 0] + [0, 0, 0.3]),
    "50 frames at 0.1 Hz": lambda: fixed_case(50, step=10.0, pace=0.3),
    "50 frames at 0.1 Hz, 70° apart": lambda: fixed_case(50, step=10.0, features=FEATURES[:5]),
    "5000 frames at 100 Hz": lambda: fixed_case(5000, step=0.01, features=FEATURES[:5]),
}


@pytest.mark.parametrize("name", SAMPLINGS)
@BOTH
def test_few_features_and_all_rates_of_sampling(method, name):
    case = SAMPLINGS[name]()
    found = found_by(method, case.tracks)
    assert_good(found, case)
    assert found.diagnostics["position_deviation"] < 0.004


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


def thinned(kind):
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
def test_frames_that_show_too_little_are_bridged(method, kind):
    """Also where a single frame between two others is all that an interval has."""
    case, position, share = thinned(kind)
    found = found_by(method, with_positions(case, position))
    assert len(found.position) == 200
    assert_as_few_frames(found, case, share * 5 / 8)


@BOTH
def test_empty_frames_and_frames_left_out_are_the_same(method):
    case = fixed_case(features=FEATURES[:5])
    kept = np.arange(200) % 3 > 0
    position = case.tracks.position.copy()
    position[~kept] = np.nan
    whole = found_by(method, with_positions(case, position))
    part = found_by(method, FeatureTracks(case.tracks.time[kept], position[kept], case.tracks.labels))
    np.testing.assert_allclose(part.position, whole.position[kept], atol=2e-5)


@BOTH
def test_three_features_in_a_line_that_tie_two_clusters(method):
    """All they share: an interval may go on across the change, but the bodies' turn about the line is open there."""
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
    factor = (0.05 / plain.diagnostics["residual_rms"]) ** 2
    # Not quite in proportion: the noise also says what only seems to be seen.
    np.testing.assert_allclose(known.covariance, factor * plain.covariance, rtol=0.01, atol=1e-8)
    assert known.diagnostics["residual_rms"] == 0.05
    assert known.diagnostics["options"]["sigma"] == 0.05


@BOTH
def test_given_covariances_weigh(method):
    """Every other feature is ten times as noisy, and says so; the stated ones are twice the true deviations."""
    case, rng = fixed_case(noise=0.0), np.random.default_rng(7)
    deviation = np.where(np.arange(8) % 2, 0.2, 0.02)[:, None, None]
    position = case.tracks.position + deviation[..., 0] * rng.normal(size=case.tracks.position.shape)
    covariance = np.broadcast_to(4 * deviation**2 * np.eye(3), (*position.shape, 3))
    tracks = FeatureTracks(case.tracks.time, position, case.tracks.labels, covariance)
    found = found_by(method, tracks, noise="fixed")
    assert_good(found, case)
    # 4,800 numbers: 2 % of a variance is a standard deviation.
    assert found.diagnostics["variance_factor"] == pytest.approx(0.25, rel=0.1)
    blind = found_by(method, with_positions(case, position))
    assert found.diagnostics["position_deviation"] < 0.7 * blind.diagnostics["position_deviation"]
    known = found_by(method, tracks, noise="fixed", sigma=0.5)
    assert known.diagnostics["variance_factor"] == 0.25


@pytest.mark.parametrize("share", [0.1, 0.3])
@BOTH
def test_blunders_are_rejected(method, share):
    case, rng = fixed_case(300, seed=8), np.random.default_rng(8)
    wrong = rng.random((300, 8)) < share
    position = case.tracks.position + np.where(wrong[..., None], 2 / np.sqrt(3) * rng.normal(size=(300, 8, 3)), 0)
    found = found_by(method, with_positions(case, position))
    assert_good(found, case)
    assert found.diagnostics["rejected_share"] == pytest.approx(wrong.mean(), abs=0.03)
    assert found.diagnostics["rejected_features"] == []
    # The noise is that of the others, not quite without those that lie within 4.5 deviations by chance.
    assert found.diagnostics["residual_rms"] == pytest.approx(NOISE, rel=0.05)
    clean = found_by(method, case.tracks)
    assert found.diagnostics["position_deviation"] < 1.35 * clean.diagnostics["position_deviation"]


@BOTH
def test_swapped_labels_are_rejected_where_they_are(method):
    case = fixed_case(300, seed=9)
    position = case.tracks.position.copy()
    for begin, (one, two) in ((40, (0, 1)), (120, (2, 6)), (200, (3, 4))):
        position[begin : begin + 40, [one, two]] = position[begin : begin + 40, [two, one]]
    found = found_by(method, with_positions(case, position))
    assert_good(found, case)
    stretches = found.diagnostics["rejected_sightings"]
    expected = {"F0": 40, "F1": 40, "F2": 120, "F6": 120, "F3": 200, "F4": 200}
    assert set(stretches) >= set(expected)
    for label, begin in expected.items():
        assert [float(begin), begin + 39.0] in stretches[label]
    assert found.diagnostics["rejected_share"] == pytest.approx(240 / 2400, abs=0.002)


@BOTH
def test_a_feature_that_slides_is_rejected(method):
    """At 2 cm/s along the body from 100 s on, and at 5 mm/s from the beginning."""
    case = fixed_case(300, seed=10)
    for start, speed in ((100, 0.02), (0, 0.005)):
        way = speed * np.maximum(case.tracks.time - start, 0)
        position = case.tracks.position.copy()
        position[:, 3] += way[:, None] * (case.R_I_B @ [0, 0.6, 0.8])
        found = found_by(method, with_positions(case, position))
        assert found.diagnostics["rejected_features"] == ["F3"]
        assert squared_error(found, case) < 4.5**2
        # Of the 2,100 others, χ²₃ puts 0.4 beyond the gate.
        others = {label: times for label, times in found.diagnostics["rejected_sightings"].items() if label != "F3"}
        assert sum(map(len, others.values())) <= 4
        begin, end = max(found.diagnostics["rejected_sightings"]["F3"], key=lambda stretch: stretch[1] - stretch[0])
        if start:
            assert 100 <= begin <= 115
            assert end == 299


STRANGERS = {
    "anywhere": lambda case, rng: case.com + 4 * rng.normal(size=case.com.shape),
    "at rest in C": lambda case, rng: np.array([3.0, -17.0, 1.0]) + NOISE * rng.normal(size=case.com.shape),
    "of another body": lambda case, rng: case.com + np.swapaxes(case.R_I_B, 1, 2) @ [3.0, 1.0, 2.0],
}


@pytest.mark.parametrize("kind", STRANGERS)
@BOTH
def test_a_feature_that_is_not_of_the_body_is_rejected(method, kind):
    """In all frames, so that it has no usual distance to any other."""
    case = fixed_case(300, seed=10)
    position = case.tracks.position.copy()
    position[:, 3] = STRANGERS[kind](case, np.random.default_rng(0))
    found = found_by(method, with_positions(case, position))
    assert_good(found, case)
    assert found.diagnostics["rejected_features"] == ["F3"]


def pure_spin(noise, seed, path="fixed"):
    time = np.arange(200.0)
    R = Rotation.from_rotvec(np.outer(np.deg2rad(4.0) * time, [0, 0.6, 0.8])).as_matrix()
    return make_case(time, R, PATHS[path][0](time), FEATURES, noise=noise, seed=seed)


@pytest.mark.parametrize("path", ["fixed", "polynomial:2"])
@BOTH
def test_a_pure_spin_hides_the_place_along_its_axis(method, path):
    """No motion tells a point on the axis from another: that is said, without noise and with it."""
    draws = [(0.0, 0), (NOISE, 1), *([(NOISE, seed) for seed in range(2, 20)] if method == "pivot" else [])]
    for noise, seed in draws:
        case = pure_spin(noise, seed, path)
        found = found_by(method, case.tracks, path)
        assert found.diagnostics["verdict"].startswith("along-axis position not observable")
        axis = np.array([0, 0.6, 0.8])
        error = found.position[100] - case.com[100]
        across = error - axis * (axis @ error)
        assert np.linalg.norm(across) < 0.01
        assert abs(axis @ error) < 3 * np.sqrt(axis @ found.covariance[100] @ axis)


@BOTH
def test_the_hidden_place_is_told_in_the_clusters_axes_too(method):
    """The axis along which nothing is known is that of the spin, also where the last step along it was a long one."""
    for seed in range(6 if method == "pivot" else 2):
        case = pure_spin(NOISE, seed)
        assert squared_error_of_cluster(found_by(method, case.tracks), case) < 4.5**2


# Frames, pace and path of what is too short or too slow; pace 1 is 7 °/s.
FAINT = {
    "20 frames, 14° in all": (20, 0.1, "fixed"),
    "20 frames, 1.4° in all": (20, 0.01, "fixed"),
    "20 frames, 1.4° in all, in orbit": (20, 0.01, "relative-orbit"),
    "200 frames, 14° in all": (200, 0.01, "fixed"),
    "200 frames, 14° in all, in orbit": (200, 0.01, "relative-orbit"),
    "at rest": (200, 0.0, "fixed"),
}


@pytest.mark.parametrize("name", FAINT)
@BOTH
def test_too_little_turning_is_said_or_the_error_is_what_is_said(method, name):
    """A computation that could not be done, or an error of at most 3.5 of its deviations in the worst direction."""
    count, pace, path = FAINT[name]
    time, R = turning(count, 1.0, pace)
    for seed in range(6 if method == "pivot" else 2):
        case = make_case(time, R, PATHS[path][0](time), FEATURES, noise=NOISE, seed=seed)
        if method == "ml" and count == 20:
            with pytest.raises(ComputationError, match="how fast the target turns"):
                found_by(method, case.tracks, path)
            continue
        found = found_by(method, case.tracks, path)
        error, covariance = found.position[count // 2] - case.com[count // 2], found.covariance[count // 2]
        values, vectors = np.linalg.eigh(covariance)
        assert abs(vectors[:, -1] @ error) < 3.5 * np.sqrt(values[-1])


@pytest.mark.parametrize("noise", [0.0, NOISE])
@BOTH
def test_what_cannot_be_computed_is_said_in_a_sentence(method, noise):
    line = np.outer(np.arange(5.0), [1.0, 2, 3])
    unseen = fixed_case(noise=noise, features=FEATURES[:4])
    nothing = with_positions(unseen, np.full_like(unseen.tracks.position, np.nan))
    for tracks, expected in (
        (fixed_case(noise=noise, features=line).tracks, "lie in a line"),
        (fixed_case(noise=noise, features=FEATURES[:2]).tracks, "at most 2 features are seen together"),
        (nothing, "at most 0 features are seen together"),
    ):
        with pytest.raises(ComputationError) as caught:
            found_by(method, tracks)
        assert expected in str(caught.value)
        assert "\n" not in str(caught.value)


@BOTH
def test_options_that_do_not_go_together_are_refused(method):
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
        ({"noise": "white"}, "noise is 'white', expected one of stereo, fixed"),
        ({"torque": "drag"}, "torque is 'drag', expected one of none, gravity-gradient"),
    ],
)
def test_wrong_options_are_refused(options, expected):
    with pytest.raises(InputError, match="expected") as caught:
        PathOptions(**options)
    assert expected in str(caught.value)


def test_the_list_has_both_with_their_options_and_pivot_is_what_is_taken():
    assert METHODS["pivot"].options is METHODS["ml"].options is PathOptions
    assert estimate(fixed_case(20).tracks).diagnostics["method"] == "pivot"
    with pytest.raises(InputError, match="ml takes PathOptions, found ScrewOptions"):
        estimate(fixed_case(20).tracks, method="ml", options=METHODS["screw-gpa"].options())


RUNS, FRAMES = 200, 80


@pytest.fixture(scope="module")
def draws():
    """200 draws of 80 frames of 5 features in relative orbit: estimates of both methods, truth, and the bound."""
    time, R = turning(FRAMES)
    com, features = in_orbit(time), FEATURES[:5]
    cases = [make_case(time, R, com, features, noise=NOISE, seed=seed) for seed in range(RUNS)]
    labelled = (
        FeaturePoint(label=f"F{k}", position=tuple(point), normal=tuple(point)) for k, point in enumerate(features)
    )
    scenario = Scenario(
        target=Target(inertia=tuple(map(tuple, ENVISAT)), angular_rate_deg=tuple(np.rad2deg(RATE))),
        features=Features(points=tuple(labelled)),
        orbit=ORBIT.model(),
        chaser=Chaser(position=tuple(CHASER[0]), velocity=tuple(CHASER[1])),
        sensor=Sensor(noise=NOISE),
        run=Run(duration=FRAMES - 1.0, sample_time=1.0),
    )
    found = {
        method: [found_by(method, case.tracks, "relative-orbit", torque="none") for case in cases]
        for method in ("pivot", "ml")
    }
    return cases, found, cramer_rao_bound(scenario)


def in_band(values):
    """The mean of independent χ²₃ in its 95 % band."""
    low, high = chi2.ppf([0.025, 0.975], 3 * len(values)) / len(values)
    return low < np.mean(values) < high


@BOTH
def test_the_normalised_error_lies_in_its_band_over_200_runs(method, draws):
    """Of the position in C in the middle of the time, and of the centre of mass in the features' axes."""
    cases, found, _ = draws
    assert in_band([squared_error(*pair) for pair in zip(found[method], cases, strict=True)])
    assert in_band([squared_error_of_cluster(*pair) for pair in zip(found[method], cases, strict=True)])


def test_ml_reaches_the_bound_and_pivot_comes_within_a_quarter(draws):
    """The mean squared error of the path over that of the bound; the band is three standard errors of 200 draws."""
    cases, found, bound = draws
    for method in ("pivot", "ml"):
        ratio = np.array(
            [rms(one, case) ** 2 / bound.position_deviation**2 for one, case in zip(found[method], cases, strict=True)]
        )
        spread = 3 * ratio.std() / np.sqrt(RUNS)
        assert spread < 0.25
        assert ratio.mean() > 1 - spread
        assert ratio.mean() < (1 + spread if method == "ml" else 1.25**2)
    # What they say of themselves is the bound, but for how well 1,200 numbers tell the noise.
    stated = np.mean([one.diagnostics["position_deviation"] for one in found["ml"]])
    assert stated == pytest.approx(bound.position_deviation, rel=0.02)


def in_held_axes(found, case, time):
    """Attitude, rate and inertia of `ml` at a time, in axes turned so that the features stand as in the truth."""
    cluster, rotation = found.diagnostics["clusters"][0], found.diagnostics["rotation"]
    shape = np.array(list(cluster["features"].values()))
    turn = Rotation.align_vectors(case.features - case.features.mean(axis=0), shape)[0].as_matrix()
    attitude, rate, inertia = (np.array(rotation[key]) for key in ("attitude", "angular_rate", "inertia_over_trace"))
    then = Tumbling(rotation["epoch"], attitude, rate, inertia).at(np.array([time]))
    return then.attitude[0] @ turn.T, turn @ then.rate[0], turn @ inertia @ turn.T


def test_attitude_rate_and_inertia_of_ml_reach_the_bound(draws):
    """In the features' axes, in the middle of the time; the band is four standard errors of 200 draws."""
    cases, found, bound = draws
    middle = float(bound.time.mean())
    start = Tumbling(0.0, np.eye(3), RATE, ENVISAT).at(np.array([middle]))
    squares = []
    for one, case in zip(found["ml"], cases, strict=True):
        attitude, rate, inertia = in_held_axes(one, case, middle)
        turned = Rotation.from_matrix(start.attitude[0].T @ attitude).magnitude()
        missed = np.linalg.norm(rate - start.rate[0]), np.linalg.norm(inertia - ENVISAT / np.trace(ENVISAT))
        squares.append(np.square([turned, *missed]))
    k = FRAMES // 2
    expected = [
        np.trace(bound.attitude_covariance[k - 1 : k + 1].mean(axis=0)),
        np.trace(bound.rate_covariance),
        np.trace(bound.inertia_covariance),
    ]
    ratio = np.array(squares) / expected
    spread = 4 * ratio.std(axis=0) / np.sqrt(RUNS)
    assert (spread < 0.6).all()
    np.testing.assert_array_less(np.abs(ratio.mean(axis=0) - 1), spread)


def test_cases_are_frozen_truths():
    """The tests above share their truth: nothing may have changed it."""
    case = fixed_case(noise=0.0)
    assert isinstance(case, Case)
    seen = case.com[:, None] + FEATURES @ np.swapaxes(case.R_I_B, 1, 2)
    np.testing.assert_allclose(case.tracks.position, seen, atol=1e-12)

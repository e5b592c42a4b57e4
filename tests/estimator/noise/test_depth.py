"""Noise that is another along the line of sight than across it, or than covariances tell."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from baryscope.estimator import FeatureTracks, PathOptions, estimate
from baryscope.estimator.findings import DepthNoise
from baryscope.estimator.noise.depth import DepthRatio, depth_ratio, with_noisier_depths
from baryscope.estimator.result import Status

TIME = np.arange(300.0)
ACROSS, RATIO = 0.004, 5.0
CENTRE = np.array([3.0, -5.0, 20.0])
FIXED = PathOptions(trajectory="fixed")


def seen_by_a_rig(seed, ratio=RATIO, across=ACROSS, approach=0.0, told=None):
    """Six features about a fixed centre, turning freely as a symmetric top, with noise of a rig at the origin of C.

    approach: share of the range by which the target comes nearer; across and along, noise goes with range and its
    square, and is that of `across` and `ratio` at the mean range. told: the ratio by the tracks' covariances.
    """
    rng = np.random.default_rng(seed)
    precession = Rotation.from_rotvec(0.031 * TIME[:, None] * np.array([0.3, 0.9, 0.1]))
    R = (precession * Rotation.from_rotvec(0.05 * TIME[:, None] * np.array([0.0, 0.6, 0.8]))).as_matrix()
    points = rng.normal(size=(6, 3)) + np.array([0.5, 0.3, -0.4])
    true = CENTRE * (1 - approach * TIME / TIME[-1])[:, None, None] + points @ np.swapaxes(R, 1, 2)
    distance = np.linalg.norm(true, axis=2)[..., None]
    sight, relative = true / distance, distance / distance.mean()
    deviation = across * relative, across * ratio * relative**2
    outer = sight[..., :, None] * sight[..., None, :]
    noise = deviation[0] * rng.normal(size=true.shape)
    noise += sight * (deviation[1] * rng.normal(size=distance.shape) - np.sum(noise * sight, axis=2, keepdims=True))
    if told is None:
        return FeatureTracks(TIME, true + noise, tuple("abcdef"))
    across2, along2 = deviation[0][..., None] ** 2, (told / ratio * deviation[1][..., None]) ** 2
    return FeatureTracks(TIME, true + noise, tuple("abcdef"), across2 * (np.eye(3) - outer) + along2 * outer)


def across_the_sight(seed, ratio, lever=0.3, shake=0.0, memory=0.0, told=None):
    """Tracks of three features near a plane across the line of sight, about which the target turns by two radians, and
    the path (n, 3) of its centre, which has no acceleration.

    lever: of the features from the centre along the line of sight, m; shake: white displacements that all features of
    a frame have in common, the same along all axes, m, with an autocorrelation of `memory` to the next frame; told: the
    ratio by the tracks' covariances.
    """
    rng, time, sight = np.random.default_rng(seed), TIME[:200], CENTRE / np.linalg.norm(CENTRE)
    axis = np.cross(sight, rng.normal(size=3))
    axis /= np.linalg.norm(axis)
    rocking = Rotation.from_rotvec(0.1 * np.sin(0.02 * time + 1)[:, None] * axis)
    R = (rocking * Rotation.from_rotvec(0.01 * time[:, None] * sight)).as_matrix()
    points = rng.normal(size=(3, 3))
    points += np.outer(lever - points @ sight, sight) + 0.2 * rng.normal(size=3)
    path = CENTRE + time[:, None] * np.array([0.003, 0.002, -0.004])
    true = path[:, None] + points @ np.swapaxes(R, 1, 2)
    toward = true / np.linalg.norm(true, axis=2, keepdims=True)
    noise = ACROSS * rng.normal(size=true.shape)
    noise += (ratio - 1) * np.sum(noise * toward, axis=2, keepdims=True) * toward
    common = rng.normal(size=(100 + len(time), 1, 3))
    common = shake * lfilter([np.sqrt(1 - memory**2)], [1, -memory], common, axis=0)[100:]
    position = true + noise + common
    if told is None:
        return FeatureTracks(time, position, tuple("abc")), path
    covariance = np.eye(3) + (told**2 - 1) * toward[..., :, None] * toward[..., None, :]
    return FeatureTracks(time, position, tuple("abc"), ACROSS**2 * covariance), path


def normalised_square(found, centre=CENTRE):
    error = found.position[0] - centre
    return float(error @ np.linalg.solve(found.covariance[0], error))


@pytest.mark.parametrize("seed", [3, 4])
def test_depths_that_turn_all_connections_tell_a_ratio_though_no_greatest(seed):
    """Frames too far apart for differences, depths of 0.3 m on a body of 2 m: none of these connections is along the
    line of sight, and a ratio of a thousand is the likeliest. That passed for none at all.
    """
    tracks = seen_by_a_rig(seed, ratio=30.0, across=0.01)
    few = FeatureTracks(tracks.time[::6], tracks.position[::6], tracks.labels)
    found = depth_ratio(few, few.seen)
    assert found is not None
    assert 30.0 / 2 < found.ratio < 30.0 * 2


def test_deviations_have_their_ratio_and_their_root_mean_square():
    across, along = DepthRatio(RATIO, of_rig=False, distance=20.0).deviations(ACROSS)
    assert along / across == pytest.approx(RATIO)
    assert (2 * across**2 + along**2) / 3 == pytest.approx(ACROSS**2)


def test_what_no_covariance_tells_is_found_and_used():
    """As good as with the covariances, to 10 %, and five standard deviations of the mean of 6 normalised squares."""
    squares, errors = [], {RATIO: [], None: []}
    for seed in range(6):
        for told in (RATIO, None):
            found = estimate(seen_by_a_rig(seed, told=told), options=FIXED)
            assert found.status is Status.GOOD
            errors[told].append(np.linalg.norm(found.position[0] - CENTRE))
        squares.append(normalised_square(found))
        (noise,) = found.findings
        assert isinstance(noise, DepthNoise)
        # 300 frames of 15 distances, whose 3 · 6 − 6 = 12 values are independent, tell ρ to 5 %: four deviations.
        assert noise.along / noise.across == pytest.approx(RATIO, rel=0.2)
        assert noise.across == pytest.approx(ACROSS, rel=0.2)
        assert found.noise.a_posteriori == pytest.approx(ACROSS * np.sqrt((2 + RATIO**2) / 3), rel=0.1)
        assert not found.noise.relative
    assert np.sqrt(np.mean(np.square(errors[None]))) < 1.1 * np.sqrt(np.mean(np.square(errors[RATIO])))
    assert np.mean(squares) < 3 + 5 * np.sqrt(6 / 6)


@pytest.mark.parametrize("method", ["ml", "ekf", "score"])
def test_all_methods_of_a_path_use_it(method):
    found = estimate(seen_by_a_rig(3), method=method, options=FIXED)
    assert any(isinstance(one, DepthNoise) for one in found.findings)
    assert normalised_square(found) < chi2.isf(1e-4, 3)


def test_the_ratio_is_that_at_the_mean_range_of_a_target_that_comes_near():
    tracks = seen_by_a_rig(7, approach=0.6)
    found = depth_ratio(tracks, tracks.seen)
    assert found.of_rig
    assert found.ratio == pytest.approx(RATIO, rel=0.15)
    assert found.distance == pytest.approx(np.linalg.norm(tracks.position, axis=2).mean(), rel=0.01)
    told = seen_by_a_rig(7, approach=0.6, told=RATIO).covariance
    size = np.sqrt(np.mean(np.trace(told, axis1=2, axis2=3)) / 3)
    ratios = np.linalg.eigvalsh(found.covariance(tracks.position))[:, 0] * size**2 / np.linalg.eigvalsh(told)[:, 0]
    assert np.sqrt(np.median(ratios, axis=0)) == pytest.approx([1, 1, 1], rel=0.3)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("ratio", "across"), [(15.0, 0.001), (30.0, 0.001), (60.0, 0.002), (100.0, 0.004)])
def test_a_short_baseline_has_the_ratio_of_its_noise(ratio, across, seed):
    """That of independent noise of both images, √2 range / baseline: 20 m by 1.9, 0.94, 0.47 and 0.28 m.

    6 features and 296 differences, of which a quarter are independent: 444 values along the line of sight and 888
    across it. Student's distribution of 4 degrees tells of each 4/7 of what the normal one does: ln ρ to
    √(7/8 (1/444 + 1/888)), 5 %: four deviations.
    """
    tracks = seen_by_a_rig(seed, ratio=ratio, across=across)
    assert depth_ratio(tracks, tracks.seen).ratio == pytest.approx(ratio, rel=0.22)
    told = seen_by_a_rig(seed, ratio=ratio, across=across, told=ratio / 2)
    assert depth_ratio(told, told.seen).ratio == pytest.approx(2.0, rel=0.22)


def test_where_differences_are_no_noise_distances_tell_what_they_can():
    """Frames are half a radian apart: the ratio is too small, but far from 1."""
    tracks = seen_by_a_rig(0, ratio=40.0)
    few = FeatureTracks(tracks.time[::10], tracks.position[::10], tracks.labels)
    assert 5 < depth_ratio(few, few.seen).ratio < 40


def test_a_lidar_knows_the_depth_better():
    tracks = seen_by_a_rig(1, ratio=0.2, across=0.02)
    assert depth_ratio(tracks, tracks.seen).ratio == pytest.approx(0.2, rel=0.25)


def test_outliers_tell_nothing_of_depth():
    tracks = seen_by_a_rig(5, ratio=1.0)
    rng, position = np.random.default_rng(5), tracks.position.copy()
    wrong = rng.random(position.shape[:2]) < 0.1
    position[wrong] += 0.5 * np.array([0.0, 0.0, 1.0]) * rng.normal(size=(int(wrong.sum()), 1))
    found = estimate(FeatureTracks(TIME, position, tracks.labels), options=FIXED)
    assert found.findings == ()
    assert found.rejected[wrong].mean() > 0.9


@pytest.mark.parametrize("seed", range(40))
def test_noise_that_is_alike_in_all_axes_is_left_as_it_is(seed):
    """Beyond 3.5 standard deviations is 1 in 2000: of 40 tracks none, but for 1 in 50."""
    tracks = seen_by_a_rig(100 + seed, ratio=1.0)
    assert depth_ratio(tracks, tracks.seen) is None


@pytest.mark.parametrize(
    ("ratio", "step", "features", "least", "most"),
    [(3.0, 8, 3, 34, 40), (1.0, 8, 3, 0, 6), (30.0, 20, 4, 24, 40), (1.0, 20, 4, 0, 6)],
)
def test_a_few_frames_of_few_features_tell_that_depths_are_noisier(ratio, step, features, least, most):
    """A ratio of 3 is three and a half deviations there, so that every other one was taken for chance. Beyond two there
    are 1 in 20 by chance, where one for a rig and one for any range are looked at. Of a ratio of 30 the likeliest has
    no end: where it had to exceed 1.5 by three and a half deviations nevertheless, 20 of 40 were found.
    """
    shown = 0
    for seed in range(40):
        tracks = seen_by_a_rig(seed, ratio=ratio, across=0.01)
        few = FeatureTracks(TIME[::step], tracks.position[::step, :features], tracks.labels[:features])
        shown += depth_ratio(few, few.seen) is not None
    assert least <= shown <= most


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("shake", [0.0, 0.03])
def test_features_across_the_line_of_sight_tell_it_by_their_own_places(seed, shake):
    """3 features less their mean and 196 differences, of which about a third are independent: ln ρ to 11 %, three
    deviations. What a frame has in common is none of their noise: with it the ratio was found to be 1.
    """
    tracks, _ = across_the_sight(seed, RATIO, shake=shake)
    assert depth_ratio(tracks, tracks.seen).ratio == pytest.approx(RATIO, rel=0.45)


@pytest.mark.parametrize("ratio, across, seed", [(1.0, 0.12, 105), (1.0, 0.12, 149), (20.0, 0.1, 0)])
def test_a_ratio_that_the_features_own_places_exclude_is_none(ratio, across, seed):
    """Distances of features that are seen in few frames may by chance be as if depths turned the connections, and any
    great ratio as likely as any greater; the features' own places tell that it is not so, or that it is.
    """
    rng, time = np.random.default_rng(seed), TIME[:56]
    points, sight = 0.6 * rng.normal(size=(11, 3)), CENTRE / np.linalg.norm(CENTRE)
    turn = Rotation.from_rotvec(0.08 * time[:, None] * (sight + np.array([0.1, 0.0, 0.0]))).as_matrix()
    true = (2 - 0.3 * time / 55)[:, None, None] * CENTRE + points @ np.swapaxes(turn, 1, 2)
    seen = np.zeros(true.shape[:2], dtype=bool)
    seen[:3, :4] = seen[10:22, :4] = seen[36:, :4] = seen[46:, 4:] = True
    noise, toward = across * rng.normal(size=true.shape), true / np.linalg.norm(true, axis=2, keepdims=True)
    noise += (ratio - 1) * np.sum(noise * toward, axis=2, keepdims=True) * toward
    position = np.where(seen[..., None], true + noise, np.nan)
    found = depth_ratio(FeatureTracks(time, position, tuple("abcdefghijk")), seen)
    assert found is None if ratio == 1 else found is not None and 0.7 < found.ratio / ratio < 1.4


def test_noisy_depths_that_distances_do_not_show_are_no_confident_answer():
    """It was `good` with a normalised square of 950, as noisy attitudes told an offset."""
    tracks, path = across_the_sight(5, RATIO)
    found = estimate(tracks, options=PathOptions(trajectory="polynomial"))
    assert any(isinstance(one, DepthNoise) for one in found.findings)
    error = found.position[100] - path[100]
    assert error @ np.linalg.solve(found.covariance[100], error) < chi2.isf(1e-4, 3)


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize(("lever", "shake", "memory"), [(0.3, 0, 0), (1.5, 0, 0), (0.9, 0.006, 0), (0.9, 0.006, 0.8)])
def test_neither_a_lever_nor_a_camera_that_shakes_passes_for_noisy_depths(seed, lever, shake, memory):
    tracks, _ = across_the_sight(seed, 1.0, lever, shake, memory)
    assert depth_ratio(tracks, tracks.seen) is None


def test_a_motion_between_frames_is_no_noise():
    """10 cm to and fro along the line of sight, a radian from frame to frame."""
    tracks, _ = across_the_sight(0, 1.0)
    moved = 0.1 * np.sin(tracks.time)[:, None, None] * CENTRE / np.linalg.norm(CENTRE)
    assert depth_ratio(replace(tracks, position=tracks.position + moved), tracks.seen) is None


def test_a_ratio_that_is_told_wrongly_is_mended():
    """Depths twice as noisy as told: answers to such tracks had squares of 40 to 84."""
    tracks, path = across_the_sight(7, RATIO, told=RATIO / 2)
    found = estimate(tracks, options=PathOptions(trajectory="polynomial"))
    (noise,) = [one for one in found.findings if isinstance(one, DepthNoise)]
    assert noise.told == pytest.approx(RATIO / 2)
    assert noise.along / noise.across == pytest.approx(RATIO, rel=0.45)  # as above
    assert noise.across == pytest.approx(ACROSS, rel=0.2)
    assert found.noise.a_posteriori == pytest.approx(1.0, rel=0.2)
    error = found.position[100] - path[100]
    assert error @ np.linalg.solve(found.covariance[100], error) < chi2.isf(1e-4, 3)


@pytest.mark.parametrize("seed", range(40))
@pytest.mark.parametrize("ratio", [1.0, 5.0])
def test_a_ratio_that_is_told_rightly_is_left_as_it_is(seed, ratio):
    tracks = seen_by_a_rig(seed, ratio, told=ratio)
    assert depth_ratio(tracks, tracks.seen) is None
    tracks, _ = across_the_sight(seed, ratio, told=ratio)
    assert depth_ratio(tracks, tracks.seen) is None


@pytest.mark.parametrize("seed", range(10))
def test_what_moves_a_frame_as_a_whole_speaks_against_no_covariance(seed):
    """A pivot that slips by more than depths are off: the told ratio of 5 was taken for four times too great."""
    tracks, _ = across_the_sight(seed, RATIO, shake=0.03, told=RATIO)
    assert depth_ratio(tracks, tracks.seen) is None


def test_features_that_are_seen_one_after_the_other_tell_it_too():
    """Ten differences out of fourteen of one feature, as many as of a third of the frames: ln ρ to 15 %."""
    tracks, _ = across_the_sight(0, RATIO)
    now = (np.arange(len(tracks.time)) // 14 % 3)[:, None] == np.arange(3)
    alone = FeatureTracks(tracks.time, np.where(now[..., None], tracks.position, np.nan), tracks.labels)
    assert depth_ratio(alone, alone.seen).ratio == pytest.approx(RATIO, rel=0.45)


def test_a_feature_that_is_seen_alone_tells_nothing_of_its_own():
    tracks, _ = across_the_sight(0, RATIO, shake=0.03)
    position = np.full((len(tracks.time), 4, 3), np.nan)
    position[50:, :3], position[:50, 3] = tracks.position[50:], tracks.position[:50, 0]
    with_one = FeatureTracks(tracks.time, position, tuple("abcd"))
    three = with_one.of_features(tuple("abc"))
    assert depth_ratio(with_one, with_one.seen).ratio == pytest.approx(depth_ratio(three, three.seen).ratio)


@pytest.mark.parametrize("seed", [0, 1, 2, 5])
@pytest.mark.parametrize(("ratio", "across"), [(60.0, 0.002), (40.0, 0.004)])
def test_told_depths_that_turn_connections_are_left_as_they_are(seed, ratio, across):
    """Distances show a third of them, which is not theirs; the places deny it, or, in every tenth frame, tell nothing.

    The covariances are those that the noise is drawn of; beyond 3.5 standard deviations is 1 in 2000.
    """
    tracks = seen_by_a_rig(seed, ratio, across, told=ratio)
    assert depth_ratio(tracks, tracks.seen) is None
    rows = slice(None, None, 10)
    few = FeatureTracks(tracks.time[rows], tracks.position[rows], tracks.labels, tracks.covariance[rows])
    assert depth_ratio(few, few.seen) is None


@pytest.mark.parametrize("factor", [0.1, 3.0])
def test_covariances_of_any_axes_stay_covariances(factor):
    """Those of a wide rig seen from its side have no axis along the line of sight."""
    rng = np.random.default_rng(0)
    place, root = rng.normal(size=(50, 4, 3)), rng.normal(size=(50, 4, 3, 3)) * [1.0, 1.0, 1e-3]
    covariance = root @ np.swapaxes(root, -1, -2)
    mended = with_noisier_depths(covariance, place, factor)
    np.testing.assert_array_equal(mended, np.swapaxes(mended, -1, -2))
    sight = place / np.linalg.norm(place, axis=2, keepdims=True)
    along = [np.einsum("nmi,nmij,nmj->nm", sight, one, sight) for one in (covariance, mended)]
    np.testing.assert_allclose(along[1], factor**2 * along[0], rtol=1e-9)
    assert FeatureTracks(TIME[:50], place, tuple("abcd"), mended).covariance is not None


def test_too_few_frames_or_noise_tell_nothing():
    tracks = seen_by_a_rig(2)
    few = FeatureTracks(tracks.time[::30], tracks.position[::30], tracks.labels)
    assert depth_ratio(few, few.seen) is None
    alone = FeatureTracks(tracks.time, tracks.position[:, :1], tracks.labels[:1])
    assert depth_ratio(alone, alone.seen) is None
    exact = seen_by_a_rig(2, across=1e-13)
    assert depth_ratio(exact, exact.seen) is None
    assert depth_ratio(tracks, np.zeros(tracks.seen.shape, bool)) is None


def test_a_label_of_two_points_is_two():
    """`ml` gives the second point of a label one of its own: here from half the time on."""
    tracks = seen_by_a_rig(4)
    position = tracks.position.copy()
    half = len(TIME) // 2
    for feature in range(3):
        position[half:, feature] = np.nan
        position[: half - 1, feature + 3] = np.nan
    position[half:, 0] = tracks.position[half:, 1]
    found = estimate(FeatureTracks(TIME, position, tracks.labels), method="ml", options=FIXED)
    assert found.labels == (*tracks.labels, "a (2)")
    assert any(isinstance(one, DepthNoise) for one in found.findings)
    assert normalised_square(found) < chi2.isf(1e-4, 3)

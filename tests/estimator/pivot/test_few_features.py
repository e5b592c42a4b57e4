"""Frames to which the path gives an attitude: of two features, once path and offset are known, and of lost ones."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from baryscope.estimator.adjustment.normal_equations import attitude_information
from baryscope.estimator.adjustment.stereo import observations_of
from baryscope.estimator.findings import UnknownBurn
from baryscope.estimator.methods import estimate
from baryscope.estimator.pivot.few_features import with_found_attitudes
from baryscope.estimator.registration.body import Body
from baryscope.estimator.tracks import FeatureTracks
from burning import path_with_burns
from free_paths import NOISE, at_rest, found_by, in_orbit, turning
from synthetic import ENVISAT, Orbit, attitude, box_features, make_case, rig_tracks

FRAMES, WHOLE, DRAWS = 120, 50, 12
FIVE = box_features(5, (2, 2, 2), 3)


def with_two_features(tracks, after):
    """The same tracks, with features 0 and 1 alone after some frames."""
    position = tracks.position.copy()
    position[after:, 2:] = np.nan
    return FeatureTracks(tracks.time, position, tracks.labels)


def without(tracks, after):
    """The same tracks, without anything after some frames but their times."""
    position = tracks.position.copy()
    position[after:] = np.nan
    return FeatureTracks(tracks.time, position, tracks.labels)


@pytest.fixture(scope="module")
def draws():
    time, R = turning(FRAMES)
    com = in_orbit(time)
    cases = [make_case(time, R, com, FIVE, noise=NOISE, seed=seed) for seed in range(DRAWS)]
    return cases, [
        [
            found_by("pivot", change(case.tracks, WHOLE), "relative-orbit", process_noise="none")
            for change in (with_two_features, without)
        ]
        for case in cases
    ]


def test_they_tell_what_they_claim_to(draws):
    """The path is followed where it would else be predicted; the mean NEES is in its 99 % band at the last time."""
    cases, found = draws
    claims = np.array([[np.sqrt(np.trace(one.covariance[-1])) for one in both] for both in found])
    assert (claims[:, 0] < 0.5 * claims[:, 1]).all()
    error = [case.com[-1] - both[0].position[-1] for case, both in zip(cases, found, strict=True)]
    squares = [e @ np.linalg.solve(both[0].covariance[-1], e) for e, both in zip(error, found, strict=True)]
    low, high = chi2.ppf([0.005, 0.995], 3 * DRAWS) / DRAWS
    assert low < np.mean(squares) < high


def test_their_attitudes_are_estimated(draws):
    _, found = draws
    assert np.mean([np.isfinite(two.motion.attitude[WHOLE:]).all(axis=(1, 2)).mean() for two, _ in found]) > 0.99
    assert all(np.isnan(none.motion.attitude[WHOLE:]).all() for _, none in found)


def test_they_tell_nothing_where_the_offset_is_not_told():
    """Along the axis of a spin the path would be wrong, and so would be the attitudes that it gives."""
    time = np.arange(float(FRAMES))
    R = Rotation.from_rotvec(np.outer(time, [0.0, 0.0, 0.1])).as_matrix()
    case = make_case(time, R, at_rest(time), FIVE, noise=NOISE)
    found = found_by("pivot", with_two_features(case.tracks, WHOLE), "fixed", process_noise="none")
    assert np.isnan(found.motion.attitude[WHOLE:]).all()
    assert found.predicted_rmse > 1


def stereo_with_outliers(seed):
    """Tracks of a short baseline while a chaser burns, with 4 % of the observations half a metre off; what is right in
    them, (n, m); and the path.
    """
    time, rng = np.arange(0.0, 500.0), np.random.default_rng(seed + 100)
    com = path_with_burns(time, ((30.3, 37.9, (0.001, -0.012, -0.001)), (340.0, 342.0, (-0.001, 0.0, 0.001))))
    R, features = attitude(ENVISAT, np.deg2rad([1.0, 1.0, 3.0]), time), box_features(12, (10, 4, 4), 1)
    tracks = rig_tracks(time, R, com, features, seed=seed, baseline=0.3)
    facing = np.einsum("nij,mj,ni->nm", R, features, -com / np.linalg.norm(com, axis=1)[:, None]) > 0.6
    seen = facing & (rng.random(facing.shape) > 0.25)
    wrong = seen & (rng.random(facing.shape) < 0.04)
    position = tracks.position.copy()
    position[wrong] += 0.5 * rng.standard_normal((int(wrong.sum()), 3))
    position[~seen] = np.nan
    covariance = np.where(seen[:, :, None, None], tracks.covariance, np.nan)
    return FeatureTracks(time, position, tracks.labels, covariance), seen & ~wrong, com


def test_an_outlier_takes_no_frame_with_it():
    """Nor does a path that was off at first. Where four others are right, these tell the frame's attitude; of a χ² of
    three degrees of freedom hardly one of a thousand frames has one beyond the gate.
    """
    tracks, right, com = stereo_with_outliers(0)
    found = estimate(tracks, orbit=Orbit().model())
    told = found.used & right & (right.sum(axis=1) >= 4)[:, None]
    assert told.any(axis=1).sum() > 200
    assert (told & found.rejected).any(axis=1).sum() <= 2
    error = found.position - com
    squares = np.einsum("ni,nij,nj->n", error, np.linalg.inv(found.covariance), error)
    assert squares.mean() < 12  # in 99 % of paths, all of whose errors hang together
    assert sum(isinstance(one, UnknownBurn) for one in found.findings) == 2


@pytest.mark.parametrize("rig", [False, True])
def test_lost_attitudes_are_found(rig):
    """Of three frames that are turned by 1.3 rad, with all rejected: one has an outlier, which stays rejected."""
    time, R = turning(40)
    com, lost, outlier = in_orbit(time), [7, 20, 33], (20, 4)
    if rig:
        tracks = rig_tracks(time, R, com, FIVE, seed=1)
    else:
        tracks = make_case(time, R, com, FIVE, noise=NOISE, seed=1).tracks
    tracks.position[outlier] += [0.3, -0.4, 0.2]
    measured = observations_of(tracks, tracks.seen)
    turned = R.copy()
    turned[lost] = turned[lost] @ Rotation.from_rotvec([0.8, -0.9, 0.5]).as_matrix()
    weight = np.ones((40, 5))
    weight[lost] = 1e-9
    body = Body(np.arange(5), np.arange(40), FIVE, turned)
    variance = 1.0 if rig else NOISE**2
    (found,), weights = with_found_attitudes((body,), weight, measured, com, variance)
    np.testing.assert_array_equal(np.delete(found.attitude, lost, axis=0), np.delete(R, lost, axis=0))
    information = attitude_information(measured.weighted(weights), R, FIVE)[lost] / variance
    off = Rotation.from_matrix(np.swapaxes(R[lost], 1, 2) @ found.attitude[lost]).as_rotvec()
    # χ² of three degrees of freedom exceeds 21 once in 8,000; least absolute residuals cost half as much again.
    assert (np.einsum("ni,nij,nj->n", off, information, off) < 1.5 * 21.1).all()
    assert np.argwhere(weights < 0.5).tolist() == [list(outlier)]
    assert with_found_attitudes((found,), weights, measured, com, variance) is None

"""Registration by covariances: a stereo pair's noise in depth no longer turns and bends the body."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator.adjustment import weighted_registration
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.weighted_registration import with_covariances
from baryscope.estimator.registration.clusters import find_bodies
from synthetic import box_features

ACROSS, DEPTH = 1e-3, 0.04  # m
FRAMES = 300
POINTS = box_features(7, (4, 3, 2), seed=3)


def seen_in_depth(deviation, seed, hidden=0.0):
    """Attitudes (n, 3, 3), positions (n, m, 3) seen along z with noise, and which are seen."""
    rng = np.random.default_rng(seed)
    R = Rotation.from_rotvec(np.linspace(0, 9, FRAMES)[:, None] * [0.5, 0.6, 0.62]).as_matrix()
    place = np.array([0.0, 0.0, 20.0]) + np.linspace(-1, 1, FRAMES)[:, None]
    position = place[:, None] + POINTS @ np.swapaxes(R, 1, 2) + deviation * rng.standard_normal((FRAMES, 7, 3))
    seen = rng.random((FRAMES, 7)) >= hidden
    seen[:, :3] = True
    return R, position, seen


def errors_of(registered, R):
    """The rms errors of attitudes, rad, and of the shape, m, in axes turned to the truth."""
    (body,), frames = registered.bodies, registered.bodies[0].frames
    own = POINTS[body.features] - POINTS[body.features].mean(axis=0)
    turn, _ = Rotation.align_vectors(own, body.points)
    off = Rotation.from_matrix(body.attitude @ turn.as_matrix().T @ np.swapaxes(R[frames], 1, 2))
    return np.sqrt(np.mean(off.magnitude() ** 2)), np.sqrt(np.mean((turn.apply(body.points) - own) ** 2))


def least_error(R, seen, deviation):
    """The Cramér–Rao bound of the attitudes' rms error of known points, rad: of poses with six unknowns."""
    variances = []
    for attitude, own in zip(R, seen, strict=True):
        by_turn = [attitude @ np.cross(np.eye(3), point).T for point in POINTS[own]]
        jacobian = np.concatenate([np.concatenate([turn, np.eye(3)], axis=1) for turn in by_turn])
        white = jacobian / np.tile(deviation, own.sum())[:, None]
        variances.append(np.trace(np.linalg.inv(white.T @ white)[:3, :3]))
    return np.sqrt(np.mean(variances))


def weighted(position, seen, deviation):
    precision = np.broadcast_to(np.diag(np.asarray(deviation) ** -2.0), (*seen.shape, 3, 3))
    return Observations(np.where(seen[..., None], position, 0.0), seen.astype(float), precision)


@pytest.mark.parametrize("hidden", [0.0, 0.4])
def test_attitudes_and_shape_have_the_noise_across(hidden):
    deviation = np.array([ACROSS, ACROSS, DEPTH])
    R, position, seen = seen_in_depth(deviation, 1, hidden)
    alike = find_bodies(position, seen)
    found, _ = with_covariances(alike, weighted(position, seen, deviation))
    before, after = errors_of(alike, R), errors_of(found, R)
    # 300 frames, of which a few with features in a line make up much of the mean.
    assert after[0] == pytest.approx(least_error(R, seen, deviation), rel=0.2)
    assert before[0] > 6 * after[0]
    assert after[1] < 6 * ACROSS / np.sqrt(FRAMES) < before[1]
    assert np.allclose(found.bodies[0].points.mean(axis=0), 0.0, atol=1e-12)


def test_an_exact_body_stays():
    R, position, seen = seen_in_depth(0.0, 2)
    found, _ = with_covariances(find_bodies(position, seen), weighted(position, seen, [ACROSS, ACROSS, DEPTH]))
    assert max(errors_of(found, R)) < 1e-9


def test_origins_are_where_the_centroid_is():
    deviation = np.array([ACROSS, ACROSS, DEPTH])
    R, position, seen = seen_in_depth(deviation, 3)
    found, _ = with_covariances(find_bodies(position, seen), weighted(position, seen, deviation))
    (body,), (origin,) = found.bodies, found.origins
    true = np.array([0.0, 0.0, 20.0]) + np.linspace(-1, 1, FRAMES)[:, None] + R @ POINTS.mean(axis=0)
    error = origin - true[body.frames]
    # Seven observations: σ/√7 across; in depth the lever of the attitude's noise is small beside the noise itself.
    assert np.sqrt(np.mean(error[:, :2] ** 2)) == pytest.approx(ACROSS / np.sqrt(7), rel=0.15)
    assert np.sqrt(np.mean(error[:, 2] ** 2)) == pytest.approx(DEPTH / np.sqrt(7), rel=0.15)


def test_outliers_do_not_bend_it():
    deviation = np.array([ACROSS, ACROSS, DEPTH])
    R, position, seen = seen_in_depth(deviation, 4)
    position[::40, 5] += [0.1, -0.1, 0.0]
    found, _ = with_covariances(find_bodies(position, seen), weighted(position, seen, deviation))
    assert errors_of(found, R)[1] < 6 * ACROSS / np.sqrt(FRAMES)


@pytest.mark.parametrize("shape_frames", [FRAMES, 100])  # all tell the points, or every third
def test_many_outliers_do_not_bend_it_either(shape_frames, monkeypatch):
    """A quarter of the observations: half of the frames have more than one."""
    monkeypatch.setattr(weighted_registration, "SHAPE_FRAMES", shape_frames)
    deviation = np.array([ACROSS, ACROSS, DEPTH])
    R, position, seen = seen_in_depth(deviation, 6)
    rng = np.random.default_rng(7)
    wrong = rng.random(seen.shape) < 0.25
    position += wrong[..., None] * rng.uniform(-0.5, 0.5, position.shape)
    alike = find_bodies(position, seen)
    found, right = with_covariances(alike, weighted(position, seen, deviation))
    assert errors_of(alike, R)[1] > 8e-3
    assert errors_of(found, R)[1] < 10 * ACROSS / np.sqrt(shape_frames)
    rejected = right.weight < 0.5
    clear = wrong.sum(axis=1) <= 1  # of seven observations: those left tell which it is
    assert np.mean(rejected[clear] == wrong[clear]) > 0.97
    (body,) = found.bodies
    turn, _ = Rotation.align_vectors(POINTS - POINTS.mean(axis=0), body.points)
    off = Rotation.from_matrix(body.attitude @ turn.as_matrix().T @ np.swapaxes(R, 1, 2)).magnitude()
    assert np.quantile(off[clear], 0.95) < 3 * least_error(R, seen, deviation)


def test_a_body_that_is_none_has_little_weight():
    """Features that move among themselves, as where labels are exchanged, have residuals thirty times as great."""
    deviation = np.array([ACROSS, ACROSS, DEPTH])
    _, position, seen = seen_in_depth(deviation, 8)
    position[200:] += 30 * deviation * np.random.default_rng(9).standard_normal((100, 7, 3))
    whole = find_bodies(position, seen)
    (body,), (origin,) = whole.bodies, whole.origins
    parts = slice(0, 200), slice(200, FRAMES)
    two = replace(
        whole,
        bodies=tuple(replace(body, frames=body.frames[part], attitude=body.attitude[part]) for part in parts),
        origins=tuple(origin[part] for part in parts),
    )
    _, right = with_covariances(two, weighted(position, seen, deviation))
    assert np.median(right.weight[:200]) == pytest.approx(1.0, abs=0.01)
    assert np.median(right.weight[200:]) == pytest.approx(1 / 900, rel=0.3)


def test_without_covariances_nothing_changes():
    _, position, seen = seen_in_depth(ACROSS, 5)
    alike = find_bodies(position, seen)
    plain = Observations(position, seen.astype(float))
    assert with_covariances(alike, plain) == (alike, plain)


@pytest.mark.parametrize("seed", [1, 4, 17, 55, 70, 72, 117])
def test_steps_from_a_spoilt_shape_of_features_seen_for_four_frames_do_not_lead_uphill(seed):
    """Without halving the cost of these grows; among outliers, points then leave for infinity."""
    rng = np.random.default_rng(seed)
    body, first = box_features(20, (0.7, 0.7, 0.7), seed), rng.integers(-2, 17, 20)
    R = Rotation.from_rotvec(0.24 * np.arange(18)[:, None] * [0.5, 0.6, 0.62]).as_matrix()
    deviation = np.array([6e-5, 6e-5, 1e-3])
    position = np.array([0, 0, 5.0]) + body @ np.swapaxes(R, 1, 2) + deviation * rng.standard_normal((18, 20, 3))
    frame = np.arange(18)[:, None]
    seen = (frame >= first) & (frame < first + 4)
    registered = find_bodies(position, seen)
    index = int(np.argmax([len(one.frames) for one in registered.bodies]))
    found, origin = registered.bodies[index], registered.origins[index]
    spoilt = replace(found, points=found.points + 0.3 * rng.standard_normal(found.points.shape))
    own = weighted(position, seen, deviation).frames(found.frames).features(found.features)
    begin = weighted_registration._all_posed(spoilt, origin, own)[2].sum()
    assert weighted_registration._adjusted(spoilt, origin, own)[2].sum() <= begin

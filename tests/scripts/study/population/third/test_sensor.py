"""Noise against the statistics of its kinds."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import kurtosis
from scipy.stats import t as student_t

from baryscope.study.population.third.dice import rotation
from baryscope.study.population.third.sensor import (
    Sensor,
    Watch,
    autoregressive,
    covariances,
    marginal,
    noises,
    scales,
    student,
)

NOISE = 0.01  # m


def watch_of(frames=40, labels=6, seed=1):
    """Features of a body of 1 m at 10 m, at random attitudes and velocities."""
    rng = np.random.default_rng(seed)
    path = np.tile([10.0, 2.0, -3.0], (frames, 1))
    attitude = np.stack([rotation(rng) for _ in range(frames)])
    ideal = path[:, None] + np.einsum("nij,mj->nmi", attitude, rng.normal(0, 1, (labels, 3)))
    seen = rng.random((frames, labels)) < 0.7
    velocity = rng.normal(0, 0.3, ideal.shape)
    return Watch(ideal, velocity, attitude, path, rng.uniform(0.05, 1, (frames, labels)), seen)


def own_of(sensor, watch):
    return covariances(sensor, NOISE, watch) * scales(sensor, watch)[..., None, None] ** 2


def test_student_noise_has_unit_covariance_and_the_tails_of_its_distribution():
    for dof in (5, 8):
        values = student(np.random.default_rng(2), dof, (1000, 300)).ravel()
        scale = np.sqrt(dof / (dof - 2))
        for bound in (1.0, 2.0, 4.0):
            share = 2 * student_t.sf(bound * scale, dof)
            # Three components share a scale, so that up to 3 of the numbers count as one.
            assert np.mean(np.abs(values) > bound) == pytest.approx(share, abs=4 * np.sqrt(3 * share / values.size))


def test_student_noise_of_many_degrees_has_its_kurtosis():
    values = student(np.random.default_rng(3), 20, (1000, 300)).ravel()
    assert values.var() == pytest.approx(1, abs=4 * np.sqrt(3 * 2.4 / values.size))
    assert kurtosis(values) == pytest.approx(6 / 16, abs=0.03)  # scatters by about 0.007
    assert kurtosis(student(np.random.default_rng(3), 0, (1000, 300)).ravel()) == pytest.approx(0, abs=0.03)


@pytest.mark.parametrize("frames", [2.0, 7.5, 20.0])
def test_drift_has_unit_variance_and_decays_over_its_frames(frames):
    length, tracks = 400, 2000
    found = autoregressive(np.random.default_rng(4), frames, (length, tracks))
    for at in (0, 200, 399):
        assert found[at].var() == pytest.approx(1, abs=4 * np.sqrt(2 / tracks))
    for lag in (1, 5, 20):
        assert np.mean(found[100] * found[100 + lag]) == pytest.approx(
            np.exp(-lag / frames), abs=4 * np.sqrt(2 / tracks)
        )


def test_a_share_of_the_variance_drifts_along_axes_of_the_body():
    watch = watch_of(frames=200, labels=60)
    sensor = Sensor(drift=(0.6, 6.0))
    found = noises(np.random.default_rng(5), sensor, own_of(sensor, watch), watch) / NOISE
    in_body = np.einsum("nji,nmj->nmi", watch.attitude, found)
    count = in_body[1:].size / 12  # some 12 frames in a row count as one
    assert in_body.var() == pytest.approx(1, abs=4 * np.sqrt(2 / count))
    assert np.mean(in_body[1:] * in_body[:-1]) == pytest.approx(0.6 * np.exp(-1 / 6), abs=4 * np.sqrt(2 / count))
    assert np.mean(found[1:] * found[:-1]) == pytest.approx(0, abs=4 * np.sqrt(2 / count))  # attitudes are at random


KINDS = {
    "plain": Sensor(),
    "rig": Sensor(depth=4.0),
    "Student": Sensor(dof=8),
    "uneven, by angle and edge": Sensor(by_angle=0.8, by_edge=1.5, uneven=(0.5, 0.7, 1.0, 1.2, 1.5, 2.0)),
    "common": Sensor(common=1e-3),
    "jitter": Sensor(jitter=0.03),
    "tissue": Sensor(tissue=(0.02, 5.0)),
    "drift of a rig": Sensor(depth=3.0, drift=(0.8, 4.0)),
}


@pytest.mark.parametrize("kind", KINDS)
def test_the_covariance_that_is_said_is_that_of_the_noise(kind):
    watch, sensor, draws = watch_of(frames=12), KINDS[kind], 1500
    own = own_of(sensor, watch)
    truth = marginal(sensor, own, watch)
    rng = np.random.default_rng(6)
    whitener = np.linalg.inv(np.linalg.cholesky(truth))
    found = np.stack([noises(rng, sensor, own, watch) for _ in range(draws)])
    white = np.einsum("nmij,knmj->knmi", whitener, found)
    covariance = np.einsum("knmi,knmj->nmij", white, white) / draws
    tails = 3.0 if sensor.dof else 1.0  # 8 degrees: 1.5 and more by the fourth moment
    assert np.abs(covariance - np.eye(3)).max() < 5 * tails * np.sqrt(2 / draws)  # 5 sigma of 648 numbers
    assert np.abs(covariance.mean(axis=(0, 1)) - np.eye(3)).max() < 5 * tails * np.sqrt(2 / draws)


def test_a_rig_is_less_certain_along_the_ray():
    watch = watch_of()
    found = covariances(Sensor(depth=5.0), NOISE, watch)
    ray = watch.ray
    along = np.einsum("nmi,nmij,nmj->nm", ray, found, ray)
    distance = np.linalg.norm(watch.ideal, axis=2) / np.linalg.norm(watch.ideal, axis=2).mean()
    across = (np.trace(found, axis1=2, axis2=3) - along) / 2
    np.testing.assert_allclose(along / across, 25 * distance**2)
    np.testing.assert_allclose((2 * across / distance**2 + along / distance**4) / 3, NOISE**2)


def test_what_differs_from_point_to_point_keeps_the_mean_variance():
    watch = watch_of()
    for sensor in (KINDS["uneven, by angle and edge"], Sensor(by_angle=1.0), Sensor(by_edge=2.0)):
        found = scales(sensor, watch)
        assert np.mean(found[watch.seen] ** 2) == pytest.approx(1)
        assert np.ptp(found) > 0.5


def test_a_common_turn_of_the_camera_keeps_distances():
    watch = watch_of()
    own = own_of(Sensor(), watch) * 1e-20
    found = noises(np.random.default_rng(7), Sensor(common=1e-4), own, watch)
    between = np.diff(watch.ideal, axis=1)
    stretch = np.sum(np.diff(found, axis=1) * between, axis=2)
    assert np.abs(stretch).max() < 1e-9
    assert np.abs(found).max() > 1e-3


def test_jitter_moves_all_points_of_a_frame_by_one_time():
    watch = watch_of()
    found = noises(np.random.default_rng(8), Sensor(jitter=1e-3), own_of(Sensor(), watch) * 1e-20, watch)
    times = np.sum(found * watch.velocity, axis=2) / np.sum(watch.velocity**2, axis=2)
    np.testing.assert_allclose(times, np.broadcast_to(times[:, :1], times.shape), atol=1e-9)


def test_the_spread_is_from_the_centroid_of_each_frame():
    watch = watch_of()
    squares = []
    for positions, seen in zip(watch.ideal, watch.seen, strict=True):
        points = positions[seen]
        squares += list(((points - points.mean(axis=0)) ** 2).sum(axis=1)) if len(points) else []
    assert watch.spread == pytest.approx(np.sqrt(np.mean(squares)))
    assert replace(watch, ideal=watch.ideal + 5).spread == pytest.approx(watch.spread)

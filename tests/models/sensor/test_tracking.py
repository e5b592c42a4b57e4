"""The sensor: who is seen when, and the statistics of the noise."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from baryscope.models.scenario import Run, Scenario, Sensor, Tracking, load_scenario
from baryscope.models.sensor.tracking import incidence_cosine, observe, tracked

BASE = load_scenario("cubesat-class")
COUNT = len(BASE.features.points)
FRAMES = 20_000
SIGMAS = 5.0  # a statistic may be off by so many of its own standard deviations


def scenario(**changes) -> Scenario:
    return BASE.model_copy(update={"tracking": Tracking(), "sensor": Sensor(noise=0.0)} | changes)


def intervals(*triples):
    return Tracking.model_validate({"intervals": tuple({"start": s, "end": e, "features": f} for s, e, f in triples)})


def still(frames=FRAMES):
    """Features that rest 10 m away and look at the chaser."""
    features = np.broadcast_to([0.0, 10.0, 0.0], (frames, COUNT, 3))
    return np.arange(frames, dtype=float), features, np.broadcast_to([0.0, -1.0, 0.0], features.shape)


def test_without_noise_the_truth_is_measured():
    time, features, normals = still(10)
    seen = observe(scenario(), time, features, normals)
    assert seen.seen.all()
    np.testing.assert_array_equal(seen.position, features)


def test_noise_is_isotropic_white_and_normal():
    sigma = 0.02
    time, features, normals = still()
    noise = observe(scenario(sensor=Sensor(noise=sigma)), time, features, normals).position - features
    n = noise.size
    assert abs(noise.mean()) < SIGMAS * sigma / np.sqrt(n)
    assert abs(noise.std() / sigma - 1) < SIGMAS / np.sqrt(2 * n)
    assert ((noise / sigma) ** 4).mean() == pytest.approx(3, abs=SIGMAS * np.sqrt(96 / n))
    per_axis = noise.reshape(-1, 3)
    covariance = np.cov(per_axis.T) / sigma**2
    np.testing.assert_allclose(covariance, np.eye(3), atol=SIGMAS * np.sqrt(2 / len(per_axis)))
    in_time = (noise[1:] * noise[:-1]).mean() / sigma**2
    between_features = (noise[:, 1:] * noise[:, :-1]).mean() / sigma**2
    assert max(abs(in_time), abs(between_features)) < SIGMAS / np.sqrt(n * (COUNT - 1) / COUNT)


def test_dropout():
    share = 0.1
    seen = observe(scenario(sensor=Sensor(noise=0.0, dropout=share)), *still()).seen
    n = seen.size
    assert abs((~seen).mean() - share) < SIGMAS * np.sqrt(share * (1 - share) / n)
    both = (~seen[1:] & ~seen[:-1]).mean()
    assert abs(both - share**2) < SIGMAS * share / np.sqrt(n)


def test_missing_is_nan_in_all_three_coordinates():
    seen = observe(scenario(sensor=Sensor(noise=0.1, dropout=0.5)), *still(100))
    np.testing.assert_array_equal(np.isnan(seen.position), np.repeat(~seen.seen[:, :, None], 3, axis=2))


moments = st.integers(0, 12).map(float)


@given(
    spans=st.lists(st.tuples(moments, moments, st.sets(st.integers(0, COUNT - 1), min_size=1)), min_size=1),
    time=st.lists(moments, max_size=20),
)
def test_intervals_of_any_number_and_order(spans, time):
    """Against the definition, interval by interval and time by time, which may stand in any order."""
    labels = BASE.features.labels
    spans = [(min(s, e), max(s, e) + 0.5, tuple(labels[k] for k in sorted(named))) for s, e, named in spans]
    last = max(end for _, end, _ in spans)
    seen = tracked(scenario(tracking=intervals(*spans)), np.array(time))
    for row, t in zip(seen, time, strict=True):
        there = {label for s, e, named in spans if s <= t < e or t == e == last for label in named}
        assert {label for label, flag in zip(labels, row, strict=True) if flag} == there


def test_intervals_and_blackouts():
    a, b, c = BASE.features.labels[:3]
    flown = scenario(tracking=intervals((0.0, 10.0, (a, b)), (10.0, 20.0, (b, c)), (30.0, 40.0, (c, a))))
    time = np.arange(0.0, 46.0, 0.5)
    seen = tracked(flown, time)
    for t, row in zip(time, seen, strict=True):
        names = {label for label, there in zip(BASE.features.labels, row, strict=True) if there}
        if t < 10:
            assert names == {a, b}
        elif t < 20:
            assert names == {b, c}
        elif 30 <= t <= 40:  # the last interval holds its end
            assert names == {a, c}
        else:
            assert names == set()


def test_intervals_may_overlap_and_stand_in_any_order():
    a, b = BASE.features.labels[:2]
    seen = tracked(scenario(tracking=intervals((5.0, 15.0, (b,)), (0.0, 10.0, (a,)))), np.array([0, 5, 10, 15.0]))
    np.testing.assert_array_equal(seen[:, :2], [[True, False], [True, True], [False, True], [False, True]])
    assert not seen[:, 2:].any()


def test_no_intervals_means_always():
    assert tracked(scenario(), np.array([0.0, 1e6])).all()


@given(
    limit=st.floats(1, 90),
    angle=st.floats(0, 180),
    about=st.floats(0, 360),
    reach=st.floats(0.1, 100),
)
def test_facing(limit, angle, about, reach):
    """A normal turned by an angle from the direction to the chaser is seen up to the limit, all around."""
    if abs(angle - limit) < 1e-6:
        angle = limit + 1e-6
    flown = scenario(tracking=Tracking(visibility="facing", max_incidence_deg=limit))
    to_chaser, aside, across = np.array([0.6, 0.0, 0.8]), np.array([0.8, 0.0, -0.6]), np.array([0.0, 1.0, 0.0])
    turn, around = np.deg2rad([angle, about])
    normal = np.cos(turn) * to_chaser + np.sin(turn) * (np.cos(around) * aside + np.sin(around) * across)
    shape = (1, COUNT, 3)
    features, normals = np.broadcast_to(-reach * to_chaser, shape), np.broadcast_to(normal, shape)
    assert incidence_cosine(features, normals)[0, 0] == pytest.approx(np.cos(turn), abs=1e-14)
    assert observe(flown, np.zeros(1), features, normals).seen.all() == (angle < limit)


def test_a_feature_at_the_limit_is_seen():
    normal = [-np.sin(np.deg2rad(75)), -np.cos(np.deg2rad(75)), 0.0]
    time, features, _ = still(1)
    flown = scenario(tracking=Tracking(visibility="facing", max_incidence_deg=75.0))
    assert observe(flown, time, features, np.broadcast_to(normal, features.shape)).seen.all()


def test_the_same_seed_gives_the_same_run_and_another_seed_another():
    noisy = {"sensor": Sensor(noise=0.02, dropout=0.1)}
    first, again = (observe(scenario(**noisy), *still(500)) for _ in range(2))
    other = observe(scenario(**noisy, run=Run(seed=BASE.run.seed + 1)), *still(500))
    np.testing.assert_array_equal(first.position, again.position)
    both = first.seen & other.seen
    assert not np.any(first.position[both] == other.position[both])
    assert np.any(first.seen != other.seen)


def test_draws_are_those_of_numpy_s_philox():
    """Of key (seed, purpose) and counter (frame, feature); frames count from 1, which is where its first draw is."""
    time, features, normals = still(20)
    flown = scenario(sensor=Sensor(noise=0.02, dropout=0.3))
    seen = observe(flown, time, features, normals)
    for feature in range(COUNT):
        noise, fate = (
            np.random.Philox(key=(purpose << 64) + BASE.run.seed, counter=feature << 64).random_raw(80).reshape(20, 4)
            for purpose in (0, 1)
        )
        u = ((noise >> np.uint64(12)) + 0.5) / 2**52
        kept = ((fate[:, 0] >> np.uint64(12)) + 0.5) / 2**52 >= 0.3
        np.testing.assert_array_equal(seen.seen[:, feature], kept)
        third = 0.02 * np.sqrt(-2 * np.log(u[:, 2])) * np.cos(2 * np.pi * u[:, 3])
        np.testing.assert_allclose((seen.position - features)[kept, feature, 2], third[kept], rtol=1e-9)


def test_noise_and_dropout_are_separate_streams():
    """More noise loses the same observations, scaled; more dropout leaves the noise of what is seen as it was."""
    time, features, normals = still(500)
    low, high, lossy = (
        observe(scenario(sensor=sensor), time, features, normals)
        for sensor in (
            Sensor(noise=0.01, dropout=0.1),
            Sensor(noise=0.03, dropout=0.1),
            Sensor(noise=0.01, dropout=0.4),
        )
    )
    np.testing.assert_array_equal(low.seen, high.seen)
    np.testing.assert_allclose((high.position - features)[low.seen], 3 * (low.position - features)[low.seen], rtol=1e-9)
    assert np.all(low.seen[lossy.seen])
    np.testing.assert_array_equal(low.position[lossy.seen], lossy.position[lossy.seen])


def test_a_blackout_leaves_the_rest_as_it_was():
    time, features, normals = still(500)
    sensor = Sensor(noise=0.01)
    whole = observe(scenario(sensor=sensor), time, features, normals)
    parts = intervals((0.0, 100.0, BASE.features.labels), (300.0, 499.0, BASE.features.labels))
    dark = observe(scenario(sensor=sensor, tracking=parts), time, features, normals)
    assert not dark.seen[100:300].any()
    np.testing.assert_array_equal(dark.position[300:], whole.position[300:])
    np.testing.assert_array_equal(dark.position[:100], whole.position[:100])


def test_a_longer_run_begins_like_a_shorter_one():
    short, long = (observe(scenario(sensor=Sensor(noise=0.01, dropout=0.2)), *still(n)) for n in (100, 500))
    np.testing.assert_array_equal(short.position, long.position[:100])


def test_the_truth_is_not_touched():
    time, features, normals = still(50)
    features, normals = features.copy(), normals.copy()
    observe(scenario(sensor=Sensor(noise=0.1, dropout=0.3)), time, features, normals)
    np.testing.assert_array_equal(features, still(50)[1])
    np.testing.assert_array_equal(normals, still(50)[2])


def test_shapes_that_do_not_fit():
    time, features, normals = still(10)
    with pytest.raises(ValueError, match=r"features \(10, 9, 3\).*expected \(10, 10, 3\)"):
        observe(scenario(), time, features[:, 1:], normals)

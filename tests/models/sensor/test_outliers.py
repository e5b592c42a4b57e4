"""Observations that are wrong: how many, by how much, for how long, and that the others are left alone."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.models.scenario import Outliers, Run, Sensor, Tracking, load_scenario
from baryscope.models.sensor.tracking import observe

BASE = load_scenario("cubesat-class")
COUNT = len(BASE.features.points)
FRAMES = 20_000
SIGMAS = 5.0  # a statistic may be off by so many of its own standard deviations
TIME = np.arange(float(FRAMES))
ATTITUDE = np.roll(Rotation.from_rotvec(TIME[:, None] * [0.001, -0.002, 0.003]).as_quat(), 1, axis=1)
R_I_B = Rotation.from_quat(ATTITUDE, scalar_first=True).as_matrix()
PLACES_B, NORMALS_B = (np.array([getattr(p, name) for p in BASE.features.points]) for name in ("position", "normal"))
FEATURES_C = [0.0, 10.0, 0.0] + PLACES_B @ np.swapaxes(R_I_B, 1, 2)


def scenario(outliers=None, tracking=None, **sensor):
    chosen = Sensor(outliers=outliers or Outliers(), **({"noise": 0.0} | sensor))
    run = Run(duration=FRAMES - 1.0)
    return BASE.model_copy(update={"tracking": tracking or Tracking(), "sensor": chosen, "run": run})


def observed(flown):
    return observe(flown, TIME, FEATURES_C, NORMALS_B @ np.swapaxes(R_I_B, 1, 2), attitude=ATTITUDE)


def of_features(*numbers):
    labels = tuple(BASE.features.labels[number] for number in numbers)
    return Tracking.model_validate({"intervals": ({"start": 0.0, "end": FRAMES, "features": labels},)})


def test_none_unless_asked_for():
    seen = observed(scenario())
    assert not seen.wrong.any()
    np.testing.assert_array_equal(seen.position, FEATURES_C)


@pytest.mark.parametrize(
    "outliers",
    [Outliers(share=0.2), Outliers(swapped=0.2), Outliers(sliding=3), Outliers(share=0.1, swapped=0.1, sliding=1)],
)
def test_the_others_are_left_alone(outliers):
    clean, spoilt = observed(scenario(noise=0.02, dropout=0.1)), observed(scenario(outliers, noise=0.02, dropout=0.1))
    np.testing.assert_array_equal(clean.seen, spoilt.seen)
    right = spoilt.seen & ~spoilt.wrong
    np.testing.assert_array_equal(clean.position[right], spoilt.position[right])
    assert not np.any(clean.position[spoilt.wrong] == spoilt.position[spoilt.wrong])
    assert not np.any(spoilt.wrong & ~spoilt.seen)
    assert 0.1 < spoilt.wrong[spoilt.seen].mean() < 0.4


def test_blunders():
    """Share of the observations, rms length, no direction preferred, each by itself."""
    share, size = 0.1, 2.0
    seen = observed(scenario(Outliers(share=share, size=size)))
    off = (seen.position - FEATURES_C)[seen.wrong]
    assert seen.wrong.mean() == pytest.approx(share, abs=SIGMAS * np.sqrt(share * (1 - share) / seen.wrong.size))
    assert np.sqrt((off**2).sum(axis=1).mean()) == pytest.approx(size, rel=SIGMAS * np.sqrt(1 / (6 * len(off))))
    np.testing.assert_allclose(off.mean(axis=0), 0, atol=SIGMAS * size / np.sqrt(3 * len(off)))
    twice = (seen.wrong[1:] & seen.wrong[:-1]).mean()
    assert twice == pytest.approx(share**2, abs=SIGMAS * share / np.sqrt(seen.wrong.size))


def test_a_larger_size_scales_the_same_blunders():
    small, large = (observed(scenario(Outliers(share=0.1, size=size))) for size in (1.0, 3.0))
    np.testing.assert_array_equal(small.wrong, large.wrong)
    np.testing.assert_allclose(large.position - FEATURES_C, 3 * (small.position - FEATURES_C), atol=1e-12)


@pytest.mark.parametrize("features", [tuple(range(COUNT)), (1, 4, 7), (0, 2)], ids=["even", "odd", "two"])
def test_swaps(features):
    """Pairs change places, mutually, for whole stretches of 10 s, in the share that is asked for."""
    share = 0.2
    seen = observed(scenario(Outliers(swapped=share), of_features(*features)))
    chosen = list(features)
    positions, wrong = seen.position[:, chosen], seen.wrong[:, chosen]
    distance = np.linalg.norm(positions[:, :, None] - FEATURES_C[:, None, chosen], axis=3)
    source = np.argmin(distance, axis=2)
    assert distance.min(axis=2).max() == 0
    np.testing.assert_array_equal(
        np.take_along_axis(source, source, axis=1), np.broadcast_to(range(len(chosen)), source.shape)
    )
    np.testing.assert_array_equal(source != range(len(chosen)), wrong)
    held = source.reshape(-1, 10, len(chosen))
    np.testing.assert_array_equal(held, held[:, :1] + 0 * held)
    pairs = len(held) * (len(chosen) // 2)
    assert wrong.mean() == pytest.approx(share, abs=SIGMAS * np.sqrt(share * (1 - share) / pairs))
    assert not seen.wrong[:, [k for k in range(COUNT) if k not in chosen]].any()


def test_swaps_are_between_features_that_are_seen():
    seen = observed(scenario(Outliers(swapped=0.5, stretch=25.0), dropout=0.3))
    distance = np.linalg.norm(seen.position[:, :, None] - FEATURES_C[:, None], axis=3)
    frame, feature = np.nonzero(seen.wrong)
    partner = np.argmin(distance[frame, feature], axis=1)
    assert seen.seen[frame, partner].all()
    assert np.all(distance[frame, partner, feature] == 0)


def test_stretches_shorter_than_a_sample():
    """Each frame is one of its own, however short a stretch is."""
    seen = observed(scenario(Outliers(swapped=0.2, stretch=1e-9)))
    assert seen.wrong.mean() == pytest.approx(0.2, abs=SIGMAS * np.sqrt(0.16 / (FRAMES * (COUNT // 2))))


def test_slides():
    """So many features go, from a time on, straight and at the speed, in the plane normal to their normal, in B."""
    speed = 0.005
    seen = observed(scenario(Outliers(sliding=4, sliding_speed=speed)))
    off_B = np.einsum("nji,nmj->nmi", R_I_B, seen.position - FEATURES_C)
    length = np.linalg.norm(off_B, axis=2)
    gone = np.nonzero(seen.wrong.any(axis=0))[0]
    assert len(gone) == 4
    for k in gone:
        first = int(np.argmax(seen.wrong[:, k]))
        assert seen.wrong[first:, k].all()
        assert 0 < length[first, k] <= speed + 1e-12
        np.testing.assert_allclose(np.diff(length[first:, k]), speed, atol=1e-12)
        way = off_B[first:, k] / length[first:, k, None]
        np.testing.assert_allclose(way[2:], np.broadcast_to(way[-1], way[2:].shape), atol=1e-10)
        assert abs(way[-1] @ NORMALS_B[k]) < 1e-12


def test_more_that_slide_leave_those_before_them_as_they_were():
    few, many = (observed(scenario(Outliers(sliding=count))) for count in (2, 5))
    np.testing.assert_array_equal(few.position[few.wrong], many.position[few.wrong])
    assert many.wrong.sum() > few.wrong.sum()


def test_sliding_needs_the_attitude():
    with pytest.raises(ValueError, match="attitude is missing"):
        observe(scenario(Outliers(sliding=1)), TIME, FEATURES_C, FEATURES_C)


def test_outliers_seen_by_a_rig():
    """A rig states the covariance of what it has measured, be it another feature or no feature at all."""
    rig = {"focal_length": 1911.0, "baseline": 1.0, "pixel_noise": 0.5}
    sensor = Sensor.model_validate({"stereo": rig, "outliers": {"swapped": 0.3}})
    flown = BASE.model_copy(update={"tracking": Tracking(), "sensor": sensor})
    target = np.broadcast_to([0.0, 10.0, 0.0], (FRAMES, 3))
    seen = observe(flown, TIME, FEATURES_C, FEATURES_C, target_C=target)
    along = seen.covariance[..., 1, 1]
    assert seen.wrong.any()
    np.testing.assert_allclose(
        along[seen.seen], 2 * (seen.position[seen.seen][:, 1] ** 2 * 0.5 / 1911.0) ** 2, rtol=1e-9
    )

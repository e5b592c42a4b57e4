"""Covariances of a rig, and what an estimator is told."""

import numpy as np

from baryscope.study.population.fourth.sensor import COARSEST, FINEST, Sensor, drawn


def test_a_rig_is_less_certain_of_the_depth_and_of_what_is_far():
    sensor = Sensor(0.1, ratio=5.0)
    position = np.array([[[10.0, 0, 0], [0, 20.0, 0]]])
    near, far = sensor.covariances(position, 10.0)[0]
    np.testing.assert_allclose(near, np.diag([0.1, 0.02, 0.02]) ** 2, atol=1e-15)
    np.testing.assert_allclose(far, np.diag([0.04, 0.4, 0.04]) ** 2, atol=1e-15)


def test_without_a_rig_it_is_alike_everywhere():
    position = np.random.default_rng(1).normal(0, 10, (4, 3, 3))
    found = Sensor(0.1).covariances(position, 10.0)
    np.testing.assert_allclose(found, np.broadcast_to(0.01 * np.eye(3), found.shape))


def test_sigma_is_the_noise_or_a_factor():
    assert Sensor(0.1).sigma == 0.1
    assert Sensor(0.1, ratio=3.0).sigma == 1
    assert Sensor(0.1, ratio=3.0, told=False).sigma is None


def test_what_is_told_is_true():
    for seed in range(300):
        sensor = drawn(np.random.default_rng(seed), 1.0)
        assert FINEST <= sensor.noise <= COARSEST
        assert sensor.factor == 1 or (sensor.ratio and not sensor.told)
        assert bool(sensor.blunders) == bool(sensor.blunder)
        assert 0 <= sensor.blunders <= 0.2
        assert sensor.ratio == 0 or 1.3 <= sensor.ratio <= 12


def test_words_say_what_is_special():
    sensor = Sensor(0.012, 4.0, True, 0.5, False, 0.03, "near")
    expected = "12 mm, rig 1:4.0 by measured range, covariances told times 0.50², near outliers 3.0 %"
    assert sensor.words() == expected
    assert Sensor(0.012).words() == "12 mm, told"

import numpy as np
import pytest

from baryscope.estimator.screws.low_pass import low_pass, low_pass_axes


def test_slow_signals_pass_without_shift_and_fast_ones_are_stopped():
    time = np.arange(2000) * 0.1
    slow, fast = np.sin(2 * np.pi * 0.05 * time), np.sin(2 * np.pi * 3.0 * time)
    smooth = low_pass(np.column_stack([slow, fast]), 0.1, cutoff=0.5)
    np.testing.assert_allclose(smooth[:, 0], slow, atol=2e-3)
    assert np.abs(smooth[100:-100, 1]).max() < 1e-2


@pytest.mark.parametrize("n", [1, 2, 7, 8, 9, 20])
def test_short_runs_and_no_cutoff_are_handled(n):
    values = np.linspace(0, 1, n)[:, None]
    np.testing.assert_allclose(low_pass(values, 1.0, cutoff=0.1), values, atol=0.05)
    np.testing.assert_array_equal(low_pass(values, 1.0, cutoff=np.inf), values)
    np.testing.assert_array_equal(low_pass(values, 1.0, cutoff=0.5), values)


def lines_through(pivot, n, seed):
    rng = np.random.default_rng(seed)
    time = np.linspace(0, 6, n)
    axis = np.column_stack([np.cos(time), np.sin(time), 0.5 + 0.1 * np.cos(3 * time)])
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    return axis, pivot + rng.normal(size=(n, 1)) * axis


def test_filtered_lines_still_pass_through_their_common_point():
    pivot = np.array([3.0, -20, 7])
    axis, point = lines_through(pivot, 200, seed=1)
    new_axis, new_point = low_pass_axes(axis, point, 1.0, cutoff=0.05)
    np.testing.assert_allclose(np.linalg.norm(new_axis, axis=1), 1.0)
    np.testing.assert_allclose(np.cross(new_point - pivot, new_axis), 0, atol=1e-10)
    np.testing.assert_allclose(np.sum((new_point - point) * new_axis, axis=1), 0, atol=1e-10)  # the nearest ones
    assert np.abs(new_axis - axis).max() < 0.2


def test_noise_is_reduced_as_the_bandwidth():
    rng = np.random.default_rng(2)
    axis, point = lines_through(np.zeros(3), 2000, seed=2)
    noisy = axis + 0.05 * rng.normal(size=axis.shape)
    noisy /= np.linalg.norm(noisy, axis=1, keepdims=True)
    new_axis, _ = low_pass_axes(noisy, point, 1.0, cutoff=0.02)
    # White noise keeps about 2 · cut-off · step of its variance, 0.04, so a fifth of its amplitude.
    assert np.abs(new_axis - axis).std() < 0.3 * np.abs(noisy - axis).std()


def test_a_flip_of_sense_near_180_degrees_is_bridged():
    axis, point = lines_through(np.zeros(3), 100, seed=3)
    sign = np.where(np.arange(100) % 3 == 0, -1.0, 1.0)[:, None]
    flipped, _ = low_pass_axes(sign * axis, point, 1.0, cutoff=0.1)
    straight, _ = low_pass_axes(axis, point, 1.0, cutoff=0.1)
    np.testing.assert_allclose(flipped, sign * straight, atol=1e-12)

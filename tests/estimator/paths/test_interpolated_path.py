"""A path interpolated between the knots of blocks, against the same path sampled at every frame."""

from dataclasses import replace

import numpy as np
import pytest

from baryscope.estimator.orbits.error import with_orbit_error
from baryscope.estimator.paths.forces import ForcedPath, constant_of
from baryscope.estimator.paths.interpolated_path import InterpolatedPath, interpolated
from baryscope.estimator.paths.path import Polynomial, SmoothPath
from baryscope.estimator.paths.process_noise import disturbed
from baryscope.estimator.paths.relative_motion import PerturbedOrbit, RelativeOrbit
from baryscope.estimator.paths.sampled_path import SampledPath
from baryscope.models.orbit import EARTH_J2, EARTH_RADIUS, Orbit

TIME = np.sort(np.random.default_rng(0).uniform(-100.0, 5900.0, 20_000))
ORBIT = Orbit(semi_major_axis=7.15e6, eccentricity=0.02, inclination=1.7)
ECCENTRIC = replace(ORBIT, semi_major_axis=2.4e7, eccentricity=0.7)
OBLATE = replace(ORBIT, j2=EARTH_J2, equatorial_radius=EARTH_RADIUS)
MIDDLE = 2900.0
# A wave over a block has an error of 3e-13; that of RelativeOrbit.at, of its own spline, is 5/384 (0.01 rad)⁴ of the
# orbit's rate, and more of its harmonics. Slopes lose an order, 0.01 rad.
SPAN = (-100.0, 5900.0)


def wrong(path, orbit):
    """The path with an error of its orbit, about one that drifts."""
    x = np.array([20.0, -30.0, 10.0, 5.0, -8.0, 3.0])
    return with_orbit_error(path, orbit, lambda time: path.at(time).position(x), *SPAN)


CASES = {
    "fixed": (Polynomial(0, -100.0, 5900.0), 1e-11),
    "polynomial": (SmoothPath(20, -100.0, 5900.0), 1e-11),
    "orbit": (RelativeOrbit(ORBIT, MIDDLE), 1e-9),
    "eccentric": (RelativeOrbit(ECCENTRIC, MIDDLE), 1e-9),
    "J2": (PerturbedOrbit(OBLATE, MIDDLE), 1e-10),
    "orbit error": (wrong(RelativeOrbit(ORBIT, MIDDLE), ORBIT), 1e-9),
    "eccentric, orbit error": (wrong(PerturbedOrbit(ECCENTRIC, MIDDLE), ECCENTRIC), 1e-9),
    "drag": (ForcedPath(RelativeOrbit(ECCENTRIC, MIDDLE), constant_of("lvlh", ECCENTRIC, *SPAN), *SPAN), 1e-9),
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("noisy", [False, True])
def test_interpolation_agrees_with_the_path_itself(name, noisy):
    (path, tolerance), time = CASES[name], TIME[::2]
    if noisy:
        path = disturbed(path, 1e-10, -100.0, 5900.0)
    for at, accuracy in ((path.at, tolerance), (path.rate_at, 100 * tolerance)):
        few, every = interpolated(at, path.frequency, time), at(time)
        assert isinstance(few, InterpolatedPath)
        assert len(few.blocks.knots.ravel()) < len(time) / 4
        size = np.maximum(np.abs(every.jacobian).max(axis=(0, 1)), 1e-300)
        np.testing.assert_allclose(few.jacobian / size, every.jacobian / size, atol=accuracy)
        x = 20.0 * np.random.default_rng(1).normal(size=few.size)
        expected = every.position(x)
        np.testing.assert_allclose(few.position(x), expected, atol=10 * accuracy * np.abs(expected).max())


@pytest.fixture(scope="module")
def few():
    path = disturbed(RelativeOrbit(ORBIT, MIDDLE), 1e-10, -100.0, 5900.0)
    return interpolated(path.at, path.frequency, TIME)


@pytest.mark.parametrize(
    "frames", [slice(0, 20_000), slice(3_111, 9_998), np.flatnonzero(np.arange(20_000) % 7 > 2), np.arange(40, 45)]
)
def test_sums_over_blocks_are_those_over_frames(few, frames):
    every = SampledPath(few.jacobian, few.position)
    count = len(np.arange(20_000)[frames])
    rng = np.random.default_rng(2)
    weights, values = rng.normal(size=(2, count, 3, 3)), rng.normal(size=(count, 3, 5))
    weights += np.swapaxes(weights, 2, 3)
    close = {"rtol": 0.0, "atol": 1e-12 * count * np.abs(few.jacobian).max() ** 2}
    np.testing.assert_allclose(few.gram(frames, weights[0]), every.gram(frames, weights[0]), **close)
    both = (path.gram_and_diagonal(frames, *weights) for path in (few, every))
    for found, expected in zip(*both, strict=True):
        np.testing.assert_allclose(found, expected, **close)
    np.testing.assert_allclose(few.moment(frames, values), every.moment(frames, values), rtol=1e-9, atol=1e-8)


def test_covariances_are_those_of_every_frame(few):
    root = np.random.default_rng(3).normal(size=(few.size, 4))
    every = SampledPath(few.jacobian, few.position)
    expected = every.covariance(root @ root.T)
    np.testing.assert_allclose(few.covariance(root @ root.T), expected, atol=1e-12 * np.abs(expected).max())
    assert np.linalg.eigvalsh(few.covariance(root @ root.T)).min() > -1e-12 * np.abs(expected).max()
    directions = np.random.default_rng(4).normal(size=(few.size, 2))
    np.testing.assert_allclose(few.lengths(directions), every.lengths(directions), rtol=1e-12)
    mean_square = every.mean_square()
    np.testing.assert_allclose(few.mean_square(), mean_square, atol=1e-12 * np.abs(mean_square).max())


@pytest.mark.parametrize("frames", [np.arange(0, 20_000, 7), np.arange(9_000, 9_020), np.array([0, 12_345, 19_999])])
def test_some_of_the_frames_are_at_the_same_places(few, frames):
    some, every = few.frames_at(frames), SampledPath(few.jacobian, few.position)
    assert some.frames == len(frames)
    x = np.random.default_rng(5).normal(size=few.size)
    np.testing.assert_allclose(some.position(x), few.position(x)[frames], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(some.jacobian, few.jacobian[frames], atol=1e-14 * np.abs(few.jacobian).max())
    mean_square = every.frames_at(frames).mean_square()
    np.testing.assert_allclose(some.mean_square(), mean_square, atol=1e-12 * np.abs(mean_square).max())


def test_some_of_the_frames_need_no_jacobian_of_all():
    path = RelativeOrbit(ORBIT, MIDDLE)
    every = interpolated(path.at, path.frequency, TIME)
    every.frames_at(np.arange(0, 20_000, 7)).mean_square()
    assert "jacobian" not in vars(every)  # which is there once it is computed


def test_few_frames_are_not_interpolated():
    path = RelativeOrbit(ORBIT, MIDDLE)
    assert not isinstance(interpolated(path.at, path.frequency, TIME[::400]), InterpolatedPath)
    assert not isinstance(interpolated(path.at, np.inf, TIME), InterpolatedPath)
    assert not isinstance(interpolated(path.at, path.frequency, TIME[:1]), InterpolatedPath)

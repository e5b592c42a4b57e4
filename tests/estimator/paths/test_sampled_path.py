"""A path that is the same in three axes, against a path with the same Jacobian in full."""

import numpy as np
import pytest

from baryscope.estimator.paths.path import SmoothPath
from baryscope.estimator.paths.process_noise import disturbed
from baryscope.estimator.paths.sampled_path import IsotropicPath, SampledPath

TIME = np.sort(np.random.default_rng(0).uniform(-5.0, 95.0, 200))
X = np.random.default_rng(1).normal(size=3 * 14)
FRAMES = {"all": slice(0, 200), "a part": slice(40, 90), "some": np.flatnonzero(np.arange(200) % 7 < 2)}
PATH = disturbed(SmoothPath(1, -5.0, 95.0), "auto", -5.0, 95.0)


@pytest.fixture(params=["plain", "moved", "few"])
def both(request):
    """The path, and the same with its Jacobian in full."""
    own = PATH.at(TIME)
    if request.param == "moved":
        by = np.random.default_rng(2).normal(size=(len(TIME), 3))
        own = own.moved(by).moved(-2 * by)
    elif request.param == "few":
        own = own.frames_at(np.arange(200)[::-1]).frames_at(np.arange(200)[::-1])
    assert isinstance(own, IsotropicPath)
    return own, SampledPath(own.jacobian, own.position)


def test_the_jacobian_is_that_of_the_position(both):
    own, full = both
    assert (own.frames, own.size) == (full.frames, full.size) == (len(TIME), len(X))
    moved = own.position(X) - own.offset  # it is linear
    np.testing.assert_allclose(moved, own.jacobian @ X, rtol=0, atol=1e-12)
    first, second = (one.itself.position(X) for one in both)
    np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize("frames", FRAMES.values(), ids=FRAMES)
def test_sums_over_frames_are_those_of_the_full_jacobian(both, frames):
    rng = np.random.default_rng(3)
    count = len(TIME[frames])
    weights, others = (root @ np.swapaxes(root, 1, 2) for root in rng.normal(size=(2, count, 3, 3)))
    last = np.asfortranarray(rng.normal(size=(count, 3, 5)))  # the frames last in memory
    first, second = (
        (*one.gram_and_diagonal(frames, weights, others), one.gram(frames, others), one.moment(frames, last))
        for one in both
    )
    for a, b in zip(first, second, strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-12 * np.abs(b).max())


@pytest.mark.parametrize("lead", [(), (2,), (2, 3)])
def test_moments_of_several_arrays_at_once(both, lead):
    values = np.random.default_rng(4).normal(size=(*lead, len(TIME), 3, 4))
    first, second = (one.moment(slice(0, len(TIME)), values) for one in both)
    np.testing.assert_allclose(first, second, rtol=0, atol=1e-12 * np.abs(second).max())
    if lead:
        np.testing.assert_allclose(first[0], both[0].moment(slice(0, len(TIME)), values[0]), rtol=0, atol=1e-10)


def test_covariances_and_directions_are_those_of_the_full_jacobian(both):
    rng = np.random.default_rng(5)
    root = rng.normal(size=(len(X), len(X)))
    for a, b in zip(*((one.covariance(root @ root.T), one.times(root[:, :7])) for one in both), strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-12 * np.abs(b).max())
    for a, b in zip(*((one.lengths(root[:, :7]), one.mean_square()) for one in both), strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-12 * np.abs(b).max())


def test_further_unknowns_of_one_axis_alone(both):
    own, full = both
    columns = np.random.default_rng(6).normal(size=(len(TIME), 3, 2))
    one, two = own.extended(columns), full.extended(columns)
    x = np.append(X, [0.3, -0.2])
    np.testing.assert_allclose(one.position(x), two.position(x), rtol=0, atol=1e-12)
    np.testing.assert_array_equal(one.jacobian, two.jacobian)
    terms = columns[:, 0]
    same = own.with_terms(terms)
    np.testing.assert_array_equal(same.jacobian, full.with_terms(terms).jacobian)
    assert isinstance(same, IsotropicPath)


def test_what_a_camera_sees_keeps_the_path_itself_and_its_turn():
    """Further unknowns turn nothing; a path that is moved, or taken in some frames, is so for the camera, too."""
    rng = np.random.default_rng(7)
    jacobian, turn = rng.normal(size=(2, 30, 3, 6))
    itself = SampledPath(jacobian / 2, lambda x: jacobian @ x / 2)
    seen = SampledPath(jacobian, lambda x: jacobian @ x, itself, turn)
    columns, by, index = rng.normal(size=(30, 3, 2)), rng.normal(size=(30, 3)), np.array([3, 7, 20])
    found = seen.extended(columns).moved(by).frames_at(index)
    x = rng.normal(size=8)
    np.testing.assert_array_equal(found.turn, np.concatenate([turn, np.zeros((30, 3, 2))], axis=2)[index])
    for own, first in ((found, jacobian), (found.itself, jacobian / 2)):
        whole = np.concatenate([first, columns], axis=2)
        np.testing.assert_array_equal(own.jacobian, whole[index])
        np.testing.assert_allclose(own.position(x), (whole @ x + by)[index], rtol=0, atol=1e-13)

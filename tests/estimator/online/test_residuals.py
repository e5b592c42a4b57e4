"""What the online estimator tells of the points of its last frame: how far they are off its map, and which fit."""

import numpy as np
import pytest

from baryscope.estimator.online import OnlineEstimator
from tops import FRAMES, POINTS, SIGMA, straight, tracks

M = len(POINTS)
SETTLED = FRAMES // 2  # frames after which the map is known ten times better than one frame shows it


def watched(points, **more):
    """After each frame, what the filter tells of it: residuals (n, m, 3), NaN where none; told and fits (n, m)."""
    filter = OnlineEstimator(SIGMA)
    residuals, told, fits = np.full(points.shape, np.nan), *np.zeros((2, *points.shape[:2]), dtype=bool)
    for k, frame in enumerate(points):
        filter.update(float(k), frame, **more)
        found = filter.residuals()
        residuals[k, found.names], told[k, found.names], fits[k, found.names] = found.residual, True, found.fits
    return residuals, told, fits


@pytest.fixture(scope="module")
def points():
    time = np.arange(FRAMES, dtype=float)
    return tracks(np.random.default_rng(5), time, straight(time))


def test_residuals_are_as_large_as_the_noise(points):
    """Their squares are χ² of three for each point less six for each pose, in five σ, and 2 % for the map's errors."""
    residuals, told, fits = watched(points)
    assert not told[0].any()  # the first frame is the map
    assert told[1:].all()
    assert (~fits[1:]).mean() < 1e-3  # the gate is at 1e-4
    squares = np.sum((residuals[SETTLED:][fits[SETTLED:]] / SIGMA) ** 2)
    degrees = 3 * fits[SETTLED:].sum() - 6 * (FRAMES - SETTLED)
    assert squares == pytest.approx(degrees, abs=5 * np.sqrt(2 * degrees) + 0.02 * degrees)


def test_points_that_are_off_do_not_fit_and_no_others(points):
    """Of one in ten, by 25 σ along each axis; where fewer than half are off, and three are right."""
    rng = np.random.default_rng(6)
    off = (rng.random((FRAMES, M)) < 0.1) & (np.arange(FRAMES)[:, None] > 0)
    moved = points + 25 * SIGMA * off[..., None] * rng.choice([-1.0, 1.0], (FRAMES, M, 3))
    residuals, told, fits = watched(moved)
    most = (2 * (~off).sum(axis=1) > M) & (np.arange(FRAMES) > 0)
    assert told[1:].all()
    assert not (fits & off)[most].any()
    assert fits[most][~off[most]].mean() > 0.995  # the gate is at 1e-4, and a pose that many are missing from is weaker
    # What is off is off by as much as it was moved by: the pose is that of the others.
    most[:SETTLED] = False
    lengths = np.linalg.norm(residuals[most], axis=2)[off[most]]
    np.testing.assert_allclose(lengths, 25 * np.sqrt(3) * SIGMA, atol=8 * SIGMA)


def test_a_frame_of_nothing_has_no_pose_and_nothing_fits(points):
    points = points.copy()
    points[100] = np.random.default_rng(7).uniform(5.0, 50.0, points[100].shape)
    residuals, told, fits = watched(points)
    assert told[100].all()
    assert not fits[100].any()
    assert np.isnan(residuals[100]).all()
    assert fits[101].all()


def test_names_are_those_under_which_points_came(points):
    """Whole numbers of the user's. A feature that is not in the map is not told of; a refused frame changes nothing."""
    filter, names = OnlineEstimator(SIGMA), 100 + 7 * np.arange(M)
    for k in range(50):
        filter.update(float(k), points[k, :-1], names=names[:-1])
    assert filter.residuals().names.tolist() == names[:-1].tolist()
    filter.update(50.0, points[50][::-1], names=names[::-1])
    assert filter.residuals().names.tolist() == names[-2::-1].tolist()
    before = filter.residuals()
    with pytest.raises(ValueError, match="time"):
        filter.update(50.0, points[51])
    np.testing.assert_array_equal(filter.residuals().residual, before.residual)
    filter.update(51.0, [])
    assert len(filter.residuals().names) == 0

"""Residuals of samples against a map: what is off is found and what is right stays, feature by feature."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.special import chdtri

from baryscope.estimator.online.residuals import residuals_of_map

LABELS = tuple("abcdefghijkl")
DEVIATION = np.array([0.002, 0.002, 0.02])  # depths are worse, as a rig's


def samples(share, count=400, seed=1):
    """Points of a body at random poses, of which a share is off by half a metre; four tenths are not seen."""
    rng = np.random.default_rng(seed)
    body = 2.0 * rng.normal(size=(len(LABELS), 3))
    R, place = Rotation.random(count, rng).as_matrix(), 20.0 * rng.normal(size=(count, 1, 3))
    position = body @ np.swapaxes(R, 1, 2) + place + DEVIATION * rng.normal(size=(count, len(LABELS), 3))
    off = rng.random(position.shape[:2]) < share
    position[off] += 0.5 * rng.normal(size=(off.sum(), 3))
    position[rng.random(off.shape) < 0.4] = np.nan
    covariance = np.broadcast_to(np.diag(DEVIATION**2), (*off.shape, 3, 3))
    return position, covariance, body, off & np.isfinite(position[..., 0])


def found_in(position, covariance, body):
    return residuals_of_map(np.arange(len(position), dtype=float), LABELS, position, covariance, body)


def test_residuals_are_as_large_as_the_noise():
    """Their weighted squares are χ² of three for each point less six for each pose; of 1e4 that holds in five σ."""
    position, covariance, body, _ = samples(0.0)
    found = found_in(position, covariance, body)
    seen = np.isfinite(position[..., 0])
    enough = seen.sum(axis=1) >= 3
    np.testing.assert_array_equal(found.used, seen & enough[:, None])
    # Squares beyond the gate of p = 1e-4 have been left out: of 2900 points a few at most.
    assert found.rejected.sum() <= 3
    squares = np.nansum((found.residuals / DEVIATION) ** 2)
    degrees = 3 * found.used.sum() - 6 * enough.sum()
    assert squares == pytest.approx(degrees, abs=5 * np.sqrt(2 * degrees))
    np.testing.assert_allclose(
        found.feature_rms,
        np.sqrt(np.nanmean(np.where(found.rejected[..., None], np.nan, found.residuals) ** 2, (0, 2))),
    )


@pytest.mark.parametrize("share", [0.02, 0.1, 0.2])
def test_points_that_are_off_are_rejected_and_no_others(share):
    position, covariance, body, off = samples(share)
    found = found_in(position, covariance, body)
    posed = np.isfinite(found.residuals[..., 0]).any(axis=1)
    most = 2 * (found.used & ~off).sum(axis=1) > np.maximum(found.used.sum(axis=1), 5)  # three right ones at least
    assert posed[most].mean() > 0.95
    rows = posed[:, None] & found.used
    assert (found.rejected & ~off & rows).sum() <= 3 + 0.01 * (off & rows).sum()
    # Half a metre along the depth is 25 σ: as little as ±0.1 of it passes the gate by chance.
    assert (~found.rejected & off & rows).sum() <= 0.03 * (off & rows).sum() + 1


def test_a_sample_that_is_of_nothing_has_no_pose():
    position, covariance, body, _ = samples(0.0)
    position[7] = np.random.default_rng(2).uniform(5.0, 50.0, position[7].shape)
    position[9, 2:] = np.nan  # two points are no sample
    found = found_in(position, covariance, body)
    assert found.rejected[7].all()
    assert np.isnan(found.residuals[7]).all()
    assert not found.used[9].any()
    assert not found.rejected[9].any()


def test_features_that_the_map_has_not_are_not_used():
    position, covariance, body, _ = samples(0.0)
    body[4] = np.nan
    found = found_in(position, covariance, body)
    assert not found.used[:, 4].any()
    assert np.isnan(found.feature_rms[4])
    assert np.isfinite(np.delete(found.feature_rms, 4)).all()
    assert chdtri(3, 1e-4) == pytest.approx(21.1, abs=0.05)  # the gate of fmu/csrc/online/registration.c

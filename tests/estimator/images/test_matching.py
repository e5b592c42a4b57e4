"""Features that are followed from image to image."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from baryscope.estimator.images.matching import flow

pytest.importorskip("cv2", reason="OpenCV, the extra images, is not installed")

SHIFT = np.array([3.0, -2.0])  # px


@pytest.mark.parametrize("exposure", [1.0, 0.5, 1.8])
def test_features_are_followed_into_another_exposure(exposure):
    """A camera that sets its exposure by itself lost all features where the light fell by a third."""
    texture = gaussian_filter(np.random.default_rng(1).normal(size=(160, 200)), 2)
    before = 90 + 25 * texture / texture.std()
    now = 10 + exposure * (np.roll(before, SHIFT[::-1].astype(int), axis=(0, 1)) - 10)
    images = [np.clip(np.rint(image), 0, 255).astype(np.uint8) for image in (before, now)]
    places = np.array([[40.0, 40.0], [100.0, 60.0], [150.0, 120.0], [60.0, 110.0]])
    moved, followed = flow(*images, places)
    assert followed.all()
    assert np.abs(moved - places - SHIFT).max() < 0.1

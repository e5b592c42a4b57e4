"""The renderer: where a facet is seen, how bright, and what hides it."""

import numpy as np
import pytest

from baryscope.estimator.camera.lens import Lens
from baryscope.study.images.body import Facet, satellite
from baryscope.study.images.render import AMBIENT, View, render

pytest.importorskip("cv2", reason="OpenCV, the extra images, is not installed")

LENS = Lens(
    focal_length=(300.0, 300.0), principal_point=(79.5, 59.5), resolution=(160, 120), distortion=(-0.3, 0.1, 0, 0, 0)
)
VIEW = View.of(LENS)
TOWARDS = np.array([0.0, 0.0, -1.0])
WHITE = np.ones((2, 2), np.float32)
UPRIGHT = np.eye(3)


def disc(x, y, z, radius, tilt=0.0):
    """A white disc around (x, y, z) that faces the camera, but for a tilt about x."""
    a, b = np.array([0.0, np.cos(tilt), np.sin(tilt)]), np.array([1.0, 0.0, 0.0])
    return Facet(np.array([x, y, z]) - radius * (a + b), 2 * radius * np.array([a, b]), WHITE, round=True)


def test_a_disc_is_seen_where_the_lens_says():
    """Off the axis, to a hundredth of a pixel: nine rays a pixel, along an edge of some 30 pixels."""
    image = render([disc(0.4, 0.3, 2.0, 0.03)], VIEW, UPRIGHT, np.zeros(3), TOWARDS)
    x, y, r2 = 0.2, 0.15, 0.2**2 + 0.15**2
    bent = 1 - 0.3 * r2 + 0.1 * r2**2
    v, u = np.mgrid[:120, :160]
    centre = np.array([(image * u).sum(), (image * v).sum()]) / image.sum()
    np.testing.assert_allclose(centre, 300 * bent * np.array([x, y]) + [79.5, 59.5], atol=0.02)


def test_light_is_the_cosine_to_the_sun():
    sun = np.array([0.6, 0.0, -0.8])
    image = render([disc(0, 0, 2.0, 0.2)], VIEW, UPRIGHT, np.zeros(3), sun)
    assert image[60, 80] == pytest.approx((AMBIENT + 0.8) / (AMBIENT + 1), rel=1e-5)
    assert image[5, 5] == 0


def test_the_nearer_facet_hides_the_other_and_backs_are_not_seen():
    dark = Facet(*(getattr(disc(0, 0, 1.5, 0.1), name) for name in ("corner", "edges")), 0.2 * WHITE, round=True)
    for order in ([disc(0, 0, 2, 0.3), dark], [dark, disc(0, 0, 2, 0.3)]):
        assert render(order, VIEW, UPRIGHT, np.zeros(3), TOWARDS)[60, 80] == pytest.approx(0.2, rel=1e-5)
    back = Facet(dark.corner, dark.edges[::-1], WHITE)
    assert not render([back], VIEW, UPRIGHT, np.zeros(3), TOWARDS).any()


def test_the_satellite_is_closed():
    """From any side the rays near the middle of the box meet it, and a seed gives the same textures again."""
    body = satellite(1)
    rng = np.random.default_rng(0)
    for _ in range(3):
        R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        R *= np.linalg.det(R)
        image = render(body, VIEW, R, np.array([0.0, 0.0, 4.0]), TOWARDS)
        assert image[55:65, 75:85].min() > 0
    np.testing.assert_array_equal(satellite(1)[3].albedo, body[3].albedo)

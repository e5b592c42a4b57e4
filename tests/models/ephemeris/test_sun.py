"""The Sun's direction against published positions, and the Earth's shadow against geometry."""

import numpy as np
import pytest

from baryscope.models.ephemeris.sun import sun_direction, sunlit
from baryscope.models.ephemeris.utc import utc_of


@pytest.mark.parametrize(
    ("moment", "right_ascension", "declination"),
    [
        ("1992-10-12T23:59:01", 198.38083, -7.78507),  # Meeus, Astronomical Algorithms, example 25.a
        ("2000-03-20T07:35:00", 0.0, 0.0),  # the equinox
        ("2026-06-21T08:24:00", 90.0, 23.4362),  # the solstice
    ],
)
def test_published_directions(moment, right_ascension, declination):
    alpha, delta = np.deg2rad([right_ascension, declination])
    expected = [np.cos(delta) * np.cos(alpha), np.cos(delta) * np.sin(alpha), np.sin(delta)]
    found = sun_direction(utc_of(moment, "here"), np.zeros(1))[0]
    assert np.rad2deg(np.linalg.norm(np.cross(found, expected))) < 0.012
    later = sun_direction(utc_of("1992-10-12T00:00:00", "here"), np.array([86341.0]))
    np.testing.assert_allclose(later, sun_direction(utc_of("1992-10-12T23:59:01", "here"), np.zeros(1)), atol=1e-9)


def test_shadow():
    towards = np.tile([1.0, 0, 0], (4, 1))
    radius = 6378137.0
    places = np.array([[7e6, 0, 0], [-7e6, 0, 0], [0, 0, 7e6], [-7e6, radius * 1.0, 0]])
    share = sunlit(places, towards, radius)
    np.testing.assert_allclose(share[:3], [1, 0, 1], atol=1e-9)
    assert 0.3 < share[3] < 0.7  # on the edge of the cylinder, half the disc is behind the limb

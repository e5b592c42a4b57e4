"""J2: the gradient of its potential, fifty digits for the difference."""

from decimal import Decimal, localcontext

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.models.columns import ColumnFunction
from baryscope.models.differences import Pair
from baryscope.models.forces import zonal_gravity, zonal_strength
from baryscope.models.orbit import EARTH_J2, EARTH_MU, EARTH_RADIUS

PLACES = Rotation.random(20, rng=np.random.default_rng(1)).as_matrix()[:, 0] * np.linspace(6.6e6, 4.2e7, 20)[:, None]


def zonal(offsets):
    """The accelerations (n, 3) at PLACES, and their changes (n, 3) over offsets."""
    place, offset = ca.SX.sym("place", 3), ca.SX.sym("offset", 3)
    pair = zonal_gravity(Pair(place, offset), zonal_strength(EARTH_MU, EARTH_J2, EARTH_RADIUS))
    found = ColumnFunction("zonal", [place, offset], ca.vertcat(pair.base, pair.excess))(PLACES.T, offsets.T)
    return found[:, :3], found[:, 3:]


def test_the_acceleration_is_the_gradient_of_the_potential():
    """U = −μ J₂ R²/r³ (3 z²/r² − 1)/2 (Montenbruck, Gill, (3.16)), differentiated by central differences."""

    def potential(r):
        square = r @ r
        scale = EARTH_MU * EARTH_J2 * EARTH_RADIUS**2
        return -scale / square**1.5 * (3 * r[2] ** 2 / square - 1) / 2

    for place, found in zip(PLACES, zonal(np.zeros_like(PLACES))[0], strict=True):
        steps = 1e3 * np.eye(3)
        slope = np.array([(potential(place + h) - potential(place - h)) / 2e3 for h in steps])
        assert found == pytest.approx(slope, rel=1e-6, abs=1e-6 * np.linalg.norm(slope))


def test_the_difference_keeps_its_digits():
    """Two accelerations that agree in six digits, subtracted with fifty."""

    def exact(place):
        x, y, z = place
        square = x * x + y * y + z * z
        factor = -Decimal("1.5") * Decimal(EARTH_J2) * Decimal(EARTH_MU) * Decimal(EARTH_RADIUS) ** 2
        factor /= square * square * square.sqrt()
        ratio = 5 * z * z / square
        return np.array([factor * x * (1 - ratio), factor * y * (1 - ratio), factor * z * (3 - ratio)])

    offsets = np.random.default_rng(2).normal(size=PLACES.shape) * np.geomspace(0.1, 1e4, len(PLACES))[:, None]
    with localcontext() as context:
        context.prec = 50
        places, moved = ([[Decimal(float(c)) for c in p] for p in rows] for rows in (PLACES, offsets))
        expected = [
            exact(np.add(place, offset)) - exact(np.array(place)) for place, offset in zip(places, moved, strict=True)
        ]
    for found, right in zip(zonal(offsets)[1], np.array(expected, dtype=float), strict=True):
        assert np.linalg.norm(found - right) < 1e-14 * np.linalg.norm(right)

"""An error of the orbit among a path's unknowns, against the path on the right orbit."""

from dataclasses import replace

import numpy as np
import pytest

from baryscope.estimator.orbits.error import with_orbit_error
from baryscope.estimator.paths.extended_path import factors_of
from baryscope.estimator.paths.relative_motion import PerturbedOrbit
from baryscope.models.ephemeris.trajectory import lvlh_axes, target_states
from baryscope.models.orbit import EARTH_J2, EARTH_RADIUS
from synthetic import Orbit

TIME = np.linspace(0.0, 3000.0, 61)
FILE = replace(Orbit(eccentricity=0.02, semi_major_axis=7.4e6).model(), j2=EARTH_J2, equatorial_radius=EARTH_RADIUS)


@pytest.mark.parametrize(
    "error",
    [
        {"true_anomaly": np.deg2rad(0.1)},
        {"inclination": np.deg2rad(0.1)},
        {"semi_major_axis": 500.0},
        {"eccentricity": 1e-4, "raan": np.deg2rad(0.05)},
    ],
)
def test_the_factors_are_the_displacement_of_the_target(error):
    """To the second order of the displacement, some 10⁻³ of it."""
    true = replace(FILE, **{name: getattr(FILE, name) + value for name, value in error.items()})
    x = np.array([3.0, -20.0, 8.0, 2.0, -6.0, 5.0])
    flown = PerturbedOrbit(true, 1500.0)
    path = with_orbit_error(
        PerturbedOrbit(FILE, 1500.0), FILE, lambda time: flown.at(time).position(x), TIME[0], TIME[-1]
    )
    com, sampled, found = flown.at(TIME).position(x), path.at(TIME), np.zeros(12)
    jacobian = sampled.jacobian.reshape(-1, 12)
    for _ in range(3):
        found = found + np.linalg.lstsq(jacobian, (com - sampled.position(found)).ravel(), rcond=None)[0]
    right, wrong = (target_states(orbit, np.array([1500.0]))[0] for orbit in (true, FILE))
    R_L_I = lvlh_axes(wrong[None])[0].T
    shift = R_L_I @ (right - wrong)[:3]
    # ρ̇ is the rate in axes that turn with the orbit.
    spin = np.cross(wrong[:3], wrong[3:]) / (wrong[:3] @ wrong[:3])
    rate = R_L_I @ ((right - wrong)[3:] - np.cross(spin, (right - wrong)[:3])) / FILE.mean_motion
    factors = [factor.value for factor in factors_of(path, found, np.eye(12))]
    np.testing.assert_allclose(factors, [*shift, *rate], atol=5e-3 * np.abs(shift).max())
    without = np.linalg.lstsq(jacobian[:, :6], (com - sampled.position(np.zeros(12))).ravel(), rcond=None)[0]
    left = com - sampled.position(np.concatenate([without, np.zeros(6)]))
    assert np.abs(com - sampled.position(found)).max() < 0.01 * np.abs(left).max()

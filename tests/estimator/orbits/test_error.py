"""An error of the orbit among a path's unknowns, against the path on the right orbit."""

from dataclasses import replace

import numpy as np
import pytest

from baryscope.estimator.orbits.error import SHARES, shares_on, with_orbit_error
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


@pytest.mark.parametrize("anomaly", [1.0, 2.5, 5.4])
def test_a_target_that_is_early_or_whose_ellipse_is_turned_is_as_likely_as_on_a_circle(anomaly):
    """Differences of elements, in deviations of an error that is as great along the track: a target of e = 0.5 that is
    early was off radially or in its rates by 50 to 82 times what was thought likely, and a push stood for it.
    """
    early = replace(FILE, eccentricity=0.5, semi_major_axis=2e7, true_anomaly=anomaly, j2=None, equatorial_radius=None)
    step = 1e-6
    for element in ("true_anomaly", "argument_of_periapsis"):
        changed = replace(early, **{element: getattr(early, element) + step})
        file, true = (target_states(orbit, np.array([0.0]))[0] for orbit in (early, changed))
        R_L_I = lvlh_axes(file[None])[0].T
        spin = np.cross(file[:3], file[3:]) / (file[:3] @ file[:3])
        shift = R_L_I @ (true - file)[:3]
        rate = R_L_I @ ((true - file)[3:] - np.cross(spin, (true - file)[:3])) / early.mean_motion
        off = np.abs([*shift, *rate]) / shift[1]
        assert (off <= 1.001 * shares_on(early, 0.0)).all()
        if element == "true_anomaly":
            assert 49 < (off / SHARES).max() < 83
    circle = replace(early, eccentricity=0.0)
    np.testing.assert_allclose(shares_on(circle, 0.0), SHARES, rtol=1e-9)

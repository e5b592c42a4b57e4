"""The orbit in SI units: closed forms, and what it refuses."""

from dataclasses import FrozenInstanceError, fields, replace

import casadi as ca
import numpy as np
import pytest

from baryscope.models.ephemeris.trajectory import gravity_gradient, target_states
from baryscope.models.errors import InputError
from baryscope.models.keplerian import ELEMENT_COUNT, Elements
from baryscope.models.lvlh import lvlh_attitude
from baryscope.models.orbit import EARTH_J2, EARTH_RADIUS, Orbit, orbit_parameters
from baryscope.models.variables import Kind, variable_table

GOOD = Orbit(7.15e6, 0.01, 1.7, 0.3, 0.7, 0.2)


def test_parameters_stand_in_the_order_of_the_table():
    names = [v.name for v in variable_table(3) if v.kind == Kind.PARAMETER and v.name.startswith("orbit.")]
    assert list(orbit_parameters(GOOD)) == names
    assert orbit_parameters(GOOD)["orbit.trueAnomaly0"] == 0.2


def test_numbers_and_symbols_have_the_same_fields():
    names = [field.name for field in fields(Elements)]
    assert [field.name for field in fields(Orbit)] == [
        *names,
        "j2",
        "equatorial_radius",
        "epoch",
        "accuracy",
        "ephemeris",
    ]
    values = Elements.of(ca.DM(GOOD.elements))
    assert all(float(getattr(values, name)) == getattr(GOOD, name) for name in names)
    assert len(GOOD.elements) == ELEMENT_COUNT


def test_symbols_named_by_the_unit():
    parameters = {name: ca.DM(value) for name, value in orbit_parameters(GOOD).items()}
    assert ca.vertcat(*vars(Elements.named(parameters)).values()).full().ravel().tolist() == list(GOOD.elements)


def test_period_of_the_geostationary_orbit():
    """One sidereal day, 86164.1 s, at 42,164.17 km."""
    orbit = Orbit(42_164_170.0, 0.0, 0.0)
    assert orbit.period == pytest.approx(86164.1, abs=0.1)
    assert orbit.mean_motion == pytest.approx(7.2921159e-5, rel=1e-6)
    assert orbit.periapsis_rate == orbit.mean_motion


def test_an_orbit_of_another_body_may_be_small():
    """1.5 km from the centre of Bennu, μ = 4.89 m³/s²: 2π √(1500³ / 4.89) = 165,066 s."""
    orbit = Orbit(semi_major_axis=1500.0, eccentricity=0.0, inclination=0.0, gravitational_parameter=4.89)
    assert orbit.period == pytest.approx(165_066, rel=1e-3)


def test_the_true_anomaly_goes_fastest_at_periapsis():
    orbit = Orbit(semi_major_axis=26600e3, eccentricity=0.7, inclination=1.1)
    R_I_L = lvlh_attitude(orbit, np.array([-0.05, 0.05]))
    turned = np.arccos(R_I_L[0, :, 0] @ R_I_L[1, :, 0])
    assert orbit.periapsis_rate == pytest.approx(turned / 0.1, rel=1e-6)


def test_frozen_hashable_and_of_plain_floats():
    orbit = Orbit(np.float64(7150e3), 0, np.int64(1))
    assert orbit == Orbit(7150e3, 0.0, 1.0)
    assert all(type(value) is float for value in orbit.elements)
    assert len({orbit, Orbit(7150e3, 0.0, 1.0), GOOD}) == 2
    with pytest.raises(FrozenInstanceError):
        orbit.raan = 1.0


@pytest.mark.parametrize(
    "change, expected",
    [
        ({"semi_major_axis": -7e6}, "orbit.semi_major_axis: found value -7e+06, expected a length above 0 m"),
        ({"semi_major_axis": 7150.0}, "orbit.semi_major_axis: found 7150 m, which puts the periapsis 7078.5 m from"),
        ({"eccentricity": 1.0}, "orbit.eccentricity: found value 1, expected 0 ≤ e < 1"),
        ({"eccentricity": -1e-9}, "orbit.eccentricity: found value -1e-09, expected 0 ≤ e < 1"),
        ({"eccentricity": 0.2}, "orbit.semi_major_axis: found 7.15e+06 m, which puts the periapsis 5.72e+06 m from"),
        ({"gravitational_parameter": 0}, "orbit.gravitational_parameter: found value 0, expected a value above 0"),
        (
            {"gravitational_parameter": 398600.4},  # a period of six years, and answers to match, without a word
            "orbit.gravitational_parameter: found 398600 m³/s², the Earth's in km³/s²?, expected m³/s², as the Earth's "
            "3.986e+14",
        ),
        ({"inclination": float("nan")}, "orbit.inclination: found nan, expected a finite number"),
        ({"true_anomaly": 10**400}, "orbit.true_anomaly: found inf, expected a finite number"),
        ({"raan": "120"}, "orbit.raan: found '120', expected a number"),
        ({"raan": True}, "orbit.raan: found True, expected a number"),
    ],
)
def test_what_is_impossible_is_refused(change, expected):
    with pytest.raises(InputError) as caught:
        replace(GOOD, **change)
    assert str(caught.value).startswith(expected)


def test_j2_stands_with_its_radius():
    orbit = replace(GOOD, j2=EARTH_J2, equatorial_radius=EARTH_RADIUS)
    assert (orbit.j2, orbit.equatorial_radius) == (EARTH_J2, EARTH_RADIUS)
    assert orbit.elements == GOOD.elements
    assert orbit != GOOD


@pytest.mark.parametrize(
    "change, message",
    [
        ({"accuracy": -1.0}, "orbit.accuracy: found -1 m, expected 0 to"),
        ({"accuracy": 1e6}, "a tenth of semi_major_axis"),
        ({"accuracy": "1 km"}, "orbit.accuracy: found '1 km', expected a number"),
        ({"j2": EARTH_J2}, "orbit.equatorial_radius: missing, expected a value beside j2"),
        ({"equatorial_radius": EARTH_RADIUS}, "orbit.j2: missing, expected a value beside equatorial_radius"),
        ({"j2": 1082.6, "equatorial_radius": EARTH_RADIUS}, "orbit.j2: found 1082.6"),
        ({"j2": 0.5, "equatorial_radius": EARTH_RADIUS}, "orbit.j2: found 0.5, expected the Earth's, 0.00108263, or 0"),
        ({"j2": -EARTH_J2, "equatorial_radius": EARTH_RADIUS}, "orbit.j2: found -0.00108263, expected the Earth's"),
        ({"j2": EARTH_J2, "equatorial_radius": 6378.137}, "expected the Earth's, 6.37814e+06 m"),
        ({"j2": float("nan"), "equatorial_radius": EARTH_RADIUS}, "orbit.j2: found nan, expected a finite number"),
        ({"j2": True, "equatorial_radius": EARTH_RADIUS}, "orbit.j2: found True, expected a number"),
        (
            {"gravitational_parameter": 4.9e12, "j2": 2e-4, "equatorial_radius": 8e6},
            "orbit.equatorial_radius: found 8e+06 m, expected at most the distance of the periapsis",
        ),
    ],
)
def test_an_oblateness_or_accuracy_that_cannot_be(change, message):
    with pytest.raises(InputError) as error:
        replace(GOOD, **change)
    assert message in str(error.value)


def test_an_orbit_that_tells_that_there_is_no_j2_is_the_same_kepler_orbit():
    plain = GOOD
    told = plain.of_simulation()
    assert (told.j2, told.with_earths_j2()) == (0.0, None)
    assert told.of_simulation() == told
    oblate = plain.with_earths_j2()
    assert oblate.of_simulation() == replace(oblate, accuracy=0.0)
    time = np.array([0.0, 1e3, 1e5])
    np.testing.assert_array_equal(target_states(told, time), target_states(plain, time))
    np.testing.assert_array_equal(
        gravity_gradient(told, target_states(told, time)), gravity_gradient(plain, target_states(plain, time))
    )

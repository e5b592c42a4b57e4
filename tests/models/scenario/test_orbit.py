"""Orbit files: degrees there, radians in the program, and the same digits when written again."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from baryscope.models.ephemeris.trajectory import target_states
from baryscope.models.errors import InputError
from baryscope.models.orbit import Orbit
from baryscope.models.scenario import OrbitTable, load_orbit, write_orbit
from baryscope.models.scenario.orbit import degrees_of

FILE = """[orbit]
semi_major_axis = 7150000.0
eccentricity = 0.001
inclination_deg = 98.55
raan_deg = 120.1
argument_of_periapsis_deg = -0.7
true_anomaly_deg = 1234.5678901
gravitational_parameter = 398600441800000.0
"""


def test_a_file_that_is_read_and_written_is_the_same(tmp_path):
    first, second = tmp_path / "first.toml", tmp_path / "second.toml"
    first.write_text(FILE, encoding="utf-8")
    orbit = load_orbit(first)
    assert orbit == Orbit(7150e3, 0.001, *(np.pi / 180 * np.array([98.55, 120.1, -0.7, 1234.5678901])))
    write_orbit(orbit, second)
    assert second.read_text(encoding="utf-8") == FILE


def test_j2_and_accuracy_are_read_and_written_where_they_are_given(tmp_path):
    first, second = tmp_path / "first.toml", tmp_path / "second.toml"
    text = FILE + "j2 = 0.00108262668\nequatorial_radius = 6378137.0\naccuracy = 250.0\n"
    first.write_text(text, encoding="utf-8")
    orbit = load_orbit(first)
    assert (orbit.j2, orbit.equatorial_radius, orbit.accuracy) == (0.00108262668, 6378137.0, 250.0)
    write_orbit(orbit, second)
    assert second.read_text(encoding="utf-8") == text
    first.write_text(FILE + "j2 = 0.00108262668\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"orbit\.equatorial_radius: missing, expected a value beside j2"):
        load_orbit(first)


@pytest.mark.parametrize("written", ["2026-03-01T12:00:00Z", '"2026-03-01T12:00:00Z"', "2026-03-01T14:00:00+02:00"])
def test_elements_are_carried_from_their_epoch_to_time_0(tmp_path, written):
    path = tmp_path / "orbit.toml"
    for more in ("", "j2 = 0.00108262668\nequatorial_radius = 6378137.0\n"):
        path.write_text(FILE + more + f"epoch = {written}\n", encoding="utf-8")
        orbit = load_orbit(path)
        assert orbit.epoch == "2026-03-01T12:00:00Z"
        assert load_orbit(path, "2026-03-01T12:00:00Z") == orbit
        later = load_orbit(path, "2026-03-01T13:00:00Z")
        assert later.epoch == "2026-03-01T13:00:00Z"
        time = np.array([-3600.0, 500.0])
        np.testing.assert_allclose(target_states(later, time), target_states(orbit, time + 3600), atol=2e-3)
    write_orbit(later, path)
    assert load_orbit(path) == later


def test_elements_of_long_ago_are_refused(tmp_path):
    path = tmp_path / "orbit.toml"
    path.write_text(FILE + "epoch = 2026-03-01T12:00:00Z\n", encoding="utf-8")
    assert load_orbit(path, "2026-03-31T12:00:00Z").epoch == "2026-03-31T12:00:00Z"
    expected = r"orbit\.toml: elements of 2026-03-01T12:00:00Z, 365 days from time 0 of the tracks, expected elements"
    for other in ("2027-03-01T12:00:00Z", "2025-03-01T12:00:00Z"):
        with pytest.raises(InputError, match=expected):
            load_orbit(path, other)


def test_elements_without_an_epoch_are_those_of_time_0(tmp_path):
    path = tmp_path / "orbit.toml"
    path.write_text(FILE, encoding="utf-8")
    assert load_orbit(path, "2026-03-01") == replace(load_orbit(path), epoch="2026-03-01T00:00:00Z")
    path.write_text(FILE + 'epoch = "noon"\n', encoding="utf-8")
    with pytest.raises(InputError, match="epoch: found 'noon', expected a UTC time"):
        load_orbit(path)


@given(digits=st.integers(-(10**14), 10**14), shift=st.integers(0, 14))
def test_degrees_of_up_to_fourteen_digits_come_back(digits, shift):
    degrees = float(f"{digits}e-{shift}")
    assert degrees_of(float(np.deg2rad(degrees))) == degrees


@given(degrees=st.floats(-1e6, 1e6))
def test_any_degrees_come_back_as_the_same_angle(degrees):
    angle = float(np.deg2rad(degrees))
    assert np.deg2rad(degrees_of(angle)) == angle


@given(angle=st.floats(-1e4, 1e4))
def test_any_angle_comes_back_to_its_last_bit(angle):
    assert abs(np.deg2rad(degrees_of(angle)) - angle) <= np.spacing(abs(angle))


def test_a_table_and_its_orbit():
    table = OrbitTable(semi_major_axis=9e6, eccentricity=0.1, inclination_deg=63.4, raan_deg=359.9)
    assert OrbitTable.of(table.to_si()) == table


def test_a_folder_that_cannot_be_written_to(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="cannot be written"):
        write_orbit(Orbit(7e6, 0.0, 0.0), tmp_path / "file" / "orbit.toml")

"""Scenarios as they are read and what is derived from them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from baryscope.models.orbit import Orbit
from baryscope.models.scenario import Run, Scenario, load_scenario
from baryscope.models.variables import Kind, variable_table


def test_a_file_of_ones_own(write_scenario):
    path = write_scenario()
    scenario = load_scenario(str(path))
    assert scenario.name == "mine"
    assert scenario.description == "a small body"
    assert scenario.features.labels == ("a", "b", "c", "d")
    assert scenario.orbit.gravitational_parameter == 3.986004418e14
    assert scenario.chaser.velocity == (0.0, 0.0, 0.0)
    assert scenario.tracking.visibility == "all"
    np.testing.assert_array_equal(scenario.sample_times, np.arange(101.0))


def test_a_path_without_a_folder(write_scenario, monkeypatch):
    monkeypatch.chdir(write_scenario().parent)
    assert load_scenario("mine.toml").name == "mine"


def test_normals_are_made_unit(write_scenario):
    scenario = load_scenario(str(write_scenario(("normal = [0, 1, 0]", "normal = [0, 3, -4]"))))
    assert scenario.features.points[1].normal == pytest.approx((0, 0.6, -0.8))


def test_whole_numbers_will_do(write_scenario):
    assert load_scenario(str(write_scenario(("7.0e6", "7_000_000")))).orbit.semi_major_axis == 7e6


def test_one_orbit_unless_the_file_says_otherwise(write_scenario):
    """2π √(a³/μ) = 2π √(3.43e20 / 3.986004418e14) = 5828.52 s."""
    scenario = load_scenario(str(write_scenario(("duration = 100.0", ""))))
    assert scenario.duration == scenario.orbit.period == pytest.approx(5828.52, abs=0.01)
    assert scenario.sample_times[-1] == 5828.0


@given(count=st.integers(2, 5000), sample_time=st.sampled_from([0.01, 0.1, 0.3, 1.0, 7.3, 1 / 3]))
def test_sample_times(count, sample_time):
    """A duration of a whole number of samples has that number, whatever the division rounds to."""
    scenario = load_scenario("envisat")
    scenario = scenario.model_copy(update={"run": Run(duration=count * sample_time, sample_time=sample_time)})
    assert scenario.sample_times.size == count + 1
    assert scenario.sample_times[-1] == pytest.approx(count * sample_time, rel=1e-15)


@pytest.mark.parametrize("name", ["envisat", "upper-stage"])
def test_parameters_fill_the_table(name):
    scenario = load_scenario(name)
    table = [v for v in variable_table(len(scenario.features.points)) if v.kind == Kind.PARAMETER]
    parameters = scenario.parameters()
    assert list(parameters) == [variable.name for variable in table]
    for variable in table:
        assert parameters[variable.name].shape == variable.shape
    flat = dict(zip([n for v in table for n in v.scalar_names], scenario.flat_parameters(), strict=True))
    assert flat["target.features[3,2]"] == scenario.features.points[2].position[1]
    assert flat["target.inertia.xz"] == scenario.target.inertia[0][2]
    assert flat["target.angularRate0[3]"] == np.pi / 180 * scenario.target.angular_rate_deg[2]
    assert flat["orbit.inclination"] == scenario.orbit.inclination


def test_the_orbit_of_a_scenario_is_in_si_and_goes_back_to_the_files_degrees():
    scenario = load_scenario("envisat")
    assert scenario.orbit == Orbit(
        semi_major_axis=7150e3,
        eccentricity=0.001,
        inclination=np.pi / 180 * 98.55,
        raan=np.pi / 180 * 120.0,
        argument_of_periapsis=np.pi / 180 * 90.0,
    )
    written = scenario.model_dump()["orbit"]
    assert (written["inclination_deg"], written["raan_deg"], written["true_anomaly_deg"]) == (98.55, 120.0, 0.0)
    assert Scenario.parse(scenario.model_dump(mode="json"), "again").orbit == scenario.orbit


def test_scenarios_are_frozen_and_hashable():
    scenario = load_scenario("envisat")
    with pytest.raises(ValidationError):
        scenario.name = "other"
    assert hash(scenario) == hash(load_scenario("envisat"))


def test_the_json_schema_states_units():
    definitions = Scenario.model_json_schema()["$defs"]
    assert definitions["OrbitTable"]["properties"]["semi_major_axis"]["unit"] == "m"
    assert definitions["Target"]["properties"]["angular_rate_deg"]["unit"] == "deg/s"
    assert definitions["Run"]["properties"]["duration"]["unit"] == "s"
    assert definitions["Sensor"]["properties"]["noise"]["unit"] == "m"
    assert definitions["StereoRig"]["properties"]["focal_length"]["unit"] == "px"
    assert definitions["Outliers"]["properties"]["sliding_speed"]["unit"] == "m/s"

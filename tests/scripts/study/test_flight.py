"""Flights: the density of thrust noise, its seed, and that nothing else changes; cameras at the end of their range."""

import numpy as np
import pytest

from baryscope.models.scenario import Sensor, StereoRig
from baryscope.study import fly
from baryscope.study.flight import thrust

Q = 1e-8  # m²/s³


@pytest.fixture(scope="module")
def short(envisat):
    run = envisat.run.model_copy(update={"duration": 400.0, "sample_time": 2.0})
    return envisat.model_copy(update={"run": run, "tracking": type(envisat.tracking)()})


def noisy(scenario, q=Q, seed=1):
    run = scenario.run.model_copy(update={"seed": seed})
    chaser = scenario.chaser.model_copy(update={"acceleration_noise": q})
    return scenario.model_copy(update={"run": run, "chaser": chaser})


def test_the_density_of_the_noise(short):
    """Velocity gathers the variance q t: 200 intervals, 3 axes, 20 seeds, a chi-square of 12,000 degrees of freedom."""
    draws = np.array([thrust(noisy(short, seed=seed)) for seed in range(20)])
    assert draws.shape == (20, 200, 3)
    assert (draws * 2.0).var() / 2.0 == pytest.approx(Q, rel=5 * np.sqrt(2 / draws.size))
    constant = short.chaser.model_copy(update={"acceleration": (1e-5, 0.0, -2e-5)})
    pushed = thrust(noisy(short.model_copy(update={"chaser": constant}), seed=3))
    assert pushed - draws[3] == pytest.approx(np.broadcast_to([1e-5, 0, -2e-5], pushed.shape), abs=1e-15)


def test_noise_moves_the_chaser_and_leaves_the_sensors_draws(short, envisat_fmu):
    """Over 400 s a free chaser goes astray by √(q t³/3) on an axis, to the order of it."""
    calm, shaken = (fly(scenario, envisat_fmu) for scenario in (short, noisy(short)))
    off = shaken.true_path - calm.true_path
    expected = np.sqrt(Q * 400.0**3 / 3)
    assert 0.1 * expected < np.abs(off[-1]).max() < 5 * expected
    errors = [flight.tracks.position - flight.truth["features"] for flight in (calm, shaken)]
    np.testing.assert_allclose(errors[0], errors[1], atol=1e-12)
    again = fly(noisy(short), envisat_fmu)
    assert np.array_equal(again.true_path, shaken.true_path)
    assert not np.array_equal(fly(noisy(short, seed=2), envisat_fmu).true_path, shaken.true_path)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_pair_of_cameras_tells_no_depth_from_hardly_any_disparity(short, seed):
    """At 2 km a disparity of 1 px has noise of 0.7 px; covariances beyond 1e18 m² were refused as wrong input."""
    chaser = short.chaser.model_copy(update={"position": (0.0, -2000.0, 0.0)})
    sensor = Sensor(stereo=StereoRig(focal_length=1911.0, baseline=1.0, pixel_noise=0.5))
    run = short.run.model_copy(update={"duration": 1500.0, "sample_time": 1.0, "seed": seed})
    tracks = fly(short.model_copy(update={"chaser": chaser, "sensor": sensor, "run": run})).tracks
    depth = np.linalg.norm(tracks.position[tracks.seen], axis=1)
    assert 1e4 < depth.max() < 1.1e5
    assert tracks.seen.any(axis=0).sum() > 8

"""The orbit of a smooth path, from coefficients of a path whose truth is two Kepler orbits in extended precision."""

import numpy as np
import pytest
from numpy.polynomial import chebyshev

from baryscope.estimator.adjustment.evidence import Linear, maximise
from baryscope.estimator.dynamics.paths import Smooth
from baryscope.estimator.orbits.search import likeliest_orbit
from baryscope.models.orbit import Orbit
from oracles import inertial_states, propagate_kepler
from synthetic import MU
from synthetic import Orbit as Written

CHASER = (np.array([-4.0, -18.0, 3.0]), np.array([0.004, -0.007, 0.01]))
LOW, ELLIPSE = Written(), Written(semi_major_axis=24.4e6, eccentricity=0.7, anomaly=-0.5)


def seen(position, span, sigma, seed=0, frames=400, degree=40):
    """What noisy positions over 0 … span tell of the coefficients of a smooth path, at their least squares."""
    smooth, time = Smooth(degree, 0.0, span), np.linspace(0.0, span, frames)
    noisy = position(time) + sigma * np.random.default_rng(seed).standard_normal((frames, 3))
    terms = chebyshev.chebvander(2 * time / span - 1, degree)
    x = np.linalg.lstsq(terms, noisy, rcond=None)[0].ravel()
    linear = Linear(np.kron(terms.T @ terms, np.eye(3)) / sigma**2, np.zeros(len(x)), x)
    return linear, smooth, maximise(linear, smooth.prior)


def on(orbit: Orbit):
    """The path of the centre of mass from the chaser, the difference of two Kepler orbits."""
    target, chaser = inertial_states(orbit, *CHASER)
    return lambda time: np.array(
        [propagate_kepler(*target, MU, t)[0] - propagate_kepler(*chaser, MU, t)[0] for t in time], dtype=float
    )


@pytest.mark.parametrize(
    ("orbit", "share", "sigma"), [(LOW, 0.7, 1e-3), (LOW, 2.3, 0.05), (ELLIPSE, 0.3, 1e-3)], ids=["low", "long", "gto"]
)
def test_the_orbit_is_that_of_the_path(orbit, share, sigma):
    """Period and eccentricity within what tracks of a hundred thousandth of the distance tell: to a thousandth."""
    model = orbit.model()
    linear, smooth, theta = seen(on(model), share * model.period, sigma)
    found = likeliest_orbit(linear, smooth, theta)
    assert found is not None
    assert found.gain > 5
    assert found.elements.period == pytest.approx(model.period, rel=2e-3)
    assert found.elements.eccentricity == pytest.approx(model.eccentricity, abs=2e-3)
    time = np.linspace(0.0, smooth.end, 50)
    path, true = smooth.at(time).position(found.coefficients), on(model)(time)
    # Twelve numbers from 400 frames, at the ends some four times as uncertain as on average.
    assert np.abs(path - true).max() < 5 * 4 * sigma * np.sqrt(12 / 400 / 3)


def on_helix(time):
    """No orbit turns by ω on which nothing has ω² of acceleration from its own middle."""
    return np.column_stack([5 * np.cos(2e-3 * time), 5 * np.sin(2e-3 * time), 20 + 1e-3 * time])


def on_parabola(time):
    s = time[:, None] / 4000
    return np.array([4.0, -19, 3]) + s * [0.5, 0.2, -0.3] + s**2 * [-0.2, 0.1, 0.1]


@pytest.mark.parametrize("path", [on_helix, on_parabola])
def test_other_paths_are_on_no_orbit(path):
    found = likeliest_orbit(*seen(path, 4000.0, 1e-3))
    assert found is None or found.gain < 0


def test_a_short_path_tells_none():
    """Of an arc of a few degrees in noise of 2 cm, a period could be anything."""
    model = LOW.model()
    found = likeliest_orbit(*seen(on(model), 0.02 * model.period, 0.02))
    assert found is None or found.gain < 5

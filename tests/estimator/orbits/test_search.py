"""The orbit of a smooth path, from coefficients of a path whose truth is two Kepler orbits in extended precision."""

import numpy as np
import pytest
from numpy.polynomial import chebyshev
from scipy.linalg import solve_triangular

from baryscope.estimator.hyperparameters.evidence import GaussianLikelihood, maximise
from baryscope.estimator.orbits.search import likeliest_orbit
from baryscope.estimator.paths.path import SmoothPath
from baryscope.models.ephemeris.trajectory import target_states
from baryscope.models.orbit import Orbit
from oracles import inertial_states, propagate_kepler
from synthetic import MU
from synthetic import Orbit as Written

# In LVLH, m and m/s
CHASER = (np.array([-4.0, -18.0, 3.0]), np.array([0.004, -0.007, 0.01]))
KEPT = np.array([0.0, -20.0, 0.0]), np.zeros(3)
LOW, ELLIPSE = Written(), Written(semi_major_axis=24.4e6, eccentricity=0.7, anomaly=-0.5)


def seen(position, span, sigma, seed=0, frames=400, degree=40):
    """What noisy positions over 0 … span tell of the coefficients of a smooth path, at their least squares."""
    smooth, time = SmoothPath(degree, 0.0, span), np.linspace(0.0, span, frames)
    noisy = position(time) + sigma * np.random.default_rng(seed).standard_normal((frames, 3))
    terms = chebyshev.chebvander(2 * time / span - 1, degree)
    x = np.linalg.lstsq(terms, noisy, rcond=None)[0].ravel()
    linear = GaussianLikelihood(np.kron(terms.T @ terms, np.eye(3)) / sigma**2, np.zeros(len(x)), x)
    return linear, smooth, maximise(linear, smooth.prior)


def on(orbit: Orbit, place=CHASER):
    """The path of the centre of mass from the chaser, the difference of two Kepler orbits; place: see CHASER."""
    target, chaser = inertial_states(orbit, *place)
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


@pytest.mark.parametrize("seed", range(3))
def test_the_orbit_of_a_chaser_that_keeps_its_place_is_told(seed):
    """Behind the target, on V-bar: a turn of the orbit's plane makes a difference of second order to the path, at a
    given place, and of first order only by its eccentricity, a thousandth.
    """
    model = LOW.model()
    found = likeliest_orbit(*seen(on(model, KEPT), 0.87 * model.period, 1e-3, seed=seed))
    assert found is not None
    assert found.gain > 5
    assert found.elements.period == pytest.approx(model.period, rel=2e-3)
    pole = np.cross(*target_states(model, np.zeros(1))[0].reshape(2, 3))
    assert found.elements.axes[:, 2] @ pole == pytest.approx(np.linalg.norm(pole), rel=1e-3)  # to 2.5°


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


def of_motion(elements, smooth):
    """The coefficients (p, 6) of the path by the relative state at its middle: differences of two Kepler orbits."""
    middle, half = (smooth.begin + smooth.end) / 2, (smooth.end - smooth.begin) / 2
    points = chebyshev.chebpts1(smooth.degree + 1)
    fit = np.linalg.inv(chebyshev.chebvander(points, smooth.degree))
    state = target_states(elements.orbit(middle, MU), np.array([middle]))[0]
    target = [propagate_kepler(state[:3], state[3:], MU, half * t)[0] for t in points]
    columns = []
    for moved in np.diag([10.0, 10.0, 10.0, 0.01, 0.01, 0.01]):  # m, m/s
        chaser = [propagate_kepler(state[:3] - moved[:3], state[3:] - moved[3:], MU, half * t)[0] for t in points]
        columns.append((fit @ (np.array(target) - np.array(chaser)).astype(float)).ravel())
    return np.stack(columns, axis=1)


def log_density(x, covariance):
    """That of a normal distribution of mean zero, up to its constant."""
    root = np.linalg.cholesky(covariance)
    return -np.log(np.diag(root)).sum() - np.sum(solve_triangular(root, x, lower=True) ** 2) / 2


def test_the_gain_is_the_ratio_of_two_marginal_likelihoods():
    """Both as densities of the coefficients that the tracks show, of which one law or the other gives the covariance.

    Their mean has a variance that hardly matters, the first ones that of the law, elements a deviation of 1: so have
    the motions on an orbit. Laplace's approximation is exact for the derivatives by elements at the maximum.
    """
    model, flat, step = LOW.model(), 1e5, 1e-5
    linear, smooth, theta = seen(on(model), 0.5 * model.period, 0.05, frames=200, degree=12)
    found = likeliest_orbit(linear, smooth, theta)
    noise, law = np.linalg.inv(linear.information), 1 / smooth.prior.precision(theta)[3:]
    columns = of_motion(found.elements, smooth)
    x = np.linalg.lstsq(columns, found.coefficients)[0]
    np.testing.assert_allclose(columns @ x, found.coefficients, atol=2e-4)  # m: p²/r is left out by it
    begin = np.diag([flat] * 3 + [law[0]] * 3)  # of mean and first coefficients
    motion = columns @ np.linalg.inv(columns[:6])
    moves = (of_motion(found.elements.moved(move), smooth) for move in np.vstack([step * np.eye(6), -step * np.eye(6)]))
    ahead = np.array([moved @ x for moved in moves])
    by_elements = (ahead[:6] - ahead[6:]).T / (2 * step)
    of_orbit = noise + motion @ begin @ motion.T + by_elements @ by_elements.T
    of_law = noise + np.diag(np.concatenate([[flat] * 3, law]))
    expected = 2 * (log_density(linear.x, of_orbit) - log_density(linear.x, of_law)) + smooth.prior.penalty(theta)[0]
    assert found.gain == pytest.approx(expected, abs=0.05)  # what is left out is a thirtieth of a deviation


def test_the_gain_does_not_depend_on_where_the_tracks_are_linearised():
    """The same likelihood about other coefficients: −2 ln p is a constant less for orbit and law alike."""
    linear, smooth, theta = seen(on(LOW.model()), 0.5 * LOW.model().period, 0.05, frames=200, degree=12)
    away = 0.01 * np.random.default_rng(1).standard_normal(len(linear.x))
    other = GaussianLikelihood(linear.information, linear.information @ away, linear.x - away)
    gains = [likeliest_orbit(one, smooth, theta).gain for one in (linear, other)]
    assert gains[0] == pytest.approx(gains[1], abs=1e-3)  # the search ends where squares change by 10⁻⁸ of them


def test_low_degrees_lead_to_the_orbit_where_high_ones_are_noise():
    """Two fifths of a revolution about the apoapsis, in 3 cm of noise: accelerations by all degrees lead nowhere."""
    model = Written(semi_major_axis=18.65e6, eccentricity=0.535, anomaly=2.52).model()
    found = likeliest_orbit(*seen(on(model), 0.43 * model.period, 0.03, frames=150, degree=30))
    assert found is not None
    assert found.elements.period == pytest.approx(model.period, rel=0.05)


def test_an_orbit_is_not_told_where_its_likelihood_is_no_gaussian():
    """A twentieth of a revolution in 10 cm of noise: a period of another length, at a gain far beyond chance."""
    model = ELLIPSE.model()
    assert likeliest_orbit(*seen(on(model), 0.05 * model.period, 0.1, frames=200)) is None

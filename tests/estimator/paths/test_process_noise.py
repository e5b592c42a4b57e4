"""Process noise: modes of a free beam, and the motion that white acceleration makes of them."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from baryscope.estimator.paths.path import Polynomial
from baryscope.estimator.paths.process_noise import (
    ProcessNoisePath,
    disturbed,
    enriched,
    free_modes,
    told_slip,
    wave_numbers,
)
from baryscope.estimator.paths.relative_motion import RelativeOrbit
from baryscope.models.lvlh import lvlh_attitude, lvlh_rate
from baryscope.models.orbit import EARTH_MU, Orbit


def test_wave_numbers_are_those_of_blevins():
    """Table 8-1 of R. Blevins, Formulas for Natural Frequency and Mode Shape, 1979."""
    np.testing.assert_allclose(wave_numbers(5), [4.73004074, 7.85320462, 10.9956079, 14.1371655, 17.2787597], rtol=1e-8)


def test_modes_are_orthonormal_to_each_other_and_to_straight_lines():
    nodes, weights = np.polynomial.legendre.leggauss(400)
    u = (nodes + 1) / 2
    modes, slopes = free_modes(u, 60)
    basis = np.column_stack([np.ones(400), np.sqrt(3) * nodes, modes])
    np.testing.assert_allclose(basis.T @ (basis * weights[:, None] / 2), np.eye(62), atol=1e-10)
    higher, lower = free_modes(u + 1e-7, 60)[0], free_modes(u - 1e-7, 60)[0]
    np.testing.assert_allclose((higher - lower) / 2e-7, slopes, atol=1e-5 * np.abs(slopes).max())


def test_the_variance_is_that_of_integrated_white_noise():
    """Of what is left of q ∫∫ dW after straight lines are removed: the mean over time is q T³/420."""
    path = ProcessNoisePath(Polynomial(1, 0.0, 20.0), 0.0, 20.0, 60)
    variance = np.exp(path.prior.offset[6::3]) * 3e-4
    assert variance.sum() + path.omitted_variance(3e-4) == pytest.approx(3e-4 * 20.0**3 / 420, rel=1e-3)


def test_modes_are_doubled_until_those_left_out_are_told_less_than_a_hundredth():
    path, theta = ProcessNoisePath(Polynomial(1, 0.0, 20.0), 0.0, 20.0), np.array([np.log(3e-4)])
    variance = 3e-4 * 20.0**3 / wave_numbers(200) ** 4
    for told, count in ((11, None), (14, 24), (47, 48), (100, 96)):
        information = np.full(path.size, 0.01 / variance[told - 1])  # just enough for as many
        assert path.told_modes(3e-4, information, 1000) == pytest.approx(told, abs=1)
        richer = enriched(path, theta, information)
        assert (None if richer is None else richer.count) == count
        assert enriched(path.base, theta, information) is None
    assert enriched(path, theta, np.full(path.size, -1e-12)) is None
    assert enriched(path, theta, np.full(path.size, np.inf)).count == 96


@pytest.mark.parametrize("eccentricity", [0.0, 0.3])
def test_the_motion_on_an_orbit_obeys_the_linearised_equation(eccentricity):
    orbit = Orbit(1.1e7, eccentricity, 1.0, 0.3, 0.4, -1.0)
    path = ProcessNoisePath(RelativeOrbit(orbit, 0.0), 0.0, 6000.0, 3)
    time = np.linspace(0.0, 6000.0, 40)
    found, rate = path.at(time).jacobian[:, :, 6:], path.rate_at(time).jacobian[:, :, 6:]

    def fall(t, y):
        """The linearised relative motion in inertial axes beside the orbit, integrated from its own elements."""
        r, z = y[:3], y[6:].reshape(2, 3, 9)
        n = np.linalg.norm(r)
        gradient = EARTH_MU / n**3 * (3 * np.outer(r, r) / n**2 - np.eye(3))
        bent = (free_modes(np.array([t + 3.0]) / 6000, 3)[1] - free_modes(np.array([t - 3.0]) / 6000, 3)[1]) / (
            6.0 * 6000
        )
        push = np.einsum("k,ij->ikj", bent[0], np.eye(3)).reshape(3, 9)
        return np.concatenate([y[3:6], -EARTH_MU * r / n**3, z[1].ravel(), (gradient @ z[0] + push).ravel()])

    strongest = np.linalg.eigvalsh(RelativeOrbit(orbit, 0.0).gravity_gradient(np.zeros(1))[0])[-1]
    radius = (2 * EARTH_MU / strongest) ** (1 / 3)
    assert radius == pytest.approx(1.1e7 * (1 - eccentricity**2) / (1 + eccentricity * np.cos(-1.0)))
    R, turn = lvlh_attitude(orbit, np.zeros(1))[0], lvlh_rate(orbit, np.zeros(1))[0]
    semi_latus = 1.1e7 * (1 - eccentricity**2)
    radial = np.sqrt(EARTH_MU / semi_latus) * eccentricity * np.sin(-1.0)
    start = np.concatenate(
        [radius * R[:, 0], radial * R[:, 0] + radius * turn * R[:, 1], found[0].ravel(), rate[0].ravel()]
    )
    end = solve_ivp(fall, (0, 6000), start, method="DOP853", rtol=1e-10, atol=1e-9, t_eval=time).y
    np.testing.assert_allclose(end[6:33].T.reshape(-1, 3, 9), found, atol=2e-4 * np.abs(found).max())
    np.testing.assert_allclose(end[33:].T.reshape(-1, 3, 9), rate, atol=2e-4 * np.abs(rate).max())


def test_outside_the_span_a_mode_goes_straight_on():
    modes, slopes = free_modes(np.array([-0.5, 0.0, 1.0, 1.25]), 4)
    np.testing.assert_allclose(modes[0], modes[1] - 0.5 * slopes[1])
    np.testing.assert_allclose(modes[3], modes[2] + 0.25 * slopes[2])


def test_noise_is_none_given_or_unknown():
    fixed, line = Polynomial(0, 0.0, 1.0), Polynomial(1, 0.0, 1.0)
    assert disturbed(line, "none", 0.0, 1.0) is line
    assert disturbed(fixed, "auto", 0.0, 1.0) is fixed
    assert disturbed(fixed, 1e-6, 0.0, 1.0) is fixed  # of its position
    assert (told_slip(fixed, 1e-6), told_slip(fixed, "auto"), told_slip(line, 1e-6)) == (1e-6, 0.0, 0.0)
    assert [one.name for one in disturbed(line, "auto", 0.0, 1.0).prior.hyperparameters] == ["process noise"]
    given = disturbed(line, 1e-6, 0.0, 1.0).prior
    assert given.hyperparameters == ()
    assert given.precision(np.zeros(0))[6] == pytest.approx(wave_numbers(1)[0] ** 4 / 1e-6)


@pytest.mark.parametrize("count", [12, 48])
def test_a_force_that_lasts_shows_amid_the_modes(count):
    """The parabola of a constant acceleration, by least squares beside a straight line: its curvature amid the tracks.

    Modes have none at the ends, so that twelve of them are off by a few per cent of its square.
    """
    begin, span, density = 50.0, 400.0, 1e-12
    acceleration = np.array([3e-7, -1e-7, 2e-7])
    time = begin + np.linspace(0, span, 2001)
    terms = np.column_stack([np.ones_like(time), time - begin, free_modes((time - begin) / span, count)[0]])
    x = np.linalg.lstsq(terms, np.outer((time - begin) ** 2 / 2, acceleration), rcond=None)[0][2:].ravel()
    path = ProcessNoisePath(Polynomial(0, begin, begin + span), begin, begin + span, count)
    expected = acceleration @ acceleration / 3
    assert path.lasting_variance(np.append(np.zeros(3), x), 0.0) == pytest.approx(expected, rel=0.1)
    white = density / (span / 2)
    assert path.lasting_variance(np.append(np.zeros(3), x), density) == pytest.approx(expected - white, rel=0.1)
    assert path.lasting_variance(np.append(np.zeros(3), x), 1e-9) == 0.0

"""The online estimator where the path bends, and nobody tells how: it estimates the acceleration, too."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp
from scipy.stats import chi2

import oracles
from baryscope.estimator.online import OnlineEstimator, OnlineStatus
from baryscope.models.orbit import Orbit
from tops import POINTS, SIGMA, attitudes, errors, run, straight, tracks

ALPHA = 1e-4  # of the chi-square bands
DRAWS = 8
TIME = np.arange(0.0, 400.0, 2.0)  # s, of more than three turns
AHEAD = 460.0
ORBIT = Orbit(7.2e6, 0.01, 1.7, 2.0, 1.5, 0.4)


def orbital(times):
    """The path (n, 3) from the chaser by two Kepler orbits: it bends by 1.8 m."""
    target, chaser = oracles.inertial_states(ORBIT, [2.0, -20.0, 1.0], [0.005, 0.002, -0.003])
    mu = ORBIT.gravitational_parameter
    both = [[oracles.propagate_kepler(*start, mu, t)[0] for start in (target, chaser)] for t in times]
    return np.array([here - there for here, there in both], dtype=float)


def steady(times):
    """3e-4 m/s² in a constant direction."""
    return straight(times) + 0.5 * times[:, None] ** 2 * np.array([2e-4, -2e-4, 1e-4])


def pushed(times):
    """1e-5 m/s² besides the orbit: 0.8 m in the end."""
    return orbital(times) + 0.5 * times[:, None] ** 2 * np.array([6e-6, -7e-6, 4e-6])


def flights(path, orbit, seed):
    """Of each draw: the filter after all frames, and its last state."""
    for draw in range(DRAWS):
        filter = OnlineEstimator(SIGMA, orbit)
        yield filter, run(filter, TIME, tracks(np.random.default_rng([seed, draw]), TIME, path))[-1]


def assert_followed_and_predicted(path_of, orbit, seed):
    """As well as it is claimed, to 2 cm in the end, and a minute ahead."""
    path = path_of(np.append(TIME, AHEAD))
    nees, ahead, distances = [], [], []
    for filter, state in flights(path[:-1], orbit, seed):
        assert state.status is OnlineStatus.TRACKING
        distance, of_last = errors([state], path[-2:-1])
        distances.append(distance[0])
        nees.append(of_last[0])
        ahead.append(errors([filter.predict(AHEAD)], path[-1:])[1][0])
    assert np.sqrt(np.mean(np.square(distances))) < 0.02
    assert sum(nees) < chi2.ppf(1 - ALPHA, 3 * DRAWS)
    assert sum(ahead) < chi2.ppf(1 - ALPHA, 3 * DRAWS)


@pytest.mark.parametrize("path_of", [orbital, steady])
def test_without_an_orbit_the_path_is_followed_and_predicted(path_of):
    assert_followed_and_predicted(path_of, None, 51)


def test_an_acceleration_besides_the_orbit_is_followed_and_predicted():
    assert_followed_and_predicted(pushed, ORBIT, 52)


def test_drag_turns_with_the_orbit():
    """2e-6 m/s² against the target's velocity, for half an orbit that turns it by 3 rad.

    Where an acceleration stayed in inertial axes, but for a random walk, errors of these draws were 4.1 mm.
    """
    time, draws = np.arange(0.0, 3000.0, 5.0), 12

    def slope(_, s):
        pulled = [-ORBIT.gravitational_parameter * r / np.linalg.norm(r) ** 3 for r in (s[:3], s[6:9])]
        return np.concatenate([s[3:6], pulled[0] - 2e-6 * s[3:6] / np.linalg.norm(s[3:6]), s[9:], pulled[1]])

    start = np.array(oracles.inertial_states(ORBIT, [2.0, -20.0, 1.0], [0.005, 0.002, -0.003]), dtype=float).ravel()
    flown = solve_ivp(slope, (0.0, time[-1]), start, "DOP853", time, rtol=1e-13, atol=1e-6).y.T
    path = flown[:, :3] - flown[:, 6:9]
    found = [
        run(OnlineEstimator(SIGMA, ORBIT), time, tracks(np.random.default_rng([54, draw]), time, path))[-1]
        for draw in range(draws)
    ]
    distances, nees = errors(found, path[-1:])
    assert all(state.status is OnlineStatus.TRACKING for state in found)
    assert np.sqrt(np.mean(distances**2)) < 0.0033
    assert nees.sum() < chi2.ppf(1 - ALPHA, 3 * draws)


def test_an_acceleration_that_was_found_goes_on_changing():
    """As gravity on a low orbit that nobody tells turns by 1e-3 rad/s, while the target turns once in nine minutes.

    Filters for accelerations that hardly change began with the large one that others had found. They were more likely
    than those for which it changes, as long as the offset can take that: of these draws 2 % of the frames were wrong.
    """
    time, rate = np.arange(0.0, 900.0, 3.0), 1.1e-3
    wrong, known = 0, 0
    for draw in range(16):
        rng = np.random.default_rng([53, draw])
        axes = np.linalg.qr(rng.standard_normal((3, 2)))[0].T
        circle = 3e-5 / rate**2 * np.stack([1 - np.cos(rate * time), rate * time - np.sin(rate * time)], axis=1)
        path = straight(time) + circle @ axes
        states = run(OnlineEstimator(1e-4), time, tracks(rng, time / 4.5, path, 4 * POINTS[:4], sigma=1e-4))
        tracking = [k for k, state in enumerate(states) if state.status is OnlineStatus.TRACKING]
        known += len(tracking)
        wrong += np.sum(errors([states[k] for k in tracking], path[tracking])[1] > chi2.ppf(0.999, 3))
    assert known > 0.8 * 16 * len(time)
    assert wrong < 0.01 * known


def test_a_path_that_bends_leaves_the_map_of_a_target_that_shows_another_side_as_it_is():
    """By 2e-5 m/s², as 40 m from a target in a low orbit that nobody tells, of features that are seen from one side.

    The large filter took the path for straight until a bend had shown, and the bend for an offset of those features
    that came into view: of these draws 47 % of the frames that track were wrong, now 0.7 %.
    """
    time = np.arange(0.0, 1000.0, 5.0)
    points = np.concatenate([POINTS, -0.7 * POINTS])
    wrong, known, nees = 0, 0, []
    for draw in range(10):
        rng = np.random.default_rng([54, draw])
        axis = rng.standard_normal(3)
        path = straight(time) * [1.0, 2.0, 1.0] + 1e-5 * time[:, None] ** 2 * axis / np.linalg.norm(axis)
        seen = tracks(rng, time / 4.5, path, points, sigma=0.04)
        arms = points @ np.swapaxes(attitudes(time / 4.5), 1, 2)
        seen[np.einsum("nmi,ni->nm", arms, path) > 0.0] = np.nan
        states = run(OnlineEstimator(0.04), time, seen)
        tracking = [k for k, state in enumerate(states) if state.status is OnlineStatus.TRACKING]
        every = errors(states, path)[1]
        known += len(tracking)
        wrong += np.sum(every[tracking] > chi2.ppf(0.999, 3))
        nees.append(every[-1])
        assert states[-1].status is OnlineStatus.TRACKING
    assert known > 0.6 * 10 * len(time)
    assert wrong < 0.015 * known
    assert sum(nees) < chi2.ppf(1 - ALPHA, 3 * 10)


def test_a_path_that_sways_is_followed_as_claimed():
    """By 5 cm in 40 s, for which the largest process noise is the likeliest, and enough: nothing is to be doubted.

    It was, as soon as that was the likeliest; and in one draw as long as the density before that was no less likely,
    under which innovations agree. The sum of NEES over the draws is below the 99.9 % quantile of χ².
    """
    time = np.arange(240.0)
    path = straight(time) + 0.05 * np.sin(2 * np.pi * time / 40.0)[:, None] * np.array([0.6, 0.6, 0.5])
    nees = []
    for draw in range(6):
        states = run(OnlineEstimator(SIGMA), time, tracks(np.random.default_rng([27, draw]), time, path))
        assert states[-1].status is OnlineStatus.TRACKING
        nees.append(errors(states, path)[1][-1])
    assert sum(nees) < chi2.ppf(0.999, 18)


def test_a_path_that_bends_otherwise_than_any_filter_takes_it_for_is_doubted():
    """It sways by 0.6 m in 40 s: the bank takes its acceleration for a random walk, of which successive steps agree."""
    time = np.arange(240.0)
    path = straight(time) + 0.6 * np.sin(2 * np.pi * time / 40.0)[:, None] * np.array([0.6, 0.6, 0.5])
    for draw in range(2):
        states = run(OnlineEstimator(SIGMA), time, tracks(np.random.default_rng([27, draw]), time, path))
        assert states[-1].status is OnlineStatus.DOUBTFUL
        assert states[-1].noise_ratio < 1.1  # the features are as precise as told


def test_a_path_that_needs_more_process_noise_than_there_is_is_doubted():
    """White acceleration of 1e-5 m²/s³, three times the largest density: after two turns that has shown."""
    time, density = np.arange(240.0), 1e-5
    root = np.sqrt(density) * np.linalg.cholesky([[1 / 3, 1 / 2], [1 / 2, 1]])  # of r and v after 1 s
    for draw in range(4):
        rng = np.random.default_rng([28, draw])
        moved = root @ rng.standard_normal((len(time) - 1, 2, 3))
        speed = np.cumsum(moved[:, 1], axis=0) - moved[:, 1]
        path = straight(time) + np.concatenate([np.zeros((1, 3)), np.cumsum(speed + moved[:, 0], axis=0)])
        assert run(OnlineEstimator(SIGMA), time, tracks(rng, time, path))[-1].status is OnlineStatus.DOUBTFUL


@pytest.mark.parametrize("orbit", [None, ORBIT])
def test_frames_of_a_single_feature_leave_what_was_foreseen(orbit):
    """The frames that wait in a node were taken along a straight line, the longer the blackout the farther."""
    filter = OnlineEstimator(SIGMA, orbit)
    run(filter, TIME, tracks(np.random.default_rng(54), TIME / 4, orbital(TIME)))
    later = np.arange(TIME[-1] + 2.0, 1600.0, 2.0)
    single = np.full((len(later), len(POINTS), 3), np.nan)
    single[:, 0] = orbital(later)
    run(filter, later[:20], single[:20])  # those that wait are a node by themselves by then
    foreseen = filter.predict(later[-1])
    state = run(filter, later[20:], single[20:])[-1]
    size = np.sqrt(np.diag(foreseen.covariance))
    assert_allclose(state.position / size[:3], foreseen.position / size[:3], atol=0.05)
    assert_allclose(state.covariance / np.outer(size, size), foreseen.covariance / np.outer(size, size), atol=0.02)


def test_frames_that_wait_before_a_gap_are_taken_where_they_were():
    """60 s of a target that turns by 18° in them, and one frame four and a half minutes later.

    They were taken together when that came, along a straight line over a sixth of a radian of the orbit, where the
    offset was open by metres: the eight squares were 41 to 2200.
    """
    time, slower = np.append(np.arange(60.0), 330.0), 10.0
    path, ahead = orbital(time), orbital(np.array([329.0, 331.0]))
    truth = np.append(path[-1], (ahead[1] - ahead[0]) / 2)
    nees = []
    for draw in range(DRAWS):
        seen = tracks(np.random.default_rng([55, draw]), time / slower, path, POINTS / 2, sigma=7e-4)
        state = run(OnlineEstimator(7e-4, ORBIT), time, seen)[-1]
        assert state.status is OnlineStatus.TRACKING
        off = np.append(state.position, state.velocity) - truth
        size = np.sqrt(np.diag(state.covariance))
        nees.append(off / size @ np.linalg.solve(state.covariance / np.outer(size, size), off / size))
    assert max(nees) < chi2.isf(ALPHA / DRAWS, 6)


def test_frames_after_a_gap_are_not_lost():
    """The target turns by 2.8 times within it: the mean rate, of what shows of that, is none to foresee attitudes by.

    Four frames after it were left out as surprising ones, as long as the tumble was not known.
    """
    time = np.append(np.arange(40.0), np.arange(369.0, 390.0))
    for draw in range(DRAWS):
        seen = tracks(np.random.default_rng([56, draw]), time, straight(time))
        states = run(OnlineEstimator(SIGMA), time, seen)
        assert all(state.status is OnlineStatus.TRACKING for state in states[40:])

"""The online estimator against closed-form motion and a batch least squares that knows the attitudes.

The truth is a symmetric top (precession about z, a tilt, spin about its axis) whose centre of mass moves in a straight
line, or on a relative orbit by two Kepler orbits; nothing of it is shared with the filter.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

import oracles
from baryscope.estimator.online import OnlineEstimator, OnlineStatus
from baryscope.models.orbit import Orbit
from baryscope.models.scenario import StereoRig
from baryscope.models.sensor.directions import axes_along
from baryscope.models.stereo import project, triangulate
from tops import DRIFT, FRAMES, POINTS, SIGMA, START, attitudes, batch_bound, errors, run, straight, tracks

DRAWS = 16
ALPHA = 1e-4  # of the chi-square bands, two-sided


def test_a_straight_path_is_found_as_exactly_as_by_a_batch_and_no_more_is_claimed():
    time = np.arange(FRAMES, dtype=float)
    path, places = straight(time), [30, 60, 120, 179]
    distance, nees = [], []
    for draw in range(DRAWS):
        rng = np.random.default_rng([1, draw])
        states = run(OnlineEstimator(SIGMA), time, tracks(rng, time, path))
        found = errors(states, path)
        distance.append(found[0][places])
        nees.append(found[1][places])
        assert states[-1].status is OnlineStatus.TRACKING
    rms = np.sqrt(np.mean(np.square(distance), axis=0))
    for k, place in enumerate(places[2:], 2):
        # What it costs not to know that there is no process noise: 1.4; besides, the scatter of an rms of so many.
        scatter = np.sqrt(chi2.ppf(1 - ALPHA, 3 * DRAWS) / (3 * DRAWS))
        assert rms[k] < 1.4 * scatter * batch_bound(time[: place + 1])
    # Not below the band: before the density is known, the claim is the mean over densities, and too wide where it is 0.
    assert (np.sum(nees, axis=0) < chi2.ppf(1 - ALPHA, 3 * DRAWS)).all()


def test_white_acceleration_is_found_and_bridged():
    density, steps = 1e-6, 20
    time = np.arange(FRAMES, dtype=float)
    last, found = [], []
    for draw in range(DRAWS):
        rng = np.random.default_rng([2, draw])
        fine = np.arange(FRAMES * steps) / steps
        push = rng.standard_normal((len(fine), 3)) * np.sqrt(density * steps)
        speed = DRIFT + np.cumsum(push, axis=0) / steps
        path = (START + np.cumsum(speed, axis=0) / steps)[::steps]
        states = run(OnlineEstimator(SIGMA), time, tracks(rng, time, path))
        last.append(errors(states[-1:], path[-1:])[1][0])
        found.append(states[-1].density)
    assert chi2.ppf(ALPHA / 2, 3 * DRAWS) < sum(last) < chi2.ppf(1 - ALPHA / 2, 3 * DRAWS)
    # The bank's steps are of a factor of 32, and 180 frames tell the density to about one of them.
    assert density / 32 < np.exp(np.mean(np.log(found))) < 32 * density


def test_on_an_orbit_the_path_is_followed_and_predicted():
    orbit = Orbit(7.2e6, 0.1, 1.7, 2.0, 1.5, 0.4)
    time = np.arange(0.0, 400.0, 2.0)
    times = np.append(time, 1000.0)
    target, chaser = oracles.inertial_states(orbit, [2.0, -20.0, 1.0], [0.005, 0.002, -0.003])
    mu = orbit.gravitational_parameter
    both = [[oracles.propagate_kepler(*start, mu, t)[0] for start in (target, chaser)] for t in times]
    path = np.array([here - there for here, there in both], dtype=float)
    nees, ahead = [], []
    for draw in range(8):
        rng = np.random.default_rng([3, draw])
        filter = OnlineEstimator(SIGMA, orbit)
        states = run(filter, time, tracks(rng, time, path[:-1]))
        distance, of_last = errors(states[-1:], path[-2:-1])
        assert distance[0] < 0.02
        nees.append(of_last[0])
        ahead.append(errors([filter.predict(1000.0)], path[-1:])[1][0])
    assert sum(nees) < chi2.ppf(1 - ALPHA, 24)
    assert sum(ahead) < chi2.ppf(1 - ALPHA, 24)


def test_known_acceleration_of_the_chaser_leaves_no_trace():
    time = np.arange(FRAMES, dtype=float)
    push = np.array([1e-3, -2e-3, 5e-4])
    path = straight(time) - 0.5 * time[:, None] ** 2 * push
    rng = np.random.default_rng(4)
    states = run(OnlineEstimator(SIGMA), time, tracks(rng, time, path), acceleration=push)
    distance, nees = errors(states[-1:], path[-1:])
    assert nees[0] < chi2.ppf(1 - ALPHA, 3)
    assert distance[0] < 3 * batch_bound(time)
    assert states[-1].density < 1e-9  # the acceleration, unknown, would be a hundred times that


def test_fast_frames_claim_no_more_than_they_show():
    """At 20 Hz the target turns by less than the noise of an attitude between two frames."""
    time = np.arange(0.0, 60.0, 0.05)
    path = straight(time)
    worst = []
    for draw in range(8):
        rng = np.random.default_rng([5, draw])
        filter = OnlineEstimator(SIGMA * 4)
        states = run(filter, time, tracks(rng, time, path, sigma=SIGMA * 4))
        worst.append(errors(states, path)[1][[300, 600, 900, 1199]])
        observed = len(time) * len(POINTS)
        assert states[-1].noise_ratio == pytest.approx(1, abs=4 * np.sqrt(2 / (3 * observed)) + 1 / len(time))
        shape = filter.features().position
        gaps = np.linalg.norm(shape[1:] - shape[0], axis=1) - np.linalg.norm(POINTS[1:] - POINTS[0], axis=1)
        assert np.abs(gaps).max() < 5 * 4 * SIGMA * np.sqrt(2 / len(time))  # of two means over all frames
    assert (np.sum(worst, axis=0) < chi2.ppf(1 - ALPHA, 24)).all()


def test_frames_that_wait_in_a_node_are_in_the_answer():
    """At 5 Hz the target turns a tenth of what a node takes between two frames."""
    time = np.arange(FRAMES) / 5
    path = straight(time)
    narrower, nees = [], []
    for draw in range(DRAWS):
        filter = OnlineEstimator(SIGMA)
        position = tracks(np.random.default_rng([12, draw]), time, path)
        states, claims = [], []
        for instant, points in zip(time, position, strict=True):
            foreseen = filter.predict(instant) if states else None
            states.append(filter.update(instant, points))
            if foreseen is not None:
                claims.append([np.trace(one.covariance[:3, :3]) for one in (foreseen, states[-1])])
        before, after = np.array(claims[FRAMES // 2 :]).T
        narrower.append(np.mean(after < before))
        nees.append(errors(states[-1:], path[-1:])[1][0])
    assert np.mean(narrower) > 0.7  # not in all: a frame may show that the mixture of densities is wider
    assert sum(nees) < chi2.ppf(1 - ALPHA, 3 * DRAWS)


def test_features_come_and_go_and_return_under_other_names():
    time = np.arange(FRAMES, dtype=float)
    path = straight(time)
    rng = np.random.default_rng(6)
    seen = tracks(rng, time, path)
    filter = OnlineEstimator(SIGMA)
    names = np.arange(len(POINTS))
    for k, (t, frame) in enumerate(zip(time, seen, strict=True)):
        there = (np.arange(len(POINTS)) + k // 20) % 4 > 0  # each is away for 20 frames of 80
        if k == 100:
            names = names + 100 * ~there  # who is away now comes back under another name
        state = filter.update(float(t), frame, there, names=names)
    features = filter.features()
    assert len(features.names) == len(POINTS)
    assert set(features.names) == set(names)
    own = POINTS @ attitudes(time[:1])[0].T
    order = [int(name) % 100 for name in features.names]
    off = features.position - own[order]
    # B is fixed by the first frame, so that all positions share its error: a rotation by about σ over their radius.
    assert np.linalg.norm(off, axis=1).max() < 4 * SIGMA
    assert errors([state], path[-1:])[1][0] < chi2.ppf(1 - ALPHA, 3)
    assert state.status is OnlineStatus.TRACKING


def test_outliers_and_a_blackout_do_no_harm():
    time = np.delete(np.arange(240.0), np.s_[100:160])
    path = straight(time)
    worst = []
    for draw in range(8):
        rng = np.random.default_rng([7, draw])
        seen = tracks(rng, time, path)
        wrong = rng.random(seen.shape[:2]) < 0.1
        seen[wrong] += rng.uniform(-2, 2, (wrong.sum(), 3))
        seen[rng.random(seen.shape[:2]) < 0.1] = np.nan
        states = run(OnlineEstimator(SIGMA), time, seen)
        assert states[-1].status is OnlineStatus.TRACKING
        worst.append(errors(states[-1:], path[-1:])[1][0])
    assert sum(worst) < chi2.ppf(1 - ALPHA, 24)


def test_it_says_when_it_does_not_know():
    filter = OnlineEstimator(SIGMA)
    assert filter.predict(0.0).status is OnlineStatus.WAITING
    time = np.arange(60.0)
    seen = tracks(np.random.default_rng(8), time, straight(time))
    still = straight(time)[:, None] + POINTS + SIGMA * np.random.default_rng(9).standard_normal(seen.shape)
    states = run(filter, time, still)
    assert states[-1].status is OnlineStatus.STARTING  # without rotation nothing shows the centre of mass
    other = OnlineEstimator(SIGMA)
    run(other, time, seen)
    shuffled = tracks(np.random.default_rng(10), time, straight(time), POINTS[::-1] * [1, -1, 1])
    assert other.update(60.0, shuffled[0]).status is OnlineStatus.LOST
    doubtful = OnlineEstimator(SIGMA / 2)
    time = np.arange(float(FRAMES))
    assert run(doubtful, time, tracks(np.random.default_rng(11), time, straight(time)))[-1].status is (
        OnlineStatus.DOUBTFUL
    )


def test_many_frames_cost_no_memory_and_keep_the_covariance_definite():
    time = np.arange(20_000) * 0.5
    rng = np.random.default_rng(13)
    seen = tracks(rng, time, straight(time))
    filter = OnlineEstimator(SIGMA)
    states = run(filter, time, seen)
    size = len(filter.save())
    assert size == len(OnlineEstimator(SIGMA).save())
    every = np.array([state.covariance for state in states[::500]])
    assert (np.linalg.eigvalsh(every)[:, 0] > 0).all()
    assert (every == np.swapaxes(every, 1, 2)).all()
    assert errors(states[-1:], straight(time[-1:]))[1][0] < chi2.ppf(1 - ALPHA, 3)


def test_a_target_far_away_has_the_same_centre_of_mass():
    """The truth is the same tracks, moved as a whole. The first step began at the origin of the axes, with residuals as
    long as the range: it turned features where these put them, and what was left of that moved the centre of mass far
    more than rounding.
    """
    far = np.array([1e5, 0.0, 0.0])  # m, of which the last digit is 1.5e-11 m
    time = np.arange(float(FRAMES))
    seen = tracks(np.random.default_rng(90), time, straight(time))
    here, there = (run(OnlineEstimator(SIGMA), time, seen + shift)[-1] for shift in (0.0, far))
    assert here.status == there.status == "tracking"
    # Steps of 1e-8 rad are left out, of features some metres from the centre of mass.
    np.testing.assert_allclose(there.position - far, here.position, rtol=0, atol=1e-7)


def test_the_tumble_of_a_symmetric_top_is_found_and_predicts_its_features():
    """Its moments follow from the motion: J₃ ψ̇ = (J₁ − J₃) φ̇ cos θ, φ̇ the precession, ψ̇ = 0.6 φ̇ the spin."""
    time = np.arange(FRAMES, dtype=float)
    later = np.array([FRAMES + 40.0])
    path, ahead = straight(time), straight(later)[0] + POINTS @ attitudes(later)[0].T
    ratio = 1 + 0.6 / np.cos(0.7)
    moments = np.array([1, ratio, ratio]) / (1 + 2 * ratio)
    first, nees = attitudes(time[:1])[0], []
    rates = attitudes(np.array([time[-1] - 1e-3, time[-1] + 1e-3]))
    rate = np.linalg.norm(Rotation.from_matrix(rates[1] @ rates[0].T).as_rotvec()) / 2e-3
    for draw in range(8):
        rng = np.random.default_rng([16, draw])
        filter = OnlineEstimator(SIGMA)
        assert filter.tumble(0.0) is None
        run(filter, time, tracks(rng, time, path))
        found = filter.tumble(float(time[-1]))
        assert found is not None
        off = Rotation.from_matrix(found.attitude @ first @ attitudes(time[-1:])[0].T).magnitude()
        assert off < 3 * SIGMA / 2  # of the first frame, too, which defines B
        assert np.linalg.norm(found.rate) == pytest.approx(rate, rel=0.02)
        assert np.trace(found.inertia) == pytest.approx(1, abs=1e-12)
        assert np.linalg.eigvalsh(found.inertia) == pytest.approx(moments, abs=0.02)
        for name, place in enumerate(ahead):
            position, covariance = filter.point(name, float(later[0]))
            nees.append((position - place) @ np.linalg.solve(covariance, position - place))
    # The features of a draw share most of their errors: a draw counts as three degrees of freedom.
    assert np.mean(nees) < chi2.ppf(1 - ALPHA, 24) / 8
    assert filter.point(99, float(later[0])) is None


def test_a_tumble_that_changes_is_given_up_and_the_path_goes_on():
    time = np.arange(300.0)
    turned = np.where(time < 200, time, 400 - time)  # the rotation is reversed
    path = straight(time)
    places = path[:, None] + POINTS @ np.swapaxes(attitudes(turned), 1, 2)
    filter = OnlineEstimator(SIGMA)
    seen = places + SIGMA * np.random.default_rng(17).standard_normal(places.shape)
    known = []
    for t, frame in zip(time, seen, strict=True):
        state = filter.update(float(t), frame)
        known.append(filter.tumble(float(t)) is not None)
    assert known[199]
    assert not all(known[200:260])
    assert state.status is OnlineStatus.TRACKING
    assert errors([state], path[-1:])[1][0] < chi2.ppf(1 - ALPHA, 3)


def test_a_blackout_is_bridged_by_the_tumble():
    """Over 400 s, in which the attitude at a constant rate would be any; all features have other names then."""
    time = np.concatenate([np.arange(180.0), np.arange(580.0, 600.0)])
    path = straight(time)
    filter = OnlineEstimator(SIGMA)
    for t, frame in zip(time, tracks(np.random.default_rng(18), time, path), strict=True):
        state = filter.update(float(t), frame, names=np.arange(len(POINTS)) + (100 if t > 200 else 0))
        assert state.status is not OnlineStatus.LOST
    assert set(filter.features().names) == {100 + k for k in range(len(POINTS))}
    assert state.status is OnlineStatus.TRACKING
    assert errors([state], path[-1:])[1][0] < chi2.ppf(1 - ALPHA, 3)


def test_points_of_a_stereo_rig_count_by_their_covariances():
    """Depth has 15 times the deviation of the other coordinates, along y of C."""
    deviations = np.array([0.01, 0.15, 0.01])
    time = np.arange(FRAMES, dtype=float)
    path = straight(time)
    covariance = np.tile(np.diag(deviations**2), (len(POINTS), 1, 1))
    nees, distance = [], []
    for draw in range(8):
        rng = np.random.default_rng([19, draw])
        seen = tracks(rng, time, path, sigma=0.0)
        seen += deviations * rng.standard_normal(seen.shape)
        states = run(OnlineEstimator(1.0), time, seen, covariance=covariance)
        off, own = errors(states[-1:], path[-1:])
        nees.append(own[0])
        distance.append(off[0])
        assert (np.linalg.eigvalsh([s.covariance for s in states])[:, 0] > 0).all()
    assert sum(nees) < chi2.ppf(1 - ALPHA, 24)
    # With the deviation of the depth in all coordinates the bound would be 7.5 times that of 0.02 m.
    assert np.sqrt(np.mean(np.square(distance))) < 7.5 * batch_bound(time)


def test_a_spin_about_one_axis_does_not_show_the_offset_along_it():
    """What the noise of the attitudes shows of it is no knowledge: the claim stays wide, or is not vouched for."""
    time = np.arange(400.0)
    path = straight(time)
    turned = Rotation.from_rotvec(0.05 * time[:, None] * np.array([0.6, 0.0, 0.8])).as_matrix()
    places = path[:, None] + (POINTS + np.array([1.0, 2.0, 3.0])) @ np.swapaxes(turned, 1, 2)
    for draw in range(4):
        filter = OnlineEstimator(0.1)
        seen = places + 0.1 * np.random.default_rng([20, draw]).standard_normal(places.shape)
        states = run(filter, time, seen)
        _, nees = errors(states, path)
        tracking = np.array([state.status is OnlineStatus.TRACKING for state in states])
        assert not (tracking & (nees > chi2.ppf(1 - ALPHA, 3))).any()
        assert not tracking[-1]


@pytest.mark.parametrize("at_measured", [True, False])
def test_a_rig_draws_the_path_nowhere_with_covariances_at_measured_or_at_true_points(at_measured):
    """A depth of 0.15 m (1σ) at 20 m; the mean of 24 errors, in claimed deviations, has a deviation of 0.2.

    Taken as they are, covariances at measured points leave −1.1.
    """
    rig, time = StereoRig(focal_length=1911.0, baseline=1.0, pixel_noise=0.5), np.arange(0.0, 600.0, 2.0)
    path, off = straight(time), []
    axes, places = axes_along(path), path[:, None] + 2 * POINTS @ np.swapaxes(attitudes(time), 1, 2)
    pixels = project(rig, axes, places)
    for draw in range(24):
        noise = rig.pixel_noise * np.random.default_rng([28, draw]).standard_normal(pixels.shape)
        measured, covariance = triangulate(rig, axes, pixels + noise)
        if not at_measured:
            _, covariance = triangulate(rig, axes, pixels)
            range_ = np.linalg.norm(places, axis=2)
            sight = places / range_[..., None]
            spread = np.einsum("nmi,nmij,nmj->nm", sight, covariance, sight)
            measured *= 1 - (spread / range_**2)[..., None]
        filter = OnlineEstimator(1.0)
        for k, now in enumerate(time):
            state = filter.update(float(now), measured[k], covariance=covariance[k])
        along = path[-1] / np.linalg.norm(path[-1])
        of_along = along @ state.covariance[:3, :3] @ along
        off.append((state.position - path[-1]) @ along / np.sqrt(of_along))
    assert abs(np.mean(off)) < 0.8

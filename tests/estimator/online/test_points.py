"""Where a feature will be, by the online estimator, long after the last frame."""

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

import oracles
from baryscope.estimator.online import OnlineEstimator
from baryscope.models.orbit import Orbit
from baryscope.study.population.second.cases import drawn, sampled
from tops import POINTS, attitudes, run, tracks

ORBIT = Orbit(7.2e6, 0.1, 1.7, 2.0, 1.5, 0.4)
DRAWS, ALPHA = 12, 1e-4
NOISE = 0.06  # m: after 300 s the attitude is uncertain by a quarter of a radian
AHEAD, FEATURE = 300.0, 2
FINE = 0.012  # m
LITTLE = 3  # sightings, of a feature of which hardly more is known than that it was seen


def path_of(time):
    """The path (n, 3) as the difference of two Kepler orbits."""
    bodies = oracles.inertial_states(ORBIT, [2.0, -20.0, 1.0], [0.005, 0.002, -0.003])
    places = [[oracles.propagate_kepler(*body, ORBIT.gravitational_parameter, t)[0] for body in bodies] for t in time]
    return np.array([here - there for here, there in places], dtype=float)


def test_a_feature_is_foreseen_on_an_arc():
    """To first order the error along the arm was none: of these draws one had a NEES of 37."""
    time = np.arange(130.0)
    path, then = path_of(time), time[-1:] + AHEAD
    place = path_of(then)[0] + attitudes(then)[0] @ POINTS[FEATURE]
    nees = []
    for draw in range(DRAWS):
        filter = OnlineEstimator(NOISE, ORBIT)
        run(filter, time, tracks(np.random.default_rng([91, draw]), time, path, sigma=NOISE))
        position, covariance = filter.point(FEATURE, then[0])
        nees.append((position - place) @ np.linalg.solve(covariance, position - place))
    assert max(nees) < chi2.isf(ALPHA / DRAWS, 3)


def test_of_a_spin_a_feature_is_claimed_as_well_as_it_is_known():
    """Along the axis neither the centre of mass nor the map is known, but their sum is: most of these covariances had
    negative variances, as if what corrects the one did not tell of the other."""
    case = drawn(902, 41)  # a pure spin of 0.52 °/s, twelve features with 32 labels, in bursts of frames
    bodies = [case.start.orbit.position(case.start.time), case.start.orbit.velocity(case.start.time)]
    bodies = [bodies, [place + way for place, way in zip(bodies, np.split(case.start.state, 2), strict=True)]]
    ends = case.time[-1] + np.array([0.0, 10.0, 60.0])
    flown = [
        [
            oracles.propagate_kepler(*body, case.orbit.gravitational_parameter, end - case.start.time)[0]
            for body in bodies
        ]
        for end in ends
    ]
    turned = Rotation.from_rotvec((ends - case.time[-1])[:, None] * case.rate[-1]).as_matrix()
    nees = []
    for draw in range(DRAWS):
        sample = sampled(case, draw)
        filter = OnlineEstimator(case.noise, case.orbit)
        for time, points in zip(case.time, sample.tracks.position, strict=True):
            state = filter.update(time, points[(seen := np.isfinite(points[:, 0]))], names=np.flatnonzero(seen))
        assert state.status == "tracking"
        features = filter.features()
        assert (np.linalg.eigvalsh(features.covariance) > 0).all()
        for name in features.names[sample.right[:, features.names].sum(axis=0) > LITTLE]:
            for end, (target, chaser), turn in zip(ends, flown, turned, strict=True):
                position, covariance = filter.point(int(name), end)
                assert np.linalg.eigvalsh(covariance)[0] > 0
                off = position - np.array(target - chaser, dtype=float) - case.attitude[-1] @ turn @ case.points[name]
                nees.append(off @ np.linalg.solve(covariance, off))
    # The features of a draw, and the times, share most of their errors.
    assert np.mean(nees) < chi2.isf(ALPHA, 3 * DRAWS) / DRAWS


def test_a_blackout_tells_nothing_of_the_map():
    """How uncertain the path becomes while nothing is seen is no error of a feature's place."""
    time = np.arange(0.0, 400.0, 2.0)
    filter = OnlineEstimator(FINE)
    run(filter, time, tracks(np.random.default_rng(95), time, path_of(time), sigma=FINE))
    for later in np.arange(400.0, 1400.0, 20.0):
        state = filter.update(later, np.zeros((0, 3)))
        if later == 480.0:  # the frames that waited have come into the map as a node by themselves
            before = filter.features().covariance
    assert np.sqrt(np.trace(state.covariance[:3, :3])) > 1.0
    np.testing.assert_allclose(filter.features().covariance, before, rtol=1e-6)

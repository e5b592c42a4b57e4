"""Paths, cases and error measures for the tests of `pivot` and `ml`; the true values come from synthetic.py."""

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from baryscope.estimator.methods import estimate
from baryscope.estimator.options import PathOptions
from baryscope.estimator.prose import verdict
from baryscope.estimator.tracks import FeatureTracks
from oracles import cross, inertial_states, propagate_kepler
from synthetic import ENVISAT, MU, Orbit, attitude, box_features, make_case

BOTH = pytest.mark.parametrize("method", ["pivot", "ml"])
RATE = np.deg2rad([2.4, 4.4, 4.8])
ORBIT = Orbit()
CHASER = (np.array([-4.0, -18.0, 3.0]), np.array([0.004, -0.007, 0.01]))
FEATURES = box_features(8, (10, 5, 5), seed=3, centre=(1, 0.5, 0))
NOISE = 0.02
# Four clusters, gaps, features that return; the first three share three features with another one, the last does not.
TEN = box_features(10, (10, 5, 5), seed=4, centre=(1, 0.5, 0))
CLUSTERS = [
    (0.0, 80.0, [0, 1, 2, 3, 4]),
    (90.0, 150.0, [2, 3, 4, 5, 6]),
    (155.0, 200.0, [0, 3, 5, 6, 7]),
    (205.0, 240.0, [2, 8, 9]),
]


@cache
def turning(count, step=1.0, relative_rate=1.0):
    """Times and attitudes of Envisat at a rate of relative_rate times 7 °/s."""
    time = step * np.arange(float(count))
    return time, attitude(ENVISAT, relative_rate * RATE, time)


def at_rest(time):
    return np.tile([4.0, -19.0, 3.0], (len(time), 1))


def on_parabola(time):
    s = time[:, None] / 200
    return np.array([4.0, -19, 3]) + s * [0.5, 0.2, -0.3] + s**2 * [-0.2, 0.1, 0.1]


def in_orbit(time):
    """The path as the difference of two Kepler orbits."""
    target, chaser = inertial_states(ORBIT.model(), *CHASER)
    difference = [propagate_kepler(*target, MU, t)[0] - propagate_kepler(*chaser, MU, t)[0] for t in time]
    return np.array(difference, dtype=float)


def pushed(time, acceleration, axes, variation=0.0, exponent=0.0):
    """Positions and velocities (n, 6) in C where the target of two orbits has a constant acceleration in axes.

    variation: by how much of its mean that varies with the target's place, most where it is at time 0; exponent: by
    how much its logarithm does so.
    """
    target, chaser = inertial_states(ORBIT.model(), *CHASER)
    most = target[0] / np.linalg.norm(target[0])

    def slope(_, s):
        r, v, to_chaser = s[:3], s[3:6], s[6:9]
        up, momentum = r / np.linalg.norm(r), cross(r, v)
        normal = momentum / np.linalg.norm(momentum)
        R_C_A = np.column_stack([up, cross(normal, up), normal]) if axes == "lvlh" else np.eye(3)
        falls = [-MU * one / np.linalg.norm(one) ** 3 for one in (r, to_chaser)]
        factor = (1 + variation * up @ most) * np.exp(exponent * up @ most)
        return np.concatenate([v, falls[0] + factor * R_C_A @ acceleration, s[9:], falls[1]])

    start = np.concatenate([*target, *chaser])
    end = solve_ivp(slope, (0, time[-1]), start, "DOP853", time, rtol=1e-13, atol=1e-7).y
    return (end[:6] - end[6:]).T


PATHS = {
    "fixed": (at_rest, "fixed", None),
    "polynomial:2": (on_parabola, "polynomial:2", None),
    "relative-orbit": (in_orbit, None, ORBIT.model()),
}


def found_by(method, tracks, path="fixed", **options):
    _, trajectory, orbit = PATHS[path]
    return estimate(tracks, method=method, orbit=orbit, options=PathOptions(trajectory=trajectory, **options))


def fixed_case(count=200, *, step=1.0, relative_rate=1.0, noise=NOISE, seed=0, features=FEATURES, clusters=None):
    time, R = turning(count, step, relative_rate)
    return make_case(time, R, at_rest(time), features, noise=noise, seed=seed, clusters=clusters)


def with_positions(case, position):
    return FeatureTracks(case.tracks.time, position, case.tracks.labels)


def rms(found, case):
    return float(np.sqrt(np.mean(np.sum((found.position - case.com) ** 2, axis=1))))


def squared_error(found, case):
    """The normalised squared error in the middle of the time, χ²₃."""
    k = len(case.com) // 2
    error = found.position[k] - case.com[k]
    return float(error @ np.linalg.solve(found.covariance[k], error))


def squared_error_of_cluster(found, case, index=0):
    """The normalised squared error, χ²₃, of the centre of mass in a cluster's axes, aligned with the truth by scipy."""
    cluster = found.clusters[index]
    members = [case.tracks.labels.index(label) for label in cluster.labels]
    centroid = case.features[members].mean(axis=0)
    shape = cluster.points
    turn = Rotation.align_vectors(shape, case.features[members] - centroid)[0].as_matrix()
    error = cluster.centre_of_mass + turn @ centroid
    return float(error @ np.linalg.solve(cluster.covariance, error))


def assert_good(found, case, deviations=4.5):
    """Observable, converged, without findings, and with an error within 4.5 of χ₃, which 1 in 6,000 exceeds."""
    assert verdict(found.observability).startswith("observable")
    assert found.converged
    assert found.findings == ()
    assert squared_error(found, case) < deviations**2


def assert_as_few_frames(found, case, share):
    """Good, and with a predicted error that grows by the root of the share of frames lost, and 30 % at most."""
    assert_good(found, case)
    assert found.predicted_rmse < 1.3 * 0.001 / np.sqrt(share)

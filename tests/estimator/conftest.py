"""Tumbling motions that several tests share: integrated once a session."""

import numpy as np
import pytest

from solving import pivot_once
from synthetic import ENVISAT, Orbit, attitude, box_features, make_case


@pytest.fixture(scope="module")
def solved():
    """The problems of `pivot` that a module's tests have in common, once they are solved."""
    return {}


@pytest.fixture
def shared_pivot(request, solved):
    """For modules in which methods estimate the same tracks: `pivot` solves them once, but not where a test changes
    what it rests on.
    """
    if "monkeypatch" in request.fixturenames:
        yield
        return
    with pivot_once(solved):
        yield


@pytest.fixture(scope="session")
def orbit():
    return Orbit()


@pytest.fixture(scope="session")
def time():
    return np.arange(0.0, 3000.0, 1.0)


@pytest.fixture(scope="session")
def tumbling(time):
    """R_I_B (n, 3, 3) of Envisat, turning at 3.5 °/s."""
    return attitude(ENVISAT, np.deg2rad([1.2, 2.2, 2.4]), time)


@pytest.fixture(scope="session")
def features():
    return box_features(8, (10, 5, 5), seed=3, centre=(1, 0.5, 0))


CLUSTERS = [
    (100.0, 700.0, [0, 1, 2, 3, 4]),
    (750.0, 1400.0, [2, 3, 4, 5]),
    (1600.0, 2200.0, [0, 3, 5, 6, 7]),
    (2210.0, 2950.0, [1, 2, 7]),
]


@pytest.fixture(scope="session")
def case_of(time, tumbling, features):
    """Tracks through four clusters, three blackouts and blind ends, of a target whose centre of mass is at com."""

    def make(com, *, noise=0.0, seed=0, clusters=CLUSTERS, members=slice(None)):
        return make_case(time, tumbling, com, features[members], noise=noise, seed=seed, clusters=clusters)

    return make


@pytest.fixture(scope="session")
def at_rest(time):
    """The centre of mass at rest in C."""
    return np.tile([4.0, -19.0, 3.0], (len(time), 1))


@pytest.fixture(scope="session")
def on_v_bar(time, orbit):
    """The centre of mass in C, seen from a chaser that holds 20 m on V-bar."""
    return -(orbit.R_I_L(time) @ np.array([0.0, -20.0, 0.0]))

"""What users give the online estimator: it is taken, or refused in a line."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator.online import OnlineEstimator, Thrust
from baryscope.models.errors import InputError
from tops import SIGMA, run, straight, tracks


def flat():
    """A covariance of rank 2 in axes that are not its own, so that its determinant is rounding, above 0."""
    R = Rotation.from_quat([0.3, -0.3, 0.1, 0.9]).as_matrix()
    covariance = R @ np.diag([1e-4, 1e-4, 0.0]) @ R.T
    return (covariance + covariance.T) / 2


@pytest.mark.parametrize(
    "change, message",
    [
        ({"time": np.nan}, "time: found nan"),
        ({"time": 4.0}, "after that of the last frame"),
        ({"time": 1e9}, "at most 86400 s, longest_gap, after that of the last one; .* a new filter"),
        ({"points": np.zeros((8, 2))}, r"points has the shape \(8, 2\)"),
        ({"points": np.full((8, 3), np.inf)}, r"found \[inf, inf, inf\], expected numbers within"),
        ({"time": np.datetime64("2026-01-01")}, "time: found np.datetime64"),
        ({"seen": [True]}, r"found \(1,\) and \(8,\), expected one of each point, \(8,\)"),
        ({"seen": ["yes"] * 8}, "seen: found <U3, expected truth values"),
        ({"seen": [[True], [True, False]]}, "seen: found no array"),
        ({"names": np.zeros(8, dtype=int)}, "found the same twice"),
        ({"names": np.zeros(8)}, "names: found float64, expected whole numbers"),
        ({"names": np.arange(8, dtype=np.uint64) + np.uint64(2**63)}, "found uint64, expected whole numbers within 64"),
        ({"covariance": np.zeros((8, 3, 3))}, "not symmetric positive definite"),
        ({"covariance": np.tile(np.eye(3) + np.tri(3, k=-1), (8, 1, 1))}, "not symmetric positive definite"),
        ({"covariance": np.tile(flat(), (8, 1, 1))}, "not symmetric positive definite"),
        ({"covariance": np.zeros((3, 3))}, "covariance has the shape"),
        ({"covariance": np.full((8, 3, 3), np.nan)}, "not symmetric positive definite"),
        ({"acceleration": [np.nan, 0, 0]}, "three numbers within"),
        ({"acceleration": [0.1, 0.0]}, r"acceleration: found shape \(2,\), expected \(3,\)"),
        ({"acceleration": [0, 1e150, 0]}, r"three numbers within 1e\+09 m/s²"),
        ({"covariance": np.tile(1e90 * np.eye(3), (8, 1, 1))}, r"definite, or beyond 1e\+09 m"),
        ({"points": np.random.default_rng(0).uniform(-1, 1, (40, 3))}, "expected at most 32"),
    ],
)
def test_what_is_wrong_is_refused_and_changes_nothing(change, message):
    time = np.arange(5.0)
    seen = tracks(np.random.default_rng(14), time, straight(time))
    filter = OnlineEstimator(SIGMA)
    run(filter, time, seen)
    before = filter.save()
    frame = {"time": 5.0, "points": seen[-1]} | change
    with pytest.raises(InputError, match=message) as raised:
        filter.update(**frame)
    assert "\n" not in str(raised.value)
    assert filter.save() == before


@pytest.mark.parametrize(
    "arguments",
    [
        {"sigma": 0.0},
        {"sigma": np.nan},
        {"speed_std": -1.0},
        {"offset_radii": 0},
        {"longest_gap": np.inf},
        {"orbit": {"a": 7e6}},
    ],
)
def test_settings_out_of_range_are_refused(arguments):
    with pytest.raises(InputError, match="expected"):
        OnlineEstimator(**({"sigma": 1.0} | arguments))


def test_the_time_of_a_prediction_is_checked():
    filter = OnlineEstimator(SIGMA)
    time = np.arange(3.0)
    run(filter, time, tracks(np.random.default_rng(15), time, straight(time)))
    with pytest.raises(InputError, match="not before the last frame"):
        filter.predict(1.0)
    for wrong in (np.nan, np.inf, 1e300):
        for asked in (filter.predict, filter.tumble, lambda time: filter.point(0, time)):
            with pytest.raises(InputError, match=r"not before the last frame, up to 1e\+10 s"):
                asked(wrong)


@pytest.mark.parametrize(
    "nothing",
    [
        {"points": []},
        {"points": np.empty((0, 3)), "names": []},
        {"points": [], "names": np.zeros(0), "seen": [], "covariance": []},
        {"points": np.full((8, 3), np.nan)},
    ],
)
def test_a_frame_that_shows_nothing_is_a_frame(nothing):
    """Lists that are empty were refused, as of another shape or kind."""
    time = np.arange(100.0)
    filter = OnlineEstimator(SIGMA)
    seen = run(filter, time, tracks(np.random.default_rng(16), time, straight(time)))[-1]
    assert seen.status == "tracking"
    state = filter.update(130.0, **nothing)
    assert state.status == "tracking"  # it is about the claim, which grows
    assert np.trace(state.covariance[:3, :3]) > np.trace(seen.covariance[:3, :3])


@pytest.mark.parametrize(
    "acceleration, attitude, message",
    [
        ([0.1, 0.0], None, r"acceleration: found shape \(2,\)"),
        ([0.1, 0.0, np.inf], None, "three numbers within"),
        ([0.1, 0.0, 0.0], 2 * np.eye(3), "attitude of the thrust: .* expected a rotation matrix"),
        ([0.1, 0.0, 0.0], -np.eye(3), "attitude of the thrust: .* expected a rotation matrix"),
        ([0.1, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], r"attitude of the thrust: found shape \(4,\)"),
    ],
)
def test_thrust_is_checked_when_it_is_made(acceleration, attitude, message):
    """The frame that came with it was refused; a reflection was taken for a rotation."""
    with pytest.raises(InputError, match=message) as raised:
        Thrust(acceleration, attitude)
    assert "\n" not in str(raised.value)


def test_thrust_that_was_made_stays_as_it_was():
    given = np.array([0.1, 0.0, 0.0])
    thrust = Thrust(given, Rotation.from_rotvec([0.1, 0.2, 0.3]).as_matrix())
    given[0] = np.nan
    assert np.array_equal(thrust.acceleration, [0.1, 0.0, 0.0])


@pytest.mark.parametrize("name", ["a", 1.0, 2**63])
def test_a_name_that_is_none_is_refused(name):
    with pytest.raises(InputError, match=r"name: found .*, expected a whole number within 64 bits"):
        OnlineEstimator(SIGMA).point(name, 0.0)

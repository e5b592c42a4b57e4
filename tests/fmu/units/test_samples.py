"""The samples and commands that CentreOfMassEstimator takes, leaves out or waits for, and what it logs of them."""

from functools import partial

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.fmu import UnitSession, build_fmu
from importer import Stepped

COUNT = 8


@pytest.fixture(scope="module")
def unit(envisat, tmp_path_factory):
    """The estimator of eight features of Envisat."""
    features = envisat.features.model_copy(update={"points": envisat.features.points[:COUNT]})
    tracking = envisat.tracking.model_copy(update={"intervals": (), "visibility": "all"})
    watched = envisat.model_copy(update={"features": features, "tracking": tracking})
    return build_fmu(watched, tmp_path_factory.mktemp("unit") / "estimator.fmu", unit="estimator")


@pytest.fixture
def started(unit, opened):
    return partial(opened, Stepped, unit, onOrbit=False)


def test_samples_that_are_no_news_change_nothing(started):
    """Nothing seen, an old number, an old time: the state goes on as predicted.

    Where nothing is seen it goes there in a step of its own, with what of the open node was known until then.
    """
    rng, body = np.random.default_rng(3), np.random.default_rng(2).uniform(-2, 2, (COUNT, 3))
    first, second = started(), started()
    for k in range(30):
        R = Rotation.from_rotvec(0.1 * k * np.array([0.6, 0.0, 0.8])).as_matrix()
        points = [0.0, 0.0, 20.0] + body @ R.T + 0.01 * rng.normal(size=(COUNT, 3))
        for one in (first, second):
            one["points"], one["seen"] = points, np.ones(COUNT)
            one["sample.time"], one["sample.number"] = float(k), k + 1
            one.step()
    second["points"] = np.zeros((COUNT, 3))  # no new number
    for one in (first, second):
        one.step()
    second["sample.number"], second["sample.time"] = 50, 3.0
    for one in (first, second):
        one.step()
    for name in ("target.position", "target.positionCovariance", "status", "samples", "sight.position"):
        np.testing.assert_array_equal(first[name], second[name])
    second["sample.time"], second["seen"], second["sample.number"] = 31.0, np.zeros(COUNT), 51
    for one in (first, second):
        one.step()
    for name in ("status", "samples", "sight.position"):
        np.testing.assert_array_equal(first[name], second[name])
    for name in ("target.position", "target.positionCovariance"):
        np.testing.assert_allclose(first[name], second[name], rtol=1e-3, atol=1e-3 * np.abs(first[name]).max())
    assert np.abs(first["target.position"] - second["target.position"]).max() < 1e-4
    np.testing.assert_allclose(first["sight.position"], points.mean(axis=0))


BAD = 3


def fly_by(started, spoil, rows=40):
    """Two estimators see the same tumbling body; `spoil` changes the second one's inputs of a row, by names."""
    rng, body = np.random.default_rng(3), np.random.default_rng(2).uniform(-2, 2, (COUNT, 3))
    units = [started() for _ in range(2)]
    for k in range(rows):
        R = Rotation.from_rotvec(0.1 * k * np.array([0.6, 0.0, 0.8])).as_matrix()
        points = [0.0, 0.0, 20.0] + body @ R.T + 0.01 * rng.normal(size=(COUNT, 3))
        covariances = np.tile([1e-4, 0, 0, 1e-4, 0, 1e-4], (COUNT, 1))
        sample = {"points": points, "covariances": covariances, "seen": np.ones(COUNT, dtype=bool)}
        sample |= {"sample.time": float(k), "sample.number": k + 1, "camera.attitude": [0.9, 0.3, -0.3, 0.1]}
        for unit, told in zip(units, (sample, sample | spoil(k, sample)), strict=True):
            for name, value in told.items():
                unit[name] = value
            unit.step()
    return units


@pytest.mark.parametrize(
    "wrong",
    [
        [1e-4, 0, 0, 1e-4, 0, 0],
        [0, 0, 0, 0, 0, 0],
        [1e-4, 2e-4, 0, 1e-4, 0, 1e-4],
        [-1e-4, 0, 0, 1e-4, 0, 1e-4],
        [1e90, 0, 0, 1e90, 0, 1e90],
    ],
    ids=["singular", "zero", "indefinite", "negative", "far too large"],
)
def test_a_point_without_a_proper_covariance_is_left_out_alone_and_said_once(started, wrong):
    """As if it were not seen; the other points of the sample count. An importer is told by a warning, once."""

    def unseen(k, sample):
        return {"seen": np.arange(COUNT) != BAD} if k >= 10 else {}

    def spoilt(k, sample):
        covariances = sample["covariances"].copy()
        if k >= 10:
            covariances[BAD] = wrong
        return {"covariances": covariances}

    (_, without), (_, unit) = fly_by(started, unseen), fly_by(started, spoilt)
    for name in ("target.position", "target.positionCovariance", "status", "samples"):
        np.testing.assert_array_equal(unit[name], without[name])
    assert unit["samples"] == 40
    assert unit.messages == [
        f"fmi2DoStep: the covariance of point {BAD + 1} at 10 s is not positive definite, or beyond 1e+18 m2: "
        "the point is left out"
    ]


@pytest.mark.parametrize(
    "spoil, words",
    [
        (lambda k: {"sample.time": 1e9} if k == 20 else {}, "sample.time is 1000000000 s, expected at most the end"),
        (lambda k: {"sample.time": 3.0} if k == 20 else {}, "sample.time is 3 s, expected more than that of the last"),
        (lambda k: {"sample.number": 20} if k == 20 else {}, "sample.number is that of the last sample, 20, expected"),
        (lambda k: {"points": np.full((COUNT, 3), 1.7e308)} if k == 20 else {}, "is not within 1e+09 m in frame C"),
        (lambda k: {"points": np.full((COUNT, 3), 1e150)} if k == 20 else {}, "is not within 1e+09 m in frame C"),
    ],
    ids=["future", "past", "number", "points", "far points"],
)
def test_a_sample_that_cannot_be_is_said_and_spoils_no_other(started, spoil, words):
    """Where it is not taken, the state goes on as if nothing had been seen."""
    (_, without), (_, unit) = (
        fly_by(started, lambda k, sample: {"seen": np.zeros(COUNT)} if k == 20 else {}),
        fly_by(started, lambda k, sample: spoil(k)),
    )
    for name in ("target.position", "target.positionCovariance", "status", "samples"):
        np.testing.assert_array_equal(unit[name], without[name])
    (message,) = unit.messages
    assert words in message


def test_a_command_that_no_chaser_has_is_taken_for_none(started):
    """With one of 1e150 m/s² nothing was finite, and the filter began again in every step."""
    (_, without), (_, unit) = (
        fly_by(started, lambda k, sample: {}),
        fly_by(started, lambda k, sample: {"chaser.acceleration": [0.0, 1e150 if k == 20 else 0.0, 0.0]}),
    )
    for name in ("target.position", "target.positionCovariance", "status", "samples"):
        np.testing.assert_array_equal(unit[name], without[name])
    assert unit.messages == ["fmi2DoStep: chaser.acceleration at 20 s is not within 1e+09 m/s2: taken for none"]


@pytest.mark.parametrize(
    "spoil, words",
    [
        (lambda k: {"sample.number": 9e18} if k == 20 else {}, ["sample.number is 22 after 9e+18, expected"]),
        (
            lambda k: {"sample.number": k - 19} if k >= 20 else {},
            ["sample.number is 1 after 20, expected"],
        ),
        (
            lambda k: {"sample.number": 2.0} if k in (20, 25) else {},
            ["sample.number is 2 after 20, expected"],
        ),
        (lambda k: {"sample.number": 1e6 - k}, ["sample.number is 999999 after 1000000, expected"]),
    ],
    ids=["one far too great", "a rig that begins again", "two too small", "counted down"],
)
def test_a_later_sample_is_taken_whatever_its_number(started, spoil, words):
    """After one number of 9e18, or of a rig that counted anew, nothing was taken until the number was passed."""
    (_, without), (_, unit) = fly_by(started, lambda k, sample: {}), fly_by(started, lambda k, sample: spoil(k))
    for name in ("target.position", "target.positionCovariance", "status", "samples"):
        np.testing.assert_array_equal(unit[name], without[name])
    assert unit["samples"] == 40
    assert len(unit.messages) == len(words)
    for message, told in zip(unit.messages, words, strict=True):
        assert told in message


def test_a_number_of_zero_is_no_sample(started):
    """As the outputs of a rig are before its first sample: nothing is taken and nothing said."""

    def unset(k, sample):
        return {name: np.zeros_like(value) for name, value in sample.items()} if 20 <= k < 25 else {}

    (_, without), (_, unit) = (
        fly_by(started, lambda k, sample: {"seen": np.zeros(COUNT)} if 20 <= k < 25 else {}),
        fly_by(started, unset),
    )
    for name in ("target.position", "target.positionCovariance", "status", "samples"):
        np.testing.assert_array_equal(unit[name], without[name])
    assert unit.messages == []


def test_python_warns_of_what_a_unit_has_left_out(unit):
    sample = {"points": np.ones((COUNT, 3)), "seen": np.ones(COUNT), "sample.number": 1.0, "sample.time": 1e9}
    with UnitSession(unit) as session:
        with pytest.warns(UserWarning, match=r"sample.time is 1000000000 s, expected at most the end of the step, 1 s"):
            session.step(1.0, sample)
        session.step(1.0)

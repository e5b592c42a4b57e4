"""Dead reckoning against Newton's and Euler's equations in inertial axes, and the modes that follow from navigation."""

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from baryscope.models.approach.reckoning import (
    MODES,
    SIZE,
    Belief,
    believed,
    carried_on,
    drift_is_clear,
    outage_and_mode,
)
from baryscope.models.keplerian import Elements

MU = 3.986004418e14
ORBIT = np.array([12e6, 0.3, 0.4, 0.5, 0.6, 6.0, MU])  # with the periapsis ahead
WAITING, NOMINAL, RECKONING, RETREAT = range(len(MODES))
STEP, PATIENCE = 1.0, 5.0
RATE, LIMIT = 0.2, 0.05  # 1/s, of the control; m/s², of the thrusters


def belief_with(**values):
    """Zeros but for some fields, as a column of numbers."""
    belief = Belief.of(ca.DM.zeros(SIZE))
    return np.array(ca.vertcat(*(values.get(name, getattr(belief, name)) for name in Belief.__annotations__))).ravel()


def field_of(column, name):
    return np.array(getattr(Belief.of(ca.DM(column)), name)).ravel()


@pytest.fixture(scope="module")
def carry():
    """(belief, acting, time, length) → belief."""
    kept, acting, time, length = (ca.SX.sym(name, size) for name, size in (("b", SIZE), ("a", 3), ("t", 1), ("h", 1)))
    after = carried_on(Belief.of(kept), acting, (time, length), Elements.of(ca.SX(ORBIT)))
    function = ca.Function("carry", [kept, acting, time, length], [after.column])
    return lambda *given: np.array(function(*given)).ravel()


def gravity(r):
    return -MU * r / np.linalg.norm(r) ** 3


def target_start():
    """Position and velocity of the target in perifocal axes at the start."""
    a, e, anomaly = ORBIT[0], ORBIT[1], ORBIT[5]
    p = a * (1 - e**2)
    r = p / (1 + e * np.cos(anomaly)) * np.array([np.cos(anomaly), np.sin(anomaly), 0])
    return r, np.sqrt(MU / p) * np.array([-np.sin(anomaly), e + np.cos(anomaly), 0])


def lvlh(r, v):
    up, normal = r / np.linalg.norm(r), np.cross(r, v) / np.linalg.norm(np.cross(r, v))
    return np.column_stack([up, np.cross(normal, up), normal])


def test_the_chaser_moves_by_gravity_and_commands(carry):
    """Two bodies in inertial axes, one of them pushed by a command that is constant in LVLH, over 300 s."""
    rho, rate, push = np.array([3.0, -18.0, 5.0]), np.array([0.02, 0.1, -0.05]), np.array([1e-3, -2e-3, 5e-4])
    r, v = target_start()
    R = lvlh(r, v)
    spin = np.cross(r, v) / (r @ r)
    start = np.concatenate([r, v, r + R @ rho, v + R @ rate + np.cross(spin, R @ rho)])

    def slopes(_, x):
        return np.concatenate([x[3:6], gravity(x[:3]), x[9:], gravity(x[6:9]) + lvlh(x[:3], x[3:6]) @ push])

    end = solve_ivp(slopes, (0, 300), start, rtol=1e-12, atol=1e-6).y[:, -1]
    belief = belief_with(position=rho, velocity=rate, attitude=[1, 0, 0, 0])
    for k in range(300):
        belief = carry(belief, push, k * STEP, STEP)
    R, apart = lvlh(end[:3], end[3:6]), end[6:] - end[:6]
    spin = np.cross(end[:3], end[3:6]) / (end[:3] @ end[:3])
    np.testing.assert_allclose(field_of(belief, "position"), R.T @ apart[:3], atol=1e-3)
    np.testing.assert_allclose(field_of(belief, "velocity"), R.T @ (apart[3:] - np.cross(spin, apart[:3])), atol=1e-5)
    assert np.linalg.norm(field_of(belief, "position") - rho) > 50


def test_the_body_tumbles_freely(carry):
    """Euler's equations at 5 °/s for 100 s, of an inertia of which only the ratios are told."""
    J, rate = np.diag([1.0, 2.0, 2.5]), np.array([0.06, 0.05, 0.03])

    def slopes(_, x):
        R, w = x[:9].reshape(3, 3), x[9:]
        turning = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
        return np.concatenate([(R @ turning).ravel(), np.linalg.solve(J, -np.cross(w, J @ w))])

    end = solve_ivp(slopes, (0, 100), np.concatenate([np.eye(3).ravel(), rate]), rtol=1e-11, atol=1e-12).y[:, -1]
    belief = belief_with(position=[0, -20, 0], attitude=[1, 0, 0, 0], rate=rate, inertia=[*np.diag(0.3 * J), 0, 0, 0])
    for k in range(100):
        belief = carry(belief, np.zeros(3), k * STEP, STEP)
    R = Rotation.from_quat(field_of(belief, "attitude"), scalar_first=True).as_matrix()
    np.testing.assert_allclose(R, end[:9].reshape(3, 3), atol=1e-5)
    np.testing.assert_allclose(field_of(belief, "rate"), end[9:], atol=1e-6)


@pytest.fixture(scope="module")
def watch(carry):
    """Steps through what navigation tells, a chaser at rest 10 m from a sphere of 10 m: the modes."""
    names = {
        "navigation.valid": 1, "target.position": 3, "target.velocity": 3, "target.positionCovariance": 6,
        "target.velocityCovariance": 6, "target.attitude": 4, "target.angularRate": 3, "target.inertia": 6,
        "grapple.point": 3, "grapple.direction": 3, "sight.position": 3,
        "thrust.error": 4,
    }  # fmt: skip
    told = {name: ca.SX.sym(name, size) for name, size in names.items()}
    given = {
        name: ca.SX.sym(name)
        for name in ("navigation.patience", "navigation.deviation", "keepOut.radius", "synchronised")
    } | {"chaser.position0": ca.SX([0, -20, 0]), "control.rate": ca.SX(RATE), "thrust.limit": ca.SX(LIMIT)}
    kept, length = ca.SX.sym("kept", SIZE), ca.SX.sym("h")
    belief = believed(Belief.of(kept), told, given, ca.SX.eye(3), ca.SX.zeros(3))
    outage, mode = outage_and_mode(belief, told, given, length)
    parameters = [value for value in given.values() if value.is_symbolic()]
    function = ca.Function(
        "watch", [kept, length, *parameters, *told.values()], [belief.column, outage, mode], {"cse": True}
    )

    def modes(steps, patience=PATIENCE, deviation=0.5, synchronised=False, length=STEP):
        column, found = np.zeros(SIZE), []
        for step in steps:
            one = {"target.position": [0, 20, 0], "target.attitude": [1, 0, 0, 0]} | step
            values = [one.get(name, np.zeros(size)) for name, size in names.items()]
            *_, outage, mode = out = function(column, length, patience, deviation, 10.0, synchronised, *values)
            found.append(int(mode))
            belief = Belief.of(ca.DM(np.array(out[0]).ravel()))
            fields = {name: getattr(belief, name) for name in Belief.__annotations__}
            column = belief_with(**fields | {"known": float(mode != WAITING), "outage": float(outage)})
            column = carry(column, np.zeros(3), 0.0, length)
        return found

    return modes


GOOD, BAD = {"navigation.valid": 1}, {"navigation.valid": 0, "target.position": [0, 0, 0]}


def test_before_there_is_navigation_it_waits(watch):
    assert watch([BAD] * 3 + [GOOD]) == [WAITING] * 3 + [NOMINAL]


def test_an_outage_is_bridged_then_it_retreats_until_navigation_lasts(watch):
    """As long as the patience; a long outage is over when navigation has been there for a third of that."""
    assert watch([GOOD] + [BAD] * 5 + [GOOD]) == [NOMINAL] + [RECKONING] * 5 + [NOMINAL]
    assert watch([GOOD] + [BAD] * 6 + [GOOD]) == [NOMINAL] + [RECKONING] * 5 + [RETREAT, NOMINAL]
    found = watch([GOOD] + [BAD] * 100 + [GOOD] * 8)
    assert found == [NOMINAL] + [RECKONING] * 5 + [RETREAT] * (95 + 1) + [NOMINAL] * 7


def test_navigation_that_comes_and_goes_is_none(watch):
    """An estimator that is lost begins anew every ten samples, and believes in that for one."""
    found = watch([GOOD] + ([BAD] * 9 + [GOOD]) * 20, patience=20.0)
    assert found[:10] == [NOMINAL] + [RECKONING] * 9
    assert set(found[60:]) == {RETREAT}
    assert RETREAT not in watch([GOOD] + ([BAD] * 4 + [GOOD] * 2) * 20)


def test_without_patience_it_retreats_at_once(watch):
    assert watch([GOOD, BAD, GOOD], patience=0.0) == [NOMINAL, RETREAT, NOMINAL]
    assert watch([GOOD, BAD], length=PATIENCE + 1) == [NOMINAL, RETREAT]


def test_a_position_too_uncertain_for_the_sphere_cannot_be_used(watch):
    """Three deviations of 3.5 m are more than the 10 m to the sphere; without a sample they grow by the velocity's."""

    def valid(deviation):
        return GOOD | {"target.positionCovariance": [deviation**2, 0, 0, 0, 0, 0]}

    assert watch([valid(3.3)]) == [NOMINAL]
    assert watch([valid(3.5)]) == [WAITING]
    assert watch([GOOD] + [valid(3.5)] * 7)[-2:] == [RETREAT] * 2
    # To end a retreat it takes ten, so that it does not go to and fro.
    assert watch([GOOD] + [valid(3.5)] * 20 + [valid(1.1)] * 20)[-1] == RETREAT
    assert watch([GOOD] + [valid(3.5)] * 20 + [valid(0.9)] * 20)[-1] == NOMINAL


def test_a_velocity_that_is_uncertain_cannot_be_used_either(watch):
    """In 1/RATE = 5 s 0.3 m/s lead astray by 1.5 m, with 2 m more than a third of 10 m. Nothing asked for the velocity:
    a chaser flew on with 0.3 m/s of doubt, a metre before the target.
    """

    def valid(deviation, drift):
        given = {"target.positionCovariance": deviation**2, "target.velocityCovariance": drift**2}
        return GOOD | {name: [square, 0, 0, 0, 0, 0] for name, square in given.items()}

    assert watch([valid(2.0, 0.25)]) == [NOMINAL]
    assert watch([valid(2.0, 0.3)]) == [WAITING]
    assert watch([valid(0.1, 0.07)], deviation=0.5) == [NOMINAL]
    assert watch([valid(0.1, 0.07)] + [valid(0.1, 0.7)] * 10)[-1] == RETREAT


def test_what_it_takes_to_brake_counts(watch):
    """At 0.8 m/s towards the sphere 0.8²/(2 · 0.05) = 6.4 m, so that three deviations of 1.2 m are all that is left."""
    towards = {"target.velocity": [0, -0.8, 0]}

    def valid(deviation):
        return GOOD | {"target.positionCovariance": [deviation**2, 0, 0, 0, 0, 0]}

    assert watch([valid(1.1) | towards]) == [NOMINAL]
    assert watch([valid(1.3) | towards]) == [WAITING]
    assert watch([valid(1.3) | {"target.velocity": [0, 0.8, 0]}]) == [NOMINAL]


def test_a_tumble_that_is_lost_counts_where_it_is_needed(watch):
    """The centre of mass is told, inertia and features are not: the estimator learns them anew."""
    whole = GOOD | {"target.inertia": [1, 2, 2.5, 0, 0, 0], "grapple.point": [1, 0, 0]}
    assert watch([GOOD] * 10, synchronised=True) == [NOMINAL] * 10
    assert watch([whole] + [GOOD] * 6, synchronised=True) == [NOMINAL] + [RECKONING] * 5 + [RETREAT]
    assert watch([whole] + [GOOD] * 10, synchronised=False) == [NOMINAL] * 11


@pytest.mark.parametrize(
    ("velocity", "drift", "clear"),
    [
        ([0.0, 0.9, 0.0], 0.0, True),  # 10 m to go in 10 s, at 0.9 m/s
        ([0.0, 1.1, 0.0], 0.0, False),
        ([0.0, 0.9, 0.0], 0.04, False),  # or more: three deviations are 1.2 m
        ([0.0, -5.0, 0.0], 0.0, True),  # away
        ([2.5, 4.0, 0.0], 0.0, True),  # past it, 20 sin(32°) m away
        ([1.0, 4.0, 0.0], 0.0, False),  # through it, and out again on the other side
        ([0.0, 0.0, 0.0], 0.3, True),
        ([0.0, 0.0, 0.0], 0.4, False),
    ],
)
def test_a_drift_is_clear_of_the_sphere(velocity, drift, clear):
    """From 20 m, of which the sphere takes 10, for 10 s."""
    belief = Belief.of(ca.DM(belief_with(position=[0, -20, 0], velocity=velocity, drift=drift)))
    given = {"navigation.patience": ca.DM(10.0), "keepOut.radius": ca.DM(10.0)}
    assert bool(drift_is_clear(belief, given)) == clear

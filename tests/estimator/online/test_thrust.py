"""The online estimator while the chaser accelerates on an orbit, against its motion by scipy's DOP853."""

import ctypes

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

import oracles
from baryscope.estimator.online import OnlineEstimator, Thrust
from baryscope.models.errors import InputError
from baryscope.models.orbit import Orbit
from compiling import ONLY_WHAT_IS_CALLED, online_core_of
from tops import DRIFT, SIGMA, START, attitudes, flown_beside, flown_through, run, straight, tracks, two_sides, unread

ACCELERATION = np.array([2e-3, -1e-3, 5e-4])  # m/s²
ORBIT = Orbit(7.2e6, 0.1, 1.7, 2.0, 1.5, 0.4)
LAST = 59.0  # s


def displaced(ahead):
    """By how much the acceleration moves the chaser in a time in s, m."""
    mu = ORBIT.gravitational_parameter
    _, start = oracles.inertial_states(ORBIT, [2.0, -20.0, 1.0], [0.005, 0.002, -0.003])
    state = np.concatenate(oracles.propagate_kepler(*start, mu, LAST)).astype(float)
    ends = [
        solve_ivp(
            lambda _, y, a=acceleration: np.concatenate([y[3:], a - mu * y[:3] / np.linalg.norm(y[:3]) ** 3]),
            (0.0, ahead),
            state,
            method="DOP853",
            rtol=1e-13,
            atol=1e-9,
        ).y[:3, -1]
        for acceleration in (ACCELERATION, np.zeros(3))
    ]
    return ends[0] - ends[1]


@pytest.mark.parametrize("ahead", [20.0, 120.0])
def test_gravity_acts_on_what_an_acceleration_displaces(ahead):
    """Without it the prediction is off by 4 mm after 120 s."""
    time = np.arange(LAST + 1)
    filter = OnlineEstimator(SIGMA, ORBIT)
    run(filter, time, tracks(np.random.default_rng(8), time, straight(time)))
    moved = filter.predict(LAST + ahead, ACCELERATION).position - filter.predict(LAST + ahead).position
    np.testing.assert_allclose(moved, -displaced(ahead), atol=2e-4)


STD = 0.02  # of what thrusters are wrong by
DRAWS = 60  # so that a claim that is too small by 14 % in each direction is beyond the 99.9 % quantile of χ² of 240


LOOKED_AT = (151, 181, 231, 329)  # s, of a flight


def flown(seed, told=STD, wrong=None, turn=None):
    """A flight of 330 s on a chaser whose thrusters are wrong by deviates of STD, or by `wrong`.

    It turns, and from 130 s on its thrust turns with the target, as that of a chaser that stays before a point of it
    does: what that is wrong by looks like an offset. Motion between frames, under a constant acceleration, is exact.
    From frame `turn` on, other features are seen than before, so that the filter begins another map.
    Returns the errors (4, 3) of position when they are looked at, their covariances, the last state, and what the
    thrusters were wrong by.
    """
    rng = np.random.default_rng(seed)
    wrong = STD * rng.standard_normal(4) if wrong is None else wrong
    time = np.arange(330.0)
    target, chaser = attitudes(time), Rotation.from_rotvec(np.outer(time, [0.01, 0.02, 0.0]))
    push = np.where(time[:, None] > 130, target @ [0.02, -0.01, 0.005], 0.0)  # since the frame before
    pushed = (chaser * Rotation.from_rotvec(wrong[1:]) * chaser.inv()).apply((1 + wrong[0]) * push)
    speed = DRIFT - np.cumsum(pushed, axis=0)
    path = START + np.concatenate([np.zeros((1, 3)), np.cumsum(speed[1:] + 0.5 * pushed[1:], axis=0)])
    filter = OnlineEstimator(SIGMA, thrust_std=told)
    seen = tracks(rng, time, path) if turn is None else two_sides(rng, time, path, turn)
    frames = (
        ((t, frame), {"acceleration": Thrust(push[k], chaser[k].as_matrix())})
        for k, (t, frame) in enumerate(zip(time.tolist(), seen, strict=True))
    )
    states = list(flown_through(filter, frames, LOOKED_AT).values())
    errors = np.array([state.position for state in states]) - path[list(LOOKED_AT)]
    return errors, np.array([state.covariance[:3, :3] for state in states]), states[-1], wrong


def squares(errors, covariances):
    return np.einsum("...i,...ij,...j->...", errors, np.linalg.inv(covariances), errors)


def test_what_thrusters_are_wrong_by_is_found_and_claims_are_true():
    """Told accelerations were taken for exact: off by several times the claim.

    Then pushes were linear about what was known of the thrusters before, for good: what is of second order in their
    errors, 0.02 % of a push, stayed in the path. NEES of the thrusters was 7 in place of 4.
    At each of four times NEES is that of true claims, its mean over the draws below the 99.9 % quantile of χ².
    """
    errors, covariances, states, wrong = zip(*(flown(seed) for seed in range(DRAWS)), strict=True)
    nees = squares(np.array(errors), np.array(covariances)).mean(axis=0)
    assert (nees < chi2.ppf(0.999, 3 * DRAWS) / DRAWS).all()
    found = np.array([state.thrust for state in states]) - wrong
    of_thrust = squares(found, np.array([state.thrust_covariance for state in states]))
    assert of_thrust.mean() < chi2.ppf(0.999, 4 * DRAWS) / DRAWS
    assert np.sqrt(np.mean(found[:, 0] ** 2)) < 0.1 * STD
    assert all(state.status == "tracking" for state in states)


def test_thrusters_that_are_better_than_told_are_found_so_and_claims_stay_true():
    """Exact ones were claimed no better known than others. Those 0.1 % and 1 mrad off pass for exact at first.

    NEES of the CoM as above, and of the thrusters, is that of true claims: over 20 draws, since those above judge the
    same filter, claims too small by 29 % in each direction are beyond the limit of the CoM. Exact ones are known better
    by a quarter than those wrong by 0.1 %, of the same covariance else: half of the deviation is what the told grade
    leaves, which is one in four at least.
    """
    medians, draws = [], 20
    for size in (0.0, 1e-3):
        wrong = [size * np.random.default_rng([seed, 5]).standard_normal(4) for seed in range(draws)]
        errors, covariances, states, _ = zip(*(flown(seed, wrong=wrong[seed]) for seed in range(draws)), strict=True)
        nees = squares(np.array(errors), np.array(covariances)).mean(axis=0)
        assert (nees < chi2.ppf(0.999, 3 * draws) / draws).all()
        known = np.array([state.thrust_covariance for state in states])
        found = squares(np.array([state.thrust for state in states]) - wrong, known)
        assert found.mean() < chi2.ppf(0.999, 4 * draws) / draws
        medians.append(np.median(np.sqrt(np.diagonal(known, axis1=1, axis2=2)), axis=0))
    assert (medians[0] < 0.75 * medians[1]).all()


def burned(seed, density):
    """Two burns of 20 s, ten minutes apart and in two directions, by thrusters wrong by deviates of STD.

    The target is under white acceleration of a density in m²/s³ besides. Returns what filter and thrusters are wrong by
    40 s after the second: the squares of the errors of the CoM (3 degrees of freedom) and thrusters (4) over what is
    claimed.
    """
    rng, time = np.random.default_rng(seed), np.arange(761.0)
    wrong, chaser = STD * rng.standard_normal(4), Rotation.from_rotvec(np.outer(time, [0.01, 0.02, 0.0]))
    first, second = (time > 130) & (time <= 150), (time > 700) & (time <= 720)
    push = np.outer(first, [0.02, -0.01, 0.005]) + np.outer(second, [-0.01, 0.005, 0.02])  # since the frame before
    pushed = (chaser * Rotation.from_rotvec(wrong[1:]) * chaser.inv()).apply((1 + wrong[0]) * push)
    root = np.linalg.cholesky([[1 / 3, 1 / 2], [1 / 2, 1]])  # of r and v after 1 s
    noise = np.sqrt(density) * root @ rng.standard_normal((len(time), 2, 3))
    speed = DRIFT + np.cumsum(noise[:, 1] - pushed, axis=0)
    path = START + np.concatenate([np.zeros((1, 3)), np.cumsum(speed[:-1] - pushed[1:] / 2 + noise[1:, 0], axis=0)])
    filter = OnlineEstimator(SIGMA, thrust_std=STD)
    with unread(filter):
        for k, frame in enumerate(tracks(rng, time, path)):
            filter.update(time[k], frame, acceleration=Thrust(push[k], chaser[k].as_matrix()))
    state = filter.predict(time[-1])
    of_thrust = squares(state.thrust - wrong, state.thrust_covariance)
    return squares(state.position - path[-1], state.covariance[:3, :3]), of_thrust


@pytest.mark.parametrize("density", [0.0, 1e-6])
def test_what_a_burn_did_follows_what_a_later_one_tells_of_the_thrusters(density):
    """What the first one did was linear about exact thrusters: NEES of the CoM was 12, of the thrusters 52.

    Under process noise the path has forgotten that burn: if it followed, thrusters would be claimed far too well known.
    Squares over the draws are below the 99.9 % quantiles of χ²: CoMs that are claimed too small by 41 % in each
    direction exceed them.
    """
    nees, of_thrust = np.transpose([burned(seed, density) for seed in range(10)])
    assert nees.mean() < chi2.ppf(0.999, 3 * len(nees)) / len(nees)
    assert of_thrust.mean() < chi2.ppf(0.999, 4 * len(nees)) / len(nees)


def flown_with_a_rig(seed):
    """What a flight of 700 s beside the target, whose thrusters are wrong by deviates of STD, is off by at its end.

    Returns the squares of the error of the thrusters' scale (1 degree of freedom), and of the CoM (3), over what is
    claimed.
    """
    rng = np.random.default_rng(seed)
    wrong = STD * rng.standard_normal(4)
    states, path = flown_beside(rng, OnlineEstimator(SIGMA, thrust_std=STD), wrong, {699})
    state = states[699]
    assert state.status == "tracking"
    scale = (state.thrust[0] - wrong[0]) ** 2 / state.thrust_covariance[0, 0]
    return scale, squares(state.position - path[-1], state.covariance[:3, :3])


def test_what_a_rig_and_thrust_say_of_sizes_is_not_counted_twice():
    """A rig's depths leave the map's size open, and thrust that is too strong by as much has a path of another size.

    The large filter took the thrusters' error for noise that is new in each node, learnt the size of the map from
    sight by that, and told the bank, which knew as much from the same nodes. Squares over the draws are below the
    99.9 % quantiles of χ², which claims too small by 37 % in each direction exceed, of the scale by 66 %.
    """
    scale, nees = np.transpose([flown_with_a_rig(seed) for seed in range(12, 24)])
    assert scale.mean() < chi2.ppf(0.999, len(scale)) / len(scale)
    assert nees.mean() < chi2.ppf(0.999, 3 * len(nees)) / len(nees)


def test_thrust_that_is_exact_is_told_by_none():
    """With thrust_std 0 nothing is estimated: claims are those of known thrust, and wrong thrust is doubted at last."""
    errors, covariances, state, _ = flown(3, told=0.0, wrong=np.zeros(4))
    assert squares(errors, covariances)[-1] < chi2.ppf(0.999, 3)
    np.testing.assert_array_equal(state.thrust, np.zeros(4))
    np.testing.assert_array_equal(state.thrust_covariance, np.zeros((4, 4)))
    known = flown(3, wrong=np.zeros(4))[1]
    assert np.trace(covariances[-1]) < np.trace(known[-1])


def test_another_map_leaves_the_thrusters_as_well_known_as_they_were():
    """STD is what is claimed of thrusters that nobody knows."""
    _, _, state, wrong = flown(3, turn=318)
    found = state.thrust - wrong
    assert squares(found, state.thrust_covariance) < chi2.ppf(0.999, 4)
    assert np.sqrt(np.trace(state.thrust_covariance)) < 0.5 * STD


@pytest.mark.parametrize("axis", range(3))
def test_a_prediction_under_thrust_knows_what_the_thrusters_may_be_wrong_by(axis):
    """Thrusters that have never fired: after T s their displacement a T²/2 is uncertain by STD in each direction."""
    time = np.arange(180.0)
    filter = OnlineEstimator(SIGMA, thrust_std=STD)
    run(filter, time, tracks(np.random.default_rng(8), time, straight(time)))
    push = 0.03 * np.eye(3)[axis]
    more = filter.predict(time[-1] + 60, push).covariance - filter.predict(time[-1] + 60).covariance
    expected = (STD * 0.5 * 0.03 * 60**2) ** 2 * np.eye(3)  # along the thrust by its scale, across it by its direction
    np.testing.assert_allclose(more[:3, :3], expected, atol=1e-9)


def test_thrust_that_is_none_is_refused():
    filter = OnlineEstimator(SIGMA)
    points = tracks(np.random.default_rng(8), np.zeros(1), straight(np.zeros(1)))[0]
    with pytest.raises(InputError, match="attitude of the thrust"):
        filter.update(0.0, points, acceleration=Thrust(ACCELERATION, 2 * np.eye(3)))
    with pytest.raises(InputError, match=r"thrust_std is -0\.1, expected 0 to 1"):
        OnlineEstimator(SIGMA, thrust_std=-0.1)


FUNCTIONS = """#include <string.h>
#include "library.c"
void move(const double wrong[4], const double axes[3][3], const double told[3], double moved[3], double errors[3][4])
{ truly_moved(wrong, axes, told, moved, errors); }
int level(void) { return PATH_AND_MAP; }
int errors(void) { return ERRORS; }
void regress(const double *before, double S[PATH_AND_MAP][PATH_AND_MAP], double x[ERRORS], double P[ERRORS][ERRORS])
{ follow_path_and_map(before, S, x, P); }
void of_node(double manoeuvred, double by_thrust[3][4], double of_thrust[4][4], double found[3][3])
{
    static Online filter;
    Measurement measurement = {0};
    filter.manoeuvred = manoeuvred;
    memcpy(filter.of_thrust, of_thrust, sizeof filter.of_thrust);
    memcpy(measurement.by_thrust, by_thrust, sizeof measurement.by_thrust);
    add_thrust_of_node(&filter, &measurement, found);
}"""


@pytest.fixture(scope="module")
def core(tmp_path_factory):
    return online_core_of(tmp_path_factory.mktemp("core"), FUNCTIONS, *ONLY_WHAT_IS_CALLED)


def called(function, *arrays):
    function(*(one.ctypes.data_as(ctypes.c_void_p) for one in arrays))


@pytest.mark.parametrize("manoeuvred", [False, True])
def test_what_a_node_says_is_uncertain_by_the_thrusters_in_as_many_nodes_as_a_day_has(core, manoeuvred):
    """Against B P Bᵀ in each of a day's nodes, of a target that turns in 22 s; nothing before a manoeuvre."""
    rng = np.random.default_rng(6)
    B, root = rng.normal(size=(3, 4)), rng.normal(size=(4, 4))
    P, own = root @ root.T, np.eye(3)
    found = own.copy()
    core.of_node.argtypes = [ctypes.c_double, *[ctypes.c_void_p] * 3]
    core.of_node(float(manoeuvred), *(one.ctypes.data_as(ctypes.c_void_p) for one in (B, P, found)))
    if manoeuvred:
        nodes = (found - own) / (B @ P @ B.T)
        np.testing.assert_allclose(nodes, nodes[0, 0], rtol=1e-9)
        # A node ends where the target has turned by 0.25 rad at most: of 24 h / 22 s turns there are 25 each.
        assert nodes[0, 0] == pytest.approx(86400 / 22 * 2 * np.pi / 0.25, rel=0.1)
    else:
        np.testing.assert_array_equal(found, own)


def test_thrusters_that_are_wrong_move_by_a_scale_and_a_rotation(core):
    """Against scipy's rotation and differences of it; derivatives are those of first order in the rotation vector."""
    axes, told = Rotation.from_rotvec([0.3, -1.0, 0.4]).as_matrix(), np.array([0.2, -0.5, 0.3])
    wrong = np.array([0.1, 0.15, -0.1, 0.05])

    def truly(values):
        return (1 + values[0]) * Rotation.from_rotvec(axes @ values[1:]).apply(told)

    moved, errors = np.zeros(3), np.zeros((3, 4))
    called(core.move, wrong, np.ascontiguousarray(axes), told, moved, errors)
    np.testing.assert_allclose(moved, truly(wrong), rtol=1e-12)
    slopes = np.stack([truly(wrong + 1e-6 * e) - truly(wrong - 1e-6 * e) for e in np.eye(4)], axis=1) / 2e-6
    # Jacobian of a rotation by φ: 1 + [φ]x/2 + [φ]x²/6, of which the last is left out.
    np.testing.assert_allclose(errors, slopes, atol=np.sum(wrong[1:] ** 2) / 6 * np.linalg.norm(told))


def test_thrusters_follow_what_is_known_of_the_path(core):
    """In information form: that of the bank on path and map is replaced by another, the rest is as it was."""
    n, m = core.level(), core.errors()
    rng, known = np.random.default_rng(5), np.r_[: core.level(), core.errors() - 4 : core.errors()]
    root = rng.standard_normal((len(known), 2 * len(known)))
    joint, mean = root @ root.T, rng.standard_normal(len(known))
    other = rng.standard_normal((n, 2 * n))
    other, moved = other @ other.T, rng.standard_normal(n)
    x, P, before, S = np.zeros(m), np.zeros((m, m)), mean[:n].copy(), np.ascontiguousarray(joint[:n, :n])
    x[known], P[np.ix_(known, known)] = mean, joint
    x[:n], P[:n, :n] = moved, other
    called(core.regress, before, S, x, P)
    own, new = np.linalg.inv(S), np.linalg.inv(other)
    information = np.linalg.inv(joint)
    told = information @ mean
    information[:n, :n] += new - own
    told[:n] += new @ moved - own @ before
    np.testing.assert_allclose(P[np.ix_(known, known)], np.linalg.inv(information), rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(x[known], np.linalg.solve(information, told), rtol=1e-8, atol=1e-8)

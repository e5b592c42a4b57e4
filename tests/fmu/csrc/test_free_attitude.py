"""The attitude without gravity gradient over wide ranges of inertias and rates, against closed forms."""

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import oracles
from baryscope.fmu import Session
from baryscope.fmu.runtime.session import UnitError

ORACLE_RATE = 0.1  # rad/s; at other rates the motion is the same in scaled time
WIDE_ORBIT = 1e9  # m; in the centuries of the slowest tumbles a low orbit has millions of revolutions to integrate


@pytest.fixture(scope="module")
def session(envisat_fmu):
    with Session(envisat_fmu) as session:
        yield session


def parameters(J, rate):
    axes = (("xx", 0, 0), ("yy", 1, 1), ("zz", 2, 2), ("xy", 0, 1), ("xz", 0, 2), ("yz", 1, 2))
    inertia = {f"target.inertia.{name}": J[i, j] for name, i, j in axes}
    start = {"target.angularRate0": rate, "target.attitude0": [1.0, 0.0, 0.0, 0.0]}
    return inertia | start | {"orbit.semiMajorAxis": WIDE_ORBIT}


def fly(session, J, rate, time):
    """R_I_B at each time, and ω, after one step to each."""
    session.reset(parameters(J, rate))
    attitudes, rates = [], []
    for t in time:
        session.step(t - session.time)
        attitudes.append(session["target.attitude"])
        rates.append(session["target.angularRate"])
    return Rotation.from_quat(attitudes, scalar_first=True), np.array(rates)


unit_interval = st.floats(0.0, 1.0)


@st.composite
def inertias(draw):
    """Tensors in any axes; the second moments of mass along the principal ones are positive."""
    second = np.array([draw(st.floats(0.01, 1.0)) for _ in range(3)]) * 10.0 ** draw(st.floats(-8, 12))
    axes = Rotation.from_rotvec([draw(st.floats(-1.8, 1.8)) for _ in range(3)]).as_matrix()
    return axes @ np.diag(second.sum() - second) @ axes.T


@st.composite
def directions(draw):
    z, angle = draw(st.floats(-1.0, 1.0)), draw(st.floats(0.0, 2 * np.pi))
    return np.array([np.sqrt(1 - z * z) * np.cos(angle), np.sqrt(1 - z * z) * np.sin(angle), z])


def deviation(session, J, direction, speed, turn):
    """The largest error, of the attitude in rad and of ω relative to the speed, on a way of `turn` rad."""
    oracle = oracles.TorqueFree(J, ORACLE_RATE * direction)
    time = np.arange(turn / ORACLE_RATE + 1)
    every = time[:: len(time) // 5][1:]
    attitudes, rates = fly(session, J, speed * direction, every * ORACLE_RATE / speed)
    error = (oracle.attitude(time)[every.astype(int)].inv() * attitudes).magnitude()
    return max(error.max(), np.abs(rates / speed - oracle.rate(every) / ORACLE_RATE).max())


@settings(max_examples=60)
@given(J=inertias(), direction=directions(), decade=st.floats(-7.0, 4.0), turn=st.integers(5, 300))
def test_against_jacobis_functions(session, J, direction, decade, turn):
    """Any inertia and speed: one turn takes from years to a millisecond."""
    moments, axes = np.linalg.eigh(J)
    assume(np.diff(moments).min() > 1e-2 * moments[2] and np.abs(axes.T @ direction).min() > 3e-2)
    assume(oracles.TorqueFree(J, direction).modulus < 0.99)
    assert deviation(session, J, direction, 10.0**decade, turn) < 1e-11 * turn


@pytest.mark.parametrize("moments, direction, turn, bound", [
    pytest.param([1.0, 1.5, 1.5001], [0.6, 0.48, 0.64], 300, 1e-11, id="nearly symmetric"),
    pytest.param([1.0, 1.0001, 1.9], [0.6, 0.48, 0.64], 300, 1e-11, id="nearly symmetric, disk"),
    pytest.param([1.0, 1.9, 2.5], [1e-3, 1.0, 1e-3], 100, 1e-8, id="nearly about the intermediate axis"),
    pytest.param([1.0, 1.9, 2.5], [1e-3, 1e-3, 1.0], 300, 1e-10, id="nearly about the greatest axis"),
])  # fmt: skip
def test_near_special_motions(session, moments, direction, turn, bound):
    direction = np.array(direction) / np.linalg.norm(direction)
    assert deviation(session, np.diag(moments), direction, 0.01, turn) < bound


@settings(max_examples=30)
@given(ratio=st.floats(0.05, 1.95), direction=directions(), decade=st.floats(-7.0, 4.0))
@example(ratio=1.0, direction=np.array([0.6, 0.0, 0.8]), decade=-1.0)
@example(ratio=0.3, direction=np.array([0.0, 0.0, 1.0]), decade=-1.0)
def test_a_symmetric_body(session, ratio, direction, decade):
    """Its axis precesses about the angular momentum while it turns about the axis, both evenly."""
    J, rate = np.diag([1.0, 1.0, ratio]), 10.0**decade * direction
    time = np.array([1.0, 30.0, 100.0]) / 10.0**decade
    attitudes, _ = fly(session, J, rate, time)
    momentum = J @ rate
    precession = Rotation.from_rotvec(np.outer(time, momentum))
    spin = Rotation.from_rotvec(np.outer(time, [0, 0, (1 - ratio) * rate[2]]))
    assert ((precession * spin).inv() * attitudes).magnitude().max() < 1e-9


@settings(max_examples=30)
@given(J=inertias(), direction=directions(), offset=st.floats(-12.0, -1.0), gap=st.floats(-12.0, -1.0))
def test_energy_and_momentum_near_the_separatrix(session, J, direction, offset, gap):
    """Near-symmetric bodies that turn nearly about their intermediate axis."""
    moments, axes = np.linalg.eigh(J)
    moments[1] = moments[2] - 10.0**gap * min(moments[0], moments[2] - moments[0])
    J = axes @ np.diag(moments) @ axes.T
    rate = axes[:, 1] + 10.0**offset * direction
    attitudes, rates = fly(session, J, rate, np.array([10.0, 100.0, 1000.0]))
    momentum = attitudes.apply(rates @ J)
    np.testing.assert_allclose(momentum / moments[2], np.tile(J @ rate / moments[2], (3, 1)), atol=1e-9)
    energy = np.einsum("ni,ij,nj->n", rates, J, rates)
    np.testing.assert_allclose(energy, rate @ J @ rate, rtol=1e-11)


@given(J=inertias(), direction=directions(), cuts=st.lists(unit_interval, min_size=1, max_size=30))
@settings(max_examples=30)
def test_the_length_of_the_steps_does_not_matter(session, J, direction, cuts):
    end = 200.0
    one, _ = fly(session, J, direction, [end])
    many, _ = fly(session, J, direction, [*(end * cut for cut in np.unique(cuts) if 1e-6 < cut < 1 - 1e-6), end])
    assert (one[-1].inv() * many[-1]).magnitude() == 0.0  # no input has changed, so that the steps inside are the same


@pytest.mark.parametrize("speed", [0.0, 5e-324, 1e-310, 1e-150, 1e-30])
def test_a_body_at_rest_stays_where_it_is(session, envisat, speed):
    attitudes, rates = fly(session, np.array(envisat.target.inertia), np.full(3, speed), [1.0, 1e5, 1e6])
    assert attitudes.magnitude().max() < 1e-15
    assert np.all(rates == speed)


@pytest.mark.parametrize("speed", [1e160, 1e300])
def test_an_extreme_rate_is_refused_and_changes_nothing(session, envisat, speed):
    session.reset(parameters(np.array(envisat.target.inertia), np.full(3, speed)))
    with pytest.raises(UnitError, match="out of bounds"):
        session.step(1.0)
    assert session.time == 0.0
    assert np.all(session["target.angularRate"] == speed)


@pytest.mark.parametrize("rate", [[0.0, 0.0, 0.0], [0.01, -0.05, 0.03]], ids=["from rest", "tumbling"])
@pytest.mark.parametrize("torque", [[0.0, 0.0, 50.0], [40.0, -60.0, 5.0], [1e7, 2e7, -1e7]])
def test_a_constant_torque_over_long_steps(session, envisat, rate, torque):
    J = np.array(envisat.target.inertia)
    span = 0.1 if max(torque) > 1e6 else 300.0
    session.reset(parameters(J, rate))
    session.step(span, torque=torque)
    found = session["target.angularRate"]

    def rates(_, w):
        return np.linalg.solve(J, torque - np.cross(w, J @ w))

    solution = solve_ivp(rates, (0, span), rate, "DOP853", rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(found, solution.y[:, -1], rtol=0, atol=1e-9 * np.abs(found).max())


def test_gravity_gradient_switched_on_and_off_again(session, envisat):
    """Momentum changes while it is on, and only then."""
    session.reset()
    session.step(500.0)
    before = session["target.angularMomentum"].copy()
    session.tune({"gravityGradient": True})
    session.step(500.0)
    after = session["target.angularMomentum"].copy()
    session.tune({"gravityGradient": False})
    session.step(500.0)
    assert np.linalg.norm(after - before) > 1.0
    np.testing.assert_allclose(session["target.angularMomentum"], after, rtol=0, atol=1e-12 * np.linalg.norm(after))

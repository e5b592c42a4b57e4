"""The maximum a posteriori estimate: its motion against the truth, and its findings if there is no free tumble."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from baryscope.estimator.dynamics.rotation import Rotation as Tumbling
from baryscope.estimator.findings import FreeAttitudes
from baryscope.estimator.methods import estimate
from baryscope.estimator.ml import iteration
from baryscope.estimator.options import PathOptions
from baryscope.estimator.prose import sentence
from baryscope.estimator.result import Status
from baryscope.models.errors import InputError
from baryscope.study.population.third.cases import drawn, sampled
from synthetic import ENVISAT, Orbit, attitude, box_features, make_case, rig_tracks

RATE = np.deg2rad([2.4, 4.4, 4.8])
FEATURES = box_features(8, (10, 5, 5), seed=3, centre=(1, 0.5, 0))
FIXED = PathOptions(trajectory="fixed")
NOISE = 0.02


def at_rest(time):
    return np.tile([4.0, -19.0, 3.0], (len(time), 1))


def test_rate_and_inertia_agree_with_their_standard_deviations():
    time = np.arange(300.0)
    R = attitude(ENVISAT, RATE, time)
    case = make_case(time, R, at_rest(time), FEATURES, noise=NOISE, seed=1)
    found = estimate(case.tracks, method="ml", options=FIXED)
    said = found.details
    turn = said.attitude.T  # R_B_C at the epoch: B against the truth's axes by the true attitude there
    k = int(said.epoch)
    assert said.epoch == time[k]
    R_B_true = turn @ R[k]
    exact = Tumbling(0.0, np.eye(3), RATE, ENVISAT).at(np.array([said.epoch]))
    rate = said.angular_rate
    # The attitude at the epoch is exact by definition of B; features hold it to 0.02/4/√(8 × 300), 1e-4 rad.
    missed = np.abs(rate - R_B_true @ exact.rate[0])
    np.testing.assert_array_less(missed, 4 * said.angular_rate_deviation + 1e-3 * np.linalg.norm(RATE))
    inertia = R_B_true @ (ENVISAT / np.trace(ENVISAT)) @ R_B_true.T
    assert np.linalg.norm(said.inertia - inertia) < 4 * said.inertia_deviation + 2e-3
    np.testing.assert_allclose(np.linalg.eigvalsh(said.inertia), np.linalg.eigvalsh(inertia), atol=2e-3)
    axes = np.linalg.eigh(said.inertia)[1].T
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    assert found.options.torque == "none"


def test_a_constant_torque_is_estimated_and_reported_where_it_must_not_be():
    """5 N m for 150 s change the angular momentum by a twentieth."""
    time = np.arange(150.0)
    torque = np.array([3.0, 3.0, -3.0])

    def slope(_, state):
        w, v, omega = state[0], state[1:4], state[4:]
        rate = 0.5 * np.concatenate([[-v @ omega], w * omega + np.cross(v, omega)])
        return np.concatenate([rate, np.linalg.solve(ENVISAT, torque - np.cross(omega, ENVISAT @ omega))])

    start = np.concatenate([[1.0, 0, 0, 0], RATE])
    q = solve_ivp(slope, (0, time[-1]), start, "DOP853", time, rtol=1e-9, atol=1e-9).y[:4].T
    R = Rotation.from_quat(q, scalar_first=True).as_matrix()
    case = make_case(time, R, at_rest(time), FEATURES, noise=NOISE, seed=2)
    free = estimate(case.tracks, method="ml", options=PathOptions(trajectory="fixed", torque_noise="none"))
    assert any(remark.startswith("no free tumble fits") for remark in [sentence(finding) for finding in free.findings])
    assert free.status is Status.MODEL_DOES_NOT_FIT
    plain = estimate(case.tracks, method="pivot", options=FIXED)
    found = estimate(case.tracks, method="ml", options=FIXED)
    assert found.findings == ()
    # A constant α is white noise with α² T in one of its modes, among some thirty that the tracks tell.
    low, high = found.details.torque_noise_bounds
    assert low < found.details.torque_noise < high
    assert 1e-3 < found.details.torque_noise / (np.linalg.norm(torque / np.diag(ENVISAT)) ** 2 * time[-1]) < 1
    assert found.predicted_rmse < 1.1 * plain.predicted_rmse
    error = found.position[0] - case.com[0]
    assert error @ np.linalg.solve(found.covariance[0], error) < 4.5**2
    assert plain.findings == ()
    error = plain.position[0] - case.com[0]
    assert error @ np.linalg.solve(plain.covariance[0], error) < 4.5**2


@pytest.fixture(scope="module")
def gravity_gradient():
    """A slow tumble under the gravity gradient over two fifths of an orbit, and its orbit."""
    orbit, time = Orbit().model(), np.linspace(0.0, 2400.0, 160)
    R = Tumbling(0.0, np.eye(3), RATE / 20, ENVISAT, orbit).at(time).attitude
    return make_case(time, R, at_rest(time), FEATURES, noise=NOISE, seed=3), orbit


def test_the_gravity_gradient_is_chosen_if_it_fits_better(gravity_gradient):
    case, orbit = gravity_gradient
    found = estimate(case.tracks, method="ml", orbit=orbit, options=FIXED)
    assert found.options.torque == "gravity-gradient"
    assert found.findings == ()
    error = found.position[0] - case.com[0]
    assert error @ np.linalg.solve(found.covariance[0], error) < 4.5**2
    noisy = estimate(case.tracks, method="ml", orbit=orbit, options=PathOptions(trajectory="fixed", torque="none"))
    assert noisy.options.torque == "none"
    error = noisy.position[0] - case.com[0]
    assert error @ np.linalg.solve(noisy.covariance[0], error) < 4.5**2
    rigid = PathOptions(trajectory="fixed", torque="none", torque_noise="none")
    free = estimate(case.tracks, method="ml", orbit=orbit, options=rigid)
    assert any(remark.startswith("no free tumble fits") for remark in [sentence(finding) for finding in free.findings])


def test_no_gravity_gradient_where_none_acts():
    orbit, time = Orbit().model(), np.arange(200.0)
    case = make_case(time, attitude(ENVISAT, RATE, time), at_rest(time), FEATURES, noise=NOISE)
    torques = [
        estimate(case.tracks, method="ml", orbit=orbit, options=PathOptions(trajectory="fixed", torque=torque))
        for torque in ("none", "gravity-gradient")
    ]
    assert [found.options.torque for found in torques] == ["none", "gravity-gradient"]
    # In 200 s at 7 °/s the gradient hardly turns the body: both agree to a part of the deviation.
    np.testing.assert_allclose(torques[0].position, torques[1].position, atol=1e-3)
    with pytest.raises(InputError, match="torque is gravity-gradient, which needs the target's orbit"):
        estimate(case.tracks, method="ml", options=PathOptions(trajectory="fixed", torque="gravity-gradient"))


def test_features_never_seen_together_share_the_motion():
    """Four clusters without a common feature: the tumble determines each, while `pivot` solves for four bodies."""
    time = np.arange(240.0)
    features = box_features(12, (10, 5, 5), seed=5, centre=(1, 0.5, 0))
    clusters = [(60 * k, 60 * k + 60, list(range(3 * k, 3 * k + 3))) for k in range(4)]
    R = attitude(ENVISAT, RATE, time)
    case = make_case(time, R, at_rest(time), features, noise=NOISE, seed=6, clusters=clusters)
    found, plain = (estimate(case.tracks, method=name, options=FIXED) for name in ("ml", "pivot"))
    assert len(found.clusters) == 4
    assert found.findings == ()
    error = found.position[0] - case.com[0]
    assert error @ np.linalg.solve(found.covariance[0], error) < 4.5**2
    assert found.predicted_rmse < 0.95 * plain.predicted_rmse


def test_stereo_range_is_unbiased():
    """As for `pivot`, with fewer draws: the uncorrected bias along the line of sight is 1.7 standard deviations."""
    time = np.arange(300.0)
    R, com = attitude(ENVISAT, RATE, time), at_rest(time)
    sight = com[0] / np.linalg.norm(com[0])
    moved, apart = [], []
    for seed in range(3):
        tracks = rig_tracks(time, R, com, FEATURES, seed=seed)
        plain, found = (
            estimate(tracks, method="ml", options=PathOptions(trajectory="fixed", noise=noise))
            for noise in ("fixed", "stereo")
        )
        peer = estimate(tracks, method="pivot", options=FIXED)
        deviation = np.sqrt(sight @ found.covariance[0] @ sight)
        moved.append(sight @ (found.position[0] - plain.position[0]) / deviation)
        apart.append(sight @ (found.position[0] - peer.position[0]) / deviation)
        assert found.findings == ()
        assert found.noise.a_posteriori**2 == pytest.approx(1, abs=0.1)
    assert np.mean(moved) == pytest.approx(1.7, abs=0.6)
    assert np.abs(apart).max() < 0.7


def test_the_density_of_white_torque_noise_is_found():
    """Kicks at every second; the estimate agrees with the density, and rates and path with their covariances."""
    density, time = 1e-8, np.arange(300.0)
    rng = np.random.default_rng(5)
    kicks = np.sqrt(density) * rng.normal(size=(300, 3))
    R, rates, rate = [np.eye(3)], [RATE], RATE
    for kick in kicks[1:]:
        step = Tumbling(0.0, R[-1], rate, ENVISAT).at(np.array([1.0]))
        rate = step.rate[0] + kick
        R.append(step.attitude[0])
        rates.append(rate)
    case = make_case(time, np.array(R), at_rest(time), FEATURES, noise=NOISE, seed=4)
    found = estimate(case.tracks, method="ml", options=FIXED)
    assert found.findings == ()
    low, high = found.details.torque_noise_bounds
    assert low / 1.5 < density < 1.5 * high  # 90 %, once
    assert high / low < 10
    for k in (0, 150, 299):
        turn = found.attitude[k].T @ case.R_I_B[k]
        missed = found.angular_rate[k] - turn @ rates[k]
        # χ²₃ with probability 1e-4 is 21; a rate jumps by the kick at the sample.
        assert missed @ np.linalg.solve(found.motion.angular_rate_covariance[k] + density * np.eye(3), missed) < 21
    error = found.position[0] - case.com[0]
    assert error @ np.linalg.solve(found.covariance[0], error) < 21
    given = estimate(case.tracks, method="ml", options=PathOptions(trajectory="fixed", torque_noise=density))
    assert given.details.torque_noise is None
    np.testing.assert_allclose(given.position, found.position, atol=0.5 * found.predicted_rmse)


def test_free_tumbles_hardly_pay_for_the_search_of_a_torque():
    time = np.arange(300.0)
    case = make_case(time, attitude(ENVISAT, RATE, time), at_rest(time), FEATURES, noise=NOISE, seed=1)
    auto, free = (
        estimate(case.tracks, method="ml", options=PathOptions(trajectory="fixed", torque_noise=noise))
        for noise in ("auto", "none")
    )
    assert auto.predicted_rmse < 1.05 * free.predicted_rmse
    np.testing.assert_allclose(auto.position, free.position, atol=0.3 * free.predicted_rmse)
    assert free.details.torque_noise is None


def test_attitudes_of_no_tumble_give_the_estimate_of_pivot():
    """The body turns by a random angle about a random axis from frame to frame."""
    time = np.arange(80.0)
    R = Rotation.random(80, random_state=7).as_matrix()
    case = make_case(time, R, at_rest(time), FEATURES, noise=NOISE, seed=4)
    found = estimate(case.tracks, method="ml", options=PathOptions(trajectory="fixed"))
    plain = estimate(case.tracks, method="pivot", options=PathOptions(trajectory="fixed"))
    assert [type(finding) for finding in found.findings] == [FreeAttitudes]
    assert found.method == "ml"
    assert found.status is plain.status
    np.testing.assert_array_equal(found.position, plain.position)
    error = found.position[0] - case.com[0]
    assert error @ np.linalg.solve(found.covariance[0], error) < 4.5**2


def test_a_path_that_free_attitudes_hardly_tell_has_the_modes_of_noise_that_a_tumble_tells():
    """Three features, all of them in a quarter of the frames: `pivot` knows the path to a metre, and needs few modes.

    With these the NEES of this draw was 73: `python -m baryscope.study.population case --population third --seed 3
    --index 17 --method ml --orbit`.
    """
    case = drawn(3, 17)
    found = estimate(sampled(case, 0).tracks, method="ml", orbit=case.orbit, options=PathOptions(sigma=1.0))
    for k in (0, len(case.time) // 2, -1):
        error = found.position[k] - case.path[k]
        assert error @ np.linalg.solve(found.covariance[k], error) < chi2.ppf(0.999, 3)


def test_a_motion_in_a_hand_is_given_up_soon(monkeypatch):
    """Turned to and fro about three axes, by no torque that lasts: 25 rounds led nowhere."""
    rounds, step = [], iteration._step_downhill
    monkeypatch.setattr(iteration, "_step_downhill", lambda *args: rounds.append(args) or step(*args))
    time = np.linspace(0.0, 20.0, 80)
    vectors = 2.0 * np.sin(2 * np.pi * time[:, None] * [0.05, 0.07, 0.11])
    com, points = np.tile([0.0, -3.0, 0.5], (80, 1)), box_features(5, (0.4, 0.3, 0.2), seed=3)
    case = make_case(time, Rotation.from_rotvec(vectors).as_matrix(), com, points, noise=0.0005, seed=1)
    found = estimate(case.tracks, method="ml")
    assert any(isinstance(one, FreeAttitudes) for one in found.findings)
    assert len(rounds) == iteration.PATIENCE
    assert np.linalg.norm(found.position - com, axis=1).max() < 0.002


def test_frames_after_the_last_that_shows_something_hardly_change_the_claim():
    """A target that is out of view for 200 s, after 100 s in it: the claim was 11.5 m, where it is 16 mm.

    The mean of the attitudes' errors, which grow beyond the tracks, was taken for that of frames that show something.

    The tolerance is for products of these errors, which are greater by the epoch, in the middle of all frames.
    """
    alone, longer = (
        estimate(
            make_case(
                time := np.arange(float(end)),
                attitude(ENVISAT, np.deg2rad([0.6, 0.9, 1.1]), time),
                at_rest(time),
                FEATURES[:5],
                noise=NOISE,
                seed=1,
                clusters=[(0, 100, list(range(5)))],
            ).tracks,
            method="ml",
            options=FIXED,
        )
        for end in (100, 300)
    )
    assert longer.status is Status.GOOD
    assert longer.observability.body.deviations == pytest.approx(alone.observability.body.deviations, rel=0.5)

"""White noise of the position from frame to frame: its variance, and what it costs a pivot that slips."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from baryscope.estimator import FeatureTracks, PathOptions, estimate
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.position_noise import LastingAndShared, position_slip
from baryscope.estimator.registration.body import Body
from free_paths import ORBIT, at_rest, in_orbit, turning
from synthetic import make_case

pytestmark = pytest.mark.usefixtures("shared_pivot")

POINTS = np.array([[0.05, 0.0, 0.2], [0.0, 0.06, 0.25], [-0.04, 0.02, 0.22], [0.02, -0.05, 0.3]])
SLIP = 5e-4
OF_TOP = np.array([[0.7, -0.2, 0.6], [-0.8, 0.9, 0.9], [-0.3, -1.0, 0.2], [0.4, 0.6, -0.5]])
AT = np.array([10.0, -20.0, 40.0])


def cases(slip, draws, points=POINTS):
    time, R = turning(200, 1.0)
    for seed in range(draws):
        com = at_rest(time)
        moved = com + slip * np.random.default_rng([seed, 1]).normal(size=com.shape)
        yield com, make_case(time, R, moved, points, noise=2e-4, seed=seed)


@pytest.mark.parametrize(
    ("method", "trajectory", "draws"), [("pivot", "fixed", 6), ("pivot", None, 2), ("ml", "fixed", 3)]
)
def test_a_pivot_that_slips_is_found_and_covered(method, trajectory, draws):
    squares, noises = [], []
    for com, case in cases(SLIP, draws):
        found = estimate(case.tracks, method=method, options=PathOptions(trajectory=trajectory))
        error = found.position[100] - com[100]
        squares.append(error @ np.linalg.solve(found.covariance[100], error))
        noises.append(found.details.position_noise)
        assert found.status.trustworthy
    # 600 values give the deviation to 3 %; the mean of n values of χ²₃ has a standard deviation of √(6/n).
    assert np.median(noises) == pytest.approx(SLIP, rel=0.1)
    assert np.mean(squares) < 3 + 4 * np.sqrt(6 / draws)


@pytest.mark.parametrize(("method", "draws"), [("pivot", 20), ("ml", 3), ("ekf", 4)])
def test_an_estimated_slip_has_an_interval_that_holds_90_percent(method, draws):
    """`pivot` and `ml` said that a fixed path had no process noise, and gave a deviation without an uncertainty."""
    held = 0
    for _, case in cases(SLIP, draws):
        noise = estimate(case.tracks, method=method, options=PathOptions(trajectory="fixed")).process_noise
        assert (noise.source, noise.of_position, noise.negligible) == ("estimated", True, False)
        low, high = noise.interval
        assert low <= noise.density <= high < 2 * low  # the densities of ekf's bank are a factor of √2 apart at most
        held += low <= SLIP**2 <= high
    assert held > 0.9 * draws - 4 * np.sqrt(0.09 * draws)  # binomial


@pytest.mark.parametrize("method", ["pivot", "ml", "ekf"])
def test_a_pivot_that_does_not_slip_has_a_bound_to_what_hides_in_the_noise(method):
    """Noise of 0.2 mm of four points a frame, of which the three of a place are seen to some 0.2 mm, 200 times."""
    ((_, case),) = cases(0.0, 1)
    found = estimate(case.tracks, method=method, options=PathOptions(trajectory="fixed"))
    assert found.process_noise.source == "estimated"
    assert found.process_noise.negligible
    assert 0 == found.process_noise.interval[0] < found.process_noise.interval[1] < 1e-4**2


@pytest.mark.parametrize("method", ["pivot", "ml", "ekf"])
def test_a_slip_that_is_given_is_one_of_the_position_in_every_method(method):
    """Its variance is m². `pivot` and `ml` took it for a density of acceleration, in m²/s³: the centre of mass was
    decimetres away, and the status good."""
    for com, case in cases(SLIP, 2):
        options = PathOptions(trajectory="fixed", process_noise=SLIP**2)
        found = estimate(case.tracks, method=method, options=options)
        left = estimate(case.tracks, method=method, options=replace(options, process_noise="auto"))
        error = found.position[100] - com[100]
        assert found.status.trustworthy
        assert (found.process_noise.source, found.process_noise.of_position) == ("given", True)
        assert found.process_noise.density == SLIP**2
        assert error @ np.linalg.solve(found.covariance[100], error) < chi2.ppf(1 - 1e-4, 3)
        # Estimated to 3 % of its deviation, it costs the same.
        np.testing.assert_allclose(found.covariance[100], left.covariance[100], rtol=0.3, atol=1e-9)


@pytest.mark.parametrize(("method", "draws"), [("pivot", 5), ("ml", 3)])
def test_a_slip_is_found_by_two_features(method, draws):
    """Their frames tell two directions of it; there was none to go by how long it lasts, and a division by zero."""
    squares, noises = [], []
    for com, case in cases(SLIP, draws, POINTS[[0, 2]] + [0.1, 0.05, 0.0]):
        found = estimate(case.tracks, method=method, options=PathOptions(trajectory="fixed"))
        error = found.position[100] - com[100]
        squares.append(error @ np.linalg.solve(found.covariance[100], error))
        noises.append(found.details.position_noise)
    # 400 values give the deviation to 4 %.
    assert np.median(noises) == pytest.approx(SLIP, rel=0.15)
    assert np.mean(squares) < 3 + 4 * np.sqrt(6 / draws)


@pytest.mark.parametrize("trajectory", ["fixed", None])
def test_the_claim_has_all_of_the_slip(trajectory):
    """No estimate of a point at rest is better than the mean of its places, even if all else is known."""
    ((_, case),) = cases(SLIP, 1)
    found = estimate(case.tracks, options=PathOptions(trajectory=trajectory))
    least = found.details.position_noise * np.sqrt(3 / len(case.tracks.time))
    assert least < found.predicted_rmse < 2 * least


def slipping(points, noise, seed, frames=300):
    """Frames whose slips last for ten, and the true place."""
    time, R = turning(frames, 1.0)
    white = np.random.default_rng([seed, 2]).normal(size=(frames, 3))
    keep = np.exp(-0.1)
    com, slips = at_rest(time), [white[0]]
    for one in white[1:]:
        slips.append(keep * slips[-1] + np.sqrt(1 - keep**2) * one)
    return com, make_case(time, R, com + SLIP * np.array(slips), points, noise=noise, seed=seed)


def test_slips_that_last_cost_as_much_as_they_hang_together():
    """Ten frames long, so that the mean of 300 knows as little as that of some fifteen."""
    squares = []
    for seed in range(24):
        com, case = slipping(POINTS, 2e-4, seed)
        found = estimate(case.tracks, options=PathOptions(trajectory="fixed"))
        error = found.position[0] - com[0]
        squares.append(error @ np.linalg.solve(found.covariance[0], error))
        assert found.status.trustworthy
    # How many frames a slip lasts is found to some 40 %: √(2 (2 W + 1)/(3 n)) for a window W of 40 lags.
    assert 3 / 2 < np.mean(squares) < 3 * 1.5 + 4 * np.sqrt(6 / 24)


def test_few_slips_that_last_cost_what_the_place_takes_of_them():
    """100 frames have five slips of 1 + 2 Σ ρ = 20 frames, and two of these are place and offset.

    The normalised squared error was 5.8 in the mean, of 3, and up to 26.
    """
    squares = []
    for seed in range(12):
        com, case = slipping(POINTS, 2e-4, seed, 100)
        found = estimate(case.tracks, options=PathOptions(trajectory="fixed"))
        error = found.position[0] - com[0]
        squares.append(error @ np.linalg.solve(found.covariance[0], error))
    assert np.mean(squares) < 3 + 2 * np.sqrt(6 / 12)
    assert max(squares) < 16.3  # χ²₃ exceeds it in one of 1,000


def test_slips_that_last_are_seen_along_the_lever_to_a_far_tip():
    """Three markers on 3 cm turn a tip at 30 cm by several times the slips across the lever, and by a fourth along it.

    1 + 2 Σ ρ is 20, so that white noise of 4.5 times the slips costs as much. Shifts were weighted by their worst
    direction, in whose noise it was lost.
    """
    points = np.array([[0.03, 0.0, 0.3], [-0.015, 0.026, 0.3], [-0.015, -0.026, 0.31]])
    squares = []
    for seed in range(10):
        com, case = slipping(points, 2e-4, seed)
        found = estimate(case.tracks, options=PathOptions(trajectory="fixed"))
        error = found.position[0] - com[0]
        squares.append(error @ np.linalg.solve(found.covariance[0], error))
        assert found.details.position_noise > 2 * SLIP
        assert found.status.trustworthy
    assert 3 / 2 < np.mean(squares) < 3 * 1.5 + 4 * np.sqrt(6 / 10)


def test_a_pivot_that_does_not_slip_has_no_noise():
    """2 ln of the likelihood ratio exceeds 9 by chance in less than 1 of 700."""
    for _, case in cases(0.0, 10):
        assert estimate(case.tracks, options=PathOptions(trajectory="fixed")).details.position_noise == 0.0


def test_slow_slips_that_hide_in_the_noise_of_single_frames_are_found():
    """A tip that jumps by a fifth of the noise of a marker once in 800 frames: no frame shows it, 100 together do."""
    time, R = turning(4000, 1.0)
    found, squares = 0, []
    for seed in range(4):
        jumps = 8e-5 * np.random.default_rng([seed, 3]).normal(size=(5, 3))
        com = at_rest(time) + np.repeat(jumps - jumps.mean(axis=0), 800, axis=0)
        case = make_case(time, R, com, POINTS, noise=4e-4, seed=seed)
        one = estimate(case.tracks, options=PathOptions(trajectory="fixed"))
        error = one.position[0] - at_rest(time)[0]
        squares.append(error @ np.linalg.solve(one.covariance[0], error))
        found += one.details.position_noise > 0
        assert one.status.trustworthy
    assert found == 4
    assert np.mean(squares) < 3 + 4 * np.sqrt(6 / 4)


def top(time, angle):
    """The attitudes of a top whose axis is by an angle in rad, which is small, from the direction that it keeps."""
    spin, nutation = (Rotation.from_rotvec(np.outer(rate * time, [0.0, 0.0, 1.0])) for rate in (0.21, 0.13))
    return (spin * Rotation.from_rotvec([angle, 0.0, 0.0]) * nutation).as_matrix()


def test_errors_of_features_that_last_are_no_slips():
    """They are the same in 1 + 2 Σ ρ frames: the mean of a span has that many times the variance of white ones."""
    keep, frames = 0.9, 1200
    lasting, found = (1 + keep) / (1 - keep), []
    R = Rotation.from_rotvec(np.outer(np.arange(frames), [0.05, 0.02, 0.04])).as_matrix()
    body = Body(np.arange(4), np.arange(frames), OF_TOP, R)
    for seed in range(6):
        white = np.random.default_rng(seed).standard_normal((frames, 4, 3))
        white[1:] *= np.sqrt(1 - keep**2)  # of a process that begins as it goes on
        errors = SLIP * lfilter([1.0], [1.0, -keep], white, axis=0)
        own = Observations(AT + OF_TOP @ np.swapaxes(R, 1, 2) + errors, np.ones((frames, 4)))
        found.append(position_slip([body], own, np.tile(AT, (frames, 1)), SLIP**2, lasting).variance)
    assert found == [0.0] * len(found)


def test_slips_are_known_as_well_beside_errors_of_features_that_last():
    """A top whose axis moves by 2.9°, slips of 1 cm, and errors of features of 3 mm that last for 10 s.

    Shifts of frames were held as if the features' errors were greater in each frame, not only in all together: they
    passed for such errors, so that no model fitted, and the centre was 3 cm off. 1 cm along the axis is claimed.
    """
    time, slip, kept = np.arange(600.0), 0.01, np.exp(-1 / 10)
    R = top(time, 0.05)
    for seed in range(3):
        rng = np.random.default_rng(seed)
        slipped = AT + slip * rng.standard_normal((600, 3))
        lasting = lfilter([np.sqrt(1 - kept**2)], [1.0, -kept], rng.standard_normal((600, 4, 3)), axis=0)
        position = slipped[:, None] + OF_TOP @ np.swapaxes(R, 1, 2) + 3e-3 * lasting
        found = estimate(FeatureTracks(time, position, tuple("abcd")), options=PathOptions(trajectory="fixed"))
        assert found.status.trustworthy
        error = found.position[0] - AT
        assert np.linalg.norm(error) < 0.025
        assert error @ np.linalg.solve(found.covariance[0], error) < 16.3  # 1 in 1000
        assert found.details.position_noise == pytest.approx(slip, rel=0.25)


@pytest.mark.parametrize("method", ["pivot", "ml"])
def test_a_camera_that_shakes_on_an_orbit_is_found_and_covered(method):
    """By 0.3 mrad about each axis, 20 m away, which nobody tells: residuals passed for those of a wrong path, and six
    times the error was claimed. Four draws: the mean of their normalised squares within three standard deviations.
    """
    time = np.arange(0.0, 600.0, 2.0)
    com, R, squares = in_orbit(time), top(time, 0.3), []
    still = com[:, None] + OF_TOP @ np.swapaxes(R, 1, 2)
    for seed in range(4):
        rng = np.random.default_rng(seed)
        shaken = still + np.cross(3e-4 * rng.standard_normal((300, 1, 3)), still)
        position = shaken + 1e-3 * rng.standard_normal((300, 4, 3))
        found = estimate(FeatureTracks(time, position, tuple("abcd")), method=method, orbit=ORBIT.model())
        assert found.status.trustworthy
        error = found.position[150] - com[150]
        squares.append(error @ np.linalg.solve(found.covariance[150], error))
        # Two axes of three move what is seen; 900 values tell it to 2.4 %.
        shift = 3e-4 * np.linalg.norm(com, axis=1).mean() * np.sqrt(2 / 3)
        assert found.details.position_noise == pytest.approx(shift, rel=0.1)
        assert found.predicted_rmse < 2e-3
    assert np.mean(squares) < 3 + 3 * np.sqrt(6 / 4)


def test_slips_do_not_turn_a_body_that_hardly_nutates():
    """A top whose axis moves by 0.8°: its centre along that is told by 1.4 % of each frame's shift.

    Attitudes that follow the slips hang together with them: the centre was half a metre off, 7 standard deviations.
    Eight draws: the mean of their normalised squares within five standard deviations, the slip within four.
    """
    time, slip = np.arange(300.0), 0.008
    R, squares, slips = top(time, 0.014), [], []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        slipped = AT + slip * rng.standard_normal((300, 3))
        position = slipped[:, None] + OF_TOP @ np.swapaxes(R, 1, 2) + 1e-3 * rng.standard_normal((300, 4, 3))
        found = estimate(FeatureTracks(time, position, tuple("abcd")), options=PathOptions(trajectory="fixed"))
        error = found.position[0] - AT
        squares.append(error @ np.linalg.solve(found.covariance[0], error))
        slips.append(found.details.position_noise)
    assert np.mean(squares) < 3 + 5 * np.sqrt(6 / 8)
    assert np.mean(slips) == pytest.approx(slip, rel=4 / np.sqrt(2 * 900 * 8))


def test_of_many_frames_some_tell_how_much_a_camera_shakes():
    """12,000 frames, of which half are looked at: 18,000 values tell the deviation to 0.5 %; three times that."""
    time = 0.05 * np.arange(12_000.0)
    com, shift = at_rest(time), 5e-3
    rng = np.random.default_rng(1)
    moved = com + shift * rng.standard_normal(com.shape)
    R = top(time, 0.3)
    position = moved[:, None] + OF_TOP @ np.swapaxes(R, 1, 2) + 1e-3 * rng.standard_normal((12_000, 4, 3))
    body = Body(np.arange(4), np.arange(12_000), OF_TOP, R)
    found = position_slip((body,), Observations(position, np.ones((12_000, 4))), com, 1e-6, slow=False).variance
    assert np.sqrt(found) == pytest.approx(shift, rel=0.015)


@pytest.mark.parametrize(("shake", "slow", "believed"), [(5e-4, False, True), (2e-2, False, False), (2e-2, True, True)])
def test_no_camera_shakes_by_as_much_as_a_path_that_is_far_off_seems_to_show(shake, slow, believed):
    """A pivot may slip by any distance, but on an orbit it is the camera that shakes, rad, from frame to frame."""
    rng, frames = np.random.default_rng(11), 300
    R, com = Rotation.random(frames, random_state=11).as_matrix(), np.tile(AT, (frames, 1))
    deviation = shake * np.linalg.norm(AT)
    shifts = deviation * rng.standard_normal((frames, 3))
    position = com[:, None] + shifts[:, None] + np.einsum("kij,mj->kmi", R, OF_TOP)
    position += 1e-3 * rng.standard_normal(position.shape)
    body = Body(np.arange(4), np.arange(frames), OF_TOP, R)
    seen = Observations(position, np.ones((frames, 4)))
    found = LastingAndShared(1.0).slipping((body,), seen, com, 1e-6, slow=slow)
    # 900 values: 2.4 %, and more where they seem to last by chance.
    assert found.slip.deviation == pytest.approx(deviation if believed else 0.0, rel=0.25)

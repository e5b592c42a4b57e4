"""The joint by maximum likelihood: exact without noise, honest where skin keeps time with the motion; hinges."""

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from baryscope.estimator.geometry.alignment import align
from baryscope.estimator.joint import joint
from baryscope.estimator.joint.bodies import Pair
from baryscope.estimator.joint.ml import bent_slides, of_wrong_turns
from baryscope.estimator.joint.noise import bands, restricted_likelihood, transformed
from baryscope.estimator.tracks import FeatureTracks
from baryscope.scripts.examples.walking import walk
from baryscope.study.joints.judging import LABELS, judged
from baryscope.study.joints.recordings import recorded
from joints import SHAPE, TIME, recording


def of_the_average_markers(parent, child, centre):
    """The true centre in the child, as the child's markers had it on average."""
    body = Pair.of(parent, child).child
    return np.mean(np.einsum("kji,kj->ki", body.rotation, centre - body.place), axis=0)


def test_without_noise_the_centre_is_exact():
    parent, child, centre = recording(np.random.default_rng(1), 0.0, 0.0)
    found = joint(parent, child)
    np.testing.assert_allclose(found.position, centre, atol=1e-9)
    probe = FeatureTracks(TIME, child.position - centre[:, None] + [1.0, 2.0, 3.0], child.labels)
    np.testing.assert_allclose(joint(None, probe).in_parent, [1.0, 2.0, 3.0], atol=1e-9)


def test_the_covariance_is_honest_where_skin_lasts():
    """The mean NEES of 12 draws is near 3, with a standard deviation of sqrt(6 / 12) = 0.71, of which 3 are allowed."""
    nees, of_path = [], []
    for seed in range(12):
        parent, child, centre = recording(np.random.default_rng(seed), 0.003, 0.9)
        found = joint(parent, child)
        error = found.in_child - of_the_average_markers(parent, child, centre)
        nees.append(error @ np.linalg.solve(found.covariance[3:, 3:], error))
        off = found.position - centre
        of_path.append(np.mean(np.einsum("ki,kij,kj->k", off, np.linalg.inv(found.position_covariance), off)))
    assert 0.9 < np.mean(nees) < 5.1, np.mean(nees)
    assert 0.9 < np.mean(of_path) < 5.1, np.mean(of_path)  # of many times, which vary less than one


def test_attitudes_whose_noise_lasts_do_not_tell_where_the_centre_is():
    """Markers of the parent nearly in a line, and skin that moves each by itself for a while: attitudes are wrong by
    some 19° about the line, at the low frequencies of the motion. Taken for white, that noise seemed to tell of the
    centre: the mean NEES of these draws was 18, where it is 4 now; 3 would be true.
    """
    line = np.array([[-0.1, 0.0, 0.0], [-0.03, 0.004, 0.0], [0.04, -0.003, 0.003], [0.09, 0.0, -0.003]])
    nees = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        parent, child, centre = recording(rng, 0.0, 0.0)
        tracks = []
        for body, shape in ((parent, line), (child, SHAPE)):
            pose = align(body.position, SHAPE, np.ones(body.seen.shape))
            white = rng.normal(size=(900, 4, 3)) * 0.003 * np.sqrt(1 - 0.94**2)
            moving = shape + lfilter([1], [1, -0.94], white, axis=0)[300:]
            position = pose.translation[:, None] + np.einsum("kij,kmj->kmi", pose.rotation, moving)
            tracks.append(FeatureTracks(TIME, position, body.labels))
        found = joint(*tracks)
        error = found.in_child - of_the_average_markers(*tracks, centre[np.isin(TIME, found.time)])
        nees.append(error @ np.linalg.solve(found.covariance[3:, 3:], error))
    assert np.mean(nees) < 8, np.mean(nees)


def test_skin_and_noise_are_told_apart():
    """3 mm of lasting slide of each segment, of which both sides have theirs; 0.75 mm of white noise of each marker.

    Per coordinate, the markers' noise is that of two centroids of four, 0.53 mm, and of the attitudes on levers of
    0.37 m and 0.2 m: about 0.75 mm / 0.11 m / 2 of each component, two of which move a point, so 1.6 mm.
    """
    parent, child, _ = recording(np.random.default_rng(3), 0.003, 0.98)
    slide = joint(parent, child).slide
    assert 0.5 < slide.correlated / (0.003 * np.sqrt(2)) < 1.5
    assert slide.of_markers == pytest.approx(0.0017, rel=0.2)
    assert slide.white == pytest.approx(slide.of_markers, rel=0.4)
    assert slide.locked < slide.correlated


def test_a_slide_that_depends_on_the_angle_is_claimed():
    """Skin that moves by a random linear map of the joint's angles shifts the centre itself; both covariances know.

    The mean of NEES over 12 draws is 3 within 4 σ, 2.8; SCoRE's was four times that of `ml` without such skin's share.
    """
    nees = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        parent, child, centre = recording(rng, 0.0005, 0.0)
        body = Pair.of(parent, child)
        angles = Rotation.from_matrix(body.relative).as_rotvec()
        slide = (angles - angles.mean(axis=0)) @ (0.004 * rng.normal(size=(3, 3)))
        moved = child.position + np.einsum("kij,kj->ki", body.child.rotation, slide)[:, None]
        child = FeatureTracks(TIME, moved, child.labels)
        row = []
        for method in ("ml", "score"):
            found = joint(parent, child, method=method)
            error = found.in_child - of_the_average_markers(parent, child, centre)
            row.append(error @ np.linalg.solve(found.covariance[3:, 3:], error))
        nees.append(row)
    assert (np.mean(nees, axis=0) < 5.8).all(), np.mean(nees, axis=0)


def test_a_slide_that_depends_on_the_angle_is_claimed_on_a_hinge():
    """Along its axis the slides of both bodies look like one; across it each shifts the centre. Where what is seen was
    taken for one body's, three tenths of such centres were off by more than NEES 16, which is one of a thousand.
    """
    nees = [judged("hinge", "by angle", 1, draw, "ml")["nees"] for draw in range(20)]
    assert np.mean(np.array(nees) > chi2.ppf(0.999, 3)) < 0.08
    assert np.mean(nees) < 5


def test_markers_that_follow_the_angle_each_by_itself_leave_a_ball_a_ball():
    """The attitudes' errors follow the angle, too, and feign nothing beside the turn that they add to: taken for noise
    of its own, they feigned all that is known of the centre, and the claim was that of an unknown one, 0.54 m.

    Errors are some 12 mm. The mean NEES over 20 draws may be 3 + 4 √(6 / 20) if the claim is true: it was 6.3 where the
    slide that is of second order in the attitudes' errors of 0.1 rad counted as noise that does not know the motion.
    What of the markers' own errors is of second order was taken for noise of theirs, and the claim for 36 mm.
    """
    lines = [judged("circles", "by angle, each marker", 1, draw, "ml") for draw in range(20)]
    assert np.median([line["claimed"] for line in lines]) < 0.025
    assert np.mean([line["nees"] for line in lines]) < 3 + 4 * np.sqrt(6 / 20)


def test_wrong_attitudes_slide_in_second_order_as_much_as_turned_levers_do():
    """Rotations of scipy, wrong by K θ with 2000 random K, at 40 angles θ of 0.2 rad: of each lever's turn, what is not
    linear in the angles that wrong attitudes show. The third order, of 0.2 / 6 of the second, is 1e-3 of its square.
    Over the K the mean is within four of its own standard deviations, of 3 % each.
    """
    rng = np.random.default_rng(5)
    turned, levers = np.array([0.02, 0.01]), np.array([[0.3, 0.0, 0.1], [0.0, 0.2, 0.0]])
    squares = np.zeros((2000, 2))
    for found in squares:
        theta = rng.normal(size=(40, 3))
        theta *= 0.2 / np.linalg.norm(theta, axis=1, keepdims=True)
        wrong = [Rotation.from_rotvec(theta @ rng.normal(size=(3, 3)) * size / 0.2) for size in turned]
        shown = (wrong[0].inv() * Rotation.from_rotvec(theta) * wrong[1]).as_rotvec()
        for body, lever in enumerate(levers):
            slide = wrong[body].apply(lever) - lever
            left = slide - shown @ np.linalg.lstsq(shown, slide, rcond=None)[0]
            found[body] = np.sum(left**2) / (3 * (40 - 3))
    scatter = squares.std(axis=0) / np.sqrt(len(squares))
    expected = bent_slides(turned**2, np.sum(levers**2, axis=1))
    assert np.all(scatter < 0.05 * expected)
    assert np.all(np.abs(squares.mean(axis=0) - expected) < 4 * scatter), squares.mean(axis=0) / expected


def test_markers_that_follow_the_angle_each_by_itself_slide_as_much_as_they_tell():
    """The two sides of each body, of the true centre as its markers have it on average, in 40 recordings: the mean
    square over that of the functions of wrong attitudes is 1 on average, within four of its standard deviations. Only
    what is of second order was told, a hundredth.
    """
    ratios = []
    for draw in range(40):
        made = recorded("circles", "by angle, each marker", draw)
        pair = Pair.of(*(FeatureTracks(made.time, markers, LABELS) for markers in (made.parent, made.child)))
        for body, told in zip((pair.parent, pair.child), of_wrong_turns(pair), strict=True):
            centre = made.joint[np.isin(made.time, pair.time)]
            side = np.einsum("kji,kj->ki", body.rotation, centre - body.place)
            ratios.append(np.sum(np.var(side, axis=0)) / np.mean(np.sum(told**2, axis=(1, 2))))
    scatter = np.std(ratios) / np.sqrt(len(ratios))
    assert scatter < 0.15
    assert abs(np.mean(ratios) - 1) < 4 * scatter, np.mean(ratios)


def test_the_axis_of_a_hinge_is_claimed_where_markers_follow_its_angle():
    """Skin that turns the markers in time with the hinge tilts the axis, by tens of degrees here, and leaves the bodies
    turning about one axis all the same: 17 of 20 were off by more than 13.8, which is one in a thousand by χ² of two
    degrees of freedom. The size of such turns hangs on few squares: 2 of 20 are allowed, and a median of 1.39 within
    4 σ: 4 √(0.25 / 20) of probability from a half, 0.05 to 0.95 of χ² at most.
    """
    lines = [judged("hinge", "by angle, each marker", 1, draw, "ml") for draw in range(20)]
    nees = np.array([line["axis_nees"] for line in lines if "axis_nees" in line])
    assert len(nees) > 15
    assert np.sum(nees > chi2.ppf(0.999, 2)) <= 2, nees
    assert chi2.ppf(0.05, 2) < np.median(nees) < chi2.ppf(0.95, 2)


def test_the_axis_of_a_hinge_is_found():
    """The axis is x of the child, and turns with it: off by less than χ² of two degrees of freedom is in 1e-4, 18.4."""
    for seed in range(6):
        parent, child, _ = recording(np.random.default_rng(seed), 0.002, 0.5, hinge=True)
        found = joint(parent, child)
        assert found.hinge
        to_truth = align(SHAPE[None], found.child_markers, np.ones((1, 4))).rotation[0]
        axis = to_truth @ found.hinge_axis.in_child
        covariance = to_truth @ found.hinge_axis.covariance_in_child @ to_truth.T
        error = axis[1:] * np.sign(axis[0])
        assert error @ np.linalg.solve(covariance[1:, 1:], error) < 18.4
        assert np.sqrt(np.linalg.eigvalsh(covariance)[-1]) < np.deg2rad(1)
    ball, other, _ = recording(np.random.default_rng(1), 0.002, 0.5)
    assert joint(ball, other).hinge_axis is None


def test_a_knee_is_a_hinge_and_a_hip_is_none():
    """Of the example's trial, whose knee turns by 1° about the shank besides."""
    trial = walk()
    pelvis, thigh, shank = (
        FeatureTracks(trial.time, trial.markers[:, k : k + 4], trial.labels[k : k + 4]) for k in (0, 4, 8)
    )
    assert not joint(pelvis, thigh).hinge
    knee = joint(thigh, shank)
    assert knee.hinge
    assert np.rad2deg(knee.hinge_axis.residual) < 1.5


def test_oscillating_noise_widens_what_it_masks():
    """Two unknowns in noise of second order: normalised squares of 80 draws have the mean 2 within 4 σ, which is 0.9.

    The second is at the frequency at which the noise rings, where its spectrum is 20 times that at the first one's.
    That is smoothed over a band, so that some more is allowed above.
    """
    t = np.arange(900) / 50.0
    waves = [np.sin(2 * np.pi * rate * t + np.arange(3)[:, None]).T for rate in (0.5, 1.5)]
    damping, turn = np.exp(-2 * np.pi * 1.5 * 0.1 / 50), 2 * np.pi * 1.5 / 50
    squares, widths = [], []
    for seed in range(80):
        white = np.random.default_rng(seed).normal(size=(1800, 3))
        noise = lfilter([1], [1, -2 * damping * np.cos(turn), damping**2], white, axis=0)[-900:]
        fit = restricted_likelihood(np.stack(waves, axis=2), noise, [], np.arange(900))
        squares.append(fit.found @ np.linalg.solve(fit.covariance, fit.found))
        widths.append(np.sqrt(np.diag(fit.covariance)))
    assert 1.1 < np.mean(squares) < 3.5, np.mean(squares)
    slow, ringing = np.median(widths, axis=0)
    assert 2 < ringing / slow < 6


def test_the_restricted_likelihood():
    """Without functions it is −½ (ln det S + ln det FᵀS⁻¹F + rᵀS⁻¹r), S the spectrum and r the residuals."""
    rng = np.random.default_rng(3)
    design, wanted, kept = rng.normal(size=(50, 3, 4)), rng.normal(size=(50, 3)), np.arange(40)
    fit = restricted_likelihood(design, wanted, [], kept)
    F, b = transformed(design)[kept].reshape(-1, 4), transformed(wanted)[kept].ravel()
    variance = np.repeat(fit.spectrum, 3)
    normal = F.T @ (F / variance[:, None])
    left = b - F @ np.linalg.solve(normal, F.T @ (b / variance))
    expected = np.log(variance).sum() + np.linalg.slogdet(normal)[1] + np.sum(left**2 / variance)
    assert fit.likelihood == pytest.approx(-expected / 2, rel=1e-9)


def test_a_variance_that_hangs_on_few_functions_is_not_believed():
    """Two functions with coefficients of one variance: one the unknown explains as well, the other tells the variance.

    The ratio of two normal variates is Cauchy's: beyond three deviations of the likeliest variance are
    1 − 2 atan(3)/π = 20 % of the errors, 41 ± 6 of 200. With the variance's posterior it is a third of that at most.
    """
    t = np.arange(400) / 50.0
    hidden, shown = np.sin(2 * np.pi * 0.5 * t), np.cos(2 * np.pi * 0.9 * t)
    functions, beyond = np.stack([hidden, shown], axis=1)[:, None, :], 0
    for seed in range(200):
        rng = np.random.default_rng(seed)
        wanted = functions[:, 0] @ rng.normal(size=2) + 0.001 * rng.normal(size=400)
        fit = restricted_likelihood(hidden[:, None, None], wanted[:, None], [functions], np.arange(400))
        fit = fit.over_variances(10.0)
        beyond += abs(fit.found[0]) > 3 * np.sqrt(fit.covariance[0, 0])
    assert beyond < 41 / 3


@pytest.mark.parametrize("count", [1, 2, 3, 4, 7, 100, 5001])
def test_bands_cover_all_coefficients(count):
    ends = bands(count)
    assert ends[0] == 0
    assert ends[-1] == count
    assert (np.diff(ends) >= min(3, count)).all()

"""Spurious information against its definition, and against random near-spins from an own simulation."""

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from baryscope.estimator.adjustment.attitude_noise import Departures, departures_of
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.spurious import (
    FRAMES,
    NoisyAttitudes,
    OffsetPrior,
    SpuriousInformation,
    implausible_columns,
    spurious_information_columns,
    untold_decrease,
)
from baryscope.estimator.paths.path import Polynomial
from baryscope.estimator.pivot.free_attitudes import gauss_newton_step
from baryscope.estimator.registration.body import Body
from synthetic import attitude


def exact(information):
    return SpuriousInformation(information, np.zeros_like(information))


def test_a_bound_of_three_deviations_holds_and_is_no_wider():
    """Against χ²: a mean square of so many values is above it as seldom as their law says, to a seventh of that."""
    rng = np.random.default_rng(7)
    for values in (20, 100):
        found = SpuriousInformation.of(np.eye(1), values)
        above = np.mean(np.mean(rng.normal(size=(100_000, values)) ** 2, axis=1) > found.likely[0, 0])
        assert above == pytest.approx(chi2.sf(values * (1 + 3 * np.sqrt(2 / values)), values), rel=0.15)
        joined = SpuriousInformation.of_each([found, found.scaled(2.0)]) + exact(np.eye(2))
        np.testing.assert_allclose(joined.likely, np.diag([1 + found.likely[0, 0], 1 + 2 * found.likely[0, 0]]))


def test_variance_of_an_estimating_equation():
    """Against (I − S)⁻¹ I (I − S)⁻¹ of the offset, and against the regression of the other unknowns on it."""
    rng = np.random.default_rng(0)
    factor = rng.normal(size=(7, 7))
    joint = factor @ factor.T
    offset, crossed, others = joint[:3, :3], joint[:3, 3:], joint[3:, 3:]
    information = np.linalg.inv(offset)
    values, axes = np.linalg.eigh(information)
    spurious = (axes * (values * [0.9, 0.5, 0.0])) @ axes.T
    left = np.linalg.inv(information - spurious)
    expected = left @ information @ left
    columns, gain = spurious_information_columns(offset, crossed, exact(spurious), 1e-9)
    np.testing.assert_allclose(offset + columns @ columns.T, expected, rtol=1e-9, atol=1e-9)
    regression = crossed.T @ information
    expected_others = others + regression @ (expected - offset) @ regression.T
    np.testing.assert_allclose(others + gain @ gain.T, expected_others, rtol=1e-9, atol=1e-9)
    expected_crossed = crossed + (expected - offset) @ regression.T
    np.testing.assert_allclose(crossed + columns @ gain.T, expected_crossed, rtol=1e-9, atol=1e-9)


def test_spurious_information_along_other_axes_than_the_information():
    """Against the same formula, for two offsets and a spurious information with axes of its own."""
    rng = np.random.default_rng(1)
    factor, other = rng.normal(size=(6, 6)), rng.normal(size=(6, 6))
    offset, spurious = factor @ factor.T, other @ other.T
    spurious *= 0.8 / np.linalg.eigvals(offset @ spurious).real.max()
    columns, _ = spurious_information_columns(offset, np.zeros((6, 1)), exact(spurious), 1e-9)
    left = np.linalg.inv(np.linalg.inv(offset) - spurious)
    np.testing.assert_allclose(offset + columns @ columns.T, left @ np.linalg.inv(offset) @ left, rtol=1e-8, atol=1e-8)


def test_the_margin_is_that_of_the_frames_which_give_most():
    """Forty frames that see the same; one of them may have only three features, nearly in a line."""
    time = np.linspace(0.0, 60.0, 40)
    R = attitude(np.diag([1.0, 2.0, 2.5]), np.array([0.05, 0.0, 0.07]), time)
    points = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.1, 0.02, 0.0], [0.0, 0.0, 1.0]])
    position, weight = points @ np.swapaxes(R, 1, 2), np.ones((40, 4))
    factors = []
    for _ in range(2):
        noisy = NoisyAttitudes.of(
            Body(np.arange(4), np.arange(40), points, R), Observations(position, weight), np.zeros((40, 3)), 1e-8
        )
        found = noisy.spurious_information()
        factors.append(np.diag(found.deviation / found.mean))
        weight[7, 3] = 0.0
    np.testing.assert_allclose(factors[0], np.sqrt(2 / 40))
    np.testing.assert_allclose(factors[1], np.sqrt(2), rtol=0.12)


def test_frames_that_are_passed_over_count_as_those_that_are_looked_at():
    """Of a body that does not turn every frame gives the same: the sum is that of one times their number, and so is
    how many values it has.
    """
    count, points = 2 * FRAMES + 2, np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    found = []
    for frames in (count, 1):
        body = Body(np.arange(3), np.arange(frames), points, np.tile(np.eye(3), (frames, 1, 1)))
        observations = Observations(np.tile(points, (frames, 1, 1)), np.ones((frames, 3)))
        noisy = NoisyAttitudes.of(body, observations, np.zeros((frames, 3)), 1e-8)
        assert len(noisy.frames) == min(frames, count // 2)
        found.append(noisy.spurious_information())
    many, one = found
    np.testing.assert_allclose(many.mean, count * one.mean)
    np.testing.assert_allclose(many.deviation, np.sqrt(2 / count) * many.mean)


def face_on(seed):
    """Five features of a face that turns about the line of sight, 5 cm before the centre of mass, with noise of 3 mm
    across it and 12 cm along it: body with attitudes by scipy's least squares, its observations, times, and the errors
    φ (n, 3) of the attitudes.
    """
    rng, time = np.random.default_rng(seed), np.arange(200.0)
    true, deviation = Rotation.from_rotvec(0.05 * time[:, None] * np.array([0.0, 0, 1])), np.array([0.003, 0.003, 0.12])
    points = np.c_[rng.uniform(-1, 1, (5, 2)), np.full(5, -0.05)]
    position = points @ np.swapaxes(true.as_matrix(), 1, 2) + deviation * rng.normal(size=(200, 5, 3))

    def error(seen, turn):
        return least_squares(
            lambda phi: (((turn * Rotation.from_rotvec(phi)).apply(points) - seen) / deviation).ravel(), np.zeros(3)
        ).x

    turned = np.array([error(*one) for one in zip(position, true, strict=True)])
    body = Body(np.arange(5), np.arange(200), points, (true * Rotation.from_rotvec(turned)).as_matrix())
    precision = np.broadcast_to(np.diag(deviation**-2), (200, 5, 3, 3))
    return body, Observations(position, np.ones((200, 5)), precision), time, turned


@pytest.mark.parametrize("seed", range(2))
def test_departures_show_spurious_information_that_covariances_of_tilted_attitudes_hide(seed):
    """Against Σ (φ × e)ᵀ Q (φ × e) of the true errors φ: 0.35 to 0.53 of it was expected.

    Fits to a dozen neighbours add a fifth of the variance of φ, which is known, and their products with φ, of which
    some 60 frames give most: 2 √(0.2 / 120) of the sum, 8 %, and 20 % are two and a half deviations.
    """
    body, observations, time, turned = face_on(seed)
    noisy = NoisyAttitudes.of(body, observations, np.zeros((200, 3)), 1.0)
    moved = np.cross(turned, [0.0, 0, 1])
    true = np.einsum("ki,kij,kj->", moved, noisy.known, moved)
    found = noisy.shown_information(departures_of(body, observations, time, 1.0))
    assert found.mean[2, 2] == pytest.approx(true, rel=0.2)
    assert noisy.spurious_information().mean[2, 2] < 0.6 * true
    untested = noisy.shown_information(Departures.none_of(200))
    np.testing.assert_allclose(untested.mean, noisy.spurious_information().mean)


def test_products_of_errors_against_random_ones():
    """The gradient's covariance against that of 20,000 draws of attitude errors and errors of the offset.

    An element of a covariance from n draws has a relative standard deviation of √(2/n), and of about √(8/n) where each
    value is a product of two: 2 %.
    """
    rng = np.random.default_rng(4)
    time, noise = np.linspace(0.0, 60.0, 6), 0.05
    R = attitude(np.diag([1.0, 2.0, 2.5]), np.array([0.05, 0.0, 0.07]), time)
    points, x = rng.normal(size=(4, 3)), np.array([4.0, -19, 3, 0, 0, 0])
    sampled = Polynomial(1, 0.0, 60.0).at(time)
    position = sampled.position(x)[:, None] + points @ np.swapaxes(R, 1, 2)
    body, weight = Body(np.arange(4), np.arange(6), points, R), np.ones((6, 4))
    factor = rng.normal(size=(3, 3))
    noisy = NoisyAttitudes.of(body, Observations(position, weight), sampled.position(x), noise**2)
    found = noisy.product_gradient(sampled, factor @ factor.T)
    squares = np.sum(points**2) * np.eye(3) - points.T @ points  # Σ [b]× [b]×ᵀ
    mean = points.mean(axis=0)
    known = 4 * np.eye(3) - 16 * _cross(mean).T @ np.linalg.inv(squares) @ _cross(mean)
    draws = 20_000
    turn = noise * rng.normal(size=(draws, 6, 3)) @ np.linalg.cholesky(np.linalg.inv(squares)).T
    pulled = np.cross(turn, (rng.normal(size=(draws, 1, 3)) @ factor.T)) @ known
    by_x = np.einsum("nki,kji,kjp->np", pulled, R, sampled.jacobian)
    gradient = np.concatenate([pulled.sum(axis=1), by_x], axis=1)
    scale = np.sqrt(np.diag(found))
    np.testing.assert_allclose(
        np.cov(gradient.T, bias=True) / np.outer(scale, scale), found / np.outer(scale, scale), atol=5 * 0.02
    )


def _cross(vector):
    return np.cross(np.eye(3), -vector)


def test_a_direction_without_information_gets_the_least():
    offset = np.diag([1.0, 1.0, 4.0])
    columns, _ = spurious_information_columns(offset, np.zeros((3, 1)), exact(np.diag([0.0, 0.0, 0.3])), 1e-4)
    np.testing.assert_allclose(np.diag(offset + columns @ columns.T), [1.0, 1.0, 1e4])


@pytest.mark.parametrize("uncertain", [0.0, 0.2])
@pytest.mark.parametrize("firmer", [1.0, 3.0])
def test_with_a_prior_errors_are_as_claimed_where_spurious_information_is_uncertain(uncertain, firmer):
    """Against draws: of offsets of the prior, of a slope I − S with S uncertain, and of a gradient with the noise of I.

    What holds the offset need not be the best.
    """
    information, known = np.array([50.0, 80.0, 300.0]), 0.4
    spurious = np.array([0.0, 0.5, 0.97]) * information
    left = information - spurious
    deviation = uncertain * left
    held = firmer * known * information / left
    prior = OffsetPrior(known * np.eye(3), np.diag(held))
    feigned = SpuriousInformation(np.diag(spurious), np.diag(deviation))
    offset = np.diag(1 / (information + held))
    columns, _ = spurious_information_columns(offset, np.zeros((3, 1)), feigned, known / 2, prior)
    rng, draws = np.random.default_rng(0), (100_000, 3)
    true = rng.normal(size=draws) / np.sqrt(known)
    slope = left + deviation * rng.normal(size=draws)
    found = (slope * true + np.sqrt(information) * rng.normal(size=draws)) / (slope + held)
    squares = np.mean((found - true) ** 2, axis=0)
    # 100,000 squares have their mean to 0.5 %, three nodes that of so uncertain a slope to a few.
    np.testing.assert_allclose(np.diag(offset + columns @ columns.T), squares, rtol=0.05, atol=0.0)


def test_with_a_prior_what_is_told_may_be_nothing_as_in_a_spin():
    """Against draws: one in five is a spin, of the others anything of the information is as likely told; of these such
    as seem to be told 1, 2.5 and 4 deviations, to a tenth of one. The least information bounds the variance.
    """
    information, known, least, deviation = 100.0, 0.4, 0.2, 7.0
    seeming = np.array([1.0, 2.5, 4.0]) * deviation
    prior = OffsetPrior(known * np.eye(3), known * np.eye(3))
    feigned = SpuriousInformation(np.diag(information - seeming), deviation * np.eye(3))
    offset = np.eye(3) / (information + known)
    columns, _ = spurious_information_columns(offset, np.zeros((3, 1)), feigned, least, prior)
    rng, draws = np.random.default_rng(0), 2_000_000
    told = np.where(rng.random(draws) < 0.2, 0.0, information * rng.random(draws))
    seen = told + deviation * rng.normal(size=draws)
    squares = np.minimum((known + information) / (told + known) ** 2, 1 / least)
    near = (np.abs(seen - one) < 0.1 * deviation for one in seeming)
    # 1,500 draws or more have such a mean to 7 % at most; three nodes stand for those that are no spin.
    np.testing.assert_allclose(
        np.diag(offset + columns @ columns.T), [squares[one].mean() for one in near], rtol=0.25, atol=0.0
    )


def test_a_step_counts_where_the_tracks_tell_and_not_where_noise_leads():
    """The third is spurious by more than its information: a step of 1 m there is one of a hundredth of a deviation."""
    offset, spurious = np.diag([1.0, 1.0, 4.0]), exact(np.diag([0.0, 0.5, 0.3]))
    assert untold_decrease(np.array([0.0, 0.0, 1.0]), offset, spurious, 1e-4) == pytest.approx(1 / 4 - 1e-4)
    assert untold_decrease(np.array([3.0, 4.0, 0.0]), offset, spurious, 1e-4) == 0


NEAR_SPINS = {"noisy": (0.1, 0.1), "mostly spurious": (0.1, 0.05), "20 cm at 1 m": (0.2, 0.2)}  # noise in m, wobble


@pytest.mark.parametrize("kind", NEAR_SPINS)
def test_near_spins_have_errors_as_claimed(kind):
    """A wobbling spin, a third to four fifths of whose information along the axis is noise of the attitudes."""
    noise, wobble = NEAR_SPINS[kind]
    time = np.linspace(0.0, 270.0, 100)
    R = attitude(np.diag([1.0, 2.0, 2.5]), np.array([0.07 * wobble, 0.0, 0.07]), time)
    points = np.random.default_rng(3).normal(size=(4, 3))
    points = points / np.sqrt((points**2).sum() / 4) + 0.5
    sampled = Polynomial(1, 0.0, 270.0).at(time)
    squares, shares = [], []
    for seed in range(24):
        x = np.array([4.0, -19, 3, 0, 0, 0])
        position = sampled.position(x)[:, None] + points @ np.swapaxes(R, 1, 2)
        position += noise * np.random.default_rng(seed).normal(size=position.shape)
        observations = Observations(position, np.ones(position.shape[:2]))
        bodies = (Body(np.arange(4), np.arange(100), points, R),)
        for _ in range(60):
            found = gauss_newton_step(bodies, observations, sampled, x)
            bodies, x = found.bodies, found.x
            if found.decrease < 1e-3 * noise**2:
                break
        own = NoisyAttitudes.of(bodies[0], observations, sampled.position(x), noise**2).spurious_information()
        shares.append(np.linalg.eigvals(found.offset_covariance @ own.mean).real.max())
        columns, _ = spurious_information_columns(found.offset_covariance, found.offset_path, own, noise**2 / 20**2)
        covariance = noise**2 * (found.offset_covariance + columns @ columns.T)
        centred = bodies[0].points - bodies[0].points.mean(axis=0)
        turn = Rotation.align_vectors(centred, points - points.mean(axis=0))[0]
        error = bodies[0].points.mean(axis=0) - turn.apply(points.mean(axis=0))
        squares.append(error @ np.linalg.solve(covariance, error))
    assert 0.25 < np.median(shares) < 0.9
    # The margin of three standard deviations is on the safe side, so there is no lower bound.
    assert np.mean(squares) < chi2.ppf(0.999, 3 * 24) / 24


def test_a_centre_of_mass_far_from_its_features_is_as_uncertain_as_it_is_far():
    """Of two bodies of one metre, the second is 100 m away: its offset and the path that follows it get 100 m."""
    near = np.array([[1.0, 0, 0], [-1.0, 0, 0], [0, 1.0, 0]])
    offset = np.diag(np.full(6, 1e-4))
    crossed = -np.vstack([np.zeros((3, 3)), 1e-4 * np.eye(3)])  # the path moves against the second offset
    far = near + np.array([0, 0, 100.0])
    columns, of_path = implausible_columns([near, far], offset, crossed)
    assert columns[:3] == pytest.approx(np.zeros((3, 3)))
    assert columns[3:] @ columns[3:].T == pytest.approx(1e4 * np.eye(3), rel=1e-3)
    assert of_path == pytest.approx(-columns[3:])
    assert implausible_columns([near], offset[:3, :3], crossed[:3])[0].size == 0

"""The linear drifting pivot: exact without noise; its weights agree with the variance of many draws."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.geometry.alignment import align
from baryscope.estimator.paths.path import Polynomial
from baryscope.estimator.paths.prior import Prior
from baryscope.estimator.paths.relative_motion import RelativeOrbit
from baryscope.estimator.pivot.drift import drift_equations, frame_roots
from baryscope.estimator.pivot.offset_prior import RADII, radius_of_many
from baryscope.estimator.registration.body import Body
from baryscope.estimator.registration.clusters import Registered
from synthetic import Orbit

OFFSETS = np.array([[3.0, -1, 0.5], [-2.0, 0.3, 4]])


def registered(frames, offset, origin, seed):
    """A body in some frames, whose origin is `offset` from the centre of mass, and the origin in C in these frames."""
    attitude = Rotation.random(len(frames), random_state=seed).as_matrix()
    points = np.random.default_rng(seed).normal(size=(4, 3))
    translation = origin[frames] + attitude @ offset
    return Body(np.arange(4), frames, points - points.mean(axis=0), attitude), translation


@pytest.mark.parametrize("kind", ["fixed", "polynomial:3", "relative-orbit"])
def test_exact_without_noise_for_any_weights(kind):
    time = np.linspace(0.0, 3000.0, 60)
    orbit = Orbit(eccentricity=0.1).model()
    path = {
        "fixed": Polynomial(0, 0.0, 3000.0),
        "polynomial:3": Polynomial(3, 0.0, 3000.0),
        "relative-orbit": RelativeOrbit(orbit, 1500.0),
    }[kind]
    x = np.random.default_rng(0).normal(size=path.size) * 5
    sampled = path.at(time)
    # Computed with the Jacobian, as relative motion is linear only for small distances.
    origin = sampled.jacobian @ x
    bodies, origins = zip(
        *(
            registered(frames, offset, origin, seed)
            for seed, (frames, offset) in enumerate(zip((np.arange(0, 25), np.arange(30, 60)), OFFSETS, strict=True))
        ),
        strict=True,
    )
    roots = [np.random.default_rng(1).uniform(0.3, 3, len(body.frames)) for body in bodies]
    found = drift_equations(Registered(bodies, origins, 0.0), roots, sampled, 0.0).solved(Prior.none(sampled.size))
    np.testing.assert_allclose(found.x, x, atol=1e-8)
    np.testing.assert_allclose(found.offsets, OFFSETS, atol=1e-8)


def test_agrees_with_numpys_least_squares():
    time = np.linspace(0.0, 100.0, 40)
    sampled = Polynomial(1, 0.0, 100.0).at(time)
    rng = np.random.default_rng(0)
    origin = sampled.position(rng.normal(size=6)) + 0.1 * rng.normal(size=(40, 3))
    body, translation = registered(np.arange(40), OFFSETS[0], origin, 3)
    rows = np.concatenate([body.attitude, sampled.jacobian, translation[:, :, None]], axis=2)
    alike, all_axes = rng.uniform(0.3, 3, 40), rng.normal(size=(40, 3, 3))
    for root, weighted in ((alike, alike[:, None, None] * rows), (all_axes, all_axes @ rows)):
        *_, wanted = flat = weighted.reshape(120, -1).T
        expected = np.linalg.lstsq(flat[:-1].T, wanted, rcond=None)[0]
        equations = drift_equations(Registered((body,), (translation,), 0.0), [root], sampled, 0.0)
        found = equations.solved(Prior.none(sampled.size))
        np.testing.assert_allclose(found.offsets[0], expected[:3], atol=1e-9)
        np.testing.assert_allclose(found.x, expected[3:], atol=1e-9)


def test_the_prior_of_the_offsets_is_as_many_further_observations():
    """Against numpy's least squares with rows of deviation RADII times the features' radius, for noise of 0.3 m."""
    sampled, noise = Polynomial(1, 0.0, 100.0).at(np.linspace(0.0, 100.0, 5)), 0.3
    body, translation = registered(np.arange(5), OFFSETS[0], sampled.position(np.arange(6.0)), 3)
    rows = np.concatenate([body.attitude, sampled.jacobian, translation[:, :, None]], axis=2).reshape(15, -1)
    prior = np.zeros((3, 10))
    prior[:, :3] = noise / (RADII * radius_of_many(body.points)) * np.eye(3)
    both = np.concatenate([rows, prior])
    expected = np.linalg.lstsq(both[:, :-1], both[:, -1], rcond=None)[0]
    equations = drift_equations(Registered((body,), (translation,), noise), [np.ones(5)], sampled, noise)
    found = equations.solved(Prior.none(sampled.size))
    np.testing.assert_allclose(found.offsets[0], expected[:3], atol=1e-9)
    np.testing.assert_allclose(found.x, expected[3:], atol=1e-9)


@pytest.mark.parametrize("offset", [[0.0, 0, 0], [1.0, -2, 0.5], [30.0, 0, 10]])
@pytest.mark.parametrize("weight", [[1.0, 1, 1, 1, 1], [1.0, 1, 1, 0, 0], [4.0, 1, 1, 0.25, 1]])
def test_weight_of_a_frame_is_the_inverse_variance_of_its_pivot(offset, weight):
    """c − R d of 20,000 noisy alignments: the relative error of their variance is at most √(2/20,000) = 1 %."""
    draws, noise = 20_000, 1e-3
    rng = np.random.default_rng(0)
    points = np.array([[2.0, 0, 0], [0, 1.5, 0], [0, 0, 1], [-1, -1, 2], [0.5, -0.5, -3]])
    points = points - points.mean(axis=0)
    weight = np.array(weight)
    deviation = noise / np.sqrt(np.where(weight > 0, weight, 1.0))
    seen = points + deviation[:, None] * rng.normal(size=(draws, 5, 3))
    fitted = align(seen, points, np.tile(weight, (draws, 1)))
    pivot = fitted.translation - fitted.rotation @ np.array(offset)
    variance = np.var(pivot, axis=0).mean() / noise**2
    body = Body(np.arange(5), np.zeros(1, dtype=int), points, np.eye(3)[None])
    observations = Observations(np.zeros((1, 5, 3)), weight[None])
    found = frame_roots((body,), observations, (np.array(offset),))
    assert found[0][0] ** -2 == pytest.approx(variance, rel=0.05)
    with_precisions = Observations(np.zeros((1, 5, 3)), weight[None], np.broadcast_to(np.eye(3), (1, 5, 3, 3)))
    (root,) = frame_roots((body,), with_precisions, (np.array(offset),))[0]
    np.testing.assert_allclose(np.linalg.inv(root.T @ root), np.cov(pivot.T) / noise**2, atol=0.1 * variance)

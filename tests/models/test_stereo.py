"""The stereo rig: closed forms, a plain numpy triangulation, and the statistics of many draws."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from baryscope.models.scenario import Sensor, StereoRig, Tracking, load_scenario
from baryscope.models.sensor.directions import axes_along
from baryscope.models.sensor.tracking import observation_covariance, observe
from baryscope.models.stereo import project, triangulate

RIG = StereoRig(focal_length=1911.0, baseline=1.0, pixel_noise=0.5)
BASE = load_scenario("cubesat-class")
COUNT = len(BASE.features.points)
FRAMES = 20_000
SIGMAS = 5.0  # a statistic may be off by so many of its own standard deviations
TARGET = 20.0 * np.array([0.48, -0.6, 0.64])


def scenario(rig=RIG, **sensor):
    return BASE.model_copy(update={"tracking": Tracking(), "sensor": Sensor(stereo=rig, **sensor)})


def measured(flown, point, frames=FRAMES, **truth):
    """Observe all features at one point that stands still, the target at TARGET."""
    features = np.broadcast_to(point, (frames, COUNT, 3))
    target = np.broadcast_to(TARGET, (frames, 3))
    normals = np.broadcast_to(-TARGET / 20, features.shape)
    return observe(flown, np.arange(float(frames)), features, normals, target_C=target, **truth)


def true_covariance(flown, point):
    return observation_covariance(flown, np.reshape(point, (1, 1, 3)), TARGET[None])[0, 0]


def test_pixels():
    """At (2, −1, 10) m with f = 1911 px, B = 1 m: f X/Z = 382.2, f Y/Z = −191.1, f (X − B)/Z = 191.1."""
    R_C_V = axes_along(TARGET[None])
    point_C = R_C_V[0] @ [2.0, -1.0, 10.0]
    np.testing.assert_allclose(project(RIG, R_C_V, point_C[None, None])[0, 0], [382.2, -191.1, 191.1], rtol=1e-12)


@given(
    direction=st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda d: np.linalg.norm(d) > 0.1),
    point=st.tuples(st.floats(-20, 20), st.floats(-20, 20), st.floats(1, 50)),
)
def test_without_noise_the_point_is_found_again(direction, point):
    R_C_V = axes_along(np.array([direction]))
    point_C = (R_C_V[0] @ point)[None, None]
    found, covariance = triangulate(RIG, R_C_V, project(RIG, R_C_V, point_C))
    np.testing.assert_allclose(found, point_C, atol=1e-10)
    np.testing.assert_array_equal(covariance[0, 0], covariance[0, 0].T)


@pytest.mark.parametrize("distance", [10.0, 20.0, 40.0])
def test_covariance_on_the_boresight(distance):
    """σ_X = σ_Y = Z σ/f, σ_Z = Z² √2 σ/(f B), and X shares with Z the noise of the left image: −Z³ σ²/(f² B)."""
    f, B, s, Z = 1911.0, 1.0, 0.5, distance
    R = axes_along(TARGET[None])[0]
    across, along, shared = (Z * s / f) ** 2, 2 * (Z**2 * s / (f * B)) ** 2, -(Z**3) * s**2 / (f**2 * B)
    expected_V = [[across, 0, shared], [0, across, 0], [shared, 0, along]]
    found = true_covariance(scenario(), Z * TARGET / 20)
    np.testing.assert_allclose(R.T @ found @ R, expected_V, atol=1e-12 * along)


def test_the_rig_of_reference():
    """0.15 m along, 5.2 mm across at 20 m: 28 to 1."""
    R = axes_along(TARGET[None])[0]
    across, _, along = np.sqrt(np.diag(R.T @ true_covariance(scenario(), TARGET) @ R))
    assert along == pytest.approx(0.148, abs=0.0005)
    assert along / across == pytest.approx(28.28, abs=0.01)


@given(point=st.tuples(st.floats(-10, 10), st.floats(-10, 10), st.floats(5, 40)))
def test_covariance_off_the_boresight(point):
    """Central differences of a triangulation written here."""

    def triangulated(pixels):
        u_l, v_l, u_r = pixels
        Z = 1911.0 / (u_l - u_r)
        return np.array([Z * u_l / 1911.0, Z * v_l / 1911.0, Z])

    x, y, z = point
    pixels, step = 1911.0 / z * np.array([x, y, x - 1.0]), 1e-3
    J = np.stack([(triangulated(pixels + h) - triangulated(pixels - h)) / (2 * step) for h in step * np.eye(3)], axis=1)
    R = axes_along(TARGET[None])[0]
    found = R.T @ true_covariance(scenario(), R @ point) @ R
    np.testing.assert_allclose(found, 0.25 * J @ J.T, atol=1e-6 * np.abs(found).max())


def test_many_draws():
    """Sample covariance against the true one, and the mean range against its bias of second order, Z (σ_d/d)²."""
    point = TARGET + np.array([2.0, 1.0, -1.5])
    observations = measured(scenario(), point).position.reshape(-1, 3)
    whitened = np.linalg.solve(np.linalg.cholesky(true_covariance(scenario(), point)), (observations - point).T)
    n = len(observations)
    np.testing.assert_allclose(np.cov(whitened), np.eye(3), atol=SIGMAS * np.sqrt(2 / n))
    boresight = TARGET / 20
    range_, ranges = point @ boresight, observations @ boresight
    bias = range_ * (np.sqrt(0.5) / (1911.0 / range_)) ** 2
    assert ranges.mean() - range_ == pytest.approx(bias, abs=SIGMAS * ranges.std() / np.sqrt(n))


def test_the_covariance_that_is_reported_is_that_at_the_point_measured():
    """σ_Z² = 2 (Z² σ/(f B))² with the Z that was measured, and elsewhere as at that point."""
    seen = measured(scenario(), TARGET + np.array([1.0, -2.0, 0.5]), frames=50)
    boresight = TARGET / 20
    along = np.einsum("i,nmij,j->nm", boresight, seen.covariance, boresight)
    np.testing.assert_allclose(along, 2 * ((seen.position @ boresight) ** 2 * 0.5 / 1911.0) ** 2, rtol=1e-10)
    target = np.broadcast_to(TARGET, (50, 3))
    np.testing.assert_allclose(seen.covariance, observation_covariance(scenario(), seen.position, target), rtol=1e-9)


def test_what_is_behind_the_rig_or_without_disparity_is_not_seen():
    assert not measured(scenario(), -TARGET, frames=100).seen.any()
    assert not measured(scenario(), [0.0, 0.0, 0.0], frames=100).seen.any()
    narrow = StereoRig(focal_length=1911.0, baseline=0.01, pixel_noise=0.5)
    far = measured(scenario(narrow), 50 * TARGET)  # DEEPEST: half of them, 0.019 px of disparity and 0.7 px of noise
    assert far.seen.mean() == pytest.approx(0.5, abs=SIGMAS * 0.5 / np.sqrt(far.seen.size))
    np.testing.assert_array_equal(far.seen, np.isfinite(far.position).all(axis=2))
    np.testing.assert_array_equal(far.seen, np.isfinite(far.covariance).all(axis=(2, 3)))
    assert np.all(far.position[far.seen] @ TARGET > 0)
    assert np.isnan(true_covariance(scenario(), -TARGET)).all()


def test_images_have_edges():
    """At 10 m with 1911 px: the left image of 800 px ends at 2.09 m, the right one begins at −2.09 + 1 m."""
    edged = RIG.model_copy(update={"resolution": (800, 600), "pixel_noise": 1e-6})
    R = axes_along(TARGET[None])[0]
    ends = {"x": (-2.093 + 1, 2.093), "y": (-1.570, 1.570)}
    for k, (low, high) in enumerate(ends.values()):
        for value, inside in ((low - 0.01, False), (low + 0.01, True), (high - 0.01, True), (high + 0.01, False)):
            point = np.array([0.5, 0.0, 10.0])
            point[k] = value
            assert measured(scenario(edged), R @ point, frames=2).seen.all() == inside
            assert np.isfinite(true_covariance(scenario(edged), R @ point)).all() == inside
            assert measured(scenario(), R @ point, frames=2).seen.all()


def test_dropout_is_the_same_with_a_rig():
    lossy = measured(scenario(dropout=0.3), TARGET, frames=200)
    plain = BASE.model_copy(update={"tracking": Tracking(), "sensor": Sensor(noise=0.0, dropout=0.3)})
    np.testing.assert_array_equal(lossy.seen, measured(plain, TARGET, frames=200).seen)
    assert np.isnan(lossy.covariance[~lossy.seen]).all()


def test_isotropic_noise_has_no_covariance_in_the_tracks_but_a_true_one():
    plain = BASE.model_copy(update={"sensor": Sensor(noise=0.03)})
    assert measured(plain, TARGET, frames=3).covariance is None
    found = observation_covariance(plain, np.zeros((4, 2, 3)))
    np.testing.assert_allclose(found, np.broadcast_to(0.0009 * np.eye(3), (4, 2, 3, 3)), rtol=1e-15)


def test_a_rig_needs_the_target():
    features = np.broadcast_to(TARGET, (2, COUNT, 3))
    for call in (
        lambda: observe(scenario(), np.arange(2.0), features, features),
        lambda: observation_covariance(scenario(), features),
    ):
        with pytest.raises(ValueError, match="target_C is missing"):
            call()

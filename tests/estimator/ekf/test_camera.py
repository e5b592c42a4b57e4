"""What `ekf` is told of a camera: its equations against dense ones, its covariances against those of `ml`."""

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation

from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.camera.rig import Rig
from baryscope.estimator.camera.shared import SharedErrors
from baryscope.estimator.ekf.camera import CameraErrors
from baryscope.estimator.ekf.linearised import INERTIA, Nodes, Reference, linearised, moved, points_in, residuals
from baryscope.estimator.ekf.motion import free_motion
from baryscope.estimator.methods import estimate
from baryscope.estimator.ml.model import FrameNoise
from baryscope.estimator.options import PathOptions
from baryscope.estimator.paths.path import Polynomial
from baryscope.estimator.paths.seen_path import SeenPath
from free_paths import ORBIT, in_orbit
from synthetic import ENVISAT, attitude, box_features
from turning_camera import ARM, turning_camera

FRAMES, FEATURES, OWN, ERRORS = 5, 4, 9, 7
SIZE = OWN + ERRORS
RIG = Rig(
    lever_arm=tuple(ARM), boresight_deviation=1e-3, scale_deviation=1e-3, lever_arm_deviation=0.01, attitude_noise=2e-2
)


@pytest.fixture(params=[False, True], ids=["weights", "precisions"])
def case(request):
    """A reference with errors of a camera that turns, nodes, and noisy observations, of which some are missing."""
    rng, time = np.random.default_rng(5), np.arange(float(FRAMES))
    turn = Rotation.from_rotvec(time[:, None] * [0.1, -0.2, 0.05]).as_matrix()
    errors = SharedErrors.of(turn, RIG)
    path = SeenPath(Polynomial(2, 0.0, time[-1]), errors)
    values = errors.deviations * rng.normal(size=ERRORS)
    reference = Reference(
        free_motion(path, time, np.array([4.0, -19.0, 3.0]), time[-1]),
        np.concatenate([rng.normal(size=OWN), values]),
        rng.normal(size=(FRAMES, 6)),
        attitude(ENVISAT, np.array([0.06, 0.01, 0.01]), time),
        np.tile([0.06, 0.01, 0.01], (FRAMES, 1)),
        ENVISAT / np.trace(ENVISAT),
        box_features(FEATURES, (10, 5, 5), seed=3),
        np.zeros((FRAMES - 1, 3)),
        CameraErrors(errors, slice(OWN, SIZE), values),
    )
    nodes = Nodes(time, np.arange(FRAMES))
    position = reference.seen_at(nodes) + 0.1 * rng.normal(size=(FRAMES, FEATURES, 3))
    root = rng.normal(size=(FRAMES, FEATURES, 3, 3)) + 2 * np.eye(3)
    precision = root @ np.swapaxes(root, 2, 3) if request.param else None
    weight = np.ones((FRAMES, FEATURES))
    weight[1, 2] = weight[3, 0] = 0.0
    return reference, nodes, Observations(position, weight, precision)


def stacked(observations, values):
    """What is seen of values (frames, m, 3), in one column for each frame."""
    return [own[shown].ravel() for own, shown in zip(values, observations.weight > 0, strict=True)]


def covariances(reference, nodes, observations, noise):
    """The covariances of each frame's observations: their own, and that of a turn about the origin of C by noise."""
    found = []
    seen = reference.seen_at(nodes)
    for frame, shown in enumerate(observations.weight > 0):
        count = int(shown.sum())
        own = (
            np.eye(3 * count)
            if observations.precision is None
            else block_diag(*np.linalg.inv(observations.precision[frame][shown]))
        )
        if noise is not None:
            turns = np.concatenate([np.cross(np.eye(3), point).T for point in seen[frame][shown]])
            own = own + turns @ noise.turn[frame] @ turns.T
        found.append(own)
    return found


def cost_of(at, nodes, observations, by):
    left = stacked(observations, observations.position - at.seen_at(nodes))
    return sum(float(one @ np.linalg.solve(own, one)) for one, own in zip(left, by, strict=True))


@pytest.mark.parametrize("noisy", [False, True], ids=["errors", "errors and noise"])
def test_the_quadratic_cost_is_that_of_what_a_camera_with_errors_sees(case, noisy):
    """With dense covariances of whole frames, at points of a true size: neither was in the equations of `ekf`.

    Exact to first order in the change of the residuals, but for the errors themselves, here 1e-3, times the change of
    the path: so the gradient departs by some 1e-3, and without the errors or the noise it would by all of itself.
    """
    reference, nodes, observations = case
    noise = FrameNoise.of(reference.camera.errors, 0.0, FRAMES, 1.0) if noisy else None
    by = covariances(reference, nodes, observations, noise)
    system, rng = linearised(reference, nodes, observations, noise), np.random.default_rng(1)
    c = points_in(SIZE).start + 3 * FEATURES
    theta = np.zeros(c)
    theta[points_in(SIZE)] = rng.normal(size=3 * FEATURES)
    theta[INERTIA + OWN : INERTIA + SIZE] = rng.normal(size=ERRORS)
    state = rng.normal(size=(FRAMES, 12))

    def linear(step):
        s, y = step * state, np.concatenate([[1.0], step * theta])
        seen = (system.observed @ s[:, :, None])[:, :, 0]
        return (
            y @ system.static @ y
            - 2 * np.einsum("ki,kic,c", seen, system.rhs, y)
            + np.einsum("ki,kij,kj", seen, system.information, seen)
        )

    def exact(step):
        return cost_of(moved(reference, step * state, step * theta), nodes, observations, by)

    assert linear(0.0) == pytest.approx(exact(0.0), rel=1e-10)
    slopes = [(one(1e-5) - one(-1e-5)) / 2e-5 for one in (linear, exact)]
    bends = [(one(1e-3) + one(-1e-3) - 2 * one(0.0)) / 1e-6 for one in (linear, exact)]
    assert slopes[0] == pytest.approx(slopes[1], rel=1e-2)
    assert bends[0] == pytest.approx(bends[1], rel=2e-2)


def test_noise_of_whole_frames_has_its_determinant_and_its_movements(case):
    """ln det of the dense covariances over those of the features, and residuals less the likeliest turns."""
    reference, nodes, observations = case
    noise = FrameNoise.of(reference.camera.errors, 0.0, FRAMES, 1.0)
    both, own = (covariances(reference, nodes, observations, one) for one in (noise, None))
    grown = sum(np.linalg.slogdet(wide)[1] - np.linalg.slogdet(one)[1] for wide, one in zip(both, own, strict=True))
    assert grown > 1.0
    assert linearised(reference, nodes, observations, noise).log_determinant == pytest.approx(grown, rel=1e-9)
    all_of_it = stacked(observations, residuals(reference, nodes, observations, None))
    left = stacked(observations, residuals(reference, nodes, observations, noise))
    expected = [one @ np.linalg.solve(wide, r) for one, wide, r in zip(own, both, all_of_it, strict=True)]
    np.testing.assert_allclose(np.concatenate(left), np.concatenate(expected), atol=1e-9)


TIME = 4.0 * np.arange(120.0)
PATH = in_orbit(TIME)


def through(seen, method):
    options = PathOptions(process_noise="none", torque_noise="none")
    return estimate(seen.tracks, method=method, orbit=ORBIT.model(), camera=seen.camera, options=options)


@pytest.mark.parametrize(
    "rig",
    [
        Rig(lever_arm=tuple(ARM), boresight_deviation=3e-3),
        Rig(lever_arm=tuple(ARM), scale_deviation=1e-3, lever_arm_deviation=0.01),
        Rig(lever_arm=tuple(ARM), attitude_noise=1e-3),
    ],
    ids=["boresight", "scale and lever arm", "noise of the attitude"],
)
def test_predictions_claim_what_those_of_ml_do(rig):
    """Position and velocity together, without process noise, so that both estimate the same by different equations.

    Relative to each other the covariances have eigenvalues within 4 % of 1. They had 0.09 to 2e4 and to 800 where
    constant errors were added as if the path followed them, with a velocity that was tied to it; and 0.7 to 110 where
    noise of the attitude, 2 cm at the target and four times that of the features, was taken for noise of these.
    """
    seen = turning_camera(TIME, PATH, rig, noise=0.005, seed=2)
    found, other = (through(seen, method) for method in ("ekf", "ml"))
    times = np.array([-60.0, 0.0, 241.3, TIME[-1], TIME[-1] + 60.0])
    for point in (None, "F4"):
        own, expected = (one.predict(times, point) for one in (found, other))
        for mine, its in zip(own.covariance, expected.covariance, strict=True):
            size = 1 / np.sqrt(np.diag(its))
            root = np.linalg.cholesky(its * np.outer(size, size))
            white = np.linalg.solve(root, np.linalg.solve(root, mine * np.outer(size, size)).T)
            np.testing.assert_allclose(np.linalg.eigvalsh((white + white.T) / 2), 1.0, atol=0.1)
    np.testing.assert_allclose(found.noise.a_posteriori, other.noise.a_posteriori, rtol=0.02)
    assert [one.name for one in found.forces] == [one.name for one in other.forces]
    for one, its in zip(found.forces, other.forces, strict=True):
        assert one.deviation == pytest.approx(its.deviation, rel=0.05)
        assert one.value == pytest.approx(its.value, abs=0.1 * its.deviation)

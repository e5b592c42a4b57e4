"""The Cramér–Rao bound, against a Fisher matrix of all unknowns by brute force, and what must hold of any bound."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import forces
from baryscope.estimator.bound import Truth, cramer_rao_bound, expected_observations
from baryscope.estimator.camera.rig import Rig
from baryscope.estimator.ml.likelihood import equations
from baryscope.estimator.ml.model import Model
from baryscope.estimator.paths.sampled_path import SampledPath
from baryscope.estimator.prose import verdict
from baryscope.models.attitude import INERTIA_BASIS
from baryscope.models.errors import ComputationError, InputError
from baryscope.models.scenario import (
    Chaser,
    FeaturePoint,
    Features,
    Interval,
    Outliers,
    Run,
    Scenario,
    Sensor,
    StereoRig,
    Target,
    Tracking,
    load_scenario,
)
from baryscope.models.sensor.tracking import observation_covariance
from baryscope.study.bounds import variant_of
from oracles import TorqueFree, relative_kepler, torque_free_attitude
from synthetic import ENVISAT, Orbit, attitude, box_features, differences, turned_back

ORBIT = Orbit(eccentricity=0.1, semi_major_axis=8500e3)
POINTS = box_features(6, (10, 5, 5), seed=3, centre=(1, 0.5, 0))
STATE = np.array([-4.0, -18.0, 3.0, 0.004, -0.007, 0.01])
RATE_DEG = (1.2, 2.2, 2.4)


def scenario(points=POINTS, *, rate_deg=RATE_DEG, duration=190.0, step=10.0, sensor=None, tracking=None):
    labelled = (
        FeaturePoint(label=f"F{k}", position=tuple(point), normal=tuple(point)) for k, point in enumerate(points)
    )
    return Scenario(
        target=Target(inertia=tuple(map(tuple, ENVISAT)), angular_rate_deg=tuple(rate_deg)),
        features=Features(points=tuple(labelled)),
        orbit=ORBIT.model(),
        chaser=Chaser(position=tuple(STATE[:3]), velocity=tuple(STATE[3:])),
        tracking=tracking or Tracking(),
        sensor=sensor or Sensor(noise=0.02),
        run=Run(duration=duration, sample_time=step),
    )


class BruteForce:
    """The covariance of all unknowns, and of functions of them, by differences of independent integrations.

    Unknowns: φ of the attitude in the middle of the time, the rate there, the inertia's five, the relative state at 0,
    points. Turned axes look the same: the pseudo-inverse leaves the directions in which nothing is seen.
    """

    def __init__(self, flown, seen):
        time = flown.sample_times
        self.time, self.middle, self.J = time, (time[0] + time[-1]) / 2, ENVISAT / np.trace(ENVISAT)
        self.points = np.array([point.position for point in flown.features.points])
        self.orbit_I_L = ORBIT.R_I_L(time)
        at = np.array([self.middle])
        quaternion = torque_free_attitude(flown, np.array([0.0, self.middle]))[-1]
        self.attitude0 = Rotation.from_quat(quaternion, scalar_first=True).as_matrix()
        self.rate0 = TorqueFree(ENVISAT, np.deg2rad(flown.target.angular_rate_deg)).rate(at)[0]
        self.flown, self.known = flown, {}
        m = len(self.points)
        # Changes of about one in what these are units of.
        self.units = np.repeat([1e-2, 1e-3, 1e-2, 1.0, 1e-2, 1.0], [3, 3, 5, 3, 3, 3 * m])
        zero = np.zeros(len(self.units))
        truth = self.observations(zero)
        covariance = observation_covariance(flown, truth, self.path(zero))
        root = np.swapaxes(np.linalg.cholesky(np.linalg.inv(covariance)), -1, -2) * seen[..., None, None]
        jacobian = differences(lambda u: (root @ self.observations(u)[..., None]).ravel(), zero, 1e-4)
        self.covariance = np.linalg.pinv(jacobian.T @ jacobian, rcond=1e-10, hermitian=True)
        self.rank = np.linalg.matrix_rank(jacobian, tol=1e-5 * np.linalg.norm(jacobian, 2))

    def motion(self, unknowns):
        """Attitudes; a free motion that is run backwards is a free motion with the opposite rate."""
        key = unknowns[:11].tobytes()
        if key not in self.known:
            self.known[key] = self._motion(self.units * unknowns)
        return self.known[key]

    def _motion(self, values):
        R0 = self.attitude0 @ Rotation.from_rotvec(values[:3]).as_matrix()
        rate, J = self.rate0 + values[3:6], self.J + np.tensordot(values[6:11], INERTIA_BASIS, 1)
        since = self.time - self.middle
        before, after = -since[since < 0][::-1], since[since >= 0]
        back = attitude(J, -rate, np.concatenate([[0.0], before]))[1:][::-1]
        forth = attitude(J, rate, np.concatenate([[0.0], after]))[1:]
        return R0 @ np.concatenate([back, forth]), rate, J

    def path(self, unknowns):
        state = STATE + (self.units * unknowns)[11:17]
        if state.tobytes() not in self.known:
            rho = relative_kepler(self.flown.orbit, state, self.time)[:, :3]
            self.known[state.tobytes()] = -(self.orbit_I_L @ rho[..., None])[..., 0]
        return self.known[state.tobytes()]

    def places(self, unknowns):
        return self.points + (self.units * unknowns)[17:].reshape(-1, 3)

    def observations(self, unknowns):
        return self.path(unknowns)[:, None] + self.places(unknowns) @ np.swapaxes(self.motion(unknowns)[0], 1, 2)

    def of(self, function):
        """The covariance of a function (k,) of the unknowns."""
        jacobian = differences(function, np.zeros(len(self.units)), 1e-4)
        return jacobian @ self.covariance @ jacobian.T

    def held(self, unknowns):
        """Attitude errors in B at all times, rate, and inertia's five, in axes that the features hold."""
        attitudes, rate, J = self.motion(unknowns)
        points = self.places(unknowns)
        centred = self.points - self.points.mean(axis=0)
        turn = Rotation.align_vectors(centred, points - points.mean(axis=0))[0].as_matrix()
        errors = Rotation.from_matrix(np.swapaxes(self.truth, 1, 2) @ attitudes @ turn.T).as_rotvec()
        inertia = np.einsum("kij,ij->k", INERTIA_BASIS, turn @ J @ turn.T)
        return np.concatenate([errors.ravel(), turn @ rate, inertia])

    @property
    def truth(self):
        return self.motion(np.zeros(len(self.units)))[0]


def close(found, expected):
    np.testing.assert_allclose(found, expected, rtol=0, atol=2e-3 * np.abs(expected).max())


STEREO = Sensor(stereo=StereoRig(focal_length=1911.0, baseline=1.0, pixel_noise=0.5))
INTERVALS = Tracking(
    intervals=(
        Interval(start=0, end=90, features=("F0", "F1", "F2", "F3")),
        Interval(start=110, end=300, features=("F2", "F4", "F5")),
    )
)


@pytest.mark.parametrize("sensor", [Sensor(noise=0.02), STEREO], ids=["isotropic", "stereo"])
@pytest.mark.parametrize("tracking", [Tracking(), INTERVALS], ids=["all", "intervals"])
def test_equals_the_inverse_of_a_fisher_matrix_by_brute_force(sensor, tracking):
    flown = scenario(sensor=sensor, tracking=tracking)
    time = flown.sample_times
    seen = np.ones((len(time), 6))
    if tracking.intervals:
        seen[:, :] = 0
        seen[time < 90, :4] = 1
        seen[np.ix_(time >= 110, [2, 4, 5])] = 1
    exact, found = BruteForce(flown, seen), cramer_rao_bound(flown)
    assert exact.rank == 17 + 18 - 3  # all but a turn of the axes
    assert found.observations == seen.sum()
    assert verdict(found.observability).startswith("observable")
    path = exact.of(lambda u: exact.path(u).ravel()).reshape(len(time), 3, len(time), 3)
    close(found.position_covariance, np.einsum("kikj->kij", path))
    close(found.offset_covariance, exact.of(lambda u: turned_back(exact.places(u), exact.points)))
    held = exact.of(exact.held)
    n = 3 * len(time)
    attitudes = held[:n, :n].reshape(len(time), 3, len(time), 3)
    close(found.attitude_covariance, np.einsum("kikj->kij", attitudes))
    close(found.rate_covariance, held[n : n + 3, n : n + 3])
    close(found.inertia_covariance, held[n + 3 :, n + 3 :])
    mean = np.einsum("kiki->", path) / len(time)
    assert found.position_deviation == pytest.approx(np.sqrt(mean), rel=2e-3)
    assert found.inertia_deviation == pytest.approx(np.sqrt(np.trace(held[n + 3 :, n + 3 :])), rel=2e-3)


def test_scales_as_the_noise():
    one, five = (cramer_rao_bound(scenario(sensor=Sensor(noise=noise))) for noise in (0.02, 0.1))
    for name in ("position", "offset", "attitude", "rate"):
        small, large = (getattr(bound, f"{name}_covariance") for bound in (one, five))
        np.testing.assert_allclose(large, 25 * small, rtol=1e-5, atol=1e-6 * large.max())
    assert five.position_deviation == pytest.approx(5 * one.position_deviation, rel=1e-6)


def test_scales_as_the_pixel_noise_of_a_stereo_rig():
    fine, coarse = (
        cramer_rao_bound(scenario(sensor=Sensor(stereo=StereoRig(focal_length=1911, baseline=1, pixel_noise=noise))))
        for noise in (0.5, 1.0)
    )
    assert coarse.position_deviation == pytest.approx(2 * fine.position_deviation, rel=1e-6)
    assert coarse.attitude_deviation == pytest.approx(2 * fine.attitude_deviation, rel=1e-6)


def test_scales_as_one_over_the_root_of_the_number_of_frames():
    """Over one span of time, 16 times as many frames: to the ends' share, one interval in 400."""
    few, many = (cramer_rao_bound(scenario(duration=400.0, step=step)) for step in (1.0, 1 / 16))
    for name in ("position", "offset", "attitude", "rate", "inertia"):
        ratio = getattr(few, f"{name}_deviation") / getattr(many, f"{name}_deviation")
        assert ratio == pytest.approx(4, rel=0.01)


def test_dropped_and_wrong_observations_have_no_information():
    plain = cramer_rao_bound(scenario())
    sensor = Sensor(noise=0.02, dropout=0.5, outliers=Outliers(share=0.2, swapped=0.1))
    lossy = cramer_rao_bound(scenario(sensor=sensor))
    np.testing.assert_allclose(lossy.position_covariance * (0.5 * 0.8 * 0.9), plain.position_covariance, rtol=1e-5)


@settings(max_examples=15)
@given(st.sets(st.integers(0, 5), min_size=3, max_size=5), st.sampled_from([None, "fixed", "polynomial:2"]))
def test_more_features_are_never_worse(members, trajectory):
    few, all_of_them = (
        cramer_rao_bound(scenario(points, duration=100.0), trajectory=trajectory)
        for points in (POINTS[sorted(members)], POINTS)
    )
    lost = np.linalg.eigvalsh(few.position_covariance - all_of_them.position_covariance)
    assert lost.min() > -1e-6 * few.position_covariance.max()


def test_a_more_specific_path_model_has_a_smaller_bound():
    """Of nested kinds of paths each has the smaller bound."""
    kinds = ["fixed", "polynomial:1", "polynomial:2", "polynomial:5"]
    bounds = [cramer_rao_bound(scenario(), trajectory=kind).position_covariance for kind in kinds]
    for known, unknown in pairwise(bounds):
        assert np.linalg.eigvalsh(unknown - known).min() > -1e-6 * unknown.max()


def test_a_pure_spin_is_not_observable_along_its_axis():
    values, axes = np.linalg.eigh(ENVISAT)
    spin = cramer_rao_bound(scenario(rate_deg=3.5 * axes[:, 2], duration=600.0), trajectory="fixed")
    assert verdict(spin.observability).startswith("along-axis position not observable")
    worst = np.linalg.eigh(spin.offset_covariance)[1][:, -1]
    assert abs(worst @ axes[:, 2]) > 0.999
    tumble = cramer_rao_bound(scenario(duration=600.0), trajectory="fixed")
    assert verdict(tumble.observability).startswith("observable")
    assert values[0] > 0


def test_scenarios_without_a_bound_are_refused():
    with pytest.raises(ComputationError, match="no feature is seen"):
        cramer_rao_bound(
            scenario(tracking=Tracking(intervals=(Interval(start=500, end=600, features=("F0", "F1", "F2")),)))
        )
    with pytest.raises(ComputationError, match=r"sensor\.noise is 0"):
        cramer_rao_bound(scenario(sensor=Sensor(noise=0.0)))
    with pytest.raises(InputError, match="expected its degree for a bound"):
        cramer_rao_bound(scenario(), trajectory="polynomial")
    with pytest.raises(InputError, match=r"process_noise is -1\.0, expected 0 to"):
        cramer_rao_bound(scenario(), process_noise=-1.0)
    with pytest.raises(InputError, match=r"process_noise is 1e-06 m²/s³.*expected 0 where the trajectory is fixed"):
        cramer_rao_bound(scenario(), trajectory="fixed", process_noise=1e-6)
    with pytest.raises(InputError, match="predict is inf, expected 0 to"):
        cramer_rao_bound(scenario(), predict=np.inf)


def integrated_noise(time, density):
    """The covariance (3 n, 3 n) of twice integrated white noise from time 0, and of an unknown start and velocity."""
    first, last = np.minimum.outer(time, time), np.maximum.outer(time, time)
    noise = density * (first**3 / 3 + first**2 * (last - first) / 2)
    return np.kron(noise + 1e2 + 1e-2 * np.outer(time, time), np.eye(3))


def test_with_process_noise_it_is_that_of_a_gaussian_process():
    """Positions are free in every frame and ahead, with the covariance of integrated white noise as prior."""
    flown, density, ahead = scenario(), 1e-7, 30.0
    found = cramer_rao_bound(flown, trajectory="polynomial:1", process_noise=density, predict=ahead)
    time = flown.sample_times
    n = len(time)
    truth = Truth.of(flown, time)
    observations = expected_observations(flown, time, truth)
    free = SampledPath(np.eye(3 * n).reshape(n, 3, 3 * n), lambda x: x.reshape(n, 3))
    information = equations(observations, Model(truth.motion, free, truth.origin, truth.points)).matrix
    joint = np.zeros((len(information) + 3, len(information) + 3))
    joint[:-3, :-3] = information
    joint[8:, 8:] += np.linalg.inv(integrated_noise(np.append(time, time[-1] + ahead), density))
    of_positions = np.linalg.inv(joint)[8:, 8:]
    expected = np.einsum("kikj->kij", of_positions.reshape(n + 1, 3, n + 1, 3))
    np.testing.assert_allclose(found.position_covariance, expected[:-1], atol=0.02 * np.abs(expected[:-1]).max())
    np.testing.assert_allclose(found.predicted_covariance[:3, :3], expected[-1], atol=0.02 * np.abs(expected[-1]).max())
    assert truth.rotation.size == 8


@pytest.mark.parametrize("rate, expected", [(3.5, (0.65, 0.89, 2.2)), (1.2, (1.01, 2.05, 15))])
def test_envisat_in_white_acceleration(rate, expected):
    """Values of an independent program, for 600 s at 1 Hz, 2 cm and 9 or 10 features at 20 m: rms in mm."""
    preset = load_scenario("envisat").model_copy(update={"tracking": Tracking()})
    flown = replace(variant_of(preset), rate=rate, duration=600.0, features=10).of(preset)
    found = [1e3 * cramer_rao_bound(flown, process_noise=q).position_deviation for q in (0.0, 1e-12, 1e-10)]
    np.testing.assert_allclose(found, expected, rtol=0.1)


def test_noise_of_the_thrusters_is_process_noise():
    """A flight has it in the path; the bound was that of a path without."""
    free = scenario()
    noisy = free.model_copy(update={"chaser": free.chaser.model_copy(update={"acceleration_noise": 1e-9})})
    found, expected = cramer_rao_bound(noisy, process_noise=2e-9), cramer_rao_bound(free, process_noise=3e-9)
    np.testing.assert_allclose(found.position_covariance, expected.position_covariance, rtol=1e-9)
    assert found.position_deviation > 1.4 * cramer_rao_bound(free).position_deviation


def test_the_true_path_is_under_j2():
    """By two orbits of an independent program: in half a day it is 2 km long, and 90 m from Kepler's."""
    orbit = replace(ORBIT.model(), j2=forces.J2, equatorial_radius=forces.RADIUS)
    flown = scenario(duration=40e3, step=400.0).model_copy(update={"orbit": orbit})
    found = Truth.of(flown, flown.sample_times).origin
    _, expected = forces.fly_paths(flown, flown.sample_times)
    kepler = Truth.of(flown.model_copy(update={"orbit": ORBIT.model()}), flown.sample_times).origin
    assert np.abs(kepler - expected).max() > 50.0
    np.testing.assert_allclose(found, expected, atol=0.2)  # there LVLH axes turn about the radius, too, at the start


def test_an_acceleration_that_is_known_costs_nothing_and_its_scale_does():
    """A millimetre per second squared moves the chaser by 18 m in 190 s, which a scale of 10 % makes uncertain."""
    free, chaser = scenario(), Chaser(position=tuple(STATE[:3]), velocity=tuple(STATE[3:]), acceleration=(0, 1e-3, 0))
    thrusting = free.model_copy(update={"chaser": chaser})
    plain, told = cramer_rao_bound(free), cramer_rao_bound(thrusting)
    assert told.position_deviation == pytest.approx(plain.position_deviation, rel=0.02)
    scaled = cramer_rao_bound(thrusting, acceleration_scale=0.1)
    assert 1.05 * told.position_deviation < scaled.position_deviation < 20 * told.position_deviation


def test_errors_of_the_camera_that_the_motion_does_not_tell_are_added():
    """A wrong scale moves the path along itself, and no tracks tell it: Schmidt's sum of two covariances."""
    flown = scenario()
    plain = cramer_rao_bound(flown, trajectory="polynomial:2")
    found = cramer_rao_bound(flown, trajectory="polynomial:2", consider=Rig(scale_deviation=1e-2))
    origin = Truth.of(flown, flown.sample_times).origin
    expected = plain.position_covariance + 1e-4 * origin[:, :, None] * origin[:, None]
    np.testing.assert_allclose(found.position_covariance, expected, atol=1e-2 * np.abs(expected).max())
    noisy = cramer_rao_bound(flown, consider=Rig(attitude_noise=1e-3))
    assert noisy.position_deviation > 1.1 * cramer_rao_bound(flown).position_deviation

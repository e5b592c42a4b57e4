"""What of the information is spurious, and when the steps of `pivot` are at rest."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from baryscope.estimator import FeatureTracks, estimate
from baryscope.estimator.options import PathOptions
from baryscope.estimator.paths.relative_motion import RelativeOrbit
from baryscope.estimator.pivot.joint_covariance import is_at_rest
from baryscope.estimator.pivot.method import estimate_by_pivot, solve_pivot
from baryscope.estimator.pivot.pivot_solution import LastStep
from baryscope.estimator.result import Status
from baryscope.study.population.cases import drawn
from baryscope.study.population.judging import of_estimate, wrong
from baryscope.study.population.sensing import sampled
from synthetic import Orbit, box_features, make_case

AXIS = np.array([0.6, 0.0, 0.8])


def spinning():
    """The solution of a pure spin about AXIS."""
    time = np.linspace(0.0, 270.0, 60)
    spin = Rotation.from_rotvec(np.outer(0.07 * time, AXIS)).as_matrix()
    points = np.random.default_rng(3).normal(size=(6, 3))
    case = make_case(time, spin, np.tile([4.0, -19.0, 3.0], (60, 1)), points, noise=0.1, seed=1)
    return solve_pivot(case.tracks, None, PathOptions(trajectory="fixed"))


def test_steps_that_only_noise_asks_for_are_no_lack_of_convergence():
    """A step of 30 cm along a pure spin's axis is several deviations of its apparent information, which is noise."""
    solved = spinning()
    information = np.linalg.inv(solved.solution.offset_covariance)
    axis = np.linalg.eigh(information)[1][:, 0]

    def stepped(offsets, steady=True):
        last = LastStep(solved.last.decrease + offsets @ information @ offsets, offsets, steady)
        return is_at_rest(replace(solved, last=last))

    across = np.cross(axis, [1.0, 0.0, 0.0])
    assert 0.3**2 * axis @ information @ axis > solved.variance
    assert stepped(0.3 * axis)
    assert not stepped(0.3 * axis, steady=False)
    assert not stepped(0.3 * across)
    assert not stepped(5.0 * axis)  # the covariance claims three radii


def test_the_prior_is_as_wide_as_an_offset_that_contradicts_it():
    """`population case --seed 102 --index 63 --orbit`: led 12.5 m off along an axis that hardly anything tells, by 3.4
    deviations of the prior, it was wrong with a NEES of 46.
    """
    case = drawn(102, 63)
    found = estimate_by_pivot(sampled(case).tracks, case.orbit, PathOptions(sigma=1.0))
    assert found.status is Status.NOT_OBSERVABLE
    assert not wrong(of_estimate(found, case.path))


def test_an_attitude_that_is_flipped_by_itself_tells_nothing():
    """`population case --seed 108 --index 69`: two labels are exchanged where no other attitude is near; 158° off, it
    told the place along a spin's axis to 13 mm, 0.3 m off.
    """
    case = drawn(108, 69)
    found = estimate_by_pivot(sampled(case).tracks, None, PathOptions())
    assert found.status is Status.NOT_OBSERVABLE
    assert not wrong(of_estimate(found, case.path))


def test_an_attitude_that_rests_on_a_rejected_observation_tells_nothing():
    """Once around a spin with three to seven features in view, one frame of three of which one is displaced: of the two
    that were left it told the place along the axis, 2.5 m off at a claim of 0.08 m.
    """
    case = drawn(120, 15)
    found = estimate_by_pivot(sampled(case).tracks, case.orbit, PathOptions())
    assert found.status is Status.NOT_OBSERVABLE
    assert not wrong(of_estimate(found, case.path))


@pytest.mark.parametrize(("seed", "index", "given"), [(123, 5, True), (128, 23, False)])
def test_features_nearly_in_a_line_tell_nothing_where_they_do_not_tell_all(seed, index, given):
    """The centre of mass is 1 to 6 m beside the line, and found on it: without an orbit the claims had a NEES of 559
    and 745.
    """
    case = drawn(seed, index)
    options = PathOptions(sigma=case.sensor.noise if case.sensor.told else None)
    found = estimate_by_pivot(sampled(case).tracks, case.orbit if given else None, options)
    assert found.status is Status.NOT_OBSERVABLE
    assert not found.observability.observable.any()
    line = of_estimate(found, case.path)
    assert not wrong(line)
    assert line["rmse"] > 1


def test_features_in_a_line_tell_nothing_where_noise_makes_them_wide():
    """25 features in a line, of which noise of 4.2 mm made a body 3.7 mm wide: 0.9 m off at a claim of 0.1 m."""
    case = drawn(168, 8)
    found = estimate_by_pivot(sampled(case).tracks, None, PathOptions())
    assert found.status is Status.NOT_OBSERVABLE
    assert not wrong(of_estimate(found, case.path))


def test_a_few_attitudes_that_are_far_off_tell_nothing():
    """A slow spin with three to seven features in view, of which a third are displaced by some deviations.

    Five of 19 answers to `population case --seed 93 --index 69 --draws 20` were wrong, this with a NEES of 6710.
    """
    case = drawn(93, 69)
    found = estimate_by_pivot(sampled(case, 11).tracks, None, PathOptions(sigma=1.0))
    assert not wrong(of_estimate(found, case.path))


def test_noise_that_features_share_does_not_tell_the_place_along_a_spins_axis():
    """Each frame is shifted by 5 mm, as by a camera that shakes. Attitudes that took the shifts for turns led the
    centre of mass more than a metre along the axis from the features, to a longer lever.
    """
    time = np.arange(1200.0)
    spin = Rotation.from_euler("z", np.deg2rad(3.8) * time[:, None])
    R = (Rotation.from_rotvec([0.3, 0.5, 0.1]) * spin).as_matrix()
    orbit = Orbit().model()
    com = RelativeOrbit(orbit, 600.0).at(time).position(np.array([3.0, -12.0, 2.0, 0.0, -6.0, 2.0]))
    tracks = make_case(time, R, com, box_features(15, (0.6, 0.6, 0.6), 1), noise=0.02).tracks
    shift = 5e-3 * np.random.default_rng(100).standard_normal((len(time), 1, 3))
    found = estimate(FeatureTracks(time, tracks.position + shift, tracks.labels))
    assert found.status is Status.NOT_OBSERVABLE
    error, covariance = found.position[600] - com[600], found.covariance[600]
    assert np.linalg.norm(error) < 1.0
    # Along the axis two deviations at most, as where it is not told; χ² of three degrees of freedom is below 9 in 97 %.
    assert error @ np.linalg.solve(covariance, error) < 9.0


@pytest.mark.parametrize(("seed", "away"), [(1, 20.0), (2, 20.0), (2, 40.0)])
def test_a_spin_about_the_line_of_sight_is_not_observable_along_it(seed, away):
    """A face that turns about the line of sight, 0.8 m before the centre of mass, passes by a rig whose covariances are
    told exactly: all were `good`, with normalised squares of 109, 9310 and 396.

    away: degrees by which the line of sight leaves the axis.
    """
    rng, time, across, ratio = np.random.default_rng(seed), 2.0 * np.arange(300), 0.003, 40.0
    path = 18 * np.stack([np.tan(np.radians(away)) * time / time[-1], 0 * time, np.ones(300)], axis=1)
    spin = Rotation.from_rotvec(0.04 * time[:, None] * np.array([0.0, 0, 1])).as_matrix()
    true = path[:, None] + np.c_[rng.uniform(-1, 1, (5, 2)), np.full(5, -0.8)] @ np.swapaxes(spin, 1, 2)
    sight = true / np.linalg.norm(true, axis=2, keepdims=True)
    noise = across * rng.normal(size=true.shape)
    noise += (ratio - 1) * np.sum(noise * sight, axis=2, keepdims=True) * sight
    covariance = across**2 * (np.eye(3) + (ratio**2 - 1) * sight[..., :, None] * sight[..., None, :])
    tracks = FeatureTracks(time, true + noise, tuple("abcde"), covariance)
    found = estimate(tracks, options=PathOptions(trajectory="polynomial:1"))
    assert found.status in (Status.NOT_OBSERVABLE, Status.NOT_CONVERGED)
    for frame in (0, 150, 299):
        error = found.position[frame] - path[frame]
        assert error @ np.linalg.solve(found.covariance[frame], error) < chi2.isf(1e-4, 3)

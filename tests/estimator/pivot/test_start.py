"""From where the solution starts, where a flexible path hides it."""

import numpy as np
import pytest

from baryscope.estimator.options import PathOptions
from baryscope.estimator.paths.process_noise import DENSITY
from baryscope.estimator.pivot import method
from baryscope.estimator.pivot import start as starting
from baryscope.estimator.pivot.free_attitudes import diverged
from baryscope.estimator.pivot.method import estimate_by_pivot
from baryscope.estimator.result import Status
from baryscope.models.errors import ComputationError
from baryscope.study.population.cases import drawn
from baryscope.study.population.judging import of_estimate, wrong
from baryscope.study.population.sensing import sampled
from free_paths import NOISE, ORBIT, at_rest, turning
from synthetic import box_features, make_case


@pytest.mark.parametrize("seed, index, draw", [(97, 79, 0), (98, 71, 0)])
def test_a_place_at_rest_is_found_beside_a_path_that_follows_the_rotation(seed, index, draw):
    """Features far from the centre of mass, which hardly moves: all paths that start from the features stay with them.

    `python -m baryscope.study.population case --seed 97 --index 79 --method pivot --draws 8`: with the code before,
    five of eight answers were 2 to 4 m off, one with a NEES of 2400; all are to 4 cm. 98/71 has the path that is found
    at rest only as long as outliers do not bend it.
    """
    case = drawn(seed, index)
    sigma = 1.0 if case.sensor.told and case.sensor.baseline else None
    found = estimate_by_pivot(sampled(case, draw).tracks, None, PathOptions(sigma=sigma))
    line = of_estimate(found, case.path)
    assert found.status is Status.GOOD
    assert not wrong(line)
    assert line["rmse"] < 0.05


def test_many_outliers_near_by_are_told_from_noise():
    """More than a quarter of the observations of five features are off by nine deviations: as if they were few, a path
    with process noise that follows the rotation is likelier, 6 m off at a claim of 0.4 m.
    """
    case = drawn(104, 84)
    found = estimate_by_pivot(sampled(case).tracks, case.orbit, PathOptions())
    line = of_estimate(found, case.path)
    assert not wrong(line)
    assert line["rmse"] < 1.0


def test_a_start_that_diverges_is_left_out(monkeypatch):
    time, R = turning(60)
    case = make_case(time, R, at_rest(time), box_features(6, (10, 5, 5), 3), noise=NOISE)
    usual, kept, failing = estimate_by_pivot(case.tracks, None, PathOptions()), starting._stepped, {0}
    count = iter(range(1000))

    def stepped(*trial, steps, **options):
        if steps == starting.STEPS and next(count) in failing:
            raise diverged()
        return kept(*trial, steps=steps, **options)

    monkeypatch.setattr(starting, "_stepped", stepped)
    found = estimate_by_pivot(case.tracks, None, PathOptions())
    assert next(count) > 2
    assert found.status is usual.status
    np.testing.assert_allclose(found.position, usual.position, atol=usual.predicted_rmse / 10)
    failing.update(range(1000))
    with pytest.raises(ComputationError, match="diverge"):
        estimate_by_pivot(case.tracks, None, PathOptions())


def test_a_path_with_an_orbit_begins_without_process_noise(monkeypatch):
    """Until weights have settled, if that start is the best: there is no place at rest to begin from."""
    starts = []
    monkeypatch.setattr(starting, "_best", lambda *_: 0)
    monkeypatch.setattr(starting, "_is_explained", lambda *_, **__: False)

    def refined(start, options):
        starts.append(start)
        return kept(start, options)

    kept = method.refined
    monkeypatch.setattr(method, "refined", refined)
    time, R = turning(60)
    case = make_case(time, R, at_rest(time), box_features(6, (10, 5, 5), 3), noise=NOISE)
    estimate_by_pivot(case.tracks, ORBIT.model(), PathOptions())
    first, own = starts[0].first_prior, starts[0].path.prior
    assert first is not None
    assert first.index(DENSITY) is None
    quiet = own.fixed(DENSITY, -200.0).precision(np.zeros(0))
    np.testing.assert_array_equal(first.precision(np.zeros(0)), quiet)


@pytest.mark.parametrize("shaken", [False, True], ids=["at rest", "shaken"])
def test_one_start_is_enough_where_noise_explains_all(monkeypatch, shaken):
    """On an orbit, without process noise; where the path leaves more, both are compared. The answer is that of both."""
    compared = []
    kept = starting._best
    monkeypatch.setattr(starting, "_best", lambda *given: compared.append(len(given[0])) or kept(*given))
    time, R = turning(60)
    path = at_rest(time)
    if shaken:
        path = path + 20 * NOISE * np.sin(0.7 * time + np.arange(3)[:, None]).T
    tracks = make_case(time, R, path, box_features(6, (10, 5, 5), 3), noise=NOISE).tracks
    found = estimate_by_pivot(tracks, ORBIT.model(), PathOptions())
    assert compared == ([2] if shaken else [])
    monkeypatch.setattr(starting, "_is_explained", lambda *_, **__: False)
    both = estimate_by_pivot(tracks, ORBIT.model(), PathOptions())
    np.testing.assert_allclose(found.position, both.position, atol=both.predicted_rmse / 10)
    np.testing.assert_allclose(found.covariance, both.covariance, rtol=0.05, atol=0.05 * both.predicted_rmse**2)


def test_many_outliers_in_the_eyes_of_a_stereo_rig_do_not_lead_it_off():
    """A quarter of outliers and labels that are exchanged for a while: 54 m off without robust registration.

    `python -m baryscope.study.population case --seed 114 --index 80 --method pivot --orbit`
    """
    case = drawn(114, 80)
    found = estimate_by_pivot(sampled(case).tracks, case.orbit, PathOptions(sigma=1.0))
    error = np.linalg.norm(found.position - case.path, axis=1)
    assert np.median(error) < 0.02  # the bound is 3.5 mm; at the end, frames with other labels are left out
    assert not wrong(of_estimate(found, case.path))

"""From where the solution starts, where a flexible path hides it."""

import pytest

from baryscope.estimator.options import PathOptions
from baryscope.estimator.pivot.method import estimate_by_pivot
from baryscope.estimator.result import Status
from baryscope.study.population.cases import drawn
from baryscope.study.population.judging import of_estimate, wrong
from baryscope.study.population.sensing import sampled


@pytest.mark.parametrize("seed, index, draw", [(97, 79, 0), (97, 79, 1), (98, 71, 0)])
def test_a_place_at_rest_is_found_beside_a_path_that_follows_the_rotation(seed, index, draw):
    """Features far from the centre of mass, which hardly moves: all paths that start from the features stay with them.

    `python -m baryscope.study.population case --seed 97 --index 79 --draws 8`: five of eight answers were 2 to 4 m off,
    one of them with a NEES of 2200. 98/71 has the path that is found at rest only as long as outliers do not bend it.
    """
    case = drawn(seed, index)
    sigma = 1.0 if case.sensor.told and case.sensor.baseline else None
    found = estimate_by_pivot(sampled(case, draw).tracks, None, PathOptions(sigma=sigma))
    line = of_estimate(found, case.path)
    assert found.status is Status.GOOD
    assert not wrong(line)
    assert line["rmse"] < 0.05

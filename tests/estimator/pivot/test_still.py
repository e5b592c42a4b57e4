"""A centre of mass at rest, on a path that may bend: as of a body on a stand, or in a hand."""

import numpy as np

from baryscope.estimator.methods import estimate
from baryscope.estimator.options import PathOptions
from synthetic import ENVISAT, attitude, box_features, make_case

TIME = np.linspace(0.0, 100.0, 40)


def test_a_place_at_rest_is_found_nearly_as_well_as_by_who_is_told():
    """Of four draws of two thirds of a turn. The squared errors were 1.3 times those of a fixed place."""
    turning, com = attitude(ENVISAT, np.deg2rad([0.6, 0.8, 2.0]), TIME), np.array([1.0, 0.5, 6.0])
    squares = np.zeros(2)
    for seed in range(4, 8):
        case = make_case(TIME, turning, np.tile(com, (40, 1)), box_features(6, (3, 2, 2), 1), noise=5e-3, seed=seed)
        for index, trajectory in enumerate((None, "fixed")):
            found = estimate(case.tracks, options=PathOptions(trajectory=trajectory))
            squares[index] += np.square(found.position - com).sum(axis=1).mean()
    assert squares[0] < 1.2 * squares[1]

"""What both methods do, and what is refused."""

import numpy as np
import pytest

from baryscope.estimator.joint import joint
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import ComputationError, InputError
from joints import TIME, recording


def test_bodies_that_do_not_turn_and_other_times_are_refused():
    parent, child, _ = recording(np.random.default_rng(1), 0.0, 0.0, hinge=True)
    with pytest.raises(ComputationError, match="no single centre"):
        joint(parent, child)
    with pytest.raises(InputError, match="different times"):
        joint(parent, FeatureTracks(TIME + 1, child.position, child.labels))
    with pytest.raises(InputError, match="found 'sara', expected one of score, ml"):
        joint(parent, child, method="sara")

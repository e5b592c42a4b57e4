"""screw-gpa: the published method. Screws of the poses that generalised Procrustes registers."""

import numpy as np

from baryscope.estimator.screws.motion import Pairs
from baryscope.estimator.screws.reuleaux import reuleaux
from baryscope.estimator.screws.screws import Screws


def screws(pairs: Pairs) -> Screws:
    """Reuleaux's rule on the rigid body of each pose: its centroid, and a point at its radius on each of its axes.

    These four points move with the registered features, but never lie in one plane with the axis, where the rule
    applied to the features of a flat cluster would fail.
    """
    motion = pairs.motion
    radius = motion.per_frame([fitted.radius for fitted in motion.registrations])
    arms = radius[:, None, None] * np.swapaxes(motion.rotation, 1, 2)
    body = np.concatenate([arms, np.zeros_like(arms[:, :1])], axis=1) + motion.centre[:, None]
    return reuleaux(body[pairs.first], body[pairs.second], np.ones((len(pairs.first), 4)))

"""screw-gpa: the published method. Screws of the poses that generalised Procrustes registers."""

import numpy as np

from baryscope.estimator.screws.motion import Pairs
from baryscope.estimator.screws.reuleaux import reuleaux
from baryscope.estimator.screws.screws import Screws


def screws(pairs: Pairs) -> Screws:
    """Screws by Reuleaux's rule for four points of the registered body: its centroid, and one on each of its axes.

    The points on the axes are at the shape's rms radius. The four points are never coplanar with the screw axis; the
    features of a flat cluster can be, and the rule then fails.
    """
    motion = pairs.motion
    radius = motion.per_frame([fitted.radius for fitted in motion.registrations])
    arms = radius[:, None, None] * np.swapaxes(motion.rotation, 1, 2)
    body = np.concatenate([arms, np.zeros_like(arms[:, :1])], axis=1) + motion.centre[:, None]
    return reuleaux(body[pairs.first], body[pairs.second], np.ones((len(pairs.first), 4)))

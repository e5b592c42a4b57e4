"""screw-raw: the baseline without registration. Reuleaux's rule for three measured points."""

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.screws.motion import Pairs
from baryscope.estimator.screws.reuleaux import reuleaux
from baryscope.estimator.screws.screws import Screws

IntArray = NDArray[np.intp]

CANDIDATES = 12  # features whose triangles are compared


def screws(pairs: Pairs) -> Screws:
    """Screws of the three features seen in both frames of a pair that span the largest triangle."""
    motion = pairs.motion
    triangle = _triangles(pairs)
    seen = triangle[:, 0] >= 0
    before = np.take_along_axis(motion.position[pairs.first], np.abs(triangle)[..., None], axis=1)
    after = np.take_along_axis(motion.position[pairs.second], np.abs(triangle)[..., None], axis=1)
    return reuleaux(before, after, np.repeat(seen[:, None], 3, axis=1).astype(np.float64), pairs.deviation)


def _triangles(pairs: Pairs) -> IntArray:
    """The three features of the largest triangle that both frames of a pair see, (k, 3); -1 if there is none."""
    motion = pairs.motion
    seen = ~np.isnan(motion.position[..., 0])
    both = seen[pairs.first] & seen[pairs.second]
    number = motion.interval[pairs.first]
    chosen = np.full((len(pairs.first), 3), -1, dtype=np.intp)
    for index, (interval, fitted) in enumerate(zip(motion.intervals, motion.registrations, strict=True)):
        members = np.nonzero(number == index)[0]
        features = np.array(interval.features)
        often = np.argsort(-both[members][:, features].sum(axis=0), kind="stable")[:CANDIDATES]
        triples = np.array(list(combinations(sorted(often.tolist()), 3)), dtype=np.intp)
        corners = fitted.shape[triples]
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        for triple in features[triples[np.argsort(-area, kind="stable")]]:
            if not members.size:
                break
            fits = both[np.ix_(members, triple)].all(axis=1)
            chosen[members[fits]] = triple
            members = members[~fits]
    return chosen

"""Features that are rigid among themselves and move against those of the body: a second rigid body in the tracks.

The chaser's own arm, another piece of debris, or a turning panel have labels like any other. In frames in which they
are more than the body's they would be taken for it, and the body for outliers. But the distances between features of
two bodies change steadily, by far more than from one frame to the next, and those of one body by noise only, which is
new in every frame: the ratio of both tells them apart whatever the noise, also where it is far greater along the line
of sight (von Neumann 1941, Ann. Math. Stat. 12).
"""

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.geometry.alignment import FEWEST_POINTS
from baryscope.estimator.registration.noise import QUARTILE

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

MOVING = 4.0  # deviation of a distance over that of its noise, from which it changes: in steps of 20° at most
CHANGED = 0.1  # of it, over the distance that a body's features typically have: less may last as noise, or bend
FEWEST = 20  # values of a distance, to tell: of noise the ratio is 1 to a fifth
TURNS = 0.5  # of how far the directions between features of the body that turns most turn: such a one turns, too
COMPARED = 2  # features of the body, at least, that each feature of another one is seen to move against


def other_bodies(pairs: IntArray, apart: FloatArray, seen: BoolArray) -> list[IntArray]:
    """Groups of features, by index, that belong to other rigid bodies than the one that the tracks are of.

    That is the one with most observations, of those that turn: the others may be the camera's own. Features that are
    not seen together with it, or move by themselves, are in no group.

    pairs (k, 2) of features, and the vectors (n, k, 3) between them, m, NaN where not both are seen; seen (n, m).
    """
    if len(apart) <= FEWEST:
        return []
    distance = np.linalg.norm(apart, axis=2)
    usual = _medians(distance)
    deviation = _medians(np.abs(distance - usual)) / QUARTILE
    noise = _medians(np.abs(np.diff(distance, axis=0))) / (QUARTILE * np.sqrt(2))
    told = np.isfinite(deviation) & np.isfinite(noise)
    steady = told & (deviation < MOVING * noise)
    if not steady.any():
        return []
    changed = deviation > CHANGED * float(np.median(usual[steady]))
    moving, steady = told & ~steady & changed, steady & ~changed
    if not moving.any():
        return []
    m = seen.shape[1]
    from scipy.sparse import coo_array  # slow to load, and few commands need it
    from scipy.sparse.csgraph import connected_components

    links = coo_array((np.ones(int(steady.sum())), tuple(pairs[steady].T)), shape=(m, m))
    group = connected_components(links, directed=False)[1]
    whole = np.flatnonzero(np.bincount(group) >= FEWEST_POINTS)
    if len(whole) < 2:
        return []
    own = np.nansum(apart[:, steady], axis=0) / np.nansum(distance[:, steady], axis=0)[:, None]
    of_pair = group[pairs[steady, 0]]
    turned = np.array([1 - np.linalg.norm(own[of_pair == one], axis=1).mean() for one in whole])
    observations = np.bincount(group, weights=seen.sum(axis=0))[whole]
    body = whole[np.argmax(np.where(turned >= TURNS * turned.max(), observations, 0.0))]
    across = (group[pairs] == body).sum(axis=1) == 1
    compared, against = (np.bincount(pairs[one & across].ravel(), minlength=m) for one in (told, moving))
    moves = (against >= COMPARED) & (2 * against > compared)
    others = (np.flatnonzero(group == one) for one in whole if one != body)
    return [features for features in others if moves[features].all()]


def _medians(values: FloatArray) -> FloatArray:
    """The medians (k,) of values (n, k) that are no NaN; NaN of fewer than FEWEST."""
    ordered, count = np.sort(values, axis=0), np.isfinite(values).sum(axis=0)
    middle = np.array([np.maximum(count - 1, 0) // 2, np.minimum(count // 2, len(values) - 1)])
    return np.where(count >= FEWEST, np.take_along_axis(ordered, middle, axis=0).mean(axis=0), np.nan)

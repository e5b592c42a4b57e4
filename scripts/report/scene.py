"""The scene of a report: where chaser, features and centres of mass are, at some hundred times."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.geometry.symmetric import elements_of
from baryscope.models.lvlh import lvlh_attitude
from baryscope.models.orbit import Orbit
from baryscope.report.document import Ghost, Scene
from baryscope.report.gaps import gaps_of
from baryscope.report.thinning import evenly

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]
BoolArray = NDArray[np.bool_]

MOST_FRAMES = 1500
MOST_POINTS = 30_000  # frames × features
MOST_FEATURES = 200


@dataclass(frozen=True, eq=False)
class Body:
    """What turns in the scene, at n times: path (n, 3), attitude (n, 3, 3) or None, features (n, m, 3) in C, m.

    Attitudes are NaN where unknown, and so are features. seen, rejected: (n, m). solids: whose convex hulls are its
    shape, points (m, 3) each in axes of its own, NaN for features of others; all features make one unless given.
    """

    time: FloatArray
    path: FloatArray
    path_label: str
    attitude: FloatArray | None
    labels: tuple[str, ...]
    features: FloatArray
    seen: BoolArray
    rejected: BoolArray
    solids: tuple[FloatArray, ...] | None = None


@dataclass(frozen=True, eq=False)
class Shown:
    """An estimate to be shown at the same n times: position (n, 3), covariance (n, 3, 3) or None."""

    label: str
    colour: int
    position: FloatArray
    covariance: FloatArray | None


def scene_of(body: Body, estimates: tuple[Shown, ...], orbit: Orbit | None, about: str = "") -> Scene:
    """The scene, thinned out in time and, if there are very many, in features."""
    chosen = evenly(len(body.labels), MOST_FEATURES)
    keep = evenly(len(body.time), min(MOST_FRAMES, max(50, MOST_POINTS // len(chosen))))
    path, features = body.path[keep], body.features[np.ix_(keep, chosen)]
    state = np.where(body.seen, np.where(body.rejected, 2, 1), 0)[np.ix_(keep, chosen)]
    solids = (body_points(body),) if body.solids is None else body.solids
    ghosts = tuple(
        Ghost(
            one.label,
            one.colour,
            one.position[keep] - path,
            None if one.covariance is None else elements_of(one.covariance[keep]),
        )
        for one in estimates
    )
    return Scene(
        time=body.time[keep],
        path=path,
        path_label=body.path_label,
        labels=tuple(body.labels[index] for index in chosen.tolist()),
        features=features - path[:, None],
        state=tuple("".join(map(str, row)) for row in state.tolist()),
        faces=np.concatenate([hull_of(points[chosen]) for points in solids]),
        ghosts=ghosts,
        attitude=None if body.attitude is None else quaternions(body.attitude[keep]),
        orbit=None if orbit is None else quaternions(lvlh_attitude(orbit, body.time[keep])),
        every=len(body.time) / len(keep),
        gaps=tuple(gaps_of(body.time[keep]).tolist()),
        about=about,
    )


def quaternions(R: FloatArray) -> FloatArray:
    """Quaternions (n, 4), the scalar first, of rotations (n, 3, 3); NaN where these are."""
    from scipy.spatial.transform import Rotation  # slow to load, and few commands need it

    known = np.isfinite(R).all(axis=(1, 2))
    found = np.full((len(R), 4), np.nan)
    if known.any():
        found[known] = Rotation.from_matrix(R[known]).as_quat(scalar_first=True)
    return found


def body_points(body: Body) -> FloatArray:
    """The features in body axes from the CoM, (m, 3): medians over the frames; NaN for those that are never seen."""
    if body.attitude is None:
        return np.full((len(body.labels), 3), np.nan)
    keep = evenly(len(body.time), 2000)
    R, arms = body.attitude[keep], body.features[keep] - body.path[keep, None]
    in_body = np.einsum("kji,kmj->kmi", R, arms)
    known = np.isfinite(in_body).all(axis=(0, 2)) | np.isfinite(in_body[..., 0]).any(axis=0)
    points = np.full((in_body.shape[1], 3), np.nan)
    if known.any():
        points[known] = np.nanmedian(in_body[:, known], axis=0)
    return points


def hull_of(points: FloatArray) -> IntArray:
    """Triangles (f, 3) of the convex hull of points (m, 3), by their places; none if they span no volume.

    Points that are NaN are left out.
    """
    from scipy.spatial import ConvexHull, QhullError  # slow to load, and few commands need it

    known = np.flatnonzero(np.isfinite(points).all(axis=1))
    if len(known) < 4:
        return np.empty((0, 3), dtype=np.intp)
    try:
        return np.asarray(known[ConvexHull(points[known]).simplices])
    except (QhullError, ValueError):
        return np.empty((0, 3), dtype=np.intp)

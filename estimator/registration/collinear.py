"""Bodies of features in a line: two, or more of which none is far from it, that are seen together.

They have a direction, but no attitude of their own: how they are turned about the line only a path tells, from which
the line passes at a distance.
"""

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.geometry.evenly import evenly_spaced
from baryscope.estimator.registration.body import Body
from baryscope.estimator.registration.clusters import MIN_FRAMES, Registered, typical_steps
from baryscope.estimator.registration.flips import same_sense
from baryscope.estimator.registration.noise import noise_of_distances

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

MOST_LINES = 50  # features in lines that are looked for, one after the other
SAMPLE = 2000  # frames in which distances tell which pair is long
OFF_LINE = 5.0  # deviations of the noise, up to which a feature is on a line
SLANT = 0.05  # of the line's length: the same, for any noise
OUT_OF_PLANE = 0.01  # mean square of the lines' directions along any axis, at least
FEWEST_ON_LINE = 2  # features, of which an exchange of labels does not show in distances
LENGTH = 3.0  # deviations of the noise, from which two features have a direction


def find_collinear(position: FloatArray, used: BoolArray, time: FloatArray | None = None) -> Registered | None:
    """The bodies of features in a line in position (n, m, 3) in C, m, or None if there are none that tell a path.

    Lines tell one where they turn out of every plane: across a plane in which they stay, nothing but noise does.
    used (n, m) selects the observations. The pair that tells most, by its length and how often it is seen together,
    begins a body, which takes all frames that show two features of it; then the next, in the frames that are left.
    Frames of two in which the line is turned round against those about them are left out: their labels are exchanged.
    time (n,) in s, of steady steps unless given.
    """
    told, left, steps = noise_of_distances(position, used), used.copy(), typical_steps(len(position), time)
    noise = told.deviation
    spread = _squared_distances(position, used) - 6 * noise**2
    spread[~(spread > (LENGTH * noise) ** 2)] = 0.0
    np.fill_diagonal(spread, 0.0)
    bodies: list[Body] = []
    origins: list[FloatArray] = []
    while len(bodies) < MOST_LINES:
        together = left.T.astype(np.float64) @ left
        first, second = np.unravel_index(int(np.argmax(together * spread)), together.shape)
        if spread[first, second] == 0 or together[first, second] < (MIN_FRAMES if bodies else 1):
            break
        features, places = _on_line(position, left, int(first), int(second), noise)
        frames = np.flatnonzero(_seen_length(left[:, features], places) > LENGTH * noise)
        if not len(frames):
            spread[first, second] = spread[second, first] = 0.0
            continue
        left[np.ix_(frames, features)] = False
        body, origin = _body(position, used, frames, features, places)
        if len(features) == FEWEST_ON_LINE:
            right, _ = same_sense(steps[frames], body.attitude[:, :, 2])
            body, origin = body.in_frames(right), origin[right]
        bodies.append(body)
        origins.append(origin)
    return Registered(tuple(bodies), tuple(origins), noise, told.values) if _leave_planes(bodies) else None


def _leave_planes(bodies: list[Body]) -> bool:
    """Whether there are lines, whose directions lead out of every plane."""
    if not bodies:
        return False
    along = np.concatenate([body.attitude[:, :, 2] for body in bodies])
    return bool(np.linalg.eigvalsh(along.T @ along)[0] > OUT_OF_PLANE * len(along))


def _seen_length(used: BoolArray, places: FloatArray) -> FloatArray:
    """The length (n,) of what is seen of a line in each frame, m, for places (m,) of its features; −∞ where none is."""
    return np.asarray(np.where(used, places, -np.inf).max(axis=1) - np.where(used, places, np.inf).min(axis=1))


def _squared_distances(position: FloatArray, used: BoolArray) -> FloatArray:
    """The mean squared distances (m, m) of features that are seen together, m², in up to SAMPLE frames; 0 of others."""
    rows = evenly_spaced(len(used), SAMPLE)
    seen = used[rows].astype(np.float64)
    points = np.where(used[rows][..., None], position[rows], 0.0)
    square = np.einsum("kmi,kmi->km", points, points)
    total = square.T @ seen + seen.T @ square - 2 * np.einsum("kai,kbi->ab", points, points, optimize=True)
    count = seen.T @ seen
    return np.asarray(np.divide(total, count, out=np.zeros_like(total), where=count > 0))


def _on_line(
    position: FloatArray, used: BoolArray, first: int, second: int, noise: float
) -> tuple[IntArray, FloatArray]:
    """The features on the line through two of them, ascending, and their places (m,) along it, m from the first."""
    both = used[:, first] & used[:, second]
    apart = position[both, second] - position[both, first]
    length = np.linalg.norm(apart, axis=1)
    along = apart / np.maximum(length, 1e-300)[:, None]
    places = {first: 0.0, second: float(np.median(length))}
    most = max(OFF_LINE * noise, SLANT * places[second])
    for feature in np.flatnonzero(used[both].sum(axis=0) >= MIN_FRAMES).tolist():
        seen = used[both, feature]
        if feature in places:
            continue
        there = position[both, feature][seen] - position[both, first][seen]
        at = np.einsum("ki,ki->k", there, along[seen])
        off = np.linalg.norm(there - at[:, None] * along[seen], axis=1)
        middle = float(np.median(at))
        if np.median(off) <= most and np.median(np.abs(at - middle)) <= most:
            places[feature] = middle
    features = np.array(sorted(places), dtype=np.intp)
    return features, np.array([places[feature] for feature in features.tolist()])


def _body(
    position: FloatArray, used: BoolArray, frames: IntArray, features: IntArray, places: FloatArray
) -> tuple[Body, FloatArray]:
    """The body, and its centroid's places (n, 3) in C, m."""
    places = places - places.mean()
    weight = used[np.ix_(frames, features)].astype(np.float64)
    seen = np.where(weight[..., None] > 0, position[np.ix_(frames, features)], 0.0)
    count = weight.sum(axis=1)
    centre, middle = np.einsum("km,kmi->ki", weight, seen) / count[:, None], weight @ places / count
    turned = np.einsum("km,kmi->ki", weight * (places - middle[:, None]), seen - centre[:, None])
    along = turned / np.maximum(np.linalg.norm(turned, axis=1), 1e-300)[:, None]
    across = np.cross(along, np.eye(3)[np.abs(along).argmin(axis=1)])
    across /= np.linalg.norm(across, axis=1)[:, None]
    attitude = np.stack([across, np.cross(along, across), along], axis=2)
    points = np.column_stack([np.zeros((len(places), 2)), places])
    return Body(features, frames, points, attitude, in_line=True), centre - middle[:, None] * along

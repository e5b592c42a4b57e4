"""What is seen: features on a body, when each is in view, and the labels that a tracker gives them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.study.population.second.bodies import Body
from baryscope.study.population.second.chance import log_uniform, unit
from baryscope.study.population.second.orbits import Elements, lvlh
from baryscope.study.population.second.times import stretches

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

LAYOUTS = {"spread": 0.68, "end": 0.18, "face": 0.14}
STYLES = {
    "all": 0.16,
    "facing": 0.18,
    "pieces": 0.12,
    "drop-out": 0.1,
    "blackout": 0.14,
    "relabel": 0.12,
    "short": 0.1,
    "view": 0.08,
}
MOST_LABELS = 600
Run = tuple[int, int, int]  # a feature, the frame in which it comes into view, and that in which it is out of view


@dataclass(frozen=True, eq=False)
class Motion:
    """What the chaser would see of a body: time (n,) s; path (n, 3): its CoM in C, m; attitude (n, 3, 3) R_C_B;
    rate (n, 3) rad/s in B. C is at the chaser, its axes those of I.
    """

    orbit: Elements
    time: FloatArray
    path: FloatArray
    attitude: FloatArray
    rate: FloatArray


@dataclass(frozen=True, eq=False)
class Features:
    """points (f, 3) in B about the CoM, m; normals (f, 3) in B, zero: seen from all sides; layout, style: how they lie
    and how they are seen; count: of all, or of those tracked at once; margin: cosine to the line of sight below which a
    feature is out of view.
    """

    points: FloatArray
    normals: FloatArray
    layout: str
    style: str
    count: int
    margin: float


@dataclass(frozen=True, eq=False)
class View:
    """feature (m,): which is behind each label; seen (n, m); labels: of m."""

    feature: IntArray
    seen: BoolArray
    labels: list[str]
    words: str


def draw_features(rng: np.random.Generator, body: Body, clean: bool) -> Features:
    """3 to 30 features of a body, or 40 of short lives; clean: 12 or more, always in view."""
    m = int(rng.choice([3, 4, 5])) if rng.random() < 0.2 else round(log_uniform(rng, 4, 30))
    layout = str(rng.choice(list(LAYOUTS), p=list(LAYOUTS.values())))
    style = str(rng.choice(list(STYLES), p=list(STYLES.values())))
    margin = rng.uniform(-0.15, 0.3)
    if clean:
        style, m = "all", max(m, 12)
    if layout == "face" and style == "short":
        style = "relabel"
    points, normals = _placed(rng, body, layout, m)
    if style == "short":
        m = max(m, 5)
        points, normals = _pool(rng, body, layout, 40)
    off = 0.003 * body.size * rng.standard_normal(points.shape)
    points = points - body.com + (0.0 if layout == "face" else off)
    return Features(points, normals, layout, style, m, margin)


def _placed(rng: np.random.Generator, body: Body, layout: str, m: int) -> tuple[FloatArray, FloatArray]:
    """Points (m, 3) and normals (m, 3): on one face, at one end, or all over the body."""
    if layout == "face":
        return body.shape.face(rng, m)
    if layout != "end":
        return body.shape.surface(rng, m)
    points, normals = body.shape.surface(rng, 12 * m)
    chosen = np.argsort(points @ unit(rng))[-3 * m :]
    chosen = rng.permutation(chosen)[:m]
    return points[chosen], normals[chosen]


def _pool(rng: np.random.Generator, body: Body, layout: str, count: int) -> tuple[FloatArray, FloatArray]:
    points, normals = body.shape.surface(rng, 4 * count if layout == "end" else count)
    if layout == "end":
        chosen = np.argsort(points @ unit(rng))[-count:]
        points, normals = points[chosen], normals[chosen]
    return points, normals


def draw_view(rng: np.random.Generator, features: Features, motion: Motion, size: float, rotations: float) -> View:
    """When each feature is in view, and under which label; size: of the body, m; rotations: in all the time."""
    n, m, style = len(motion.time), len(features.points), features.style
    place = motion.path[:, None] + np.einsum("nij,mj->nmi", motion.attitude, features.points)
    faces = facing(place, np.einsum("nij,mj->nmi", motion.attitude, features.normals), features.margin)
    seen = np.ones((n, m), bool)
    opaque = rng.random() < 0.6
    if style in ("facing", "relabel") or (opaque and style in ("pieces", "drop-out", "blackout", "view")):
        seen = faces.copy()
    if style == "pieces":
        for k in range(m):
            seen[stretches(rng, n, int(rng.integers(1, 5)), 0.05, 0.35), k] = False
    elif style == "drop-out":
        seen &= rng.random(seen.shape) > rng.uniform(0.05, 0.5)
    elif style == "blackout":
        seen[stretches(rng, n, int(rng.integers(1, 4)), 0.05, 0.25)] = False
    elif style == "view":
        seen &= _field(rng, motion, place, size)
    words = f"{features.count} features, {features.layout}, {style}"
    if style not in ("all", "facing", "relabel", "short"):
        words += " opaque" if opaque else " transparent"
    if style not in ("relabel", "short"):
        return View(np.arange(m), seen, [f"f{k}" for k in range(m)], words)
    if style == "relabel":
        if rng.random() < 0.5:
            for k in range(m):
                seen[stretches(rng, n, int(rng.integers(0, 4)), 0.04, 0.15), k] = False
        spans = runs(seen)
    else:
        life = max(6, n // 40, int(rng.uniform(0.08, 0.6) * n / max(rotations, 0.3)))
        spans = short_lives(rng, faces, features.count, life)
    return _relabelled([span for span in spans if span[2] - span[1] >= 2][:MOST_LABELS], n, words)


def _relabelled(spans: list[Run], n: int, words: str) -> View:
    """A label for each run."""
    seen = np.zeros((n, len(spans)), bool)
    for column, (_, begin, end) in enumerate(spans):
        seen[begin:end, column] = True
    feature = np.array([k for k, _, _ in spans], dtype=np.intp)
    return View(feature, seen, [f"t{k}" for k in range(len(spans))], f"{words} ({len(spans)} labels)")


def _field(rng: np.random.Generator, motion: Motion, place: FloatArray, size: float) -> BoolArray:
    """Which places (n, m, 3) in C are within a cone about a direction that is fixed in LVLH, or follows the body."""
    fixed = rng.random() < 0.35
    middle = place.mean(1)
    ray = middle / np.linalg.norm(middle, axis=1, keepdims=True)
    if fixed:
        orbit = motion.orbit
        axes = np.array([lvlh(orbit.position(t), orbit.velocity(t))[0] for t in motion.time])
        half_angle = np.deg2rad(rng.uniform(8, 30))
        ray = np.einsum("nij,j->ni", axes, axes[0].T @ ray[0])
    else:
        half_angle = np.arctan(size / 2 / np.median(np.linalg.norm(middle, axis=1))) * rng.uniform(0.5, 1.3)
        ray = ray + 0.2 * half_angle * unit(rng)
        ray /= np.linalg.norm(ray, axis=1, keepdims=True)
    cosine = (place / np.linalg.norm(place, axis=-1, keepdims=True) * ray[:, None]).sum(-1)
    return np.asarray(cosine > np.cos(half_angle))


def facing(points: FloatArray, normals: FloatArray, margin: float) -> BoolArray:
    """Which points (n, m, 3) in C face the chaser, by normals (n, m, 3) in C; with a normal of zero all do."""
    toward = -points / np.linalg.norm(points, axis=-1, keepdims=True)
    free = np.linalg.norm(normals, axis=-1) < 0.5
    return np.asarray(free | ((toward * normals).sum(-1) > margin))


def runs(seen: BoolArray) -> list[Run]:
    """The runs of frames in which each feature is seen (n, m), by when they begin."""
    found: list[Run] = []
    for k in range(seen.shape[1]):
        edge = np.flatnonzero(np.diff(np.concatenate([[0], seen[:, k].astype(int), [0]])))
        found += [(k, int(b), int(e)) for b, e in zip(edge[::2], edge[1::2], strict=True)]
    return sorted(found, key=lambda run: (run[1], run[0]))


def short_lives(rng: np.random.Generator, faces: BoolArray, slots: int, life: int) -> list[Run]:
    """As a feature tracker: `slots` at once, each of about `life` frames or until it turns away; faces (n, m)."""
    n, found = len(faces), []
    busy: dict[int, tuple[int, int]] = {}
    for k in range(n):
        for point in [p for p, (_, end) in busy.items() if k >= end or not faces[k, p]]:
            found.append((point, busy.pop(point)[0], k))
        free = np.flatnonzero(faces[k] & ~np.isin(np.arange(faces.shape[1]), list(busy)))
        for point in rng.permutation(free)[: max(slots - len(busy), 0)]:
            busy[int(point)] = (k, k + 3 + int(rng.exponential(life)))
    found += [(point, begin, n) for point, (begin, _) in busy.items()]
    return sorted(found, key=lambda run: (run[1], run[0]))

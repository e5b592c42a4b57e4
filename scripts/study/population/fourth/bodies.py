"""Bodies: features in clusters that face one way each, and the mass behind them."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.study.population.fourth.chance import direction, directions, log_uniform, normalised, rotation
from baryscope.study.population.interface import FloatArray

IntArray = NDArray[np.intp]

FEWEST, MOST = 3, 30  # features
SMALLEST, LARGEST = 0.3, 6.0  # m
MOST_CLUSTERS = 8
CLOSEST = 0.01  # m, between two features
MASSES = {"general": 0.65, "thin": 0.12, "axial": 0.18, "sphere": 0.05}


@dataclass(frozen=True, eq=False)
class Body:
    """M features: points (M, 3) from the centre of mass in B, m; cluster (M,) of each; normals (k, 3) of the clusters
    in B, None if all can be seen from everywhere; size: of what the features are drawn on, m.
    """

    shape: str
    size: float
    points: FloatArray
    cluster: IntArray
    normals: FloatArray | None

    @property
    def radius(self) -> float:
        """The rms distance of all features from their centroid, m."""
        return spread(self.points)

    @property
    def reach(self) -> float:
        """The largest distance of a feature from the centre of mass, m."""
        return float(np.linalg.norm(self.points, axis=1).max())


@dataclass(frozen=True, eq=False)
class Mass:
    """inertia (3, 3) in B, in any unit; axes (3, 3): the principal ones in B as columns; kind: what it is that of."""

    inertia: FloatArray
    axes: FloatArray
    kind: str


@dataclass(frozen=True, eq=False)
class _Layout:
    """Features (M, 3) and the centre of mass (3,) in axes of the shape, m, with clusters (M,) and normals (k, 3)."""

    points: FloatArray
    centre: FloatArray
    cluster: IntArray
    normals: FloatArray


@dataclass(frozen=True, eq=False)
class _Plan:
    """What a shape starts from: size, scatter in a cluster, m; proportions (3,); cluster (M,) and normals (k, 3)."""

    size: float
    scatter: float
    proportions: FloatArray
    cluster: IntArray
    normals: FloatArray


def spread(points: FloatArray) -> float:
    """The rms distance of points (m, 3) from their centroid."""
    return float(np.sqrt(((points - points.mean(axis=0)) ** 2).sum(axis=1).mean()))


def drawn(rng: np.random.Generator) -> Body:
    """A body of 3 to 30 features in one to eight clusters; in 15 % of all nothing hides them."""
    count = int(np.clip(round(log_uniform(rng, 3, 33)), FEWEST, MOST))
    size = log_uniform(rng, SMALLEST, LARGEST)
    shape = str(rng.choice(list(_SHAPES), p=[share for share, _ in _SHAPES.values()]))
    cluster = _clusters(rng, count)
    proportions = np.array([1, rng.uniform(0.3, 1), rng.uniform(0.3, 1)])
    scatter = size * log_uniform(rng, 0.08, 0.7)
    plan = _Plan(size, scatter, proportions, cluster, directions(rng, int(cluster.max()) + 1))
    layout = _SHAPES[shape][1](rng, plan)
    points = _apart(rng, layout.points, np.array([1, 1, 0 if shape == "planar" else 1])) - layout.centre
    if rng.random() < 0.15:
        return Body(shape, size, points @ rotation(rng).T, layout.cluster, None)
    return Body(shape, size, points, layout.cluster, layout.normals)


def drawn_mass(rng: np.random.Generator) -> Mass:
    """An inertia of any axes, of second moments of mass that are positive; 18 % nearly or exactly axisymmetric."""
    kind = str(rng.choice(list(MASSES), p=list(MASSES.values())))
    second = rng.uniform(0.1, 1, 3)
    if kind == "thin":
        second = np.array([1, rng.uniform(0.01, 0.1), rng.uniform(0.01, 0.1)])
    elif kind == "axial":
        second[1] = second[0] * (1 if rng.random() < 0.5 else 1 + rng.uniform(-0.02, 0.02))
    elif kind == "sphere":
        second[:] = 1
    axes = rotation(rng)
    return Mass(axes @ np.diag(second.sum() - second) @ axes.T, axes, kind)


def _clusters(rng: np.random.Generator, count: int) -> IntArray:
    """The cluster (count,) of each feature, ascending: at most one for three features, or two."""
    number = int(np.clip(rng.integers(1, max(2, count // 3) + 1), 1, MOST_CLUSTERS))
    cluster = np.sort(rng.integers(0, number, count))
    for one in range(number):
        if one not in cluster:
            cluster[rng.integers(count)] = one
    return np.sort(cluster).astype(np.intp)


def _apart(rng: np.random.Generator, points: FloatArray, ways: IntArray) -> FloatArray:
    """Points (m, 3) of which those nearer than CLOSEST to another have been shaken, along axes (3,) that are 1."""
    points = points.copy()
    for _ in range(20):
        distance = np.linalg.norm(points[:, None] - points, axis=2) + np.eye(len(points))
        close = (distance < CLOSEST).any(axis=1)
        if not close.any():
            break
        points[close] += 2 * CLOSEST * rng.standard_normal((int(close.sum()), 3)) * ways
    return points


def _shell(rng: np.random.Generator, plan: _Plan) -> _Layout:
    centres = plan.normals * plan.size * plan.proportions
    points = centres[plan.cluster] + 0.6 * plan.scatter * rng.standard_normal((len(plan.cluster), 3))
    return _Layout(points, 0.15 * plan.size * rng.standard_normal(3), plan.cluster, plan.normals)


def _one_end(rng: np.random.Generator, plan: _Plan) -> _Layout:
    """All at about one height over the centre of mass, flat or half as thick as wide."""
    height = plan.size * log_uniform(rng, 0.8, 4)
    k = len(plan.normals)
    centres = np.column_stack([rng.uniform(-plan.size, plan.size, (k, 2)), np.full(k, height)])
    thick = np.array([1, 1, rng.choice([0.05, 0.5])])
    points = centres[plan.cluster] + 0.6 * plan.scatter * thick * rng.standard_normal((len(plan.cluster), 3))
    normals = normalised(0.7 * plan.normals + np.array([0, 0, rng.choice([0, 0.8])]))
    return _Layout(points, np.zeros(3), plan.cluster, normals)


def _outside(rng: np.random.Generator, plan: _Plan) -> _Layout:
    centres = 0.7 * rng.uniform(-plan.size, plan.size, plan.normals.shape)
    points = centres[plan.cluster] + 0.5 * plan.scatter * rng.standard_normal((len(plan.cluster), 3))
    return _Layout(points, direction(rng) * plan.size * rng.uniform(1.2, 4), plan.cluster, plan.normals)


def _planar(rng: np.random.Generator, plan: _Plan) -> _Layout:
    k, m = len(plan.normals), len(plan.cluster)
    centres = rng.uniform(-plan.size, plan.size, (k, 2))
    points = centres[plan.cluster] + 0.7 * plan.scatter * rng.standard_normal((m, 2))
    height = rng.choice([0.0, 1.0]) * rng.uniform(0.1, 2)
    centre = plan.size * np.append(rng.uniform(-1, 1, 2), height)
    normals = np.column_stack([np.zeros((k, 2)), rng.choice([-1.0, 1.0], k)]) + 0.3 * rng.standard_normal((k, 3))
    return _Layout(np.column_stack([points, np.zeros(m)]), centre, plan.cluster, normalised(normals))


def _ring(rng: np.random.Generator, plan: _Plan) -> _Layout:
    """One ring, or in 40 % two, in arcs of a cluster each; the centre of mass mostly on its axis."""
    k, m = len(plan.normals), len(plan.cluster)
    angle = 2 * np.pi * np.arange(m) / m
    height = np.zeros(m)
    if rng.random() < 0.4:
        height = np.where(np.arange(m) % 2, 1.0, -1.0) * rng.uniform(0.2, 1.5)
    points = plan.size * np.column_stack([np.cos(angle), np.sin(angle), height])
    on_axis = rng.random() < 0.7
    centre = plan.size * (np.array([0, 0, rng.uniform(-3, 3)]) if on_axis else 0.5 * rng.standard_normal(3))
    cluster = np.arange(m) * k // m
    outwards = np.stack([np.append(points[cluster == one, :2].mean(axis=0), 0) for one in range(k)])
    normals = normalised(outwards + plan.size * np.array([0, 0, rng.choice([0.0, 1.0])]) + 1e-3)
    return _Layout(points, centre, cluster, normals)


def _boom(rng: np.random.Generator, plan: _Plan) -> _Layout:
    m = len(plan.cluster)
    along = np.sort(rng.uniform(-1, 1, m))
    points = plan.size * np.column_stack([along, log_uniform(rng, 0.03, 0.25) * rng.standard_normal((m, 2))])
    centre = plan.size * np.append(rng.uniform(-1.5, 1.5), 0.2 * rng.standard_normal(2))
    cluster = np.arange(m) * len(plan.normals) // m
    return _Layout(points, centre, cluster, normalised(plan.normals * [0.3, 1, 1]))


def _box(rng: np.random.Generator, plan: _Plan) -> _Layout:
    """A cluster on each of up to six faces, all over it or at its corners and half-way to them."""
    k, m = min(len(plan.normals), 6), len(plan.cluster)
    cluster = plan.cluster % k
    faces = np.concatenate([np.eye(3), -np.eye(3)])[rng.permutation(6)[:k]]
    half = plan.size / np.sqrt(3) * np.array([1, rng.uniform(0.4, 1.2), rng.uniform(0.4, 1.2)])
    if rng.random() < 0.5:
        place = rng.uniform(-1, 1, (m, 3))
    else:
        place = rng.choice([-1.0, 1.0], (m, 3)) * rng.choice([1.0, 0.5], (m, 1))
    face = faces[cluster]
    points = half * np.where(face != 0, face, place) + 0.003 * plan.size * rng.standard_normal((m, 3))
    return _Layout(points, half * rng.uniform(-0.4, 0.4, 3), cluster, faces)


def _blob(rng: np.random.Generator, plan: _Plan) -> _Layout:
    points = 0.6 * plan.size * plan.proportions * rng.standard_normal((len(plan.cluster), 3))
    centre = plan.size * rng.choice([0.05, 0.5, 1.5]) * rng.standard_normal(3)
    return _Layout(points, centre, plan.cluster, plan.normals)


_SHAPES: dict[str, tuple[float, Callable[[np.random.Generator, _Plan], _Layout]]] = {  # how often, and how
    "shell": (0.2, _shell),
    "one end": (0.14, _one_end),
    "outside": (0.14, _outside),
    "planar": (0.1, _planar),
    "ring": (0.12, _ring),
    "boom": (0.06, _boom),
    "box": (0.14, _box),
    "blob": (0.1, _blob),
}

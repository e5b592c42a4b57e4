"""Bodies: features on a surface with the directions they face, inertia, and wings."""

from dataclasses import dataclass

import numpy as np

from baryscope.study.population.interface import BoolArray, FloatArray
from baryscope.study.population.third.dice import log_uniform, rotation

HULLS = ("box", "cylinder", "ellipsoid", "winged box")
WING_REACH = (1.3, 3.0)  # where a wing's points are, in half lengths of the box
WING_LABELS = 2  # at least
FREEST = ("sliding feature", "glint", "swapped labels")  # mismatches that take features away


@dataclass(frozen=True, eq=False)
class Body:
    """M features: points (M, 3) from the centre of mass and normals (M, 3) in B, m; inertia (3, 3) in B, of trace 1;
    swing (M, 3): the way a feature goes while its wing's tip goes 1 m, in B; half (3,): the hull's half lengths, m.
    """

    hull: str
    points: FloatArray
    normals: FloatArray
    inertia: FloatArray
    swing: FloatArray
    half: FloatArray

    @property
    def size(self) -> float:
        """The largest distance of a feature from the centre of mass, m."""
        return float(np.linalg.norm(self.points, axis=1).max())


def drawn(rng: np.random.Generator, names: tuple[str, ...], largest: float) -> Body:
    """A body with 3 to 40 features and half lengths up to `largest`, m; names: mismatches, some of which need wings or
    features to spare.
    """
    hull = "winged box" if "flexible wing" in names else str(rng.choice(HULLS, p=[0.35, 0.3, 0.2, 0.15]))
    least = 8 if hull == "winged box" else 7 if set(FREEST) & set(names) else 3
    count = round(log_uniform(rng, least, 40))
    half = log_uniform(rng, 0.1 * largest, largest) * np.exp(rng.normal(0, 0.4, 3))
    half *= min(1.0, largest / half.max())
    if hull == "cylinder":
        half[1] = half[0]
    points, normals = _BY_HULL.get(hull, _on_box)(rng, count, half)
    swing = np.zeros_like(points)
    if hull == "winged box":
        wing = np.arange(count) < max(WING_LABELS, count // 4)
        points, normals, swing = _with_wing(rng, wing, (points, normals), half)
    centre = half * rng.uniform(-0.35, 0.35, 3)
    weights = half[[1, 2, 0]] ** 2 + half[[2, 0, 1]] ** 2
    if rng.random() < 0.5:
        weights = weights * np.exp(rng.normal(0, 0.05, 3))  # payload where the hull does not tell
    weights = _possible(weights)
    R = rotation(rng) if rng.random() < 0.3 else np.eye(3)
    inertia = R @ np.diag(weights / weights.sum()) @ R.T
    return Body(hull, points - centre, normals, inertia, swing, half)


def _possible(weights: FloatArray) -> FloatArray:
    """Principal moments (3,) of which none is above the sum of the others."""
    ordered = np.argsort(weights)
    found = weights.copy()
    found[ordered[2]] = min(found[ordered[2]], 0.98 * (found[ordered[0]] + found[ordered[1]]))
    return found


def _on_box(rng: np.random.Generator, count: int, half: FloatArray) -> tuple[FloatArray, FloatArray]:
    areas = half[[1, 2, 0]] * half[[2, 0, 1]]
    axis = rng.choice(3, count, p=areas / areas.sum())
    points = half * rng.uniform(-0.95, 0.95, (count, 3))
    side = rng.choice([-1.0, 1.0], count)
    points[np.arange(count), axis] = side * half[axis]
    return points, side[:, None] * np.eye(3)[axis]


def _on_cylinder(rng: np.random.Generator, count: int, half: FloatArray) -> tuple[FloatArray, FloatArray]:
    angle = rng.uniform(0, 2 * np.pi, count)
    round_ = np.stack([np.cos(angle), np.sin(angle), np.zeros(count)], axis=1)
    lid = rng.random(count) < half[0] / (half[0] + 2 * half[2])
    inwards = np.where(lid, np.sqrt(rng.random(count)), 1.0)
    side = rng.choice([-1.0, 1.0], count)
    height = np.where(lid, side, rng.uniform(-0.95, 0.95, count))
    points = half[0] * inwards[:, None] * round_ + half[2] * height[:, None] * np.eye(3)[2]
    return points, np.where(lid[:, None], side[:, None] * np.eye(3)[2], round_)


def _on_ellipsoid(rng: np.random.Generator, count: int, half: FloatArray) -> tuple[FloatArray, FloatArray]:
    unit = rng.standard_normal((count, 3))
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    normals = unit / half
    return unit * half, normals / np.linalg.norm(normals, axis=1, keepdims=True)


_BY_HULL = {"cylinder": _on_cylinder, "ellipsoid": _on_ellipsoid}


def _with_wing(
    rng: np.random.Generator, wing: BoolArray, surface: tuple[FloatArray, FloatArray], half: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Points, normals and swing (M, 3) with those that `wing` (M,) marks on panels along ±y, which swing along x."""
    points, normals = (part.copy() for part in surface)
    count = int(wing.sum())
    side = rng.choice([-1.0, 1.0], count)
    out = rng.uniform(*WING_REACH, count)
    points[wing] = np.stack([np.zeros(count), side * out * half[1], rng.uniform(-0.9, 0.9, count) * half[2]], axis=1)
    normals[wing] = rng.choice([-1.0, 1.0], count)[:, None] * np.eye(3)[0]
    swing = np.zeros_like(points)
    swing[wing, 0] = ((out - 1) / (WING_REACH[1] - 1)) ** 2
    return points, normals, swing

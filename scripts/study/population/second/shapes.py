"""Shapes of bodies: features on the surface with outward normals, features on one plane face, and places inside.

All in the shape's own axes about its middle, m. A normal of zero: the feature is seen from all sides.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from baryscope.study.population.second.chance import TURN, unit

FloatArray = NDArray[np.float64]


class Shape(Protocol):
    """What a body has to offer."""

    def surface(self, rng: np.random.Generator, n: int) -> tuple[FloatArray, FloatArray]:
        """n features (n, 3) all over it, and their normals (n, 3)."""
        ...

    def face(self, rng: np.random.Generator, n: int) -> tuple[FloatArray, FloatArray]:
        """n features (n, 3) in one plane, and their normals (n, 3)."""
        ...

    def inside(self, rng: np.random.Generator, n: int) -> FloatArray:
        """n places (n, 3) where mass may be."""
        ...


@dataclass(frozen=True)
class Cylinder:
    """About z, of that radius and half height."""

    radius: float
    half: float

    def surface(self, rng: np.random.Generator, n: int) -> tuple[FloatArray, FloatArray]:
        """On the mantle and, in part, on the rims; at random angles or at even ones."""
        turn = rng.uniform(0, TURN, n) if rng.random() < 0.5 else TURN * np.arange(n) / max(n // 2, 1)
        radial = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(n)])
        rims = rng.random(n) < rng.choice([0.3, 0.7, 1.0])
        end = np.where(rng.random(n) < 0.5, 1.0, -1.0)
        z = np.where(rims, end * self.half, rng.uniform(-self.half, self.half, n))
        up = np.array([0.0, 0.0, 1.0])
        normals = np.where(rims[:, None], (radial + end[:, None] * up) / np.sqrt(2), radial)
        return radial * self.radius + z[:, None] * up, normals

    def face(self, rng: np.random.Generator, n: int) -> tuple[FloatArray, FloatArray]:
        """On one of the ends."""
        turn, r = rng.uniform(0, TURN, n), self.radius * np.sqrt(rng.uniform(0.1, 1, n))
        end = rng.choice([-1.0, 1.0])
        points = np.column_stack([r * np.cos(turn), r * np.sin(turn), np.full(n, end * self.half)])
        return points, np.tile([0.0, 0.0, end], (n, 1))

    def inside(self, rng: np.random.Generator, n: int) -> FloatArray:
        """Evenly over the volume."""
        turn, r = rng.uniform(0, TURN, n), self.radius * np.sqrt(rng.uniform(0, 1, n))
        return np.column_stack([r * np.cos(turn), r * np.sin(turn), rng.uniform(-self.half, self.half, n)])


@dataclass(frozen=True, eq=False)
class Box:
    """Of half sides (3,); wing: length of thin panels along ±y, whose corners are seen from both sides."""

    half: FloatArray
    wing: float = 0.0

    def surface(self, rng: np.random.Generator, n: int) -> tuple[FloatArray, FloatArray]:
        """Corners in any order; in some cases, or where these are too few, marks on the sides as well."""
        corners = self._corners()
        corners = [corners[k] for k in rng.permutation(len(corners))]
        if rng.random() < 0.4 or n > len(corners):
            share = rng.uniform(0.2, 0.8)
            corners = corners[: max(1, round(share * min(n, len(corners))))]
        while len(corners) < n:
            axis, side = rng.integers(3), rng.choice([-1.0, 1.0])
            p = rng.uniform(-0.95, 0.95, 3) * self.half
            p[axis] = side * self.half[axis]
            normal = np.zeros(3)
            normal[axis] = side
            corners.append((p, normal))
        points, normals = zip(*corners[:n], strict=True)
        return np.array(points), np.array(normals)

    def _corners(self) -> list[tuple[FloatArray, FloatArray]]:
        signs = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)], float)
        corners = [(s * self.half, s / np.sqrt(3)) for s in signs]
        if self.wing:
            for side in (-1, 1):
                for y in (self.half[1] + 0.1 * self.wing, self.half[1] + self.wing):
                    corners += [(np.array([0, side * y, z * 0.8 * self.half[2]]), np.zeros(3)) for z in (-1, 1)]
        return corners

    def face(self, rng: np.random.Generator, n: int) -> tuple[FloatArray, FloatArray]:
        """On one of the sides."""
        axis, side = rng.integers(3), rng.choice([-1.0, 1.0])
        p = rng.uniform(-0.98, 0.98, (n, 3)) * self.half
        p[:, axis] = side * self.half[axis]
        normal = np.zeros((n, 3))
        normal[:, axis] = side
        return p, normal

    def inside(self, rng: np.random.Generator, n: int) -> FloatArray:
        """Evenly over the volume; with wings, a fifth of them there."""
        p = rng.uniform(-1, 1, (n, 3)) * self.half
        if self.wing:
            wing = rng.random(n) < 0.2
            p[wing, 0] = 0
            p[wing, 1] = rng.choice([-1.0, 1.0], wing.sum()) * (self.half[1] + self.wing * rng.random(wing.sum()))
        return p


@dataclass(frozen=True, eq=False)
class Ellipsoid:
    """Of semi-axes (3,); rough: by which share the surface lies deeper, at most."""

    axes: FloatArray
    rough: float = 0.0

    def surface(self, rng: np.random.Generator, n: int) -> tuple[FloatArray, FloatArray]:
        """All over it, with the normals of the smooth one."""
        u = unit(rng, n)
        normals = u / self.axes
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        return u * self.axes * (1 - self.rough * rng.random((n, 1))), normals

    def face(self, rng: np.random.Generator, n: int) -> tuple[FloatArray, FloatArray]:
        """On a plate that cuts it at 0.8 of a semi-axis."""
        axis, side = rng.integers(3), rng.choice([-1.0, 1.0])
        turn, r = rng.uniform(0, TURN, n), 0.6 * np.sqrt(rng.uniform(0, 1, n))
        other = [k for k in range(3) if k != axis]
        p, normal = np.zeros((n, 3)), np.zeros((n, 3))
        p[:, axis], normal[:, axis] = 0.8 * side * self.axes[axis], side
        p[:, other[0]], p[:, other[1]] = r * np.cos(turn) * self.axes[other[0]], r * np.sin(turn) * self.axes[other[1]]
        return p, normal

    def inside(self, rng: np.random.Generator, n: int) -> FloatArray:
        """Evenly over the volume."""
        return np.asarray(unit(rng, n) * rng.random((n, 1)) ** (1 / 3) * self.axes)

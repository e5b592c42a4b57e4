"""A small satellite as flat facets with a texture each: a box in foil, a wing of solar cells, stub antennas, a dish.

Its box has the size and place of the preset cubesat-class's, in the same body axes; the rest is made up.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import zoom

FloatArray = NDArray[np.float64]
ImageArray = NDArray[np.float32]
Texture = Callable[[np.random.Generator, float, float], ImageArray]  # of a rectangle, m by m

TEXEL = 1.5e-3  # m
COARSEST_GRAIN = 0.064  # m, of the noise; each octave is half as large as the one before
OCTAVES = 5
CELL = 0.055  # m, of the solar cells


@dataclass(frozen=True, eq=False)
class Facet:
    """A parallelogram corner + s a + t b, 0 ≤ s, t ≤ 1, or the ellipse in it; its outward normal is along a × b.

    corner (3,), edges (2, 3): a and b, m in B; albedo (p, q): at s = (i + ½)/p, t = (j + ½)/q; round: the ellipse.
    """

    corner: FloatArray
    edges: FloatArray
    albedo: ImageArray
    round: bool = False

    @property
    def normal(self) -> FloatArray:
        """The outward unit normal (3,) in B."""
        normal = np.cross(*self.edges)
        return np.asarray(normal / np.linalg.norm(normal))


def satellite(seed: int) -> tuple[Facet, ...]:
    """The satellite, in body axes with the origin at its centre of mass; the seed is that of the textures."""
    rng = np.random.default_rng(seed)
    dish = Facet(
        np.array([-0.16, -0.25, 0.175]), np.array([[0.26, 0.0, 0.0], [0.0, 0.26, 0.0]]), _dish(rng, 0.26), round=True
    )
    return (
        *_box(rng, (-0.30, -0.345, -0.17), (0.26, 0.405, 0.15), _foil),
        *_box(rng, (0.26, -0.20, -0.012), (0.80, 0.26, 0.0), _cells),
        *_box(rng, (0.085, 0.405, 0.005), (0.115, 0.525, 0.035), _foil),
        *_box(rng, (-0.42, 0.065, -0.065), (-0.30, 0.095, -0.035), _foil),
        dish,
    )


def _box(rng: np.random.Generator, low: tuple[float, ...], high: tuple[float, ...], texture: Texture) -> list[Facet]:
    """The six facets of a box along the body axes between two corners."""
    size, facets = np.array(high) - low, []
    for axis in range(3):
        for upper in (False, True):
            first, second = (axis + 1) % 3, (axis + 2) % 3
            if not upper:
                first, second = second, first
            corner = np.array(low)
            corner[axis] = high[axis] if upper else low[axis]
            edges = np.zeros((2, 3))
            edges[0, first], edges[1, second] = size[first], size[second]
            facets.append(Facet(corner, edges, texture(rng, size[first], size[second])))
    return facets


def _foil(rng: np.random.Generator, length: float, width: float) -> ImageArray:
    """Crumpled foil with darker and brighter labels on it."""
    albedo = 0.45 + 0.17 * _grain(rng, length, width)
    for _ in range(int(40 * length * width / 0.2)):
        size = np.maximum(rng.uniform(0.008, 0.05, 2) / TEXEL, 1).astype(int)
        corner = (rng.uniform(0, 1, 2) * albedo.shape).astype(int)
        albedo[corner[0] : corner[0] + size[0], corner[1] : corner[1] + size[1]] += rng.uniform(-0.25, 0.25)
    return np.clip(albedo, 0.05, 0.95).astype(np.float32)


def _cells(rng: np.random.Generator, length: float, width: float) -> ImageArray:
    """Solar cells, which all look nearly alike, with bright gaps between them."""
    albedo = 0.14 + 0.02 * _grain(rng, length, width)
    row, column = ((np.arange(n) * TEXEL) / CELL for n in albedo.shape)
    of_cell = rng.normal(0.0, 0.02, (int(row[-1]) + 1, int(column[-1]) + 1))
    albedo += of_cell[row.astype(int)[:, None], column.astype(int)]
    gap = 0.004 / CELL
    albedo[(row % 1 < gap)[:, None] | (column % 1 < gap)] = 0.6
    return np.clip(albedo, 0.05, 0.95).astype(np.float32)


def _dish(rng: np.random.Generator, length: float) -> ImageArray:
    """A white disc with rings."""
    albedo = 0.75 + 0.05 * _grain(rng, length, length)
    axis = (np.arange(len(albedo)) + 0.5) / len(albedo) - 0.5
    radius = np.hypot(axis[:, None], axis)
    albedo[(radius > 0.3) & (radius < 0.33)] = 0.3
    albedo[radius < 0.06] = 0.2
    return np.clip(albedo, 0.05, 0.95).astype(np.float32)


def _grain(rng: np.random.Generator, length: float, width: float) -> FloatArray:
    """Noise of several octaves, of about unit standard deviation, on the texels of a rectangle."""
    shape = tuple(max(int(np.ceil(side / TEXEL)), 2) for side in (length, width))
    total = np.zeros(shape)
    for octave in range(OCTAVES):
        grain = COARSEST_GRAIN / TEXEL / 2**octave
        coarse = rng.normal(size=tuple(int(np.ceil(n / grain)) + 3 for n in shape))
        fine = zoom(coarse, grain, order=3, mode="nearest")
        total += fine[: shape[0], : shape[1]]
    return np.asarray(total / np.sqrt(OCTAVES))

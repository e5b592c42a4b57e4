"""A software renderer: flat facets with textures, sunlight by Lambert's law, through lenses with distortion.

The plane of a facet, corner + s a + t b = z d along a ray d, gives (s, t, 1)/z = [a b corner]⁻¹ d: three numbers that
are linear in the ray. The facet that is nearest, whose 1/z is greatest, is seen. Each pixel is the mean of SAMPLES²
rays, blurred as by a lens. There are no cast shadows, reflections or glints.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from baryscope.estimator.camera.lens import Lens
from baryscope.estimator.images.opencv import opencv
from baryscope.study.images.body import Facet, FloatArray, ImageArray

SAMPLES = 3  # rays along a pixel's side
BLUR = 0.5  # px, standard deviation of the lens's point spread
AMBIENT = 0.12  # of the Sun's irradiance
MARGIN = 4  # px around a facet's corners, in which distortion may bend its edges


def projected(lens: Lens, points_V: FloatArray) -> FloatArray:
    """Pixels (k, 2), as the lens distorts them, of points (k, 3), m in the camera's axes."""
    zero = np.zeros(3)
    pixels = opencv().projectPoints(points_V[:, None], zero, zero, lens.matrix, np.array(lens.distortion))[0]
    return np.asarray(pixels, dtype=np.float64)[:, 0]


@dataclass(frozen=True, eq=False)
class View:
    """The rays of a lens: x/z and y/z (rows, columns) of each in the camera's axes, SAMPLES² a pixel."""

    lens: Lens
    x: ImageArray
    y: ImageArray

    @classmethod
    def of(cls, lens: Lens) -> "View":
        """The rays of a lens."""
        cv2 = opencv()
        width, height = lens.resolution
        u, v = ((np.arange(n * SAMPLES) + 0.5) / SAMPLES - 0.5 for n in (width, height))
        points = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 1, 2)
        rays = cv2.undistortPoints(points, lens.matrix, np.array(lens.distortion)).reshape(len(v), len(u), 2)
        return cls(lens, *np.moveaxis(rays, -1, 0).astype(np.float32))

    def window(self, corners_V: FloatArray) -> tuple[slice, slice]:
        """Rows and columns of the rays that may meet a facet with corners (4, 3) in the camera's axes."""
        pixels = projected(self.lens, corners_V)
        low, high = pixels.min(axis=0) - MARGIN, pixels.max(axis=0) + MARGIN
        size = np.array(self.lens.resolution)
        (left, top), (right, bottom) = (SAMPLES * np.clip(edge, 0, size).astype(int) for edge in (low, high))
        return slice(top, bottom), slice(left, right)


def render(body: Sequence[Facet], view: View, R_V_B: FloatArray, origin_V: FloatArray, sun_V: FloatArray) -> ImageArray:
    """The image (height, width) of a body in front of a black sky; 1 is a white surface that faces the Sun.

    Args:
        body: its facets, all of them in front of the camera.
        view: the rays of the camera.
        R_V_B: (3, 3), the body's axes in the camera's.
        origin_V: (3,), its origin, m.
        sun_V: (3,), unit vector to the Sun.
    """
    width, height = view.lens.resolution
    light, nearness = (np.zeros((height * SAMPLES, width * SAMPLES), np.float32) for _ in range(2))
    for facet in body:
        normal, corner, edges = R_V_B @ facet.normal, origin_V + R_V_B @ facet.corner, facet.edges @ R_V_B.T
        if normal @ corner >= 0:
            continue
        corners = corner + np.array([[0, 0], [1, 0], [0, 1], [1, 1]]) @ edges
        window = view.window(corners)
        to_facet = np.linalg.inv(np.column_stack([*edges, corner])).astype(np.float32)
        x, y = view.x[window], view.y[window]
        s, t, inverse = (row[0] * x + row[1] * y + row[2] for row in to_facet)
        near = inverse > np.maximum(nearness[window], 0)
        near &= (s >= 0) & (t >= 0) & (s <= inverse) & (t <= inverse)
        rows, columns = np.nonzero(near)
        depth = inverse[rows, columns]
        s, t = s[rows, columns] / depth, t[rows, columns] / depth
        if facet.round:
            kept = (s - 0.5) ** 2 + (t - 0.5) ** 2 <= 0.25
            rows, columns, depth, s, t = rows[kept], columns[kept], depth[kept], s[kept], t[kept]
        nearness[window][rows, columns] = depth
        light[window][rows, columns] = _bilinear(facet.albedo, s, t) * (AMBIENT + max(float(normal @ sun_V), 0.0))
    blurred = gaussian_filter(light, BLUR * SAMPLES, truncate=3)
    return np.asarray(blurred.reshape(height, SAMPLES, width, SAMPLES).mean(axis=(1, 3)) / (1 + AMBIENT))


def exposed(image: ImageArray, noise: float, rng: np.random.Generator) -> NDArray[np.uint8]:
    """An image as a camera gives it: 8 bits, with noise of a standard deviation in steps of these."""
    values = 255 * image + noise * rng.standard_normal(image.shape, dtype=np.float32)
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)


def _bilinear(albedo: ImageArray, s: ImageArray, t: ImageArray) -> ImageArray:
    """The albedo at (s, t), between its texels."""
    found, weights = [], []
    for value, size in ((s, albedo.shape[0]), (t, albedo.shape[1])):
        place = np.clip(value * size - 0.5, 0, size - 1)
        first = np.minimum(place.astype(np.int32), size - 2)
        found.append(first)
        weights.append(place - first)
    (i, j), (p, q), flat, step = found, weights, albedo.ravel(), albedo.shape[1]
    at = i * step + j
    upper = flat[at] + q * (flat[at + 1] - flat[at])
    lower = flat[at + step] + q * (flat[at + step + 1] - flat[at + step])
    return np.asarray(upper + p * (lower - upper))

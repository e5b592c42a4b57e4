"""A rectified pair of cameras: projection of points to pixels, and triangulation with covariance.

The rig's frame V has its origin in the left camera, z along the boresight, x along the baseline to the right camera and
y completing them; pixel coordinates are relative to the principal point. An observation is (u_l, v_l, u_r), px.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any, Protocol

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from baryscope.models.columns import ColumnFunction
from baryscope.models.frames import Symbol

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
TINY = 1e-300  # m
DEEPEST = 1e5  # baselines; no pair tells the depth of what is farther off
FACING_TOLERANCE = 1e-12  # of a cosine, so that a feature exactly at the limit counts as seen


class RectifiedRig(Protocol):
    """What is known of a pair of cameras. A scenario's `StereoRig` is one."""

    @property
    def focal_length(self) -> float:
        """In px."""

    @property
    def baseline(self) -> float:
        """In m."""

    @property
    def pixel_noise(self) -> float:
        """The standard deviation of a coordinate, px."""

    @property
    def resolution(self) -> tuple[int, int] | None:
        """Width and height of the images, px; None if they have no edges."""


@dataclass(frozen=True)
class RectifiedPair:
    """A `RectifiedRig` by its numbers."""

    focal_length: float
    baseline: float
    pixel_noise: float = 1.0
    resolution: tuple[int, int] | None = None


def project(rig: RectifiedRig, R_C_V: FloatArray, points_C: FloatArray) -> FloatArray:
    """Pixels (n, m, 3) of points (n, m, 3), m in C; NaN where a point is not in front of the rig.

    Args:
        rig: focal length and baseline.
        R_C_V: (n, 3, 3), the rig's axes at each time; its left camera is C's origin.
        points_C: (n, m, 3).
    """
    points_V = points_C @ R_C_V
    return _of_each(_projection(), np.where(points_V[..., 2:] > 0, points_V, np.nan), rig)


def triangulate(rig: RectifiedRig, R_C_V: FloatArray, pixels: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Positions (n, m, 3), m, and their covariances (n, m, 3, 3), m², in C, from pixels (n, m, 3).

    The covariance is J Jᵀ σ² at the triangulated point, to first order. Both are NaN unless the disparity tells depth.
    """
    position_V, spread_V = triangulated(rig, pixels)
    spread_C = R_C_V[:, None] @ spread_V
    return position_V @ np.swapaxes(R_C_V, 1, 2), spread_C @ np.swapaxes(spread_C, -1, -2)


def triangulated(rig: RectifiedRig, pixels: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points (n, m, 3) in V, m, from pixels (n, m, 3), and their derivatives by these times the pixel noise, J σ.

    J σ (n, m, 3, 3) in m. Both are NaN unless the disparity tells a depth.
    """
    usable = np.where(tells_depth(pixels[..., 0] - pixels[..., 2], rig.focal_length)[..., None], pixels, np.nan)
    return _of_each(_triangulation(), usable, rig), _of_each(_spread(), usable, rig)


def in_images(rig: RectifiedRig, pixels: FloatArray) -> BoolArray:
    """Whether pixels (n, m, 3) lie in both images, (n, m); everything that is a number does if they have no edges."""
    if rig.resolution is None:
        return np.isfinite(pixels[..., 0])
    corner = pixels + np.array(rig.resolution)[[0, 1, 0]] / 2
    inside = _margins()(corner.reshape(-1, 3).T, np.array(rig.resolution, dtype=float)).reshape(pixels.shape)
    return np.asarray(np.all(inside >= 0, axis=-1))


def _of_each(function: ColumnFunction, values: FloatArray, rig: RectifiedRig) -> FloatArray:
    """Evaluate a function of (point or pixels, rig) for (n, m, 3) of them."""
    results = function(values.reshape(-1, 3).T, [rig.focal_length, rig.baseline, rig.pixel_noise])
    return results.reshape(*values.shape[:2], *results.shape[1:])


@cache
def _projection() -> ColumnFunction:
    """(point in V, rig) → u_l, v_l, u_r."""
    point, rig = ca.SX.sym("point", 3), ca.SX.sym("rig", 3)
    return ColumnFunction("projection", [point, rig], projection(point, rig[0], rig[1]))


@cache
def _triangulation() -> ColumnFunction:
    """(u_l, v_l, u_r; rig) → point in V."""
    pixels, rig = ca.SX.sym("pixels", 3), ca.SX.sym("rig", 3)
    return ColumnFunction("triangulation", [pixels, rig], triangulation(pixels, rig[0], rig[1]))


@cache
def _spread() -> ColumnFunction:
    """(u_l, v_l, u_r; rig) → J σ."""
    pixels, rig = ca.SX.sym("pixels", 3), ca.SX.sym("rig", 3)
    return ColumnFunction("spread", [pixels, rig], spread(pixels, rig[0], rig[1], rig[2]))


@cache
def _margins() -> ColumnFunction:
    """(pixels from the corner, resolution) → distances from the edges."""
    pixels, resolution = ca.SX.sym("pixels", 3), ca.SX.sym("resolution", 2)
    return ColumnFunction("margins", [pixels, resolution], image_margins(pixels, resolution))


def projection(point_V: Symbol, focal_length: Symbol, baseline: Symbol) -> Symbol:
    """u_l = f X/Z, v_l = f Y/Z, u_r = f (X − B)/Z."""
    x, y, z = ca.vertsplit(point_V)
    return focal_length / z * ca.vertcat(x, y, x - baseline)


def triangulation(pixels: Symbol, focal_length: Symbol, baseline: Symbol) -> Symbol:
    """Z = f B/(u_l − u_r), X = Z u_l/f, Y = Z v_l/f."""
    u_l, v_l, u_r = ca.vertsplit(pixels)
    return baseline / (u_l - u_r) * ca.vertcat(u_l, v_l, focal_length)


def tells_depth(disparity: Any, focal_length: Any) -> Any:
    """Whether a disparity (px, array or symbol) is of a point nearer than DEEPEST: beyond, covariances lose bounds."""
    return DEEPEST * disparity > focal_length


def spread(pixels: Symbol, focal_length: Symbol, baseline: Symbol, noise: Symbol) -> Symbol:
    """J σ: how the triangulated point moves for one standard deviation of each pixel coordinate."""
    free = ca.SX.sym("pixels", 3)
    jacobian = ca.jacobian(triangulation(free, focal_length, baseline), free)
    return ca.substitute(jacobian, free, pixels) * noise


def image_margins(pixels: Symbol, resolution: Symbol) -> Symbol:
    """Distances of u_l, v and u_r, from the corner, to the nearer edge of their images, px; below 0 outside."""
    size = ca.vertcat(resolution, resolution[0])
    return ca.fmin(pixels, size - pixels)


def facing_cosine(point: Symbol, normal: Symbol) -> Symbol:
    """Cosine of the angle between a normal and the direction from the point to the origin; 0 at the origin."""
    return -ca.dot(point, normal) / ca.fmax(ca.norm_2(point), TINY)

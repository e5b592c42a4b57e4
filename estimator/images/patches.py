"""Patches around features, and where they are found again: affine registration with gain and offset of the light.

Inverse compositional Lucas–Kanade (Baker and Matthews, IJCV 56, 2004; gain and offset as in its part 3), on cubic
splines of the images as they were taken: rectification is a map of coordinates here, so that pixels are interpolated
once. OpenCV's `findTransformECC` interpolates linearly, and errs by a tenth of a pixel on textures as fine as pixels.

A patch is always compared with that of the first sighting, so that errors don't add up from frame to frame: what is
wrong about the first patch is the same in all frames, and moves the point on the body once.

A plane in perspective is bent, too: p = A x / (1 + g·x) + centre. Fitted by an affine map, which averages better, its
centre is off by some hundredths of a pixel that change with the angle of view, and alike for all patches of a facet.
Where g is known, `Patches.straightened` takes that off.

Lens, pixels and SMOOTHING blur the image, not the surface: a patch that is stretched is less blurred along the stretch
than the first one was, by its second derivatives to first order. These are terms of the registration, too; without
them their residuals shift each patch by itself, alike in left and right image, for as long as the angle stays.
"""

from dataclasses import dataclass
from functools import cache
from typing import Self

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Image = NDArray[np.uint8]

HALF = 10  # px: a patch has 2 HALF + 1 rows and columns
SIDE = 2 * HALF + 1
MEAN_SQUARE = HALF * (HALF + 1) / 3  # px², of a patch's rows, and columns, from its centre
SMOOTHING = 1.0  # px: finer texture than pixels can hold looks different at each place between them
SMOOTHED = 1 / (4 * np.pi * SMOOTHING**2)  # of white noise, the share of its variance that is left
STEP = 1 / 12  # variance of the rounding to whole numbers
ROUNDS, ADEQUATE = 15, 0.003  # of the registration, and the last step, px
LEAST_CORRELATION, LEAST_GAIN = 0.95, 0.1  # of a patch with what it is found at, and of the contrast there
MOST_STRETCH = 0.7  # of a step
LARGEST, SMALLEST = 2.0, 0.35  # of a side that is seen at an angle, over that of the patch
REACH = 3.0  # px, by which the registration may move a patch


@dataclass(frozen=True, eq=False)
class Surface:
    """An image as a smooth function of rectified pixels: spline (rows, columns), and the map (2, rows, columns) that
    gives the row and the column in it.
    """

    spline: NDArray[np.float32]
    map: NDArray[np.float32]

    @classmethod
    def of(cls, image: Image, map: NDArray[np.float32]) -> Self:
        """The surface of an image as it was taken."""
        from scipy.ndimage import gaussian_filter, spline_filter  # slow to load, and few commands need it

        smooth = gaussian_filter(image.astype(np.float32), SMOOTHING)
        return cls(spline_filter(smooth, order=3, output=np.float32, mode="mirror"), map)

    def at(self, pixels: FloatArray) -> tuple[FloatArray, BoolArray]:
        """The values (k, …) at rectified pixels (k, …, 2), u and v; and for which k all are in both images, (k,)."""
        from scipy.ndimage import map_coordinates  # slow to load, and few commands need it

        where = pixels[..., ::-1].reshape(-1, 2).T
        places = np.stack([map_coordinates(part, where, order=1, mode="nearest") for part in self.map])
        values = map_coordinates(self.spline, places, order=3, mode="mirror", prefilter=False)
        inside = np.ones(where.shape[1], dtype=bool)
        for found in (where, places):
            inside &= ((found >= 0) & (np.array(self.spline.shape) - 1 >= found.T).T).all(axis=0)
        each = inside.reshape(len(pixels), int(np.prod(pixels.shape[1:-1])))
        return values.reshape(pixels.shape[:-1]), np.asarray(each.all(axis=1))


@dataclass(frozen=True, eq=False)
class Places:
    """Where k patches are in an image: p = A x + centre, x from the patch's centre. centre (k, 2) px; A (k, 2, 2)."""

    centre: FloatArray
    A: FloatArray

    @classmethod
    def upright(cls, centre: FloatArray) -> Self:
        """Patches that are neither turned nor stretched, at centres (k, 2)."""
        return cls(centre, np.tile(np.eye(2), (len(centre), 1, 1)))

    def __getitem__(self, which: BoolArray) -> "Places":
        return Places(self.centre[which], self.A[which])

    def pixels(self, grid: FloatArray) -> FloatArray:
        """Where the points (g, 2) of a patch are, (k, g, 2)."""
        return np.asarray(self.centre[:, None] + grid @ np.swapaxes(self.A, 1, 2))


@dataclass(frozen=True, eq=False)
class Found:
    """Places of k patches; covariance (k, 2, 2), px², of their centres; there (k,): whether the patch is there at all.

    The covariance takes the residuals for white noise of the pixels that was smoothed.
    """

    places: Places
    covariance: FloatArray
    there: BoolArray

    def __getitem__(self, which: BoolArray) -> "Found":
        return Found(self.places[which], self.covariance[which], self.there[which])

    def joined(self, other: "Found") -> "Found":
        """These and others."""
        places = Places(
            np.concatenate([self.places.centre, other.places.centre]), np.concatenate([self.places.A, other.places.A])
        )
        covariance = np.concatenate([self.covariance, other.covariance])
        return Found(places, covariance, np.concatenate([self.there, other.there]))


@dataclass(frozen=True, eq=False)
class Patches:
    """k patches: J (k, SIDE², 11); solver (k, 11, SIDE²), its pseudo-inverse; shape (k, 2, 2), the covariance of a
    shift, px², by white noise of the pixels of variance 1 before they are smoothed; bend (k, 2, 2), px²: the shift for
    which an affine registration takes a perspective g, px⁻¹.

    The columns of J: the derivatives by a shift (2), by shears and stretches (4), the patch, one, and the second
    derivatives of the patch (3).
    """

    J: FloatArray
    solver: FloatArray
    shape: FloatArray
    bend: FloatArray

    @classmethod
    def at(cls, surface: Surface, centre: FloatArray) -> Self:
        """The patches at centres (k, 2), px."""
        wide, _ = surface.at(Places.upright(centre).pixels(_grid(HALF + 1)))
        wide = wide.reshape(-1, SIDE + 2, SIDE + 2)
        along_u = (wide[:, 1:-1, 2:] - wide[:, 1:-1, :-2]) / 2
        along_v = (wide[:, 2:, 1:-1] - wide[:, :-2, 1:-1]) / 2
        x, y = _grid(HALF).T.reshape(2, SIDE, SIDE)
        middle, one = wide[:, 1:-1, 1:-1], np.ones_like(along_u)
        columns = [along_u, along_v, along_u * x, along_u * y, along_v * x, along_v * y, middle, one]
        columns += [wide[:, 1:-1, 2:] - 2 * middle + wide[:, 1:-1, :-2]]
        columns += [(wide[:, 2:, 2:] - wide[:, 2:, :-2] - wide[:, :-2, 2:] + wide[:, :-2, :-2]) / 4]
        columns += [wide[:, 2:, 1:-1] - 2 * middle + wide[:, :-2, 1:-1]]
        J = np.stack(columns, axis=-1).reshape(-1, SIDE**2, len(columns)).astype(np.float64)
        solver = np.linalg.pinv(np.swapaxes(J, 1, 2) @ J, hermitian=True) @ np.swapaxes(J, 1, 2)
        shape = solver[:, :2] @ _smoothed_noise() @ np.swapaxes(solver[:, :2], 1, 2)
        place = np.stack([x.ravel(), y.ravel()], axis=1)
        along = np.sum(J[:, :, :2] * place, axis=2, keepdims=True)
        return cls(J, solver, shape, solver[:, :2] @ (along * place))

    def __getitem__(self, which: BoolArray) -> "Patches":
        return Patches(self.J[which], self.solver[which], self.shape[which], self.bend[which])

    def joined(self, other: "Patches") -> "Patches":
        """These patches and others."""
        fields = ("J", "solver", "shape", "bend")
        return Patches(*(np.concatenate([getattr(one, name) for one in (self, other)]) for name in fields))

    def straightened(self, places: Places, perspective: FloatArray) -> FloatArray:
        """The centres (k, 2) of patches that are found at places, without what perspectives g (k, 2), px⁻¹, do.

        To first order I(A (x − x g·x) + c) is the patch. The affine map A x + c′ shows it at x + x g·x + A⁻¹ (c′ − c),
        and the c′ for which that is nearest to the patch is c − A bend g.
        """
        return np.asarray(places.centre + (places.A @ self.bend @ perspective[..., None])[..., 0])

    def found(self, surface: Surface, expected: Places, coarsest: float) -> Found:
        """The patches in an image, near the places where they are expected; coarsest: deviation of a coordinate, px."""
        centre, A, grid = expected.centre.copy(), expected.A.copy(), _grid(HALF)
        values, there = np.zeros((len(A), SIDE**2)), np.zeros(len(A), dtype=bool)
        moving = np.arange(len(A))
        for _ in range(ROUNDS):
            values[moving], inside = surface.at(Places(centre[moving], A[moving]).pixels(grid))
            terms = (self.solver[moving] @ values[moving, :, None])[..., 0]
            moving, terms = moving[near := inside & (terms[:, 6] > LEAST_GAIN)], terms[near]
            step = terms[:, :6] / terms[:, 6:7]
            stretch = np.eye(2) + step[:, 2:].reshape(-1, 2, 2)
            stays = np.linalg.norm(stretch - np.eye(2), axis=(1, 2)) < MOST_STRETCH
            moving, step, stretch = moving[stays], step[stays], stretch[stays]
            A[moving] = A[moving] @ np.linalg.inv(stretch)
            shift = (A[moving] @ step[:, :2, None])[..., 0]
            centre[moving] -= shift
            size = np.linalg.norm(shift, axis=1)
            there[moving[size < ADEQUATE]] = True
            moving = moving[(size >= ADEQUATE) & (np.linalg.norm(centre - expected.centre, axis=1)[moving] < REACH)]
            if not len(moving):
                break
        terms = (self.solver @ values[..., None])[..., 0]
        rest = values - (self.J @ terms[..., None])[..., 0]
        variance = np.sum(rest**2, axis=1) / (SIDE**2 - self.J.shape[2]) + SMOOTHED * STEP
        sides = np.linalg.svd(A, compute_uv=False)
        there &= (variance < (1 - LEAST_CORRELATION**2) * values.var(axis=1)) & (terms[:, 6] > LEAST_GAIN)
        there &= (sides[:, 0] < LARGEST) & (sides[:, 1] > SMALLEST)
        scale = np.where(there, variance / SMOOTHED / np.where(there, terms[:, 6], 1.0) ** 2, 1.0)
        covariance = scale[:, None, None] * (A @ self.shape @ np.swapaxes(A, 1, 2))
        there &= np.trace(covariance, axis1=1, axis2=2) < 2 * coarsest**2
        return Found(Places(centre, A), covariance, there)


@cache
def _smoothed_noise() -> FloatArray:
    """The covariance (SIDE², SIDE²) of a patch's pixels for white noise of variance 1 that was smoothed."""
    side = np.arange(SIDE)
    along = np.exp(-((side[:, None] - side) ** 2) / (4 * SMOOTHING**2))
    return np.asarray(SMOOTHED * np.kron(along, along))


def _grid(half: int) -> FloatArray:
    """The pixels ((2 half + 1)², 2) of a patch from its centre: u and v, row by row."""
    side = np.arange(-half, half + 1.0)
    v, u = np.meshgrid(side, side, indexing="ij")
    return np.stack([u.ravel(), v.ravel()], axis=1)

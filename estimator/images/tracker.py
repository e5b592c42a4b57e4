"""Features through a sequence of image pairs: detected, matched, followed, given up, and replaced by new ones.

The patch of a feature is in perspective, by an angle that changes with the view (`patches`). What the left image shows
of it and what the right does tell how its surface leans: the disparity d of a plane is linear, and with its gradient
e = ∇d / d in a frame, and e₀ in that of the first sighting, p = A x / (1 + g·x) with g = e₀ − Aᵀ e in either image.
"""

from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.images.matching import ROW, across, corners, flow
from baryscope.estimator.images.patches import MEAN_SQUARE, Found, Patches, Places, Surface
from baryscope.estimator.images.rectify import Rectified
from baryscope.estimator.images.rigid import BodyMap

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Image = NDArray[np.uint8]

MOST = 60  # features at a time
COARSEST = 0.08  # px, standard deviation of a coordinate of a feature that is kept
COARSEST_NEW = 0.04  # px, of a new one: those near the limit would be lost soon, and make room for others like them
ROOM = 0.2  # of them: new ones are looked for where so many are missing
LEANING = 1.0  # tangent, of a usual angle between a surface and the image


@dataclass(frozen=True, eq=False)
class Sightings:
    """What a frame shows: numbers (k,) of features; position (k, 3), m in the left camera's axes, and its covariance
    (k, 3, 3), m², for the noise that the patches tell of; parallax (k,), the difference of the rows, px, and its
    deviation (k,) by that noise.
    """

    numbers: NDArray[np.intp]
    position: FloatArray
    covariance: FloatArray
    parallax: FloatArray
    deviation: FloatArray


@dataclass(frozen=True, eq=False)
class _Pairs:
    """Features (k,) that both images show, by their numbers, with their patches and places; lean (k, 2): the gradient
    of the disparity over it where they were first seen, px⁻¹.
    """

    numbers: NDArray[np.intp]
    patches: Patches
    left: Found
    right: Found
    lean: FloatArray

    @classmethod
    def of(
        cls,
        numbers: NDArray[np.intp],
        patches: Patches,
        surfaces: tuple[Surface, Surface],
        expected: tuple[Places, Places],
        shift: float,
        lean: FloatArray,
        coarsest: float = COARSEST,
    ) -> Self:
        """The pairs of features that are found near their expected places, in rows that match, nearer than infinity.

        shift: how much farther right than the left image the right one shows what is infinitely far, px; lean: as first
        seen, see above.
        """
        left, right = (patches.found(*image, coarsest) for image in zip(surfaces, expected, strict=True))
        u, v = (left.places.centre - right.places.centre).T
        near = left.there & right.there & (u > -shift) & (np.abs(v) <= ROW)
        return cls(numbers, patches, left, right, lean)[near]

    def __getitem__(self, which: BoolArray) -> Self:
        lean = self.lean[which]
        return type(self)(self.numbers[which], self.patches[which], self.left[which], self.right[which], lean)

    def joined(self, other: "_Pairs") -> "_Pairs":
        """These and others."""
        numbers = np.concatenate([self.numbers, other.numbers])
        patches = self.patches.joined(other.patches)
        lean = np.concatenate([self.lean, other.lean])
        return _Pairs(numbers, patches, self.left.joined(other.left), self.right.joined(other.right), lean)

    def leaning(self, shift: float, focal_length: float) -> tuple[FloatArray, FloatArray]:
        """The gradients (k, 2) of the disparity over it, px⁻¹, and their variance (k,) along either axis.

        From the left image to the right one a patch is stretched along the row alone, by what the disparity changes
        along it. The gradients are the likeliest of surfaces that lean by LEANING: far away, where the disparity is
        small, hardly anything tells of them.

        shift: as in `of`; focal_length: of the rectified images, px.
        """
        across = self.right.places.A @ np.linalg.inv(self.left.places.A)
        disparity = self.left.places.centre[:, 0] - self.right.places.centre[:, 0] + shift
        seen = (np.array([1.0, 0.0]) - across[:, 0]) / disparity[:, None]
        noise = (self.left.covariance[:, 0, 0] + self.right.covariance[:, 0, 0]) / MEAN_SQUARE / disparity**2
        usual = (LEANING / focal_length) ** 2
        known = usual / (usual + noise)
        return known[:, None] * seen, known * noise


@dataclass(eq=False)
class Tracker:
    """Takes pairs of images, one after the other.

    corners: how many corners of left images were looked for in the right ones; rows: by how many px they are below
    their rows there, where they were seen; numbered: how many of these were placed well enough to be followed.
    """

    rectified: Rectified
    most: int = MOST
    corners: int = 0
    rows: list[float] = field(default_factory=list)
    numbered: int = 0
    _pairs: _Pairs | None = None
    _before: tuple[Image, Image] | None = None
    _body: BodyMap = field(default_factory=BodyMap)

    def sightings(self, left: Image, right: Image) -> Sightings:
        """What the next pair of images shows."""
        images, surfaces = self.rectified.images(left, right), self.rectified.surfaces(left, right)
        followed = self._followed(images, surfaces)
        new = self._new(images, surfaces, followed)
        self._before, pairs = images, new if followed is None else followed.joined(new)
        position, covariance = self.rectified.points(*_pixels(pairs, self.rectified))
        kept = ~self._body.strays(pairs.numbers.tolist(), position, covariance)
        self._pairs = pairs[kept]
        return Sightings(self._pairs.numbers, position[kept], covariance[kept], *_parallax(self._pairs))

    def _followed(self, images: tuple[Image, Image], surfaces: tuple[Surface, Surface]) -> _Pairs | None:
        """The features of the frame before that both images show again."""
        if self._before is None or self._pairs is None:
            return None
        before = self._pairs
        left, one = flow(self._before[0], images[0], before.left.places.centre)
        right, other = flow(self._before[1], images[1], before.right.places.centre)
        seen = one & other
        expected = Places(left, before.left.places.A), Places(right, before.right.places.A)
        there = expected[0][seen], expected[1][seen]
        same = before.numbers[seen], before.patches[seen]
        return _Pairs.of(*same, surfaces, there, self.rectified.shift, before.lean[seen])

    def _new(self, images: tuple[Image, Image], surfaces: tuple[Surface, Surface], followed: _Pairs | None) -> _Pairs:
        """New features, where there is room."""
        taken = np.zeros((0, 2)) if followed is None else followed.left.places.centre
        room, shift = self.most - len(taken), self.rectified.shift
        seen = corners(images[0], taken, room if room >= self.most * ROOM else 0)
        places = [(place, there) for place in seen if (there := across(*images, place, shift)) is not None]
        self.corners += len(seen)
        self.rows += [float(there[1] - round(place[1])) for place, there in places]
        left, right = np.array(places, dtype=np.float64).reshape(-1, 2, 2).swapaxes(0, 1)
        expected = Places.upright(left), Places.upright(right)
        patches = Patches.at(surfaces[0], left)
        unknown = np.zeros((len(left), 2))
        found = _Pairs.of(np.arange(len(left)), patches, surfaces, expected, shift, unknown, COARSEST_NEW)
        first, self.numbered = self.numbered, self.numbered + len(found.numbers)
        # The left patch is the feature's own: the residuals, which are none, don't tell its noise.
        own = Found(found.left.places, found.right.covariance, found.left.there)
        lean, _ = found.leaning(shift, self.rectified.focal_length)
        return _Pairs(np.arange(first, self.numbered), found.patches, own, found.right, lean)


def _pixels(pairs: _Pairs, rectified: Rectified) -> tuple[FloatArray, FloatArray]:
    """u and v in the left image and u in the right (k, 3), without perspective, and their covariance (k, 3, 3)."""
    lean, variance = pairs.leaning(rectified.shift, rectified.focal_length)
    A = pairs.left.places.A
    perspective = pairs.lean - (np.swapaxes(A, 1, 2) @ lean[..., None])[..., 0]
    left, right = (pairs.patches.straightened(found.places, perspective) for found in (pairs.left, pairs.right))
    noise = np.zeros((len(pairs.numbers), 3, 3))
    noise[:, :2, :2], noise[:, 2, 2] = pairs.left.covariance, pairs.right.covariance[:, 0, 0]
    bent = (A @ pairs.patches.bend @ np.swapaxes(A, 1, 2))[:, [0, 1, 0]]  # that of both images, nearly
    noise += variance[:, None, None] * bent @ np.swapaxes(bent, 1, 2)
    return np.column_stack([left, right[:, 0]]), noise


def _parallax(pairs: _Pairs) -> tuple[FloatArray, FloatArray]:
    """The differences (k,) of the rows, px, and their standard deviations."""
    rows = pairs.right.places.centre[:, 1] - pairs.left.places.centre[:, 1]
    return rows, np.sqrt(pairs.left.covariance[:, 1, 1] + pairs.right.covariance[:, 1, 1])

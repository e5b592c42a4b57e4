"""Features through a sequence of image pairs: detected, matched, followed, given up, and replaced by new ones."""

from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.images.matching import ROW, across, corners, flow
from baryscope.estimator.images.patches import Found, Patches, Places, Surface
from baryscope.estimator.images.rectify import Rectified
from baryscope.estimator.images.rigid import BodyMap

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Image = NDArray[np.uint8]

MOST = 60  # features at a time
COARSEST = 0.08  # px, standard deviation of a coordinate of a feature that is kept
COARSEST_NEW = 0.04  # px, of a new one: those near the limit would be lost soon, and make room for others like them
ROOM = 0.2  # of them: new ones are looked for where so many are missing


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
    """Features (k,) that both images show, by their numbers, with their patches and places."""

    numbers: NDArray[np.intp]
    patches: Patches
    left: Found
    right: Found

    @classmethod
    def of(
        cls,
        numbers: NDArray[np.intp],
        patches: Patches,
        surfaces: tuple[Surface, Surface],
        expected: tuple[Places, Places],
        shift: float,
        coarsest: float = COARSEST,
    ) -> Self:
        """The pairs of features that are found near their expected places, in rows that match, nearer than infinity.

        shift: how much farther right than the left image the right one shows what is infinitely far, px.
        """
        left, right = (patches.found(*image, coarsest) for image in zip(surfaces, expected, strict=True))
        u, v = (left.places.centre - right.places.centre).T
        return cls(numbers, patches, left, right)[left.there & right.there & (u > -shift) & (np.abs(v) <= ROW)]

    def __getitem__(self, which: BoolArray) -> Self:
        return type(self)(self.numbers[which], self.patches[which], self.left[which], self.right[which])

    def joined(self, other: "_Pairs") -> "_Pairs":
        """These and others."""
        numbers = np.concatenate([self.numbers, other.numbers])
        patches = self.patches.joined(other.patches)
        return _Pairs(numbers, patches, self.left.joined(other.left), self.right.joined(other.right))


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
        position, covariance = self.rectified.points(*_pixels(pairs))
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
        return _Pairs.of(before.numbers[seen], before.patches[seen], surfaces, there, self.rectified.shift)

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
        found = _Pairs.of(np.arange(len(left)), patches, surfaces, expected, shift, COARSEST_NEW)
        first, self.numbered = self.numbered, self.numbered + len(found.numbers)
        # The left patch is the feature's own: the residuals, which are none, don't tell its noise.
        own = Found(found.left.places, found.right.covariance, found.left.there)
        return _Pairs(np.arange(first, self.numbered), found.patches, own, found.right)


def _pixels(pairs: _Pairs) -> tuple[FloatArray, FloatArray]:
    """u and v in the left image and u in the right (k, 3), and their covariance (k, 3, 3)."""
    noise = np.zeros((len(pairs.numbers), 3, 3))
    noise[:, :2, :2], noise[:, 2, 2] = pairs.left.covariance, pairs.right.covariance[:, 0, 0]
    return np.column_stack([pairs.left.places.centre, pairs.right.places.centre[:, 0]]), noise


def _parallax(pairs: _Pairs) -> tuple[FloatArray, FloatArray]:
    """The differences (k,) of the rows, px, and their standard deviations."""
    rows = pairs.right.places.centre[:, 1] - pairs.left.places.centre[:, 1]
    return rows, np.sqrt(pairs.left.covariance[:, 1, 1] + pairs.right.covariance[:, 1, 1])

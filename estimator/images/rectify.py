"""A pair of cameras as a rectified one: parallel, of one focal length, with rows that match, and no distortion."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.camera.pair import CameraPair
from baryscope.estimator.images.opencv import opencv
from baryscope.estimator.images.patches import Surface
from baryscope.models.stereo import RectifiedPair, triangulated

FloatArray = NDArray[np.float64]
Image = NDArray[np.uint8]
Map = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Rectified:
    """Maps of the images, and what turns pixels of the rectified ones into points.

    maps: (2, height, width) of the left and right image: row and column where a rectified pixel is; focal_length: px;
    principal_point (2,): of the left image, px; the right one's is as much farther right as `shift`, px; baseline: m;
    R_left_V (3, 3): the rectified axes in those of the left camera.
    """

    maps: tuple[Map, Map]
    focal_length: float
    principal_point: FloatArray
    shift: float
    baseline: float
    R_left_V: FloatArray

    @classmethod
    def of(cls, pair: CameraPair) -> "Rectified":
        """The rectified pair, which sees as much as possible of what both images show near their middle."""
        cv2 = opencv()
        lenses, size = (pair.left, pair.right), pair.left.resolution
        turn = pair.R_left_right.T
        matrices, distortions = [lens.matrix for lens in lenses], [np.array(lens.distortion) for lens in lenses]
        turns = cv2.stereoRectify(
            matrices[0], distortions[0], matrices[1], distortions[1], size,
            turn, (-turn @ pair.right.position)[:, None], flags=0, alpha=-1,
        )  # fmt: skip
        to_rectified, projections = turns[:2], turns[2:4]
        maps = [
            np.stack(cv2.initUndistortRectifyMap(K, distortion, R, P, size, cv2.CV_32FC1)[::-1])
            for K, distortion, R, P in zip(matrices, distortions, to_rectified, projections, strict=True)
        ]
        left, right = (np.asarray(P, dtype=np.float64) for P in projections)
        return cls(
            maps=(maps[0], maps[1]),
            focal_length=float(left[0, 0]),
            principal_point=left[:2, 2],
            shift=float(right[0, 2] - left[0, 2]),
            baseline=float(-right[0, 3] / right[0, 0]),
            R_left_V=np.asarray(to_rectified[0], dtype=np.float64).T,
        )

    def images(self, left: Image, right: Image) -> tuple[Image, Image]:
        """Both images, rectified."""
        cv2 = opencv()
        one, two = (
            cv2.remap(image, *map[::-1], cv2.INTER_CUBIC) for image, map in zip((left, right), self.maps, strict=True)
        )
        return one, two

    def surfaces(self, left: Image, right: Image) -> tuple[Surface, Surface]:
        """Both images as smooth functions of rectified pixels."""
        return Surface.of(left, self.maps[0]), Surface.of(right, self.maps[1])

    def points(self, pixels: FloatArray, covariance: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Positions (k, 3), m, in the left camera's axes, and their covariances (k, 3, 3), m².

        pixels (k, 3): u and v in the left image and u in the right, px; covariance (k, 3, 3): theirs. Both are NaN
        unless the disparity is above 0.
        """
        rig = RectifiedPair(self.focal_length, self.baseline)
        centred = pixels - np.append(self.principal_point, self.principal_point[0] + self.shift)
        position, spread = (found[0] for found in triangulated(rig, centred[None]))
        spread = self.R_left_V @ spread
        return position @ self.R_left_V.T, spread @ covariance @ np.swapaxes(spread, 1, 2)

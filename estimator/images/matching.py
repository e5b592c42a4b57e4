"""Corners that are worth tracking, where a frame shows them again, and where the right image shows them."""

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.images.opencv import opencv
from baryscope.estimator.images.patches import HALF

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Image = NDArray[np.uint8]

QUALITY = 0.02  # of a corner, over the best one's
BLOCK = 7  # px, over which a corner is judged
SPACING = 12  # px between features
LEVELS = 3  # of the pyramid: motion of some 2**LEVELS windows is followed
WINDOW = 2 * HALF + 1
RETURN = 1.0  # px, by which forth and back may differ
ROW = 2  # px, by which rows may differ
LEAST_LIKENESS = 0.8  # correlation of left and right patch, before registration
WHITE, TINY = 255, 1e-12


def corners(image: Image, taken: FloatArray, most: int) -> FloatArray:
    """At most so many corners (k, 2), px, the best ones, at least SPACING from the places taken (m, 2)."""
    cv2 = opencv()
    free = np.zeros_like(image)
    edge = HALF + ROW
    free[edge:-edge, edge:-edge] = 255
    for place in np.rint(taken).astype(int).tolist():
        cv2.circle(free, place, SPACING, 0, -1)
    found = cv2.goodFeaturesToTrack(image, most, QUALITY, SPACING, mask=free, blockSize=BLOCK) if most > 0 else None
    return np.zeros((0, 2)) if found is None else np.asarray(found, dtype=np.float64).reshape(-1, 2)


def flow(before: Image, now: Image, places: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Where the places (k, 2), px, have moved, by pyramidal Lucas–Kanade; and whether the way back leads to them.

    It takes a point to be as bright in both images: they are brought to one exposure first.
    """
    if not len(places):
        return places, np.zeros(0, dtype=bool)
    cv2 = opencv()
    before, now = one_exposure(before, now)
    window = {"winSize": (WINDOW, WINDOW), "maxLevel": LEVELS}
    start = places.astype(np.float32).reshape(-1, 1, 2)
    moved, forth, _ = cv2.calcOpticalFlowPyrLK(before, now, start, None, **window)
    back, again, _ = cv2.calcOpticalFlowPyrLK(now, before, moved, None, **window)
    same = np.linalg.norm((back - start)[:, 0], axis=1) < RETURN
    return moved[:, 0].astype(np.float64), same & (forth[:, 0] == 1) & (again[:, 0] == 1)


def one_exposure(one: Image, other: Image) -> tuple[Image, Image]:
    """Both images with the mean and the deviation of the one of less contrast, so that little is cut off."""
    if other.std() > one.std():
        return one, _like(other, one)
    return _like(one, other), other


def _like(image: Image, wanted: Image) -> Image:
    """An image with mean and deviation of another one."""
    gain = wanted.std() / max(float(image.std()), TINY)
    evened = (image - image.mean()) * gain + wanted.mean()
    return np.asarray(np.clip(np.rint(evened), 0, WHITE).astype(np.uint8))


def across(left: Image, right: Image, place: FloatArray, shift: float) -> FloatArray | None:
    """Where the right image shows what the left one does at a place (2,), to a pixel: in the same row, and farther left
    than what is infinitely far, which is `shift` farther right, px.

    None if nothing there is alike, or if the way back leads elsewhere.
    """
    u, v = np.rint(place).astype(int).tolist()
    far, end = round(shift), left.shape[1] - HALF
    there = _best(left, right, (u, v), range(HALF, min(u + far + 1, end)))
    if there is None:
        return None
    back = _best(right, left, there, range(max(there[0] - far, HALF), end))
    if back is None or abs(back[0] - u) > RETURN:
        return None
    return np.array(there, dtype=np.float64)


def _best(one: Image, other: Image, place: tuple[int, int], columns: range) -> tuple[int, int] | None:
    """The pixel of the other image, in these columns, whose patch is most like that of one image at a place."""
    cv2 = opencv()
    u, v = place
    if not len(columns):
        return None
    patch = one[v - HALF : v + HALF + 1, u - HALF : u + HALF + 1]
    first, last = columns.start - HALF, columns.stop + HALF
    strip = other[max(v - HALF - ROW, 0) : v + HALF + ROW + 1, first:last]
    if patch.shape != (WINDOW, WINDOW) or strip.shape[0] < WINDOW or strip.shape[1] < WINDOW:
        return None
    _, likeness, _, (column, row) = cv2.minMaxLoc(cv2.matchTemplate(strip, patch, cv2.TM_CCOEFF_NORMED))
    if likeness < LEAST_LIKENESS:
        return None
    return column + first + HALF, row + max(v - HALF - ROW, 0) + HALF

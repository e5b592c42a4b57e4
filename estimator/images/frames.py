"""Grey images from a folder or a video, one at a time."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.images.numbers import places_of, refuse_other_numbers
from baryscope.estimator.images.opencv import opencv
from baryscope.models.errors import InputError
from baryscope.models.files import AnyPath, read_bytes
from baryscope.models.words import counted

Image = NDArray[np.uint8]

ENDINGS = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm")
WHAT = "an image"


@dataclass(frozen=True)
class Folder:
    """The images of a folder by name, in the order of the numbers in their names: 9.png before 10.png.

    Of grey values of 16 bits, those 8 are used which hold the greatest one of all images: a camera of 12 bits may leave
    the upper four empty.
    """

    path: Path
    files: tuple[Path, ...]
    rate: float | None = None  # Hz; a folder tells none

    def __len__(self) -> int:
        return len(self.files)

    def places(self, count: int) -> NDArray[np.int64]:
        """Which image of the sequence each of the first `count` is; numbers that are missing in the names count."""
        return places_of(self.files)[:count]

    def __iter__(self) -> Iterator[tuple[str, Image]]:
        unused: int | None = None  # lower bits of 16
        for file in self.files:
            values = _decoded(file)
            if values.dtype != np.uint8:
                if unused is None:
                    unused = max(_brightest(self.files).bit_length() - 8, 0)
                values = np.minimum(values >> unused, 255)
            yield str(file), values.astype(np.uint8)


@dataclass(frozen=True)
class Video:
    """The frames of a video; its length is what its header says, which need not be what it has."""

    path: Path
    length: int
    rate: float | None

    def __len__(self) -> int:
        return self.length

    def places(self, count: int) -> NDArray[np.int64]:
        """Which image of the sequence each of the first `count` is: a video tells of none that is missing."""
        return np.arange(count)

    def __iter__(self) -> Iterator[tuple[str, Image]]:
        cv2 = opencv()
        video = cv2.VideoCapture(str(self.path))
        try:
            number = 0
            while (found := video.read())[0]:
                image = found[1] if found[1].ndim == 2 else cv2.cvtColor(found[1], cv2.COLOR_BGR2GRAY)
                yield f"{self.path}, frame {number}", image
                number += 1
        finally:
            video.release()


def frames_of(path: AnyPath) -> Folder | Video:
    """The images of a folder, or the frames of a video.

    Raises:
        InputError: there is no such folder or file, the folder has no images, the file is no video, or OpenCV is not
            installed.
    """
    cv2, place = opencv(), Path(path)
    if place.is_dir():
        files = [file for file in place.iterdir() if file.suffix.lower() in ENDINGS and not file.name.startswith(".")]
        if not files:
            raise InputError(f"{place}: no images, expected some that end in {', '.join(ENDINGS)}")
        return Folder(place, tuple(sorted(files, key=_by_numbers)))
    if not place.is_file():
        raise InputError(f"{place}: not found, expected a folder of images or a video")
    video = cv2.VideoCapture(str(place))
    try:
        if not video.isOpened() or not video.read()[0]:
            raise InputError(f"{place}: cannot be read, expected a video that OpenCV knows, or a folder of images")
        length, rate = (float(video.get(what)) for what in (cv2.CAP_PROP_FRAME_COUNT, cv2.CAP_PROP_FPS))
    finally:
        video.release()
    known = np.isfinite([length, rate]) & (np.array([length, rate]) > 0)
    return Video(place, int(length) if known[0] else 0, rate if known[1] else None)


def pairs_of(left: Folder | Video, right: Folder | Video, resolution: tuple[int, int]) -> Iterator[tuple[Image, Image]]:
    """The pairs of images, one after the other; resolution: width and height that each must have.

    Raises:
        InputError: one cannot be read, has another size, or has no partner on the other side.
    """
    if isinstance(left, Folder) and isinstance(right, Folder):
        refuse_other_numbers(left.files, right.files)
    sides, count = (iter(left), iter(right)), 0
    while True:
        pair = [next(side, None) for side in sides]
        if pair[0] is None and pair[1] is None:
            return
        if pair[0] is None or pair[1] is None:
            short, other = (left.path, right.path) if pair[0] is None else (right.path, left.path)
            found = counted(count, "image")
            raise InputError(f"{short}: {found}, but {other} has more; expected one of each for a pair")
        for name, image in (pair[0], pair[1]):
            if image.shape[::-1] != resolution:
                found, wanted = ("×".join(map(str, size)) for size in (image.shape[::-1], resolution))
                raise InputError(f"{name}: {found} px, expected {wanted}, the rig's resolution")
        yield pair[0][1], pair[1][1]
        count += 1


def _decoded(file: Path) -> NDArray[np.uint8] | NDArray[np.uint16]:
    """The grey image of a file."""
    cv2 = opencv()
    content = np.frombuffer(read_bytes(file, WHAT), np.uint8)
    image = cv2.imdecode(content, cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH) if content.size else None
    if image is None:
        raise InputError(f"{file}: cannot be decoded, expected {WHAT} ({', '.join(ENDINGS)})")
    if image.dtype not in (np.uint8, np.uint16):
        raise InputError(f"{file}: found grey values of type {image.dtype}, expected whole numbers of 8 or 16 bits")
    return np.asarray(image)


def _brightest(files: Sequence[Path]) -> int:
    """The greatest grey value of those that have more than 8 bits."""
    images = (_decoded(file) for file in files)
    return max(int(image.max()) for image in images if image.dtype != np.uint8)


def _by_numbers(file: Path) -> list[tuple[bool, int, str]]:
    """The parts of a name, the numbers as numbers."""
    parts = re.split(r"(\d+)", file.name)
    return [(part.isdecimal(), int(part) if part.isdecimal() else 0, part) for part in parts]

"""Marker tracks in .c3d, the binary form of motion capture, by ezc3d."""

import struct
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import InputError
from baryscope.models.files import AnyPath, read_bytes

FloatArray = NDArray[np.float64]

WHAT = "marker tracks in C3D"
BLOCK, KEY, INTEL = 512, 0x50, 84
MOST_FRAMES = 0xFFFF  # that the header can count


def read_c3d(path: AnyPath) -> tuple[FeatureTracks, str]:
    """The tracks, in the file's unit, and that unit; time 0 is that of frame 0, the first of the recording.

    Raises:
        InputError: no such file, or no markers in it, or ezc3d is not installed.
    """
    source = str(path)
    content = read_bytes(path, WHAT)
    _refuse_truncated(content, source)
    if find_spec("ezc3d") is None:
        raise InputError(f"{source}: C3D needs ezc3d, expected it installed: pip install 'baryscope[mocap]'")
    import ezc3d

    try:
        found = ezc3d.c3d(source)
    except (OSError, ValueError, RuntimeError) as error:
        raise InputError(f"{source}: not {WHAT} ({error})") from error
    about = found["parameters"]["POINT"]
    position = np.moveaxis(found["data"]["points"][:3], 0, -1).swapaxes(0, 1).astype(np.float64)
    residual = found["data"]["meta_points"]["residuals"][0].T
    if len(position) == MOST_FRAMES:
        position, residual = _whole(content, found["parameters"], position, residual)
    if not position.size:
        raise InputError(f"{source}: no markers, expected the positions of some in frames")
    position[(residual < 0) | ~np.isfinite(position).all(axis=2)] = np.nan
    header = found["header"]["points"]
    time = (header["first_frame"] + np.arange(len(position))) / float(header["frame_rate"])
    try:
        tracks = FeatureTracks(time, position, _labels(about, position.shape[1]))
    except InputError as error:
        raise InputError(f"{source}: {error}") from error
    units = about.get("UNITS", {}).get("value", [])
    return tracks, str(units[0]).strip() if len(units) else ""


def _labels(about: Any, count: int) -> list[str]:
    """The markers' labels; beyond 255 they are in LABELS2 and so on, and markers without one get a number."""
    groups = ["LABELS", *(f"LABELS{k}" for k in range(2, 2 + count // 255))]
    labels = [str(label).strip() for group in groups for label in about.get(group, {}).get("value", [])]
    return [labels[k] if k < len(labels) and labels[k] else f"marker {k + 1}" for k in range(count)]


@dataclass(frozen=True)
class _Header:
    """The first block: numbers of points and of analogue values in a frame; first and last frame, which are 16 bits;
    scale, below 0 where numbers are floating-point; offset, in bytes, at which the frames begin.
    """

    points: int
    analogue: int
    first: int
    last: int
    scale: float
    offset: int

    @classmethod
    def of(cls, content: bytes) -> "_Header | None":
        """That of a file; None if it is not of Intel's processors. Others are rare, and ezc3d reads them."""
        processor = BLOCK * (content[0] - 1) + 3
        if len(content) > processor and content[processor] != INTEL:
            return None
        points, analogue, first, last, _, scale, start = struct.unpack_from("<HHHHHfH", content, 2)
        return cls(points, analogue, first, last, scale, BLOCK * (start - 1))

    @property
    def numbers(self) -> np.dtype[Any]:
        """Of coordinates and analogue values."""
        return np.dtype("<f4" if self.scale < 0 else "<i2")

    @property
    def frame(self) -> int:
        """Its length in bytes."""
        return (4 * self.points + self.analogue) * self.numbers.itemsize


def _refuse_truncated(content: bytes, source: str) -> None:
    """Check the header, and that the file is as long as it says: of a shorter one ezc3d reads for ever.

    Raises:
        InputError: it is not.
    """
    if len(content) < BLOCK or content[1] != KEY:
        raise InputError(
            f"{source}: not {WHAT}, whose second byte is {KEY:#x} and which have a header of {BLOCK} bytes"
        )
    header = _Header.of(content)
    if header is None:
        return
    frames = header.last - header.first + 1 if header.last < MOST_FRAMES else 0
    needed = header.offset + frames * header.frame
    if len(content) < needed:
        raise InputError(f"{source}: {len(content)} bytes, its header tells of {needed}: cut short")


def _whole(
    content: bytes, parameters: Any, position: FloatArray, residual: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Positions (n, m, 3) and residuals (n, m) of a file whose frames are more than its header can count.

    ezc3d reads as many as that, `position` and `residual`. How many there are is in parameters of which recorders have
    one or another, else in the length of the file, which zeros fill up to a block.
    """
    header = _Header.of(content)
    if header is None or not header.frame:
        return position, residual
    there = (len(content) - header.offset) // header.frame
    values = np.frombuffer(content, header.numbers, there * (header.frame // header.numbers.itemsize), header.offset)
    values = values.reshape(there, -1)[:, : 4 * header.points].reshape(there, header.points, 4).astype(np.float64)
    told = _told_frames(parameters)
    if told is None:
        filled = np.flatnonzero(values.any(axis=(1, 2)))
        told = int(filled[-1]) + 1 if len(filled) else 0
    values = values[: max(min(told, there), len(position))]
    return values[..., :3] * (1.0 if header.scale < 0 else header.scale), values[..., 3]


def _told_frames(parameters: Any) -> int | None:
    """The number of frames in parameters with more than 16 bits; None if there are none."""
    trial = parameters.get("TRIAL", {})
    ends = [trial.get(f"ACTUAL_{end}_FIELD", {}).get("value", []) for end in ("START", "END")]
    if all(len(words) == 2 for words in ends):
        first, last = (int(low) % 0x10000 + 0x10000 * int(high) for low, high in ends)
        return last - first + 1
    long = parameters["POINT"].get("LONG_FRAMES", {}).get("value", [])
    return int(long[0]) if len(long) else None

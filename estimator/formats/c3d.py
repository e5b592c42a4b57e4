"""Marker tracks in .c3d, the binary form of motion capture, by ezc3d."""

import struct
from importlib.util import find_spec
from typing import Any

import numpy as np

from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import InputError
from baryscope.models.files import AnyPath, read_bytes

WHAT = "marker tracks in C3D"
BLOCK, KEY, INTEL = 512, 0x50, 84
MOST_FRAMES = 0xFFFF  # that the header can count


def read_c3d(path: AnyPath) -> tuple[FeatureTracks, str]:
    """The tracks, in the file's unit, and that unit; time 0 is that of frame 0, the first of the recording.

    Raises:
        InputError: no such file, or no markers in it, or ezc3d is not installed.
    """
    source = str(path)
    _refuse_truncated(read_bytes(path, WHAT), source)
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


def _refuse_truncated(content: bytes, source: str) -> None:
    """Check the header, and that the file is as long as it says: of a shorter one ezc3d reads for ever.

    Raises:
        InputError: it is not.
    """
    if len(content) < BLOCK or content[1] != KEY:
        raise InputError(
            f"{source}: not {WHAT}, whose second byte is {KEY:#x} and which have a header of {BLOCK} bytes"
        )
    # Processors other than Intel's wrote other numbers; such files are rare, and ezc3d reads them.
    processor = BLOCK * (content[0] - 1) + 3
    if len(content) > processor and content[processor] != INTEL:
        return
    points, analog, first, last, _, scale, start = struct.unpack_from("<HHHHHfH", content, 2)
    frames = last - first + 1 if last < MOST_FRAMES else 0
    needed = BLOCK * (start - 1) + frames * (4 * points + analog) * (4 if scale < 0 else 2)
    if len(content) < needed:
        raise InputError(f"{source}: {len(content)} bytes, its header tells of {needed}: cut short")

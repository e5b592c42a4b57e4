"""The blocks of a C3D file: header, parameters and frames, as the format's manual has them (www.c3d.org).

All bounds are checked, so that whatever a damaged file says ends in an error.
"""

import struct
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baryscope.models.errors import InputError

FloatArray = NDArray[np.float64]
Parameters = dict[str, dict[str, list[Any]]]

BLOCK, KEY = 512, 0x50
INTEL, DEC, MIPS = 84, 85, 86  # processors: little-endian; the same with floating-point numbers of a VAX; big-endian
TEXT, SIZES = -1, {-1: 1, 1: 1, 2: 2, 4: 4}  # types of parameters, and bytes of a value


@dataclass(frozen=True)
class Numbers:
    """How a processor writes numbers."""

    processor: int

    @classmethod
    def of(cls, content: bytes, source: str) -> "Numbers":
        """The numbers of a file, whose first block is there.

        Raises:
            InputError: no processor that the format knows.
        """
        place = BLOCK * (content[0] - 1) + 3
        processor = content[place] if 0 < place < len(content) else 0
        if processor not in (INTEL, DEC, MIPS):
            raise InputError(
                f"{source}: cut short or damaged: the parameters, from block {content[0]} on, are for processor "
                f"{processor}, expected {INTEL}, {DEC} or {MIPS}"
            )
        return cls(processor)

    @property
    def order(self) -> str:
        """The order of bytes, as struct and numpy have it."""
        return ">" if self.processor == MIPS else "<"

    def integers(self, content: bytes, count: int, offset: int, kind: str = "i2") -> NDArray[Any]:
        """So many of 16 bits from there on."""
        return np.frombuffer(content, f"{self.order}{kind}", count, offset)

    def floats(self, content: bytes, count: int, offset: int) -> NDArray[Any]:
        """So many of 32 bits from there on."""
        if self.processor != DEC:
            return np.frombuffer(content, f"{self.order}f4", count, offset)
        words = np.frombuffer(content, "<u2", 2 * count, offset).astype(np.uint32)
        return np.asarray((words[::2] << 16 | words[1::2]).view(np.float32) / 4)  # the exponent counts from two more


@dataclass(frozen=True)
class Header:
    """The first block: numbers of points and of analogue values in a frame; first and last frame, from 1, which are
    16 bits; scale, below 0 where numbers are floating-point; offset, in bytes, at which the frames begin; rate, in Hz.
    """

    points: int
    analogue: int
    first: int
    last: int
    scale: float
    offset: int
    rate: float

    @classmethod
    def of(cls, content: bytes, numbers: Numbers) -> "Header":
        """The header of a file."""
        points, analogue, first, last, start = numbers.integers(content, 9, 2, "u2")[[0, 1, 2, 3, 7]].tolist()
        scale, _, rate = numbers.floats(content, 3, 12).tolist()  # between them start and samples in a frame
        return cls(points, analogue, first, last, scale, BLOCK * (start - 1), rate)

    @property
    def frame(self) -> int:
        """The length of a frame in bytes."""
        return (4 * self.points + self.analogue) * (4 if self.scale < 0 else 2)


def parameters_of(content: bytes, numbers: Numbers, source: str) -> Parameters:
    """The values of all parameters, by group and name; texts are without blanks around.

    Raises:
        InputError: one goes beyond the file.
    """
    groups: dict[int, str] = {}
    found: list[tuple[int, str, list[Any]]] = []
    place = BLOCK * (content[0] - 1) + 4
    try:
        while content[place]:
            length, group = struct.unpack_from("bb", content, place)
            name_ends = place + 2 + abs(length)
            name = _text(content[place + 2 : name_ends]).upper()
            (step,) = struct.unpack_from(f"{numbers.order}H", content, name_ends)
            if group < 0:
                groups[-group] = name
            else:
                found.append((group, name, _values(content, numbers, name_ends + 2)))
            if not step:
                break
            place = name_ends + step
    except (struct.error, IndexError, ValueError) as error:
        raise InputError(f"{source}: cut short or damaged: parameters go beyond its {len(content)} bytes") from error
    parameters: Parameters = {}
    for group, name, values in found:
        parameters.setdefault(groups.get(group, ""), {})[name] = values
    return parameters


def _values(content: bytes, numbers: Numbers, place: int) -> list[Any]:
    """The values of a parameter, whose type stands there."""
    kind, dimensions = struct.unpack_from("bB", content, place)
    if kind not in SIZES:
        return []
    shape = list(struct.unpack_from(f"{dimensions}B", content, place + 2))
    place += 2 + dimensions
    count = int(np.prod(shape, dtype=np.int64))
    if count * SIZES[kind] > len(content) - place:
        raise ValueError(count)
    if kind == TEXT:
        size = shape[0] if shape else 1
        return [_text(content[begin : begin + size]) for begin in range(place, place + count, size)] if size else []
    if kind == 1:
        return list(content[place : place + count])
    values: list[Any] = (numbers.floats if kind == 4 else numbers.integers)(content, count, place).tolist()
    return values


def _text(raw: bytes) -> str:
    """A text without blanks around; the format has ASCII, and recorders write either of two others besides."""
    try:
        return raw.decode().strip("\0 ")
    except UnicodeDecodeError:
        return raw.decode("latin-1").strip("\0 ")


def frames_of(content: bytes, numbers: Numbers, header: Header, count: int) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Positions (count, m, 3) in the file's unit, and which of them are valid (count, m)."""
    each = header.frame // (4 if header.scale < 0 else 2)
    read = numbers.floats if header.scale < 0 else numbers.integers
    values = read(content, count * each, header.offset).reshape(count, each)[:, : 4 * header.points]
    values = values.reshape(count, header.points, 4)
    with np.errstate(invalid="ignore"):  # of numbers that are none, in a damaged file
        position = values[..., :3].astype(np.float64)
    if header.scale > 0:
        position *= header.scale
    return position, (values[..., 3] >= 0) & np.isfinite(position).all(axis=2)

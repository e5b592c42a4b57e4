"""Whether a shared library is whole, from its header, before the process loads it.

Linux maps a library without a look at its length: what is read beyond the end of one that is cut ends the process, by
SIGBUS, without a message. The loaders of Windows and macOS refuse such a file themselves.
"""

import struct
from pathlib import Path

from baryscope.fmu.layout.platforms import library_of_this_machine
from baryscope.models.errors import InputError

MAGIC, CLASS_64 = b"\x7fELF", 2
HEADER, SEGMENT = 64, 56  # bytes of ELF's header and of a segment's, of 64 bits
LOADED = 1  # type of the segments that are mapped into memory


def refuse_cut(library: Path, place: str) -> None:
    """Check that a library in ELF is as long as its header says; `place` names it in errors.

    Raises:
        InputError: it is shorter.
    """
    content = library.read_bytes()
    if content.startswith(MAGIC) and content[4:5] in (b"", bytes([CLASS_64])):
        expected = _length(content)
        if len(content) < expected:
            raise InputError(f"{place}: is cut off, found {len(content)} bytes, expected {expected} as in its header")


def refuse_cut_unit(folder: Path, model_identifier: str, source: str) -> None:
    """Check the library of an unpacked unit of FMI 2 that this machine would load; `source` names the unit in errors.

    Raises:
        InputError: it is cut off.
    """
    library = library_of_this_machine(folder, model_identifier, 2)
    if library is not None:
        refuse_cut(library, f"{source}: {library.relative_to(folder).as_posix()}")


def _length(content: bytes) -> int:
    """How long a library in ELF of 64 bits is at least, in bytes."""
    if len(content) < HEADER:
        return HEADER
    order = ">" if content[5] == 2 else "<"
    segments, sections = struct.unpack_from(f"{order}QQ", content, 32)
    segment_size, segment_count, section_size, section_count = struct.unpack_from(f"{order}4H", content, 54)
    length = max(segments + segment_size * segment_count, sections + section_size * section_count)
    if len(content) < length or segment_size < SEGMENT:
        return int(length)
    for index in range(segment_count):
        kind, _, offset, _, _, size = struct.unpack_from(f"{order}IIQQQQ", content, segments + index * segment_size)
        if kind == LOADED:
            length = max(length, offset + size)
    return int(length)

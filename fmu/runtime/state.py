"""A saved state of a session: the unit's state, and the session's time."""

import ctypes
import struct
import zlib
from types import TracebackType
from typing import Self

from baryscope.fmu.runtime.instance import Instance
from baryscope.models.errors import InputError

_MAGIC = b"barysess"
_HEAD = struct.Struct("<8sddI")  # magic, time, the rest of the time, checksum of these two


class SavedState:
    """The whole state of a session at one time; it can be restored any number of times.

    It is freed by `close`, at the end of a `with` block, with its session, or when it is garbage collected.

    Attributes:
        time: time of the state, s.
        time_rest: low-order part of the time, s, by Kahan's sum.
    """

    def __init__(self, instance: Instance, time: float, time_rest: float):
        self._instance = instance
        self.time, self.time_rest = time, time_rest
        self._state: ctypes.c_void_p | None = instance.save()

    @property
    def pointer(self) -> ctypes.c_void_p:
        """The unit's state.

        Raises:
            InputError: the state was freed.
        """
        if self._state is None:
            raise InputError("the saved state was closed, or its session was")
        return self._state

    def to_bytes(self) -> bytes:
        """The state as bytes, for another session of the same unit, in this process or another."""
        times = struct.pack("<dd", self.time, self.time_rest)
        return _HEAD.pack(_MAGIC, self.time, self.time_rest, zlib.crc32(times)) + self._instance.serialise(self.pointer)

    __bytes__ = to_bytes

    def close(self) -> None:
        """Free it; closing twice is fine."""
        state, self._state = self._state, None
        if state is not None:
            self._instance.free_state(state)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __del__(self) -> None:
        if getattr(self, "_state", None) is not None:
            self.close()


def read_times(content: bytes) -> tuple[float, float, bytes]:
    """Time, the rest of the time, and the unit's own bytes from `SavedState.to_bytes`.

    Raises:
        InputError: the bytes are not those of a saved state, or are damaged.
    """
    if len(content) <= _HEAD.size or not content.startswith(_MAGIC):
        raise InputError(f"the {len(content)} bytes are not a saved state, expected those of SavedState.to_bytes")
    _, time, rest, checksum = _HEAD.unpack_from(content)
    if checksum != zlib.crc32(struct.pack("<dd", time, rest)):
        raise InputError("the saved state is damaged, expected the bytes of SavedState.to_bytes")
    return time, rest, content[_HEAD.size :]

"""Files: written completely or not at all, and read with errors of one line; folders for temporary ones."""

import errno
import os
import shutil
import stat
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

if sys.platform != "win32":
    import fcntl

from baryscope.models.errors import DiskError, InputError

DISK_TROUBLE = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO}
TEMPORARY = "baryscope."  # begins the names of folders for temporary files
AnyPath = str | os.PathLike[str]  # what functions take that users call


@contextmanager
def replacing(path: AnyPath) -> Iterator[Path]:
    """Yield a temporary path in the folder of `path`; rename it to `path` on success, remove it on failure.

    Folders that are missing are made. An interrupted or failed block leaves an older `path` as it was. A link stays,
    and the file that it shows is replaced; who may read or write an older file may do so with the new one.

    Raises:
        InputError: the folder cannot be made or written to, or `path` is a folder, a device or a pipe.
        DiskError: the disk is full, or fails.
    """
    path, place = Path(path), Path(os.path.realpath(path))
    if place.is_dir():
        raise InputError(f"{path}: is a folder, expected the name of a file to write")
    if place.exists() and not place.is_file():
        raise InputError(f"{path}: is a device or a pipe, expected the name of a file to write")
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=place.parent, prefix=f".{place.stem}.", suffix=place.suffix)
    except OSError as error:
        raise unwritable(path, error) from error
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        temporary.chmod(_permissions(place))
        temporary.replace(place)
    except OSError as error:
        if error.filename not in (None, name, temporary) or isinstance(error, BrokenPipeError):
            raise  # of something else that was done meanwhile
        raise unwritable(path, error) from error
    finally:
        temporary.unlink(missing_ok=True)


def _permissions(path: Path) -> int:
    """The permissions of a file that is there, or those of a new one."""
    try:
        return stat.S_IMODE(path.stat().st_mode)
    except FileNotFoundError:
        umask = os.umask(0)
        os.umask(umask)
        return 0o666 & ~umask


@contextmanager
def replacing_folder(path: AnyPath, what: str, marks: tuple[str, ...]) -> Iterator[Path]:
    """Yield a name for a new folder beside `path`; it becomes `path` on success, and is removed on failure.

    An older folder of the name is removed once the new one has its place, if it has one of `marks` in it. A link stays,
    and the folder that it shows is replaced.

    Raises:
        InputError: the folder cannot be made or written to, or `path` is there and does not hold `what`.
        DiskError: the disk is full, or fails.
    """
    path, place = Path(path), Path(os.path.realpath(path))
    if place.exists() and not any((place / mark).is_file() for mark in marks):
        raise InputError(f"{path}: is there, but is not {what}; expected another name")
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        beside = Path(tempfile.mkdtemp(dir=place.parent, prefix=f".{place.stem}."))
    except OSError as error:
        raise unwritable(path, error) from error
    new, old = beside / place.name, beside / "old"
    try:
        yield new
        if place.exists():
            place.replace(old)
        new.replace(place)
    except OSError as error:
        if old.exists() and not place.exists():
            old.replace(place)
        raise unwritable(path, error) from error
    finally:
        shutil.rmtree(beside, ignore_errors=True)


@dataclass(frozen=True)
class Whole:
    """Writes a file that is not text, under a name that it is told."""

    write: Callable[[Path], object]


@dataclass(frozen=True)
class Folder:
    """Writes a folder under a name that it is told; one that it replaces has to hold one of `marks`.

    what: it holds, for errors.
    """

    write: Callable[[Path], object]
    what: str
    marks: tuple[str, ...]


Writer = Callable[[TextIO], object] | Whole | Folder


def write_together(writers: Mapping[Path, Writer | None]) -> None:
    """Write files that belong together: all of them are finished before the first replaces an older one.

    Args:
        writers: for each file, what writes its text to a stream, or the whole file; None for one that these do without:
            one that is there, of an older result, is removed once they are written.

    Raises:
        InputError, DiskError: a file cannot be written, as for `replacing`.
    """
    with ExitStack() as stack:
        for path, write in writers.items():
            if write is None:
                continue
            if isinstance(write, Folder):
                write.write(stack.enter_context(replacing_folder(path, write.what, write.marks)))
                continue
            temporary = stack.enter_context(replacing(path))
            if isinstance(write, Whole):
                write.write(temporary)
                continue
            with temporary.open("w", encoding="utf-8", newline="") as stream:
                write(stream)
    for path in (one for one, write in writers.items() if write is None):
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise unwritable(path, error) from error


class TemporaryFolder:
    """A folder for temporary files, at `path`, until `remove`.

    A process that is killed leaves it behind; `temporary_folder` removes it later, in whatever process. What tells that
    nobody uses it any more is a lock, which ends with the process that made it: a number of that could be of another
    machine or container. Windows has no such lock, and what is left there stays.

    Raises:
        InputError, DiskError: it cannot be made; names the folder for temporary files.
    """

    path: Path

    def __init__(self) -> None:
        try:
            new = Path(tempfile.mkdtemp(prefix=f".{TEMPORARY}"))  # of a name that nobody looks at before it is locked
            self._lock = _locked(new)
            self.path = new.rename(new.with_name(new.name[1:]))
        except OSError as error:
            raise unwritable(f"{tempfile.gettempdir()}, for temporary files", error) from error

    def remove(self) -> None:
        """Remove it with what is in it; twice is fine."""
        shutil.rmtree(self.path, ignore_errors=True)
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """Yield a folder that is removed, with what is in it, in the end; those of killed processes are removed first.

    Raises:
        InputError, DiskError: it cannot be made or written to; names the folder for temporary files.
    """
    _remove_abandoned()
    folder = TemporaryFolder()
    try:
        yield folder.path
    except OSError as error:
        if isinstance(error, BrokenPipeError) or not str(error.filename or folder.path).startswith(str(folder.path)):
            raise  # of something else that was done meanwhile
        raise unwritable(f"{tempfile.gettempdir()}, for temporary files", error) from error
    finally:
        folder.remove()


def _locked(folder: Path) -> int | None:
    """A lock on a folder, until it is closed or the process ends; None if another one has it, or there are no locks."""
    if sys.platform == "win32":
        return None
    handle = None
    try:
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        if handle is not None:
            os.close(handle)
        return None
    return handle


def _remove_abandoned() -> None:
    """Remove the folders of this user that processes left which are no more."""
    if sys.platform == "win32":
        return
    for folder in Path(tempfile.gettempdir()).glob(f"{TEMPORARY}*"):
        try:
            own = folder.lstat().st_uid == os.geteuid()
        except OSError:  # another process has just removed it
            continue
        lock = _locked(folder) if own else None
        if lock is not None:
            shutil.rmtree(folder, ignore_errors=True)
            os.close(lock)


def unwritable(path: AnyPath, error: OSError) -> InputError | DiskError:
    """What to raise where `path` cannot be written: the request's fault, but for a disk that is full or fails."""
    kind = DiskError if error.errno in DISK_TROUBLE else InputError
    return kind(f"{os.fspath(path)}: cannot be written ({error.strerror or error})")


def check_outputs(written: Iterable[AnyPath], read: Iterable[AnyPath]) -> None:
    """Check, before any work is done for them, that files may be written, as far as their folders tell.

    Args:
        written: files to be written, whose folders need not be there.
        read: files that are read: none of them is to be written over, by this name, another spelling or a link.

    Raises:
        InputError: one is read, or its folder, or the nearest one above that is there, is a file or may not be written.
    """
    sources = list(read)
    for path in written:
        _check_folder_of(path)
        for source in sources:
            if _is_same(path, source):
                also = "" if os.fspath(path) == os.fspath(source) else f", as {os.fspath(source)}"
                raise InputError(f"{os.fspath(path)}: would be written over, but is read{also}; expected another name")


def _check_folder_of(path: AnyPath) -> None:
    there = next((folder for folder in Path(path).parents if os.path.exists(folder)), None)  # noqa: PTH110  never fails
    if there is None:  # not even the current folder
        return
    refuse_file(there)
    if not os.access(there, os.W_OK | os.X_OK):
        raise InputError(f"{os.fspath(path)}: cannot be written, as {there} is a folder that is read-only")


def refuse_file(folder: AnyPath) -> None:
    """Check that a folder to write to, which need not be there, is not a file.

    Raises:
        InputError: it is.
    """
    if Path(folder).exists() and not Path(folder).is_dir():
        raise InputError(f"{os.fspath(folder)}: is a file, expected a folder to write to")


def _is_same(one: AnyPath, other: AnyPath) -> bool:
    try:
        return Path(one).samefile(other)
    except OSError:  # one is not there
        return os.path.realpath(one) == os.path.realpath(other)


def read_bytes(path: AnyPath, expected: str, limit: int = -1) -> bytes:
    """The content of a file that should hold `expected` ("a scenario in TOML"), which an error then names.

    Args:
        path: the file.
        expected: what it should hold.
        limit: the most bytes it may have; negative for no limit.

    Raises:
        InputError: the file is missing, is a folder, cannot be read or is longer than the limit.
    """
    try:
        with Path(path).open("rb") as file:
            content = file.read(limit + 1 if limit >= 0 else -1)
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}, expected {expected}") from error
    if 0 <= limit < len(content):
        raise InputError(f"{path}: more than {limit} bytes, expected {expected}")
    return content


def decoded(content: bytes, source: str, expected: str) -> str:
    """The text of `content`: without a byte order mark, each line ended by a line feed; `source` names the file.

    Raises:
        InputError: it is not UTF-8.
    """
    try:
        return content.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError as error:
        raise InputError(f"{source}: byte {error.start} is not UTF-8 text, expected {expected}") from error


def read_text(path: AnyPath, expected: str, limit: int = -1) -> str:
    """The text of a file that should hold `expected`, which an error then names.

    Raises:
        InputError: the file is missing, is a folder, cannot be read, is longer than `limit` bytes, or is not UTF-8.
    """
    return decoded(read_bytes(path, expected, limit), str(path), expected)

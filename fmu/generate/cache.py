"""Keeps compiled libraries between builds, each under the hash of everything it was made from.

The cache never fails a build. Missing, damaged or unreadable entries are compiled again; where the folder cannot be
written, nothing is kept.
"""

import hashlib
import os
import sys
import tempfile
from contextlib import suppress
from pathlib import Path

_DIGEST = hashlib.sha256().digest_size
MOST_ENTRIES = 400  # of about 100 kB; the oldest are removed first


def cache_folder() -> Path | None:
    """The folder: $BARYSCOPE_CACHE, else the user's cache folder; None for a user without a home."""
    named = os.environ.get("BARYSCOPE_CACHE")
    if named:
        return Path(named)
    try:
        if sys.platform == "win32":
            local = os.environ.get("LOCALAPPDATA")
            return Path(local or Path.home() / "AppData" / "Local") / "baryscope" / "Cache"
        if sys.platform == "darwin":
            return Path.home() / "Library" / "Caches" / "baryscope"
        return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "baryscope"
    except RuntimeError:
        return None


def load_cached(key: str) -> bytes | None:
    """The content stored under a key, or None if it is missing or damaged."""
    folder = cache_folder()
    if folder is None:
        return None
    try:
        entry = (folder / key).read_bytes()
    except OSError:
        return None
    digest, content = entry[:_DIGEST], entry[_DIGEST:]
    if hashlib.sha256(content).digest() != digest:
        return None
    with suppress(OSError):
        os.utime(folder / key)
    return content


def store_cached(key: str, content: bytes) -> None:
    """Store a content under a key, atomically, if the folder can be written."""
    folder = cache_folder()
    if folder is None:
        return
    with suppress(OSError):
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=folder, prefix=".new-")
        temporary = Path(name)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(hashlib.sha256(content).digest() + content)
            temporary.replace(folder / key)
        finally:
            temporary.unlink(missing_ok=True)
        _remove_oldest(folder)


def _remove_oldest(folder: Path) -> None:
    entries = [(path.stat().st_mtime, path) for path in folder.iterdir() if not path.name.startswith(".")]
    for _, path in sorted(entries)[: max(0, len(entries) - MOST_ENTRIES)]:
        path.unlink(missing_ok=True)

"""The cache of compiled libraries: it returns what was stored or nothing, and never fails."""

import os
from pathlib import Path

import pytest

from baryscope.fmu.generate import cache


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("BARYSCOPE_CACHE", str(tmp_path / "deep" / "cache"))
    return tmp_path / "deep" / "cache"


def test_it_returns_what_was_stored(folder):
    assert cache.load_cached("a") is None
    cache.store_cached("a", b"content")
    cache.store_cached("b", b"")
    assert cache.load_cached("a") == b"content"
    assert cache.load_cached("b") == b""
    cache.store_cached("a", b"other")
    assert cache.load_cached("a") == b"other"
    assert sorted(path.name for path in folder.iterdir()) == ["a", "b"]


@pytest.mark.parametrize("begin, end, more", [(0, -1, b""), (0, None, b"!"), (0, 0, b""), (0, 20, b""), (1, None, b"")])
def test_a_damaged_entry_counts_as_missing_and_is_replaced(folder, begin, end, more):
    cache.store_cached("a", b"content")
    (folder / "a").write_bytes((folder / "a").read_bytes()[begin:end] + more)
    assert cache.load_cached("a") is None
    cache.store_cached("a", b"content")
    assert cache.load_cached("a") == b"content"


def test_an_entry_that_cannot_be_read_counts_as_missing(folder):
    (folder / "a").mkdir(parents=True)
    assert cache.load_cached("a") is None
    cache.store_cached("a", b"content")
    assert cache.load_cached("a") is None
    assert [path.name for path in folder.iterdir()] == ["a"]


def test_a_folder_that_cannot_be_made_means_no_cache(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("BARYSCOPE_CACHE", str(tmp_path / "file"))
    cache.store_cached("a", b"content")
    assert cache.load_cached("a") is None


def test_a_user_without_a_home_has_no_cache(monkeypatch):
    def no_home():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("BARYSCOPE_CACHE", raising=False)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(Path, "home", no_home)
    cache.store_cached("a", b"content")
    assert cache.load_cached("a") is None


@pytest.mark.parametrize(
    "system, variables, expected",
    [
        ("linux", {}, "home/.cache/baryscope"),
        ("linux", {"XDG_CACHE_HOME": "xdg"}, "xdg/baryscope"),
        ("darwin", {"XDG_CACHE_HOME": "xdg"}, "home/Library/Caches/baryscope"),
        ("win32", {"LOCALAPPDATA": "local"}, "local/baryscope/Cache"),
        ("win32", {}, "home/AppData/Local/baryscope/Cache"),
        ("linux", {"BARYSCOPE_CACHE": "mine", "XDG_CACHE_HOME": "xdg"}, "mine"),
    ],
)
def test_each_system_has_its_folder(system, variables, expected, monkeypatch):
    for name in ("BARYSCOPE_CACHE", "XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr("sys.platform", system)
    monkeypatch.setattr(Path, "home", lambda: Path("home"))
    assert cache.cache_folder() == Path(expected)


def test_the_entries_longest_unused_are_forgotten(folder, monkeypatch):
    monkeypatch.setattr(cache, "MOST_ENTRIES", 3)
    for age, key in enumerate("abc"):
        cache.store_cached(key, key.encode())
        os.utime(folder / key, (1000 + age, 1000 + age))
    assert cache.load_cached("a") == b"a"  # and is the newest now
    cache.store_cached("d", b"d")
    assert sorted(path.name for path in folder.iterdir()) == ["a", "c", "d"]

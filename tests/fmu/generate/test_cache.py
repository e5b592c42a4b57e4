"""The cache of compiled libraries: it returns what was stored or nothing, and never fails."""

import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from baryscope.fmu import Session, build_fmu
from baryscope.fmu.generate import cache
from baryscope.fmu.generate.compiler import find_compiler


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


COMPILER = """#!/bin/sh
case "$*" in *--version*) ;; *) echo "$@" >> {calls};; esac
exec {real} "$@"
"""


@pytest.mark.skipif(os.name == "nt", reason="the compiler of this test is a shell script")
def test_a_scenario_of_other_numbers_compiles_no_equations(folder, envisat, small, tmp_path, monkeypatch):
    """They stand in all.c. The unit is, to the byte, what it is without the cache, and has features of its own."""
    calls, own = tmp_path / "calls", tmp_path / "own-cc"
    own.write_text(COMPILER.format(calls=calls, real=" ".join(find_compiler())))
    own.chmod(0o755)
    monkeypatch.setenv("CC", str(own))
    points, features = envisat.features.points, small.features
    scenarios = {"first": points[:3], "other": points[3:6], "more": points[:4]}
    scenarios = {
        name: small.model_copy(update={"features": features.model_copy(update={"points": some})})
        for name, some in scenarios.items()
    }
    units = {}
    for name, scenario in scenarios.items():
        calls.write_text("")
        units[name] = build_fmu(scenario, tmp_path / f"{name}.fmu")
        assert ("all.c" in calls.read_text().split()) == (name != "other")
        assert "scenario.c" in calls.read_text().split()
    shutil.rmtree(folder)
    assert build_fmu(scenarios["other"], tmp_path / "whole.fmu").read_bytes() == units["other"].read_bytes()
    with Session(units["other"]) as session:
        between = np.linalg.norm(session.features[0] - session.features[1])
    assert between == pytest.approx(np.linalg.norm(np.subtract(points[3].position, points[4].position)), rel=1e-12)

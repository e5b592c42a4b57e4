"""A writer of variants of a small scenario that is right."""

import pytest

from malformed import spoil


@pytest.fixture
def write_scenario(tmp_path):
    """Write the good scenario with some of its text replaced, each found exactly once; give the path."""

    def write(*replacements):
        path = tmp_path / "mine.toml"
        path.write_text(spoil(*replacements), encoding="utf-8")
        return path

    return write

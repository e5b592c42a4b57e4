"""Files are whole or not there."""

import stat

import pytest

from baryscope.models.errors import InputError
from baryscope.models.files import read_text, replacing


def test_a_new_file_in_a_new_folder(tmp_path):
    path = tmp_path / "new" / "deeper" / "file.csv"
    with replacing(path) as temporary:
        temporary.write_text("whole")
        assert temporary.parent == path.parent
        assert temporary.suffix == ".csv"
        assert not path.exists()
    assert path.read_text() == "whole"
    assert list(path.parent.iterdir()) == [path]


def test_permissions_are_those_of_any_new_file(tmp_path):
    with replacing(tmp_path / "a") as temporary:
        temporary.touch()
    (tmp_path / "b").touch()
    assert stat.S_IMODE((tmp_path / "a").stat().st_mode) == stat.S_IMODE((tmp_path / "b").stat().st_mode)


def test_a_failed_write_leaves_the_older_file(tmp_path):
    path = tmp_path / "file.csv"
    path.write_text("older")

    def half():
        with replacing(path) as temporary:
            temporary.write_text("ha")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        half()
    assert path.read_text() == "older"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    "make, name, found",
    [
        pytest.param(lambda p: (p / "x").mkdir(), "x", "is a folder", id="folder"),
        pytest.param(lambda p: (p / "x").touch(), "x/y.csv", "cannot be written", id="file-for-a-folder"),
    ],
)
def test_nowhere_to_write(tmp_path, make, name, found):
    make(tmp_path)
    with pytest.raises(InputError) as caught, replacing(tmp_path / name):
        pytest.fail("entered")
    assert str(caught.value).startswith(f"{tmp_path / name}: ")
    assert found in str(caught.value)


def test_text_is_utf_8_with_or_without_a_mark(tmp_path):
    path = tmp_path / "text"
    for mark in (b"", b"\xef\xbb\xbf"):
        path.write_bytes(mark + "°/s".encode())
        assert read_text(path, "a text") == "°/s"


def test_unreadable_text(tmp_path):
    path = tmp_path / "text"
    with pytest.raises(InputError) as caught:
        read_text(path, "a text")
    assert str(caught.value) == f"{path}: No such file or directory, expected a text"
    path.write_bytes("caf\u00e9".encode("latin-1"))
    with pytest.raises(InputError) as caught:
        read_text(path, "a text")
    assert str(caught.value) == f"{path}: byte 3 is not UTF-8 text, expected a text"

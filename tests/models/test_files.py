"""Files are whole or not there, and none that is read is written over."""

import errno
import os
import signal
import stat
import subprocess
import sys
import tempfile
from pathlib import Path
from subprocess import PIPE

import pytest

from baryscope.models.errors import DiskError, InputError
from baryscope.models.files import (
    TemporaryFolder,
    check_outputs,
    read_text,
    replacing,
    replacing_folder,
    temporary_folder,
    write_together,
)


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


@pytest.mark.skipif(os.name != "posix", reason="permissions of POSIX")
def test_who_may_read_an_older_file_may_read_the_new_one(tmp_path):
    path = tmp_path / "a"
    path.touch()
    path.chmod(0o600)
    with replacing(path) as temporary:
        temporary.write_text("mine")
    assert stat.S_IMODE(path.stat().st_mode) == 0o600


@pytest.mark.parametrize("there", [True, False])
def test_a_link_stays_and_the_file_that_it_shows_is_replaced(tmp_path, there):
    (tmp_path / "far").mkdir()
    file, link = tmp_path / "far" / "file.csv", tmp_path / "link.csv"
    if there:
        file.write_text("older")
    link.symlink_to(file)
    with replacing(link) as temporary:
        temporary.write_text("newer")
    assert link.is_symlink()
    assert file.read_text() == "newer"
    assert sorted(item.name for item in tmp_path.rglob("*")) == ["far", "file.csv", "link.csv"]


def test_a_link_to_a_folder_stays_and_the_folder_is_replaced(tmp_path):
    folder, link = tmp_path / "store.zarr", tmp_path / "link.zarr"
    folder.mkdir()
    (folder / "mark").touch()
    link.symlink_to(folder, target_is_directory=True)
    with replacing_folder(link, "a store", ("mark",)) as new:
        new.mkdir()
        (new / "newer").touch()
    assert link.is_symlink()
    assert [item.name for item in folder.iterdir()] == ["newer"]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names")
def test_a_pipe_or_a_device_is_not_replaced(tmp_path):
    """As root, -o /dev/null put a file into the place of the device."""
    path = tmp_path / "pipe.csv"
    os.mkfifo(path)
    with pytest.raises(InputError, match=r"pipe\.csv: is a device or a pipe, expected the name of a file"):
        write_together({path: lambda stream: stream.write("text")})
    assert stat.S_ISFIFO(path.stat().st_mode)


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


def fail_at(number, half=None):
    """Fail as a write does, with half a file written."""
    if half is not None:
        half.write_text("ne")
    raise OSError(number, os.strerror(number))


@pytest.mark.parametrize("number, kind", [
    (errno.ENOSPC, DiskError),
    (errno.EIO, DiskError),
    (errno.EROFS, InputError),
])  # fmt: skip
def test_a_write_that_fails_names_the_file_and_the_reason_and_leaves_the_older_file(tmp_path, number, kind):
    path = tmp_path / "file.csv"
    path.write_text("older")
    with pytest.raises(kind) as caught, replacing(path) as temporary:
        fail_at(number, temporary)
    assert str(caught.value) == f"{path}: cannot be written ({os.strerror(number)})"
    assert path.read_text() == "older"
    assert list(tmp_path.iterdir()) == [path]


def test_what_fails_meanwhile_keeps_its_own_name(tmp_path):
    with pytest.raises(FileNotFoundError, match="elsewhere"), replacing(tmp_path / "file.csv"):
        (tmp_path / "elsewhere").read_text()
    with pytest.raises(FileNotFoundError, match="elsewhere"), temporary_folder():
        (tmp_path / "elsewhere").read_text()
    with pytest.raises(BrokenPipeError), replacing(tmp_path / "file.csv"):
        fail_at(errno.EPIPE)


def test_files_that_belong_together_are_both_new_or_both_old(tmp_path):
    names = [tmp_path / "a", tmp_path / "b"]
    for path in names:
        path.write_text("older")

    def fails(stream):
        stream.write("ne")
        fail_at(errno.ENOSPC)

    def succeeds(stream):
        assert all(path.read_text() == "older" for path in names)
        stream.write("newer\n")

    for failing in names:
        writers = {path: fails if path == failing else succeeds for path in names}
        with pytest.raises(DiskError) as caught:
            write_together(writers)
        assert str(caught.value) == f"{failing}: cannot be written ({os.strerror(errno.ENOSPC)})"
        assert {path: path.read_text() for path in tmp_path.iterdir()} == dict.fromkeys(names, "older")
    write_together(dict.fromkeys(names, succeeds))
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == dict.fromkeys(names, b"newer\n")


def test_a_temporary_folder_is_gone_afterwards_and_names_its_place_when_full():
    with temporary_folder() as folder:
        (folder / "file").touch()
    assert not folder.exists()
    with pytest.raises(DiskError) as caught, temporary_folder():
        fail_at(errno.ENOSPC)
    assert (
        str(caught.value)
        == f"{tempfile.gettempdir()}, for temporary files: cannot be written (No space left on device)"
    )


KILLED = """
import os, signal
from baryscope.models.files import TemporaryFolder
folder = TemporaryFolder()
(folder.path / "file").touch()
print(folder.path, flush=True)
input()
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no lock that ends with its process")
def test_what_a_killed_process_left_is_removed_and_what_a_living_one_has_is_not(tmp_path, monkeypatch):
    """A campaign that kill -9 ended left a unit of megabytes for each of its processes."""
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", None)  # so that it is looked for anew
    (tmp_path / "baryscope.txt").touch()
    (tmp_path / "baryscope.link").symlink_to(tmp_path)
    others = {path.name for path in tmp_path.iterdir()}
    own = TemporaryFolder()
    with subprocess.Popen([sys.executable, "-c", KILLED], stdin=PIPE, stdout=PIPE, text=True) as process:
        left = Path(process.stdout.readline().strip())
        assert left.parent == tmp_path
        with temporary_folder() as folder:
            assert (left / "file").exists()
            assert own.path.is_dir()
        process.stdin.write("\n")
    assert process.returncode == -signal.SIGKILL
    assert (left / "file").exists()
    with temporary_folder() as folder:
        assert {path.name for path in tmp_path.iterdir()} == others | {own.path.name, folder.name}
    own.remove()
    own.remove()
    assert {path.name for path in tmp_path.iterdir()} == others


def link_to(tmp_path):
    (tmp_path / "link.csv").symlink_to(tmp_path / "in.csv")
    return tmp_path / "link.csv"


def hard_link_to(tmp_path):
    os.link(tmp_path / "in.csv", tmp_path / "hard.csv")
    return tmp_path / "hard.csv"


def folder_link_to(tmp_path):
    (tmp_path / "folder").symlink_to(tmp_path, target_is_directory=True)
    return tmp_path / "folder" / "in.csv"


@pytest.mark.parametrize("name_of", [
    pytest.param(lambda p: p / "in.csv", id="same"),
    pytest.param(lambda p: str(p / "in.csv"), id="text"),
    pytest.param(lambda p: p / ".." / p.name / "in.csv", id="dots"),
    pytest.param(lambda p: os.path.relpath(p / "in.csv"), id="relative"),
    link_to,
    hard_link_to,
    folder_link_to,
])  # fmt: skip
def test_a_file_that_is_read_is_not_written_over_under_any_name(tmp_path, name_of):
    (tmp_path / "in.csv").write_text("mine")
    name = name_of(tmp_path)
    with pytest.raises(InputError) as caught:
        check_outputs([tmp_path / "other.csv", name], [tmp_path / "none.toml", tmp_path / "in.csv"])
    assert str(caught.value).startswith(f"{name}: would be written over, but is read")


def test_other_files_may_be_written(tmp_path):
    (tmp_path / "in.csv").write_text("mine")
    (tmp_path / "there.csv").write_text("older")
    check_outputs([tmp_path / "there.csv", tmp_path / "not-there.csv"], [tmp_path / "in.csv"])

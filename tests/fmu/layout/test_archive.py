"""Files that are not units of ours are refused before their library is loaded."""

import re
import sys
import zipfile
from pathlib import Path

import pytest

from baryscope.fmu import Session
from baryscope.models.errors import InputError
from mutations import rewritten


def _refusal(path):
    with pytest.raises(InputError) as raised:
        Session(path)
    assert "\n" not in str(raised.value)
    assert str(path) in str(raised.value)
    return str(raised.value)


def test_missing_file(tmp_path):
    assert "No such file" in _refusal(tmp_path / "none.fmu")


def test_not_a_zip(tmp_path):
    path = tmp_path / "text.fmu"
    path.write_text("hello")
    assert "not a whole zip" in _refusal(path)


def test_cut_short(envisat_fmu, tmp_path):
    path = tmp_path / "half.fmu"
    path.write_bytes(envisat_fmu.read_bytes()[:-5000])
    assert "not a whole zip" in _refusal(path)


LOCAL, CENTRAL = b"PK\x03\x04", b"PK\x01\x02"  # before a member, and before its entry in the directory


def _encrypted(content):
    for signature, flags in ((LOCAL, 6), (CENTRAL, 8)):
        content[content.find(signature) + flags] |= 1


def _of_a_compression_that_is_none(content):
    for signature, compression in ((LOCAL, 8), (CENTRAL, 10)):
        content[content.find(signature) + compression] = 98


def _damaged(content):
    name_length = int.from_bytes(content[26:28], "little")
    content[30 + name_length] = 0xFF  # the first block of a stream by deflate has a type that is none


def _named_by_no_text(content):
    place = content.find(CENTRAL)
    content[place + 9] |= 8  # the name is in UTF-8
    content[place + 46] = 0xFF


@pytest.mark.parametrize("change, words", [
    (_encrypted, "is encrypted"),
    (_of_a_compression_that_is_none, "compression method"),
    (_damaged, "while decompressing"),
    (_named_by_no_text, "can't decode byte 0xff"),
])  # fmt: skip
def test_what_zipfile_cannot_unpack(envisat_fmu, tmp_path, change, words):
    content = bytearray(envisat_fmu.read_bytes())
    change(content)
    path = tmp_path / "unit.fmu"
    path.write_bytes(content)
    refusal = _refusal(path)
    assert refusal.startswith(f"{path}: cannot be unpacked (")
    assert words in refusal


@pytest.mark.parametrize("name", ["../evil", "/etc/evil", "a/../../evil", "C:/evil", "a\\evil"])
def test_paths_that_lead_out(envisat_fmu, tmp_path, name):
    path = rewritten(envisat_fmu, tmp_path / "unit.fmu", lambda _, content: content)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr(name, "x")
    assert "unsafe path" in _refusal(path)
    assert [item.name for item in tmp_path.iterdir()] == ["unit.fmu"]


def test_no_description(envisat_fmu, tmp_path):
    path = rewritten(envisat_fmu, tmp_path / "x.fmu", lambda n, c: None if n == "modelDescription.xml" else c)
    assert "modelDescription.xml cannot be read" in _refusal(path)


def test_another_model(envisat_fmu, tmp_path):
    path = rewritten(
        envisat_fmu, tmp_path / "x.fmu", lambda n, c: c.replace(b'modelName="TumblingTarget"', b'modelName="Ball"')
    )
    assert "is Ball of FMI 2.0, expected TumblingTarget" in _refusal(path)


def test_other_variables(envisat_fmu, tmp_path):
    path = rewritten(envisat_fmu, tmp_path / "x.fmu", lambda n, c: c.replace(b"orbit.raan", b"orbit.node"))
    assert "not those of this version" in _refusal(path)


def test_no_library_for_this_machine(envisat_fmu, tmp_path):
    path = rewritten(envisat_fmu, tmp_path / "x.fmu", lambda n, c: None if n.startswith("binaries") else c)
    assert "expected a unit for this machine" in _refusal(path)


def test_description_and_library_of_different_builds(envisat_fmu, tmp_path):
    from baryscope.fmu.runtime.session import UnitError

    path = rewritten(envisat_fmu, tmp_path / "x.fmu", lambda n, c: c.replace(b'guid="{', b'guid="{0'))
    with pytest.raises(UnitError, match="different builds"):
        Session(path)


def test_a_library_that_cannot_be_loaded_leaves_the_working_directory(envisat_fmu, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = rewritten(envisat_fmu, tmp_path / "x.fmu", lambda n, c: b"no library" if n.startswith("binaries") else c)
    assert "cannot be loaded" in _refusal(path)
    assert Path.cwd() == tmp_path


@pytest.mark.skipif(sys.platform != "linux", reason="the loaders of other systems refuse such a library themselves")
@pytest.mark.parametrize("kept", [4, 30, 100, 5000, 0.3, 0.9, -1])
def test_a_library_that_is_cut_off_is_refused_before_it_ends_the_process(kept, envisat_fmu, tmp_path):
    def cut(name, content):
        size = kept if isinstance(kept, int) else int(kept * len(content))
        return content[:size] if name.startswith("binaries") else content

    path = rewritten(envisat_fmu, tmp_path / "x.fmu", cut)
    refusal = _refusal(path)
    assert refusal.startswith(f"{path}: binaries/")
    assert re.search(r"\.so: is cut off, found \d+ bytes, expected \d+ as in its header$", refusal)

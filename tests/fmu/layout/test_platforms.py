"""Which folders hold a unit's libraries, and which a machine looks into."""

import fmpy
import pytest

from baryscope.fmu.layout.platforms import (
    AARCH64_LINUX,
    PLATFORMS,
    binary_members,
    host_platform,
    library_of_this_machine,
    selected,
)


@pytest.mark.parametrize("fmi, folders", [(2, {"linux64", "aarch64-linux"}), (3, {"aarch64-linux"})])
def test_a_unit_for_aarch64_alone_is_found_by_importers_of_fmi_2(fmi, folders):
    members = binary_members({AARCH64_LINUX: b"arm"}, "Model", fmi)
    assert members == {f"binaries/{folder}/Model.so": b"arm" for folder in folders}


def test_folders_of_fmi_3_are_platform_tuples():
    libraries = {platform: platform.name.encode() for platform in PLATFORMS}
    members = binary_members(libraries, "Model", 3)
    assert {name.split("/")[1]: content.decode() for name, content in members.items()} == {
        name: name for name in ("x86_64-linux", "aarch64-linux", "x86_64-windows", "x86_64-darwin", "aarch64-darwin")
    }


@pytest.mark.parametrize(
    "tuple_, present, expected",
    [
        ("aarch64-linux", ["linux64", "aarch64-linux"], "aarch64-linux"),
        ("aarch64-linux", ["linux64"], "linux64"),
        ("x86_64-linux", ["linux64", "aarch64-linux"], "linux64"),
        ("x86_64-linux", ["aarch64-linux"], None),
        ("aarch64-darwin", ["darwin64"], "darwin64"),
    ],
)
def test_a_machine_finds_its_own_library_first(tuple_, present, expected, tmp_path, monkeypatch):
    monkeypatch.setattr(fmpy, "platform_tuple", tuple_)
    monkeypatch.setattr("baryscope.fmu.layout.platforms.libc_ver", lambda: ("glibc", "2.36"))
    for folder in present:
        library = tmp_path / "binaries" / folder / f"Model{host_platform().suffix}"
        library.parent.mkdir(parents=True)
        library.write_text(folder)
    found = library_of_this_machine(tmp_path, "Model", 2)
    assert (found and found.parent.name) == expected


def test_selections():
    assert selected("host") == (host_platform(),)
    assert {platform.name for platform in selected("linux")} == {"x86_64-linux", "aarch64-linux"}
    assert selected("all") == PLATFORMS

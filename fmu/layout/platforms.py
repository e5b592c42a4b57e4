"""The platforms that units are built for, FMI's names for them, and their files in binaries/.

FMI 2.0.4 and later keep linux64, win64 and darwin64 for x86-64 and ask for FMI 3's platform tuples elsewhere. Many
importers (FMPy 0.3, FMI Library, OpenModelica) look into linux64 and darwin64 on aarch64, too. Hence, for FMI 2:

- darwin64 holds a universal library, whose x86-64 half is what the standard asks for; both kinds of Mac load it.
- linux64 holds the aarch64 library only in units without one for x86-64; such a unit was built on and for aarch64.
"""

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from platform import libc_ver
from typing import Literal

import fmpy

FmiVersion = Literal[2, 3]


@dataclass(frozen=True)
class Platform:
    """A processor with an operating system.

    Attributes:
        name: FMI 3's platform tuple, which is also its folder in FMI 3.
        fmi2_folder: the folder by FMI 2.0.5.
        fmi2_common: the folder in which importers of FMI 2 look whatever the processor.
        suffix: of shared libraries.
        target: zig's name; empty if only a native compiler builds for the platform.
        flags: what the linker needs to make a shared library; `{library}` stands for the file's name.
        code_flags: what the compiler needs to make code for one.
        runtime: a file of csrc/ that zig compiles and links with runtime_flags in place of its own C library.
    """

    name: str
    fmi2_folder: str
    fmi2_common: str
    suffix: str
    target: str
    flags: tuple[str, ...]
    code_flags: tuple[str, ...] = ()
    runtime: str = ""
    runtime_flags: tuple[str, ...] = ()

    def folders(self, fmi: FmiVersion) -> tuple[str, ...]:
        """The folders in which an importer may look, the standard's first."""
        return (self.name,) if fmi == 3 else tuple(dict.fromkeys((self.fmi2_folder, self.fmi2_common)))


_ELF = (("-shared", "-lm"), ("-fPIC",))
# Without a fixed name the linker stores the path of the output in the library.
_MACH_O = ("-shared", "-Wl,-install_name,@rpath/{library}")

X86_64_LINUX = Platform("x86_64-linux", "linux64", "linux64", ".so", "x86_64-linux-gnu.2.17", *_ELF)
AARCH64_LINUX = Platform("aarch64-linux", "aarch64-linux", "linux64", ".so", "aarch64-linux-gnu.2.17", *_ELF)
X86_64_WINDOWS = Platform(
    "x86_64-windows",
    "win64",
    "win64",
    ".dll",
    "x86_64-windows-gnu",
    ("-shared",),
    runtime="windows.c",
    runtime_flags=("-nostdlib", "-lucrtbase", "-Wl,-e,windows_entry"),
)
X86_64_DARWIN = Platform("x86_64-darwin", "darwin64", "darwin64", ".dylib", "x86_64-macos.11.0", _MACH_O)
AARCH64_DARWIN = Platform("aarch64-darwin", "aarch64-darwin", "darwin64", ".dylib", "aarch64-macos.11.0", _MACH_O)

PLATFORMS = (X86_64_LINUX, AARCH64_LINUX, X86_64_WINDOWS, X86_64_DARWIN, AARCH64_DARWIN)

Selection = Literal["host", "linux", "all"]


def host_platform() -> Platform:
    """The platform of this machine. One that is not in the table can only be built for natively.

    Linux without glibc is not in the table: Python on musl cannot load a library that was built for glibc.
    """
    for known in PLATFORMS:
        if known.name == fmpy.platform_tuple and (known.suffix != ".so" or libc_ver()[0] == "glibc"):
            return known
    flags = (("-shared",),) if fmpy.system == "windows" else _ELF
    return Platform(fmpy.platform_tuple, fmpy.platform, fmpy.platform, fmpy.sharedLibraryExtension, "", *flags)


def selected(selection: Selection) -> tuple[Platform, ...]:
    """The platforms of a selection: this machine, both of Linux, or all."""
    linux = (X86_64_LINUX, AARCH64_LINUX)
    return {"host": (host_platform(),), "linux": linux, "all": PLATFORMS}[selection]


def library_of_this_machine(folder: Path, model_identifier: str, fmi: FmiVersion) -> Path | None:
    """The library in an unpacked unit that this machine can load, or None.

    FMPy by itself looks only into the common folder, which on aarch64 may hold a library for x86-64.
    """
    host = host_platform()
    for name in host.folders(fmi):
        library = folder / "binaries" / name / f"{model_identifier}{host.suffix}"
        if library.is_file():
            return library
    return None


def binary_members(libraries: Mapping[Platform, bytes], model_identifier: str, fmi: FmiVersion) -> dict[str, bytes]:
    """The members of binaries/ in an FMU, by path, for the given libraries."""

    def member(platform: Platform, folder: str) -> str:
        return f"binaries/{folder}/{model_identifier}{platform.suffix}"

    members = {member(platform, platform.folders(fmi)[0]): library for platform, library in libraries.items()}
    if fmi == 3:
        return members
    for platform, library in libraries.items():
        members.setdefault(member(platform, platform.fmi2_common), library)
    macs = [libraries[platform] for platform in (X86_64_DARWIN, AARCH64_DARWIN) if platform in libraries]
    if len(macs) > 1:
        members[member(X86_64_DARWIN, X86_64_DARWIN.fmi2_common)] = universal_library(macs)
    return members


def universal_library(slices: Sequence[bytes]) -> bytes:
    """One Mach-O file for several processors, as `lipo -create` makes it.

    A header in big-endian words (magic; number of slices; for each its processor, subtype, offset, size and the power
    of two it is aligned to), then the slices; see mach-o/fat.h. Processor and subtype are read from the slices.
    """
    power = 14  # pages of 16 kB, the largest
    page = 1 << power
    table, body = struct.pack(">II", 0xCAFEBABE, len(slices)), b""
    for content in slices:
        body += bytes(-len(body) % page)
        processor, subtype = struct.unpack_from("<II", content, 4)
        table += struct.pack(">IIIII", processor, subtype, page + len(body), len(content), power)
        body += content
    return table.ljust(page, b"\0") + body

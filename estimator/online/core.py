"""The C core of the online estimator as Python calls it: generated, compiled once, and loaded by ctypes."""

import ctypes
import hashlib
from enum import IntEnum
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Self

from baryscope.fmu.generate.cache import load_cached
from baryscope.fmu.generate.codegen import c_source
from baryscope.fmu.generate.compiler import Job, compile_all, find_compiler
from baryscope.fmu.layout.platforms import host_platform
from baryscope.fmu.units.filter import (
    MOST_FEATURES,
    OFFSET,
    SPEED,
    THRUST,
    filter_functions,
    filter_headers,
    work_of,
)
from baryscope.models.files import temporary_folder
from baryscope.models.keplerian import ELEMENT_COUNT
from baryscope.models.orbit import Orbit as KeplerOrbit

__all__ = [
    "MOST_FEATURES",
    "OFFSET",
    "SPEED",
    "THRUST",
    "Options",
    "Orbit",
    "Result",
    "State",
    "Thrust",
    "Tumble",
    "at_hand",
    "build",
    "compiled",
    "library",
    "sources",
]

MAIN = "library.c"

_double = ctypes.c_double


class Result(IntEnum):
    """`OnlineResult` of online.h: why a call was refused, if it was."""

    ACCEPTED = 0
    BAD_TIME = 1
    BAD_POINT = 2
    BAD_COVARIANCE = 3
    BAD_NAME = 4
    BAD_ACCELERATION = 5
    TOO_MANY = 6
    NO_SUCH = 7
    TOO_LATE = 8
    TOO_FAR = 9


class Orbit(ctypes.Structure):
    """`OnlineOrbit` of online.h."""

    _fields_ = (
        ("elements", _double * ELEMENT_COUNT),
        *((name, _double) for name in ("j2", "equatorial_radius", "epoch")),
    )

    @classmethod
    def of(cls, orbit: KeplerOrbit) -> Self:
        """An orbit by its elements at time 0, and its J2."""
        elements = (_double * ELEMENT_COUNT)(*orbit.elements)
        return cls(elements, orbit.j2 or 0.0, orbit.equatorial_radius or 0.0, 0.0)


class Options(ctypes.Structure):
    """`OnlineOptions` of online.h."""

    _fields_ = (
        *(
            (name, _double)
            for name in ("sigma", "offset", "speed", "attitude_noise", "thrust", "longest_gap", "on_orbit")
        ),
        ("orbit", Orbit),
    )


class Tumble(ctypes.Structure):
    """`OnlineTumble` of online.h."""

    _fields_ = (
        ("known", _double),
        ("R", _double * 9),
        ("turn", _double * 9),
        ("rate", _double * 3),
        ("of_rate", _double * 9),
        ("inertia", _double * 9),
        ("of_inertia", _double * 25),
    )


class State(ctypes.Structure):
    """`OnlineState` of online.h."""

    _fields_ = (
        *((name, _double) for name in ("time", "status", "features", "density", "noise_ratio", "lasting", "maps")),
        ("r", _double * 3),
        ("v", _double * 3),
        ("R", _double * 9),
        ("covariance", _double * 36),
        ("thrust", _double * 4),
        ("of_thrust", _double * 16),
        ("execution", _double),
    )


class Thrust(ctypes.Structure):
    """`OnlineThrust` of online.h."""

    _fields_ = (("acceleration", _double * 3), ("axes", _double * 9))


@cache
def build() -> bytes:
    """A hash of the sources (32,), by which the memory of a filter is told from that of another version."""
    return hashlib.sha256(repr(sorted(sources().items())).encode()).digest()


def sources() -> dict[str, bytes]:
    """The C files by name, generated ones among them; `MAIN` is to be compiled."""
    room = files("baryscope.fmu") / "csrc"
    written = {path.name: path.read_bytes() for path in (*(room / "online").iterdir(), room / "dialect.h")}
    generated = filter_headers() | {"dynamics.c": _dynamics()}
    return written | {name: text.encode() for name, text in generated.items()}


def _dynamics() -> str:
    """C code of the steps of orbit and tumble, by CasADi, with the sizes of their memory."""
    sizes = work_of(filter_functions())
    return c_source(filter_functions()) + "".join(f"#define {name} {size}\n" for name, size in sizes.items())


def compiled(folder: Path) -> Path:
    """The compiled core in a folder, from the cache of the units' libraries or built now.

    Raises:
        ComputationError: there is no C compiler, or it fails.
    """
    job = _job()
    path = folder / job.output
    path.write_bytes(compile_all([job])[job.platform])
    return path


def at_hand() -> bool:
    """Whether the core is loaded, or in the cache; else it is compiled when it is asked for, which may take a minute.

    Raises:
        ComputationError: there is no C compiler.
    """
    if library.cache_info().currsize:
        return True
    key = _job().key()
    return key is not None and load_cached(key) is not None


def _job() -> Job:
    platform = host_platform()
    return Job(sources(), MAIN, f"online{platform.suffix}", platform, tuple(find_compiler()))


@cache
def library() -> ctypes.CDLL:
    """The compiled core, loaded.

    Raises:
        ComputationError: there is no C compiler, or it fails.
    """
    with temporary_folder() as folder:
        loaded = ctypes.CDLL(str(compiled(folder)))
    numbers, names, thrust = ctypes.POINTER(_double), ctypes.POINTER(ctypes.c_longlong), ctypes.POINTER(Thrust)
    loaded.online_size.restype = ctypes.c_ulonglong
    loaded.online_start.argtypes = [ctypes.c_void_p, ctypes.POINTER(Options)]
    loaded.online_start.restype = None
    loaded.online_update.argtypes = [ctypes.c_void_p, _double, ctypes.c_int, names, numbers, numbers, thrust]
    loaded.online_predict.argtypes = [ctypes.c_void_p, _double, thrust, ctypes.POINTER(State)]
    loaded.online_tumble.argtypes = [ctypes.c_void_p, _double, ctypes.POINTER(Tumble)]
    loaded.online_point.argtypes = [ctypes.c_void_p, _double, thrust, ctypes.c_longlong, numbers, numbers]
    loaded.online_features.argtypes = [ctypes.c_void_p, names, numbers, numbers]
    loaded.online_residuals.argtypes = [ctypes.c_void_p, names, numbers, ctypes.POINTER(ctypes.c_int)]
    return loaded

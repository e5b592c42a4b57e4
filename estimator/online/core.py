"""The C core of the online estimator as Python calls it: generated, compiled once, and loaded by ctypes."""

import ctypes
import re
from functools import cache
from importlib.resources import files

import casadi as ca

from baryscope.fmu.generate.compiler import Job, compile_all, find_compiler
from baryscope.fmu.layout.platforms import host_platform
from baryscope.models.files import temporary_folder
from baryscope.models.relative_orbit import step_in_chaser_axes

MOST_FEATURES = 32  # in the map, and in a frame
N_ELEMENTS = 7
MAIN = "library.c"

_double = ctypes.c_double


class Options(ctypes.Structure):
    """`OnlineOptions` of online.h."""

    _fields_ = (
        *((name, _double) for name in ("sigma", "offset", "speed", "attitude_noise", "on_orbit")),
        ("elements", _double * N_ELEMENTS),
    )


class State(ctypes.Structure):
    """`OnlineState` of online.h."""

    _fields_ = (
        *((name, _double) for name in ("time", "status", "features", "density", "noise_ratio")),
        ("r", _double * 3),
        ("v", _double * 3),
        ("R", _double * 9),
        ("covariance", _double * 36),
    )


def sources() -> dict[str, bytes]:
    """The C files by name, the generated one among them; `MAIN` is to be compiled."""
    written = {path.name: path.read_bytes() for path in (files("baryscope.fmu") / "csrc" / "online").iterdir()}
    return written | {"dynamics.c": _dynamics().encode()}


def _dynamics() -> str:
    """C code of the step on an orbit, by CasADi."""
    generator = ca.CodeGenerator("dynamics.c", {"casadi_int": "int", "with_header": False})
    function = step_in_chaser_axes()
    generator.add(function)
    code = re.sub(r"^casadi_real (?=casadi_\w+\()", "static casadi_real ", str(generator.dump()), flags=re.MULTILINE)
    sizes = {name: getattr(function, f"sz_{name.lower()}")() for name in ("ARG", "RES", "IW", "W")}
    return code + "".join(f"#define {function.name()}_SZ_{name} {max(size, 1)}\n" for name, size in sizes.items())


@cache
def library() -> ctypes.CDLL:
    """The compiled core, from the cache of the units' libraries or built now.

    Raises:
        ComputationError: there is no C compiler, or it fails.
    """
    platform = host_platform()
    job = Job(sources(), MAIN, f"online{platform.suffix}", platform, tuple(find_compiler()))
    content = compile_all([job])[platform]
    with temporary_folder() as folder:
        path = folder / job.output
        path.write_bytes(content)
        loaded = ctypes.CDLL(str(path))
    numbers, names = ctypes.POINTER(_double), ctypes.POINTER(ctypes.c_longlong)
    loaded.online_size.restype = ctypes.c_ulonglong
    loaded.online_start.argtypes = [ctypes.c_void_p, ctypes.POINTER(Options)]
    loaded.online_start.restype = None
    loaded.online_update.argtypes = [ctypes.c_void_p, _double, ctypes.c_int, names, numbers, numbers, numbers]
    loaded.online_predict.argtypes = [ctypes.c_void_p, _double, numbers, ctypes.POINTER(State)]
    loaded.online_features.argtypes = [ctypes.c_void_p, names, numbers, numbers]
    return loaded

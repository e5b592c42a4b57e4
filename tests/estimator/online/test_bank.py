"""The bank of small filters: what is not computed makes no difference."""

import ctypes

import numpy as np

from baryscope.estimator.online.core import OFFSET, SPEED, THRUST, Options, State, sources
from compiling import library_of
from tops import SIGMA, straight, tracks

SHORTCUTS = {  # of abreast.c
    b"kept[m] = !least || !(member->weight < *least);": b"kept[m] = 1;",
}


def memory_after(folder, changes):
    """What a filter is, byte for byte, after a flight with an untold burn, by a core with changes in its bank."""
    folder.mkdir()
    for name, content in sources().items():
        for old, new in changes.items() if name == "abreast.c" else ():
            assert content.count(old) == 1
            content = content.replace(old, new)
        (folder / name).write_bytes(content)
    core = library_of(folder, '#include "library.c"\n')
    core.online_size.restype = ctypes.c_ulonglong
    memory = ctypes.create_string_buffer(core.online_size())
    core.online_start(memory, ctypes.byref(Options(SIGMA, OFFSET, SPEED, 0.0, THRUST, 1e4, 0.0)))
    time, rng = np.arange(260.0), np.random.default_rng(71)
    path = straight(time) + 1e-3 * np.clip(time - 150, 0, 20)[:, None] ** 2
    names, push = (ctypes.c_longlong * 8)(*range(8)), (ctypes.c_double * 12)(0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1)
    for instant, frame in zip(time, tracks(rng, time, path), strict=True):
        points = np.ascontiguousarray(frame).ctypes.data_as(ctypes.c_void_p)
        assert core.online_update(memory, ctypes.c_double(instant), 8, names, points, None, push) == 0
    assert core.online_predict(memory, ctypes.c_double(instant), push, ctypes.byref(State())) == 0
    return memory.raw


def test_a_filter_that_computes_all_members_is_the_same_byte_for_byte(tmp_path):
    assert memory_after(tmp_path / "short", {}) == memory_after(tmp_path / "all", SHORTCUTS)

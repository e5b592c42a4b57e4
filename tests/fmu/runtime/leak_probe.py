"""`leak_probe.py FMU ROUNDS LEAKY` prints by how many bytes a process grows while it uses a session.

It measures current resident memory, in a separate process: peaks of earlier tests do not hide a leak. With LEAKY = 1,
every round leaks one saved state.
"""

import os
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np

from baryscope.fmu import Session
from baryscope.fmu.runtime import UnitError

WARM_UP = 1000  # rounds, until buffers and pools have their size; Python 3.14 collects cycles more seldom


def resident():
    """Resident memory of this process, bytes (Linux)."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def work(session, leaky):
    """One round of everything that allocates: a reset, a step, a refusal; a state saved, restored and freed."""
    session.reset({"chaser.position0": [0.0, -20.0, 0.0]})
    session.step(0.1, torque=[1.0, 0.0, 0.0])
    with suppress(UnitError):
        session.step(-1.0)
    with session.state() as state:
        session.restore(bytes(state))
    if leaky:
        session.instance.save()


def main(fmu, rounds, leaky):
    with Session(fmu) as session:
        for _ in range(WARM_UP):
            work(session, leaky)
        first, before = session.outputs.copy(), resident()
        for _ in range(rounds):
            work(session, leaky)
        print(resident() - before)
        assert np.array_equal(session.outputs, first)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), sys.argv[3] == "1")

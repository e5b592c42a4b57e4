"""By how much a process grows while it works a session: `leak_probe.py FMU ROUNDS LEAKY` prints bytes.

A process of its own, whose resident memory is measured now and not at its peak: what other tests have used and given
back hides nothing. With LEAKY = 1 a saved state is forgotten in every round and never freed: a leak to be seen.
"""

import os
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np

from baryscope.fmu import Session
from baryscope.fmu.runtime import UnitError

WARM_UP = 200  # rounds, until buffers and the allocator's pools have their size


def resident():
    """Resident memory of this process, bytes (Linux)."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def work(session, leaky):
    """One round of all that takes memory: a reset, a step, a refusal, a state saved, put back and freed."""
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

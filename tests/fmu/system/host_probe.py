"""`host_probe.py CHAIN.ssp STEPS STACK TRAPS` flies a system as a harsh host does, and prints all units' last values.

STACK: bytes that the stepping thread has. TRAPS = 1: an operation without a value, a division by zero and an overflow
end the process, as in hosts that look for errors of models in this way.
"""

import ctypes
import sys
import threading
from pathlib import Path

from baryscope.fmu.system import open_system

TRAPPED = 0x1 | 0x4 | 0x8  # FE_INVALID, FE_DIVBYZERO, FE_OVERFLOW of x86


def trapping(step):
    """A call during which exceptions of floating point are trapped."""
    libm = ctypes.CDLL("libm.so.6")

    def trapped(*arguments, **named):
        libm.feclearexcept(TRAPPED)
        libm.feenableexcept(TRAPPED)
        try:
            return step(*arguments, **named)
        finally:
            libm.fedisableexcept(TRAPPED)

    return trapped


def tune(unit):
    """Set a tunable parameter, to what it is."""
    unit.set(["prediction.horizon"], unit.get(["prediction.horizon"]))


def fly(path, steps, traps):
    with open_system(path) as master:
        if traps:
            for unit in master.units.values():
                unit.fmu.doStep = trapping(unit.fmu.doStep)
        for _ in range(steps):
            master.step()
            tune(master.units["estimator"])
        for name, unit in sorted(master.units.items()):
            reals = [one for one in unit.references if one not in unit.booleans]
            print(name, *(value.hex() for value in unit.get(reals).tolist()))


if __name__ == "__main__":
    threading.stack_size(int(sys.argv[3]))
    flight = threading.Thread(target=fly, args=(Path(sys.argv[1]), int(sys.argv[2]), sys.argv[4] == "1"))
    flight.start()
    flight.join()

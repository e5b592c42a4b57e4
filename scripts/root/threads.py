"""How many threads linear algebra runs on: one, where nobody has said otherwise.

The matrices here have few rows or few columns. OpenBLAS would share them out among all cores, whose threads then wait
for each other much longer than they compute, the more so on a busy machine.
"""

import os

# Read by the linear algebra libraries when they are loaded.
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")


def prefer_one_thread() -> None:
    """Set the variables of THREADS to 1 where they are not set. To be called before numpy is imported."""
    for name in THREADS:
        os.environ.setdefault(name, "1")

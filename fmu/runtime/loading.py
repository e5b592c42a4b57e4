"""Loading a unit's library by fmpy, which makes the library's folder the process's own while it does so.

That folder belongs to all threads of a process: of two that load at the same time, one could leave the process in the
other's folder, which may be a temporary one that is soon gone.
"""

import os
import threading
from pathlib import Path
from typing import Any

_ALONE = threading.Lock()


def loaded(kind: type, **arguments: Any) -> Any:
    """An fmpy unit of this kind, such as FMU2Slave, from its keyword arguments; the process stays in its folder.

    Raises:
        Exception: as fmpy raises it.
    """
    with _ALONE:
        here = Path.cwd()
        try:
            return kind(**arguments)
        finally:
            os.chdir(here)  # where loading fails, fmpy stays in the library's folder

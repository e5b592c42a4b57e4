"""Compilers that run at the same time, and that end together where the work is given up."""

import os
import signal
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path

from baryscope.models.errors import ComputationError


class Compilers:
    """The compilers that several threads run."""

    def __init__(self) -> None:
        self._alone = threading.Lock()
        self._running: set[subprocess.Popen[str]] = set()
        self._ended = False

    def run(self, command: list[str], folder: Path) -> tuple[int, str]:
        """Run a compiler in a folder; its exit code and what it says on standard error.

        Raises:
            OSError: it cannot be run.
            ComputationError: the work has been given up.
        """
        with self._alone:
            if self._ended:
                raise ComputationError("the compilers have been ended")
            process = subprocess.Popen(  # a group of its own, as compilers start others
                command,
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                errors="replace",
                process_group=0,
            )
            self._running.add(process)
        with process:
            _, messages = process.communicate()
        with self._alone:
            self._running.remove(process)
        return process.returncode, messages

    def end(self) -> None:
        """End those that run, with what they have started, and start no more."""
        with self._alone:
            self._ended = True
            for process in self._running:
                _end(process)


def _end(process: subprocess.Popen[str]) -> None:
    """End it by SIGTERM, on which compilers remove their own temporary files."""
    if sys.platform == "win32":
        process.terminate()
    elif process.poll() is None:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGTERM)

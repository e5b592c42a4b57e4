"""A command run where it can do no harm: in a process of its own that is bounded in memory and in time.

As a program it is that process: it runs commands that it reads from standard input, one JSON list a line, and answers
with the exit code and what was printed, warnings included, also by compiled code.
"""

import json
import os
import resource
import subprocess
import sys
import tempfile
import threading
import warnings

MEMORY = 4 << 30  # bytes of address space, of which libraries that do nothing take one


class Guarded:
    """The process, and a watchdog."""

    def __init__(self, memory=MEMORY):
        self.memory = memory
        self._process = None

    def __call__(self, arguments, seconds):
        """Exit code, and what was printed on standard output and error; a string says why there is none."""
        if self._process is None:
            command = [sys.executable, __file__, str(self.memory)]
            environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
            self._process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment
            )
            assert self._process.stdout.readline() == "ready\n"
        watchdog = threading.Timer(seconds, self._process.kill)
        watchdog.start()
        try:
            print(json.dumps(arguments), file=self._process.stdin, flush=True)
            line = self._process.stdout.readline()
        finally:
            watchdog.cancel()
        if not line:
            code = self._process.wait()
            self.close()
            return None, "", f"killed by signal {-code}, after {seconds} s or by itself"
        return tuple(json.loads(line))

    def close(self):
        """End the process."""
        if self._process is not None:
            self._process.stdin.close()
            self._process.wait()
            self._process.stdout.close()
            self._process = None


def serve(memory):
    from baryscope.scripts.cli.app import main

    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    warnings.simplefilter("always")
    answers = os.fdopen(os.dup(1), "w")
    print("ready", file=answers, flush=True)
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        os.dup2(out.fileno(), 1)
        os.dup2(err.fileno(), 2)
        for line in sys.stdin:
            for file in (out, err):
                file.seek(0)
                file.truncate()
            code = main(json.loads(line))
            sys.stdout.flush()
            sys.stderr.flush()
            printed = []
            for file in (out, err):
                file.seek(0)
                printed.append(file.read().decode("utf-8", "replace"))
            print(json.dumps([code, *printed]), file=answers, flush=True)


if __name__ == "__main__":
    serve(int(sys.argv[1]))

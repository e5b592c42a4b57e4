"""Loading leaves the process in its folder, whatever other threads load, and where it fails."""

import os
import threading
import time
from pathlib import Path

import pytest

from baryscope.fmu.runtime.loading import loaded


class LikeFmpy:
    """Goes to a folder and back, as fmpy does, slowly enough that others come in between."""

    def __init__(self, folder):
        here = Path.cwd()
        os.chdir(folder)
        time.sleep(0.01)
        os.chdir(here)


class Broken:
    def __init__(self, folder):
        os.chdir(folder)
        raise OSError("no such library")


def test_threads_that_load_together_leave_the_process_where_it_was(tmp_path):
    here, folders = Path.cwd(), [tmp_path / str(index) for index in range(8)]
    for folder in folders:
        folder.mkdir()
    threads = [threading.Thread(target=loaded, args=(LikeFmpy,), kwargs={"folder": folder}) for folder in folders]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert Path.cwd() == here


def test_a_library_that_cannot_be_loaded_leaves_the_process_where_it_was(tmp_path):
    here = Path.cwd()
    with pytest.raises(OSError, match="no such library"):
        loaded(Broken, folder=tmp_path)
    assert Path.cwd() == here

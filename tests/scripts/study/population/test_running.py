"""Worker processes with a limit of time, and files of results that survive an interruption."""

import multiprocessing
import os
import time

from baryscope.study.population.running import append, lines_of, run
from baryscope.worker import answer


def test_results_come_with_their_tasks():
    found = dict(run(divmod, [[(7, 2), (9, 4)], [(5, 5)]], workers=2, limit=60))
    assert found == {(7, 2): (3, 1), (9, 4): (2, 1), (5, 5): (1, 0)}


def test_what_takes_too_long_is_killed_and_the_rest_goes_on():
    found = list(run(time.sleep, [[(600,), (601,)]], workers=1, limit=0.1))
    assert found == [((600,), None), ((601,), None)]


def test_a_process_that_ends_itself_has_no_result():
    assert list(run(os._exit, [[(3,)]], workers=1, limit=60)) == [((3,), None)]


def test_an_incomplete_line_is_left_out_and_overwritten(tmp_path):
    path = tmp_path / "results.jsonl"
    append(path, {"a": 1})
    with path.open("a", encoding="utf-8") as stream:
        stream.write('{"a": 2')
    assert lines_of(path) == [{"a": 1}]
    append(path, {"a": 3})
    assert lines_of(path) == [{"a": 1}, {"a": 3}]


def test_a_worker_whose_asker_is_killed_leaves_in_silence():
    """While it was at work: it wrote a traceback to the terminal."""
    asker, worker = multiprocessing.Pipe()
    asker.send(())
    assert answer(asker.close, worker) is None

from itertools import chain

import pytest

from baryscope.study.population import command


@pytest.fixture
def in_process(monkeypatch):
    """Cases are run here, since workers take longer to start; of these are test_running and test_report."""
    monkeypatch.setattr(
        command, "run", lambda function, groups, *_: ((task, function(*task)) for task in chain(*groups))
    )

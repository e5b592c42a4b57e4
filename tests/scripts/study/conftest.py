import pickle
from itertools import chain

import pytest

from baryscope.fmu.system import build_system
from baryscope.study.loop import fly_loop
from baryscope.study.population import command


@pytest.fixture
def in_process(monkeypatch):
    """Cases are run here, since workers take longer to start; of these are population's test_running and test_report.

    What they would be sent is sent.
    """

    def run(function, groups, *_):
        for task in chain(*groups):
            one, words = pickle.loads(pickle.dumps((function, task)))  # noqa: S301  our own
            yield task, pickle.loads(pickle.dumps(one(*words)))  # noqa: S301

    monkeypatch.setattr(command, "run", run)


@pytest.fixture(scope="package")
def system(envisat, tmp_path_factory):
    return build_system(envisat, tmp_path_factory.mktemp("loop") / "chain.ssp")


@pytest.fixture(scope="package")
def held(system):
    return fly_loop(system, duration=400.0)

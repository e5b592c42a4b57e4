"""The populations by their names: each makes a case of (seed, index), and its tracks of the number of a draw."""

from collections.abc import Callable
from functools import partial

from baryscope.study.population import cases, sensing
from baryscope.study.population.interface import Drawn, Sample
from baryscope.study.population.second import cases as second_cases
from baryscope.study.population.third import cases as third_cases

Sampler = Callable[[int], Sample]  # draw 0: the tracks of the case; others: with other noise and blunders

FIRST = "first"


def _first(seed: int, index: int) -> tuple[Drawn, Sampler]:
    case = cases.drawn(seed, index)
    return case, partial(sensing.sampled, case)


def _second(seed: int, index: int) -> tuple[Drawn, Sampler]:
    case = second_cases.drawn(seed, index)
    return case, partial(second_cases.sampled, case)


def _third(seed: int, index: int) -> tuple[Drawn, Sampler]:
    case = third_cases.drawn(seed, index)
    return case, partial(third_cases.sampled, case)


POPULATIONS: dict[str, Callable[[int, int], tuple[Drawn, Sampler]]] = {
    FIRST: _first,
    "second": _second,
    "third": _third,
}

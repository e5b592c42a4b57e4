"""The populations by their names: each makes a case of (seed, index), and its tracks of the number of a draw."""

from collections.abc import Callable
from functools import partial
from typing import TypeVar

from baryscope.study.population import cases, sensing
from baryscope.study.population.fourth import cases as fourth_cases
from baryscope.study.population.interface import Drawn, Sample
from baryscope.study.population.second import cases as second_cases
from baryscope.study.population.third import cases as third_cases

Sampler = Callable[[int], Sample]  # draw 0: the tracks of the case; others: with other noise and blunders

Population = Callable[[int, int], tuple[Drawn, Sampler]]
_Case = TypeVar("_Case", bound=Drawn)

FIRST = "first"


def _population(drawn: Callable[[int, int], _Case], sampled: Callable[[_Case, int], Sample]) -> Population:
    def population(seed: int, index: int) -> tuple[Drawn, Sampler]:
        case = drawn(seed, index)
        return case, partial(sampled, case)

    return population


POPULATIONS: dict[str, Population] = {
    FIRST: _population(cases.drawn, sensing.sampled),
    "second": _population(second_cases.drawn, second_cases.sampled),
    "third": _population(third_cases.drawn, third_cases.sampled),
    "fourth": _population(fourth_cases.drawn, fourth_cases.sampled),
}

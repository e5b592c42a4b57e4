"""How an estimate of a case is judged."""

import pytest

import baryscope.study.population.judging as judging
from baryscope.study.population.judging import judged
from baryscope.study.population.report import failing


def test_tracks_that_are_no_input_are_refused():
    """One feature in view at a time: `population case --seed 92 --index 13`."""
    line = judged(92, 13, "pivot", False)
    assert "no two of the 3 features have a time in common" in line["message"]
    (fault,) = failing([line])
    assert fault.startswith("refused ")


@pytest.mark.parametrize("what, case", [("attempt", (92, 13)), ("predicted", (5, 10))])
def test_what_is_no_reasoned_refusal_is_a_crash(what, case, monkeypatch):
    def broken(*_args, **_options):
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr(judging, what, broken)
    (fault,) = failing([judged(*case, "pivot", True, ahead=True)])
    assert fault.startswith("crashed ")
    assert "division by zero" in fault

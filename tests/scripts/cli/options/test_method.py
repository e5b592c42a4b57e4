"""The tables of methods and units that commands have, against those that estimators and units have."""

import inspect
import re
from dataclasses import fields
from typing import get_args, get_type_hints

import pytest

from baryscope.estimator.options import PathOptions, ScrewOptions
from baryscope.fmu.units import UNITS
from baryscope.scripts.cli.build import build
from baryscope.scripts.cli.options.forces import ForceChoices
from baryscope.scripts.cli.options.method import BEARING, PathChoices, ScrewChoices


def names_of(kind):
    return {field.name for field in fields(kind)}


def test_a_methods_options_are_those_of_the_command_line():
    assert names_of(PathChoices) | set(ForceChoices().chosen()) == names_of(PathOptions)
    assert names_of(ScrewChoices) == names_of(ScrewOptions)


@pytest.mark.parametrize("option", BEARING)
def test_help_names_the_methods_that_an_option_bears_on(option):
    """In its first brackets that begin with a method: (pivot, ml, ekf; …)."""
    page = inspect.cleandoc(PathChoices.__doc__)
    text = re.search(rf"^{option}\n((?:    .*\n?)+)", page, re.MULTILINE)[1]
    named = re.search(r"\(((?:pivot|ml|ekf)[\w, ]*)[);]", text)[1]
    assert tuple(named.split(", ")) == BEARING[option]


def test_build_offers_every_unit():
    assert get_args(get_type_hints(build)["unit"]) == tuple(UNITS)

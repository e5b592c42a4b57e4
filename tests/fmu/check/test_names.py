"""Names under the naming convention "structured": the standard's own examples, and fmpy's parser of its grammar."""

import xml.etree.ElementTree as ET
from types import SimpleNamespace

import numpy as np
import pytest
from fmpy.validation import _validate_variable_names

from baryscope.fmu.check.checker import check_unit
from baryscope.fmu.check.names import is_structured_name
from mutations import mutated, variable

GOOD = ["v", "vehicle.engine.speed", "resistor12.u", "v_min", "robot.axis.'motor #234'.inertia",
        "der(pipe[3,4].T[14],2)", "der(pipe[3].T[14])", "a[1]", "_", "'\\''", "'a\\n'.b", "der", "der.x"]  # fmt: skip
BAD = ["", "1a", "a.", ".a", "a..b", "a[", "a[]", "a[1,]", "a[-1]", "a[1][2]", "a b", "''", "'a", "'\\x'", "'é'", "é",
       "der(", "der(a", "der(a,)", "der(der(a))", "der(a).b", "d(a)", "a\n", "a[٣]"]  # fmt: skip


def refused_by_fmpy(names):
    """The names that fmpy's validation refuses."""
    variables = [SimpleNamespace(name=name, sourceline=line) for line, name in enumerate(names)]
    description = SimpleNamespace(variableNamingConvention="structured", modelVariables=variables)
    problems = " ".join(_validate_variable_names(description))
    return [name for line, name in enumerate(names) if f'"{name}" (line {line})' in problems]


def test_names_of_the_convention():
    assert [name for name in GOOD if not is_structured_name(name)] == []
    assert refused_by_fmpy(GOOD) == []


@pytest.mark.parametrize("name", BAD)
def test_other_names(name):
    assert not is_structured_name(name)


def test_names_are_those_that_fmpy_parses():
    """Without the escapes, in which fmpy's grammar is not the standard's: it takes any character after a backslash."""
    rng, made = np.random.default_rng(5), set()
    for _ in range(600):
        parts = rng.choice(["a", "B_1", "'#7 .'", "c[7]", "'d'[1,20]"], rng.integers(1, 4))
        name = str(rng.choice(["{}", "{}", "der({})", "der({},2)"])).format(".".join(parts))
        at, spoilt = rng.integers(len(name)), rng.random() < 0.6
        made.add(name[:at] + str(rng.choice([*"' #.[],7)(é"])) + name[at + rng.integers(2) :] if spoilt else name)
    names = sorted(made)
    refused = [name for name in names if not is_structured_name(name)]
    assert 100 < len(refused) < len(names) - 100
    assert refused == refused_by_fmpy(names)


@pytest.mark.parametrize("convention, words", [
    ("structured", ['error: my name: found this name, expected one of the naming convention "structured"']),
    ("flat", []),
])  # fmt: skip
def test_a_name_is_judged_by_the_convention_of_its_unit(small_fmu, tmp_path, convention, words):
    def renamed(root):
        root.set("variableNamingConvention", convention)
        ET.SubElement(
            ET.SubElement(root.find("ModelVariables"), "ScalarVariable", name="my name", valueReference="99999"), "Real"
        )

    found = [str(finding) for finding in check_unit(mutated(small_fmu, tmp_path / "m.fmu", renamed), isolated=False)]
    assert [line for line in found if "name:" in line and "naming" in line] == words


def test_characters_that_no_convention_has_are_found(small_fmu, tmp_path):
    """By fmpy, which keeps the check of flat names."""

    def renamed(root):
        root.set("variableNamingConvention", "flat")
        variable(root, "target.rotationalEnergy").set("name", "two\nlines")

    found = [str(finding) for finding in check_unit(mutated(small_fmu, tmp_path / "m.fmu", renamed), isolated=False)]
    assert any("illegal line feed character" in line for line in found), found

"""The checker against units with one error each, and whether fmpy's validation finds it, too."""

import re
import zipfile

import pytest
from fmpy.validation import validate_fmu

from baryscope.fmu.check.checker import check_unit
from baryscope.fmu.check.finding import Severity
from baryscope.fmu.check.units import exponents_of_name
from baryscope.fmu.units.target import target_blueprint
from baryscope.models.errors import InputError
from baryscope.models.variables import UNITS
from baryscope.scripts.cli.app import main
from mutations import (
    MUTATIONS_2,
    MUTATIONS_3,
    flag,
    mutated,
    place,
    relinked,
    rewritten,
    unknown,
    unknown3,
    variable3,
    wrong_unit_of_a_state,
)


def errors_of(path, *, isolated=False):
    return [str(finding) for finding in check_unit(path, isolated=isolated) if finding.severity == Severity.ERROR]


@pytest.mark.parametrize("mutate, words, fmpy_alone", MUTATIONS_2)
def test_a_mutation_is_caught(small_fmu, tmp_path, mutate, words, fmpy_alone):
    unit = mutated(small_fmu, tmp_path / "mutant.fmu", mutate)
    found = errors_of(unit)
    assert any(re.search(words, line) for line in found), found
    # Findings about the whole file are those of fmpy's validation.
    assert any(line.startswith("error: modelDescription.xml: ") for line in found) == fmpy_alone


@pytest.mark.parametrize("mutate, words, fmpy_alone", MUTATIONS_3)
def test_a_mutation_of_fmi_3_is_caught(small_fmu3, tmp_path, mutate, words, fmpy_alone):
    unit = mutated(small_fmu3, tmp_path / "mutant.fmu", mutate)
    found = errors_of(unit)
    assert any(re.search(words, line) for line in found), found
    assert any(line.startswith("error: modelDescription.xml: ") for line in found) == fmpy_alone


@pytest.mark.parametrize(
    "mutate, words",
    [
        (flag("CoSimulation", "hasEventMode", "true"), "CoSimulation/hasEventMode: is declared, and cannot be checked"),
        (
            flag("DefaultExperiment", "tolerance", "1e-13"),
            "DefaultExperiment/tolerance: found 1e-13, expected 1e-10 to",
        ),
    ],
)
def test_declarations_that_cannot_be_checked_or_met_are_reported(small_fmu3, tmp_path, mutate, words):
    unit = mutated(small_fmu3, tmp_path / "mutant.fmu", mutate)
    [found] = check_unit(unit)
    assert str(found).startswith(f"warning: {words}")


RATE = b"unit_set_rate(&instance->core.unit, VARIABLES[selection.references[i]].offset - AT_INPUTS, values[i]);"
NOT_FOLLOWED = r"with derivative 1 found .* after a step, expected .* \(canInterpolateInputs is declared\)"


@pytest.mark.parametrize(
    "source, words, count",
    [
        (
            b'return refuse(instance, "%s: inputs are held", function);',
            "canInterpolateInputs: is declared, but .* held",
            1,
        ),
        (RATE.replace(b"values[i]", b"-values[i]"), NOT_FOLLOWED, 6),
        (b"if (selection.references[i] < 3) " + RATE, NOT_FOLLOWED, 3),
    ],
    ids=["refused", "turned over", "of the torque ignored"],
)
def test_a_library_that_does_not_follow_derivatives_of_inputs_is_caught(
    small, small_fmu, tmp_path, source, words, count
):
    changes = [("continuous_calls.c", RATE, source)]
    unit = relinked(small_fmu, tmp_path / "m.fmu", target_blueprint(small), 2, changes)
    found = errors_of(unit)
    assert len(found) == count
    assert all(re.search(words, line) for line in found), found


def test_a_fixed_parameter_may_be_a_known_of_a_run_in_fmi_3_only(small_fmu, small_fmu3, tmp_path):
    """As Reference-FMUs' BouncingBall lists g."""

    def listed_in_3(root):
        entry, raan = unknown3(root, "Output", "features"), variable3(root, "orbit.raan").get("valueReference")
        entry.set("dependencies", f"{raan} {entry.get('dependencies')}")

    def listed_in_2(root):
        entry = unknown(root, "Outputs", "features[1,1]")
        entry.set("dependencies", f"{place(root, 'orbit.raan')} {entry.get('dependencies')}")

    assert check_unit(mutated(small_fmu3, tmp_path / "3.fmu", listed_in_3), isolated=False) == []
    [found] = check_unit(mutated(small_fmu, tmp_path / "2.fmu", listed_in_2), isolated=False)
    assert "found a dependency on orbit.raan, expected inputs and states" in str(found)


# ---- files, presets, command line ----


def test_a_missing_binary_is_reported(small_fmu, tmp_path):
    unit = rewritten(small_fmu, tmp_path / "m.fmu", lambda name, c: None if name.startswith("binaries/") else c)
    assert any("expected binaries/" in line for line in errors_of(unit))
    assert validate_fmu(str(unit)) == []


def test_a_file_that_is_no_library_is_reported(small_fmu, tmp_path):
    unit = rewritten(small_fmu, tmp_path / "m.fmu", lambda name, c: c[:1000] if name.startswith("binaries/") else c)
    assert any("the process that ran the binary ended" in line for line in errors_of(unit, isolated=True))
    unit = rewritten(small_fmu, tmp_path / "t.fmu", lambda name, c: b"text" if name.startswith("binaries/") else c)
    assert any("loading failed" in line for line in errors_of(unit))


def test_correct_units_have_no_findings(any_fmu):
    assert check_unit(any_fmu) == []


def test_the_presets_have_no_findings(preset_fmu):
    assert check_unit(preset_fmu, isolated=False) == []


def test_files_that_are_no_units_are_refused(tmp_path):
    (tmp_path / "text.fmu").write_text("no zip")
    with zipfile.ZipFile(tmp_path / "empty.fmu", "w") as archive:
        archive.writestr("readme.txt", "")
    with zipfile.ZipFile(tmp_path / "bad.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", "<fmiModelDescription")
    with zipfile.ZipFile(tmp_path / "slip.fmu", "w") as archive:
        archive.writestr("../modelDescription.xml", "")
    with zipfile.ZipFile(tmp_path / "old.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", '<fmiModelDescription fmiVersion="1.0"/>')
    for name, words in (
        ("text", "not a whole zip"),
        ("empty", "no modelDescription.xml"),
        ("bad", "is no XML"),
        ("slip", "unsafe path"),
        ("old", "version 1.0, expected 2.0 or 3.0"),
        ("none", "No such file"),
    ):
        with pytest.raises(InputError, match=words):
            check_unit(tmp_path / f"{name}.fmu")


def test_the_command_line(small_fmu, tmp_path, capsys):
    assert main(["check", str(small_fmu)]) == 0
    assert capsys.readouterr().out == "no findings\n"
    unit = mutated(small_fmu, tmp_path / "m.fmu", wrong_unit_of_a_state)
    assert main(["check", str(unit)]) == 1
    streams = capsys.readouterr()
    assert streams.out.startswith("error: der(state.trueAnomaly): ")
    assert "errors found" in streams.err
    assert main(["check", str(tmp_path / "none.fmu")]) == 2


@pytest.mark.parametrize("name, exponents", UNITS.items())
def test_the_names_of_our_units_give_their_exponents(name, exponents):
    assert exponents_of_name(name) == exponents


@pytest.mark.parametrize(
    "name, exponents",
    [("W/(m2.K)", {"kg": 1, "s": -3, "K": -1}), ("V.A.s", {"kg": 1, "m": 2, "s": -2}), ("s-1", {"s": -1}),
     ("m/s/s", None), ("N/m.s", None), ("km", None), ("degC", None)],
)  # fmt: skip
def test_names_of_other_units(name, exponents):
    assert exponents_of_name(name) == exponents

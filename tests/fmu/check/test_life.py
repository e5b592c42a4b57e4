"""The checker against libraries with one fault each in their life: what XML and start values do not show."""

import re

import pytest

from baryscope.fmu import build_fmu
from baryscope.fmu.check.checker import check_unit
from baryscope.fmu.units.estimator import estimator_blueprint
from baryscope.fmu.units.rig import rig_blueprint
from baryscope.fmu.units.target import target_blueprint
from mutations import relinked

RESET = b"    unit_reset(&instance->core.unit);\n    instance->core.state = INSTANTIATED;"
KEPT = b"""    Unit old = instance->core.unit;
    unit_reset(&instance->core.unit);
    memcpy(instance->core.unit.values, old.values, AT_OUTPUTS * sizeof *old.values);
    instance->core.state = INSTANTIATED;"""
READABLE = b"RUNNING | TERMINATED,\n    [SET_VALUES]"
STARTED = b"core->unit.time = start;"
LAST = b"*last_time = instance->core.unit.time;"
ANSWERS = b"*event = *terminate = *early_return = fmi3False;"
SERIALISE, BYTES = (
    b"    memcpy(bytes, state, sizeof(Saved));\n    return OK;",
    b"    memcpy(saved, bytes, sizeof *saved);",
)
RESTORE = b"memcpy(&instance->core, &saved->core, sizeof saved->core);"
ADVANCE = b"    if (!unit_advance"
FAULTS = [
    (2, [("instance.c", RESET, KEPT)], "CoSimulation: after a reset chaser.acceleration.* differed"),
    (2, [("fmi2.c", b"return fmi2Version;", b'return "1.0";')], 'fmiVersion: .* says "1.0", expected "2.0"'),
    (2, [("fmi2.c", b"return fmi2TypesPlatform;", b'return "x";')], 'fmi2GetTypesPlatform: found "x"'),
    (2, [("instance.c", b"if (stop_defined && ", b"if (stop_defined || ")], "a run from 3.25 s .*: stopTime is"),
    (2, [("instance.c", b"if (tolerance_defined && ", b"if (tolerance_defined || ")], "a run from 3.25 .*: tolerance"),
    (2, [("instance.c", READABLE, READABLE.replace(b"TERMINATED", b"0"))], "cannot be read after the end"),
    (2, [("instance.c", STARTED, b"core->unit.time = 0.0;")], "expected 0"),
    (2, [("saved.c", SERIALISE, b"    memcpy(bytes, &state, sizeof state);\n    return OK;"),
         ("saved.c", BYTES, b"    memcpy(saved, *(const Saved *const *)(const void *)bytes, sizeof *saved);")],
     "CoSimulation, saved states: deSer.* was freed"),
    (3, [("instance.c", STARTED, b"core->unit.time = 0.0;")], "time: found 0 in CoS.*, expected 3.25"),
    (3, [("fmi3.c", b"return fmi3Version;", b'return "2.0";')], 'fmiVersion: .* says "2.0", expected "3.0"'),
    (3, [("fmi3.c", ANSWERS, ANSWERS + b" *early_return = fmi3True;")], "found earlyReturn, expected none"),
    (3, [("fmi3.c", ANSWERS, ANSWERS + b" *event = fmi3True;")], "found eventHandlingNeeded, expected none"),
    (3, [("fmi3.c", LAST, b"*last_time = point;")], "lastSuccessfulTime 3.25, expected 4.25"),
    (3, [("step.c", ADVANCE, b"    unit->values[AT_PARAMETERS] *= 1.001;\n" + ADVANCE)],
     "target.inertia.xx: is a fixed parameter, but changed in a run of CoSimulation"),
    (3, [("step.c", ADVANCE, b"    unit->values[0] = 0.0;\n" + ADVANCE)],
     "chaser.acceleration: is a continuous input, but changed in a run of CoSimulation"),
]  # fmt: skip


def findings_of(path):
    return [str(finding) for finding in check_unit(path, isolated=False)]


@pytest.mark.parametrize("fmi, changes, words", FAULTS)
def test_a_fault_in_its_life_is_caught(request, small, tmp_path, fmi, changes, words):
    unit = request.getfixturevalue("small_fmu" if fmi == 2 else "small_fmu3")
    found = findings_of(relinked(unit, tmp_path / "mutant.fmu", target_blueprint(small), fmi, changes))
    assert any(line.startswith("error: ") and re.search(words, line) for line in found), found


def test_an_end_of_the_run_that_the_unit_asks_for_is_reported(small, small_fmu3, tmp_path):
    changes = [("fmi3.c", ANSWERS, ANSWERS + b" *terminate = fmi3True;")]
    unit = relinked(small_fmu3, tmp_path / "mutant.fmu", target_blueprint(small), 3, changes)
    assert findings_of(unit) == ["warning: CoSimulation/doStep: asks to end the run at 4.25, before its stop time"]


@pytest.mark.parametrize(
    "value, words",
    [(b"-number", "found -1 in a run, expected 0 to inf"), (b"NAN", "is not finite in a run")],
    ids=["beyond its limit", "no number"],
)  # fmt: skip
def test_outputs_in_a_run_are_looked_at(small, tmp_path, value, words):
    """Of a rig, which begins at sample 0: a sample's number was right at the start."""
    rig = build_fmu(small, tmp_path / "rig.fmu", unit="rig")
    line = b"sample->outputs[AT_SAMPLE_NUMBER - AT_OUTPUTS] = number + 1.0;"
    changes = [("rig.c", line, line.replace(b"number + 1.0", value))]
    found = findings_of(relinked(rig, tmp_path / "mutant.fmu", rig_blueprint(small), 2, changes))
    assert f"error: sample.number: {words}" in found


def test_a_restored_state_that_lacks_what_no_output_shows_yet_is_reported(small, tmp_path):
    """Of the estimator, whose memory is its filter: a run goes on alike without the last 8 kB, and had no finding."""
    whole, path = build_fmu(small, tmp_path / "estimator.fmu", unit="estimator"), tmp_path / "mutant.fmu"
    changes = [("saved.c", RESTORE, RESTORE.replace(b"sizeof saved->core", b"sizeof saved->core - 8192"))]
    found = check_unit(relinked(whole, path, estimator_blueprint(small), 2, changes), isolated=False)
    assert [finding.subject for finding in found] == ["CoSimulation/canGetAndSetFMUstate"]
    assert re.fullmatch(r"a restored state differs from the saved one in \d+ bytes", found[0].message)
    assert check_unit(whole, isolated=False) == []

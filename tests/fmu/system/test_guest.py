"""Another tool's FMU as the chain's controller: connected by name, refused in a line where something is missing."""

import json
import re
import zipfile
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from baryscope.fmu import build_fmu
from baryscope.fmu.system import build_system, open_system
from baryscope.fmu.system.master import Unit
from baryscope.fmu.system.structure import STRUCTURE
from baryscope.models.errors import InputError
from baryscope.scripts.cli.app import main

STEPS = 40


@pytest.fixture(scope="module")
def controller_fmu(envisat, tmp_path_factory):
    return build_fmu(envisat, tmp_path_factory.mktemp("guest") / "controller.fmu", unit="controller")


def described(unit, path, *changes):
    """A copy with changes of its description: a pattern, and what comes in its place."""
    with zipfile.ZipFile(unit) as archive, zipfile.ZipFile(path, "w") as copy:
        for name in archive.namelist():
            content = archive.read(name)
            if name == "modelDescription.xml":
                for pattern, new in changes:
                    content, count = re.subn(pattern.encode(), new.encode(), content)
                    assert count
            copy.writestr(name, content)
    return path


def structure(system):
    with zipfile.ZipFile(system) as archive:
        return ET.fromstring(archive.read(STRUCTURE))  # noqa: S314  of our own making


def test_our_own_controller_as_a_guest_flies_alike(envisat, controller_fmu, tmp_path):
    own = build_system(envisat, tmp_path / "own.ssp")
    guest = build_system(envisat, tmp_path / "guest.ssp", controller=controller_fmu)
    flown = []
    for system in (own, guest):
        with open_system(system) as master:
            for _ in range(STEPS):
                master.step()
            flown.append(master.units["plant"].vector("chaser.position"))
    np.testing.assert_array_equal(flown[0], flown[1])
    assert len(list(structure(own).iter())) == len(list(structure(guest).iter()))


def test_a_guest_has_what_it_wants_of_inputs_and_parameters(envisat, controller_fmu, tmp_path):
    """One that neither asks for the inertia nor has our gain is not given them."""
    less = described(
        controller_fmu,
        tmp_path / "less.fmu",
        (r'name="target\.inertia\[', 'name="inertia['),
        (r'name="control\.rate"', 'name="gain"'),
    )
    root = structure(build_system(envisat, tmp_path / "less.ssp", controller=less))
    ends = {one.get("endConnector") for one in root.iter() if one.get("endElement") == "controller"}
    assert "target.position[1]" in ends
    assert not any(name.startswith("target.inertia") for name in ends)
    (component,) = (one for one in root.iter() if one.get("name") == "controller")
    bound = {one.get("name"): one[0].get("value") for one in component.iter() if one.tag.endswith("}Parameter")}
    assert float(bound["hold.position[2]"]) == -20.0
    assert "control.rate" not in bound


REFUSED = {
    "a missing output": (
        [(r'name="camera\.attitude\[', 'name="camera.orientation[')],
        r"guest\.fmu: has no output camera\.attitude\[1\], camera\.attitude\[2\], .*, expected what the chain connects",
    ),
    "part of an input": (
        [(r'name="target\.velocity\[2\]"', 'name="other"')],
        r"guest\.fmu: has no input target\.velocity\[2\], expected all of target\.velocity, or none",
    ),
    "another type": (
        [(r'(name="navigation\.valid"[^>]*>\s*)<Boolean [^>]*/>', r'\1<Real start="1"/>')],
        r"guest\.fmu: navigation\.valid is of type Real, expected Boolean",
    ),
    "another unit": (
        [(r'(name="target\.position\[2\]"[^>]*>\s*<Real [^>]*)unit="m"', r'\1unit="km"')],
        r'guest\.fmu: target\.position\[2\] is in "km", expected "m"',
    ),
    "no Co-Simulation": (
        [(r"<CoSimulation[^>]*>", '<ModelExchange modelIdentifier="x">'), ("</CoSimulation>", "</ModelExchange>")],
        r"guest\.fmu: is of FMI 2\.0, without Co-Simulation, expected an FMU of FMI 2\.0 for Co-Simulation",
    ),
    "no description": ([("<ModelVariables>", "<Variables")], r"guest\.fmu: .*, expected an FMU of FMI 2\.0"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_does_not_fit_is_refused(case, envisat, controller_fmu, tmp_path):
    changes, message = REFUSED[case]
    guest = described(controller_fmu, tmp_path / "guest.fmu", *changes)
    with pytest.raises(InputError, match=message):
        build_system(envisat, tmp_path / "chain.ssp", controller=guest)
    assert not (tmp_path / "chain.ssp").exists()


def test_the_command(envisat_fmu3, controller_fmu, tmp_path, capsys):
    path = tmp_path / "chain.ssp"
    assert main(["system", "--controller", str(envisat_fmu3), "-o", str(path)]) == 2
    assert "is of FMI 3.0, expected an FMU of FMI 2.0 for Co-Simulation" in capsys.readouterr().err
    stays = described(
        controller_fmu,
        tmp_path / "plain.fmu",
        (r'name="(synchronised|hold\.position|grapple\.standoff|goal\.synchronised)', r'name="own.\1'),
        (r'modelName="ApproachController"', 'modelName="Plain"'),
    )
    assert main(["system", "--controller", str(stays), "-o", str(path)]) == 0
    assert "plain.fmu as controller" in capsys.readouterr().out
    assert main(["fly", str(path), "--duration", "30", "--approach", "-o", str(tmp_path / "flight")]) == 2
    assert "Plain has no synchronised, by which an approach begins" in capsys.readouterr().err
    assert main(["fly", str(path), "--controller", str(stays), "-o", str(tmp_path / "flight")]) == 2
    assert "but the system has a controller already" in capsys.readouterr().err
    assert main(["fly", "--controller", str(stays), "--duration", "30", "-o", str(tmp_path / "flight"), "-q"]) == 0
    assert "from its place" in capsys.readouterr().out
    assert json.loads((tmp_path / "flight" / "flight.json").read_text())["options"]["controller"] == str(stays)


def with_libraries(unit, path, change):
    """A copy whose libraries are changed."""
    with zipfile.ZipFile(unit) as archive, zipfile.ZipFile(path, "w") as copy:
        for name in archive.namelist():
            content = archive.read(name)
            copy.writestr(name, change(content) if name.startswith("binaries/") else content)
    return path


CUT = r"guest\.fmu: binaries/\S+: is cut off, found 5000 bytes, expected \d+ as in its header"
NO_LIBRARY = r"controller: (?!.*(chain\.ssp|/tmp)).*binaries/\S+/ApproachController"


@pytest.mark.parametrize(
    "command, change, message",
    [
        (["system"], lambda content: content[:5000], CUT),
        (["fly", "--duration", "5"], lambda content: content[:5000], CUT),
        (["fly", "--duration", "5"], lambda content: b"no library", NO_LIBRARY),
    ],
)
def test_a_library_that_cannot_be_loaded_is_named_without_temporary_folders(
    command, change, message, controller_fmu, tmp_path, capsys
):
    """What is cut is told by the user's file, before a system is written; what else is wrong, only loading tells."""
    guest, output = with_libraries(controller_fmu, tmp_path / "guest.fmu", change), tmp_path / "chain.ssp"
    assert main([*command, "--controller", str(guest), "-o", str(output)]) in (1, 2)
    assert re.search(message, capsys.readouterr().err)
    assert not output.exists()


class Typed:
    """An instance that tells its variables by their types only, as FMI 2 asks."""

    def getReal(self, places):
        assert places == [0]
        return [0.5]

    def getInteger(self, places):
        assert places == [1]
        return [3]

    def getBoolean(self, places):
        assert places == [2]
        return [1]


def test_a_mode_may_be_an_integer():
    """A flight reads `guidance.mode` where a controller has it; one that counts it in integers ended with an error."""
    references = {"gain": 0, "guidance.mode": 1, "goal.synchronised": 2}
    flags, whole = frozenset({"goal.synchronised"}), frozenset({"guidance.mode"})
    unit = Unit("controller", "Another", references, flags, whole, None, Typed(), [])
    assert [unit.vector(name)[0] for name in references] == [0.5, 3.0, 1.0]

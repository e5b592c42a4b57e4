"""The chain of units as an SSP: the same in four masters, closed on estimates, refused where it is none of ours."""

import csv
import importlib
import io
import shutil
import subprocess
import tempfile
import zipfile

import fmpy
import numpy as np
import pytest
from fmpy.ssp.simulation import simulate_ssp

from baryscope.fmu.runtime.instance import UnitError
from baryscope.fmu.system import build_system, open_system
from baryscope.models.errors import InputError
from systems import rewritten

STEPS = 120
WATCHED = {
    "plant": [f"chaser.position[{k}]" for k in (1, 2, 3)],
    "rig": ["pixels[1,1]", "pixels[7,3]"],
    "estimator": [f"target.position[{k}]" for k in (1, 2, 3)] + ["target.positionCovariance[1]"],
    "controller": [f"command.acceleration[{k}]" for k in (1, 2, 3)],
}


@pytest.fixture(scope="module")
def system(envisat, tmp_path_factory):
    return build_system(envisat, tmp_path_factory.mktemp("system") / "chain.ssp")


@pytest.fixture(scope="module")
def flown(system):
    """What is watched after so many steps by our master."""
    with open_system(system) as master:
        assert master.step_size == 1.0
        for _ in range(STEPS):
            master.step()
        found = {element: master.units[element].get(names) for element, names in WATCHED.items()}
    assert found["estimator"][3] > 0
    assert (found["rig"] > 0).any()
    assert found["controller"].any()
    return found


def same(found, flown):
    for element, names in WATCHED.items():
        np.testing.assert_array_equal(found(element, names), flown[element], err_msg=element)


@pytest.mark.parametrize("start", [0.0, 2000.0, -500.0])
def test_fmpy_flies_it_alike(system, flown, start):
    """From any start time: the orbit's true anomaly is that of the start in all units."""
    rows = simulate_ssp(str(system), start_time=start, stop_time=start + STEPS, step_size=1.0)
    assert len(rows) == STEPS

    def found(element, names):
        there = [name for name in names if f"{element}.{name}" in rows.dtype.names]
        values = dict(zip(names, flown[element], strict=True)) | {name: rows[f"{element}.{name}"][-1] for name in there}
        return [values[name] for name in names]

    assert "estimator.target.position[1]" in rows.dtype.names
    same(found, flown)


@pytest.mark.filterwarnings("ignore:'ctypes.POINTER with string':DeprecationWarning")  # its, on 3.14
def test_libcosim_flies_it_alike(system, flown, tmp_path):
    package = "libcosimpy"
    pytest.importorskip(package, reason=f"{package} has wheels for Linux and Windows on x86-64")
    part = {name: importlib.import_module(f"{package}.Cosim{name}") for name in ("Execution", "Logging", "Observer")}
    part["Logging"].log_output_level(part["Logging"].CosimLogLevel.ERROR)
    with zipfile.ZipFile(system) as archive:  # libcosim reads a folder
        archive.extractall(tmp_path)
    execution = part["Execution"].CosimExecution.from_ssp_file(str(tmp_path), 10**9)
    observer = part["Observer"].CosimObserver.create_last_value()
    assert execution.add_observer(observer)
    assert execution.step(STEPS)
    slaves = {info.name.decode(): info.index for info in execution.slave_infos()}

    def found(element, names):
        unit = fmpy.read_model_description(str(tmp_path / "resources" / f"{element}.fmu"))
        references = {variable.name: variable.valueReference for variable in unit.modelVariables}
        return observer.last_real_values(slaves[element], [references[name] for name in names])

    same(found, flown)


def test_ecos_flies_it_alike(system, flown):
    try:
        ecospy = importlib.import_module("ecospy")
    except ImportError as problem:
        pytest.skip(f"ecospy has libraries for Linux and Windows on x86-64 only ({problem})")
    except OSError as problem:
        pytest.skip(f"ecospy needs the system's libtbb.so.12, in Debian's package libtbb12 ({problem})")
    with ecospy.EcosSimulation(ssp_path=str(system), step_size=1.0) as simulation:
        simulation.init()
        simulation.step(STEPS)
        same(lambda element, names: [simulation.get_real(f"{element}::{name}") for name in names], flown)


def test_omsimulator_flies_it_alike(system, flown, tmp_path):
    """To the twelve digits that it writes. It has its own step from the structure, and what is bound, too."""
    program = shutil.which("OMSimulator")
    if program is None:
        pytest.skip("OMSimulator is not on the path; pip's package of it loads the program from elsewhere")
    nearer = (r'(name="chaser\.position0\[2\]">\s*<ssv:Real value=")-20\.0', r"\g<1>-12.5")
    rows = {}
    for path in (system, rewritten(system, tmp_path / "near.ssp", nearer)):
        table = tmp_path / f"{path.stem}.csv"
        command = [program, f"--stopTime={STEPS}", f"--resultFile={table}", f"--tempDir={tmp_path}", str(path)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=100, check=True)
        assert "error:" not in done.stdout
        with table.open(newline="") as stream:
            rows[path] = list(csv.DictReader(stream))
    for element, names in WATCHED.items():
        found = [float(rows[system][-1][f"envisat.loop.{element}.{name}"]) for name in names]
        np.testing.assert_allclose(found, flown[element], rtol=1e-11, err_msg=element)
    assert float(rows[tmp_path / "near.ssp"][0]["envisat.loop.plant.chaser.position[2]"]) == -12.5


def test_it_holds_on_estimates_alone(system):
    """Ten minutes at 20 m: the centre of mass within what is claimed, the chaser where it shall be."""
    squares = []
    with open_system(system) as master:
        target, estimator, controller = (master.units[name] for name in ("plant", "estimator", "controller"))
        for k in range(600):
            master.step()
            if k >= 120 and k % 60 == 0:
                assert estimator.vector("navigation.valid")[0] == 1.0
                error = estimator.vector("target.position") - target.vector("target.position")
                covariance = np.zeros((3, 3))
                covariance[np.triu_indices(3)] = estimator.vector("target.positionCovariance")
                covariance = covariance + np.triu(covariance, 1).T
                squares.append(error @ np.linalg.solve(covariance, error))
        away = target.vector("chaser.position") - [0.0, -20.0, 0.0]
        assert np.linalg.norm(away) < 0.02
        assert np.linalg.norm(controller.vector("goal.offset")) < 0.02
    assert max(squares) < 21.1  # p = 1e-4
    # Eight times of one flight are correlated: as if they were two, whose mean is below 3 + 4 √(6/2).
    assert np.mean(squares) < 10


def test_equal_scenarios_give_equal_files(envisat, system, tmp_path):
    assert build_system(envisat, tmp_path / "again.ssp").read_bytes() == system.read_bytes()


def test_parameters_are_those_that_are_bound(system, tmp_path):
    nearer = (r'(name="chaser\.position0\[2\]">\s*<ssv:Real value=")-20\.0', r"\g<1>-12.5")
    changed = rewritten(system, tmp_path / "near.ssp", nearer)
    with open_system(changed) as master:
        assert master.units["plant"].vector("chaser.position").tolist() == [0.0, -12.5, 0.0]
        assert master.stop_time == pytest.approx(6016.86, abs=0.01)


def test_a_parameter_that_a_unit_refuses_is_named(system, tmp_path, capfd):
    never = (r'(name="sampling\.period">\s*<ssv:Real value=")1\.0', r"\g<1>-1.0")
    line = r"^rig: fmi2ExitInitializationMode: sampling\.period: found value -1, expected .*"
    with pytest.raises(UnitError, match=line), open_system(rewritten(system, tmp_path / "bad.ssp", never)):
        pass
    assert not capfd.readouterr().out


BAD = {
    "no such scalar": (
        [(r'startConnector="sample\.time"', 'startConnector="sample.tune"')],
        r"connects rig\.sample\.tune, which is in no unit",
    ),
    "a transformation": (
        [(r'(endConnector="sample\.time") />', r'\1><ssc:LinearTransformation factor="2" /></ssd:Connection>')],
        r"a connection transforms its values",
    ),
    "not SSP": ([("ssd:Component ", "ssd:Part ")], r"bad\.ssp: .*, expected a system of FMI 2\.0 units"),
    "a unit that is not there": ([(r"resources/rig\.fmu", "resources/rag.fmu")], r"rig is of resources/rag\.fmu"),
    "a name twice": ([('name="rig"', 'name="plant"')], r"plant stands twice, expected elements of different names"),
    "a parameter that no unit has": (
        [(r'name="sampling\.period"', 'name="sampling.rate"')],
        r"binds rig\.sampling\.rate, which is not in its unit",
    ),
    "a parameter that is a text": (
        [(r'(name="sampling\.period">\s*)<ssv:Real value="1\.0"', r'\1<ssv:String value="often"')],
        r"binds rig\.sampling\.period to 'often', expected a number, true or false",
    ),
    "a unit from elsewhere": ([(r"resources/rig\.fmu", "../../rig.fmu")], r"rig is of \.\./\.\./rig\.fmu"),
}


@pytest.mark.parametrize("case", BAD)
def test_what_is_no_system_of_ours_is_refused(case, system, tmp_path):
    changes, message = BAD[case]
    with pytest.raises(InputError, match=message), open_system(rewritten(system, tmp_path / "bad.ssp", *changes)):
        pass


@pytest.mark.parametrize("name", ["left/rig", "x/../../../rig", "unit-0"])
def test_a_name_of_an_element_is_no_path(name, system, tmp_path, monkeypatch):
    """It led out of the folder for temporary files where the archive had a folder to go by."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()
    path = rewritten(
        system, tmp_path / "named.ssp", ('name="rig"', f'name="{name}"'), ('Element="rig"', f'Element="{name}"')
    )
    with zipfile.ZipFile(path, "a") as archive:
        for folder in ("unpacked-x", "unit-0"):
            archive.writestr(f"{folder}/file", "")
    with open_system(path) as master:
        master.step()
        assert master.units[name].model == "StereoRig"
    assert {item.name for item in tmp_path.iterdir()} == {"temporary", "named.ssp"}
    assert not list((tmp_path / "temporary").iterdir())


def test_other_files_and_steps_are_refused(system, envisat_fmu, envisat_fmu3, tmp_path):
    (tmp_path / "text.ssp").write_text("no archive")
    with pytest.raises(InputError, match="is not a whole zip file"), open_system(tmp_path / "text.ssp"):
        pass
    with pytest.raises(InputError, match=r"expected a system of FMI 2\.0 units"), open_system(envisat_fmu):
        pass
    with pytest.raises(InputError, match="step: found 0 s"), open_system(system, 0.0):
        pass
    with zipfile.ZipFile(system) as archive:
        archive.extractall(tmp_path / "new")
    shutil.copy(envisat_fmu3, tmp_path / "new" / "resources" / "plant.fmu")
    shutil.make_archive(str(tmp_path / "three"), "zip", tmp_path / "new")
    with pytest.raises(InputError, match=r"plant is of FMI 3\.0"), open_system(tmp_path / "three.zip"):
        pass


CUT = {
    "the unit's archive": (
        lambda member, content: content[:-1000],
        r"bad\.ssp: resources/rig\.fmu: is not a whole zip",
    ),
    "its description": (
        lambda member, content: content[:-100] if member == "modelDescription.xml" else content,
        r"bad\.ssp: resources/rig\.fmu: .*, expected a system of FMI 2\.0 units",
    ),
    "its library": (
        lambda member, content: content[: len(content) // 3] if member.startswith("binaries") else content,
        r"bad\.ssp: resources/rig\.fmu: binaries/\S+: is cut off, found \d+ bytes",
    ),
}


@pytest.mark.parametrize("case", CUT)
def test_a_unit_that_is_cut_off_is_refused_by_its_name_in_the_archive(case, system, tmp_path):
    change, message = CUT[case]
    with zipfile.ZipFile(system) as archive, zipfile.ZipFile(tmp_path / "bad.ssp", "w") as copy:
        for name in archive.namelist():
            content = archive.read(name)
            if name.endswith("rig.fmu"):
                content = change("", content) if case == "the unit's archive" else _changed(content, change)
            copy.writestr(name, content)
    with pytest.raises(InputError, match=message), open_system(tmp_path / "bad.ssp"):
        pass


def _changed(content, change):
    """The bytes of an archive with its members changed."""
    changed = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as archive, zipfile.ZipFile(changed, "w") as copy:
        for member in archive.namelist():
            copy.writestr(member, change(member, archive.read(member)))
    return changed.getvalue()

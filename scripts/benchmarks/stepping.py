"""The costs of a step: from C, by a session, by fmpy, and by other people's simulators of the same target."""

import subprocess
from dataclasses import dataclass
from pathlib import Path

import fmpy
import numpy as np
from numpy.typing import NDArray

from baryscope.fmu import Recording, Session, simulate
from baryscope.fmu.generate import find_compiler
from baryscope.models.target import tumbling_target
from baryscope.models.variables import Kind
from baryscope.scripts.benchmarks.report import Part, Row, differs, exceeds
from baryscope.scripts.benchmarks.setting import STEP, Setting, best
from baryscope.scripts.benchmarks.simulators import basilisk_steps, pythonfmu_steps

ATTITUDE, POSITION = 1e-8, 1e-6  # rad, m, over one orbit, as in the tests
SAME_UNIT = 1e-8  # of outputs, between ways to step the same library
PEER_STEPS = 2000
PEER_ATTITUDE, PEER_POSITION = 1e-6, 1e-3  # rad, m: a peer's own method and step
PEER_OUTPUTS = 1e-6


@dataclass(frozen=True)
class CSteps:
    """fmi2DoStep called from C: seconds a step, without and with reading all outputs, and the last outputs."""

    plain: float
    reading: float
    outputs: NDArray[np.float64]


def c_steps(setting: Setting) -> CSteps:
    """Step the unit from a C program."""
    program = setting.folder / "step_benchmark"
    headers = Path(fmpy.__file__).parent / "c-code"
    source = Path(__file__).with_name("step_benchmark.c")
    command = [*find_compiler(), "-O2", "-std=c11", f"-I{headers}", str(source), "-o", str(program), "-ldl"]
    subprocess.run(command, check=True)
    fmpy.extract(str(setting.unit), str(setting.folder / "unit"))
    description = fmpy.read_model_description(str(setting.unit))
    binaries = setting.folder / "unit" / "binaries" / fmpy.platform
    library = binaries / f"{description.modelName}{fmpy.sharedLibraryExtension}"
    table = tumbling_target(len(setting.scenario.features.points))
    sizes = {kind: sum(v.size for v in table.of_kind(kind)) for kind in Kind}
    first = sizes[Kind.INPUT] + sizes[Kind.PARAMETER]
    arguments = [library, description.guid, setting.steps, STEP, first + sizes[Kind.OUTPUT], first]
    runs = [
        subprocess.run([program, *map(str, arguments)], check=True, capture_output=True, text=True).stdout.split()
        for _ in range(3)
    ]
    plain, reading = (min(float(run[k]) for run in runs) * 1e-9 for k in range(2))
    return CSteps(plain, reading, np.array(runs[-1][2:], dtype=float))


def session_steps(setting: Setting) -> tuple[float, NDArray[np.float64]]:
    """Seconds for one `Session.step` with all outputs read, and the last outputs."""
    outputs = np.empty(0)

    def run() -> None:
        nonlocal outputs
        with Session(setting.unit) as session:
            for _ in range(setting.steps):
                session.step(STEP)
            outputs = session.outputs.copy()

    return best(run) / setting.steps, outputs


def recording_of(setting: Setting) -> tuple[float, Recording]:
    """Seconds for a recorded run, and what was recorded."""
    times = np.arange(setting.steps + 1) * STEP
    seconds = best(lambda: simulate(setting.unit, times))
    return seconds, simulate(setting.unit, times)


def fmpy_run(setting: Setting) -> tuple[float, NDArray[np.float64]]:
    """Seconds for the same run by fmpy's `simulate_fmu`, and the last outputs."""
    outputs = np.empty(0)

    def run() -> None:
        nonlocal outputs
        result = fmpy.simulate_fmu(
            str(setting.unit),
            stop_time=setting.duration,
            output_interval=STEP,
            step_size=STEP,
            set_stop_time=False,
        )
        outputs = np.array(result[-1].tolist()[1:])  # the first is the time

    return best(run, 1), outputs


def stepping(setting: Setting) -> Part:
    """Steps of 0.1 s; outputs must be those of closed forms, the same from C, a session and fmpy, and the peers'."""
    called, (stepped, outputs) = c_steps(setting), session_steps(setting)
    recorded, recording = recording_of(setting)
    by_fmpy, outputs_by_fmpy = fmpy_run(setting)
    attitude, position = recording["target.attitude"][-1], recording["target.position"][-1]
    off = setting.closed_form.errors(attitude, position)
    faults = [
        *exceeds("the unit's attitude after steps of 0.1 s", off[0], ATTITUDE, "rad"),
        *exceeds("the unit's position after steps of 0.1 s", off[1], POSITION, "m"),
        *differs("outputs of a session, against those of a recording", outputs, recording.values[-1], SAME_UNIT),
        *differs("outputs read from C, against those of a session", called.outputs, outputs, SAME_UNIT),
        *differs(
            "outputs by fmpy.simulate_fmu, against a recording's", outputs_by_fmpy, recording.values[-1], SAME_UNIT
        ),
    ]
    what, fmpy_step = "Session.step with all outputs", by_fmpy / setting.steps
    basilisk: tuple[str, float] | tuple[()] = ()
    if "basilisk" in setting.peers:
        run = basilisk_steps(setting.scenario, STEP, PEER_STEPS)
        basilisk = ("Basilisk, a step", run.seconds)
        faults += exceeds("Basilisk's attitude", run.attitude_error, PEER_ATTITUDE, "rad")
        faults += exceeds("Basilisk's position of the target from the chaser", run.position_error, PEER_POSITION, "m")
    rows = [
        Row("doStep of 0.1 s, from C", called.plain, 3e-6, "µs"),
        Row("doStep and all outputs, from C", called.reading, 0.6e-6, "µs", *basilisk),
        Row(what, stepped, 8e-6, "µs", "fmpy.simulate_fmu, a step", fmpy_step),
    ]
    if "pythonfmu" in setting.peers:
        seconds, found = pythonfmu_steps(STEP, PEER_STEPS)
        with Session(setting.unit) as session:
            session.step(PEER_STEPS * STEP)
            faults += differs("outputs of a pythonfmu unit, against ours", found, session.outputs, PEER_OUTPUTS)
        rows.append(Row(what, stepped, 8e-6, "µs", "a pythonfmu unit, a step", seconds))
    rows.append(Row("one orbit at 10 Hz, recorded", recorded, 2.0, "s", "fmpy.simulate_fmu", by_fmpy))
    return Part(tuple(rows), faults=tuple(faults))

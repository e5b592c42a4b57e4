"""Speed and memory of the unit, the session and the estimator, as ratios to peers measured in the same run.

    make benchmark        or        python scripts/benchmark.py

Peers: scipy's DOP853 on the same equations (CasADi function, same tolerance), fmpy's own `simulate_fmu`, and
one call of scipy's `Rotation.align_vectors` a frame. Times are the best of several runs.
"""

import subprocess
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import fmpy
import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from baryscope.estimator.methods import estimate
from baryscope.estimator.tracks import FeatureTracks
from baryscope.fmu import Session, build_fmu, simulate
from baryscope.fmu.compiler import find_compiler
from baryscope.models.scenario import Scenario, load_scenario
from baryscope.models.target import tumbling_target
from baryscope.models.tracking import observe
from baryscope.models.variables import Kind
from baryscope.scripts.console import VERSION, out, step

STEP = 0.1  # s
STEPS = 60_000
FRAMES, FEATURES = 60_000, 8


def best(work: Callable[[], object], repeats: int = 3) -> float:
    """The shortest of several runs, s."""
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        work()
        times.append(time.perf_counter() - begin)
    return min(times)


def c_steps(unit: Path, scenario: Scenario, folder: Path) -> tuple[float, float]:
    """Seconds for one fmi2DoStep of 0.1 s called from C, without and with reading all outputs."""
    program = folder / "step_benchmark"
    headers = Path(fmpy.__file__).parent / "c-code"
    source = Path(__file__).with_name("step_benchmark.c")
    command = [*find_compiler(), "-O2", "-std=c11", f"-I{headers}", str(source), "-o", str(program), "-ldl"]
    subprocess.run(command, check=True)
    fmpy.extract(str(unit), str(folder / "unit"))
    description = fmpy.read_model_description(str(unit))
    library = folder / "unit" / "binaries" / fmpy.platform / f"{description.modelName}{fmpy.sharedLibraryExtension}"
    sizes = {kind: sum(v.size for v in tumbling_target(len(scenario.features.points)).of_kind(kind)) for kind in Kind}
    first = sizes[Kind.INPUT] + sizes[Kind.PARAMETER]
    arguments = [library, description.guid, STEPS, STEP, first + sizes[Kind.OUTPUT], first]
    runs = [
        subprocess.run([program, *map(str, arguments)], check=True, capture_output=True, text=True).stdout.split()
        for _ in range(3)
    ]
    plain, reading = (min(float(run[k]) for run in runs) * 1e-9 for k in range(2))
    return plain, reading


def session_step(unit: Path) -> float:
    """Seconds for one `Session.step` of 0.1 s with all outputs read."""

    def run() -> None:
        with Session(unit) as session:
            for _ in range(STEPS):
                session.step(STEP)

    return best(run) / STEPS


def scipy_orbit(scenario: Scenario) -> float:
    """Seconds for the same orbit by scipy's DOP853 with CasADi's right-hand side, recorded at 10 Hz."""
    system = tumbling_target(len(scenario.features.points))
    p = scenario.flat_parameters()
    x0 = np.array(system.initial(p)).ravel()
    u = np.zeros(system.rhs.numel_in(1))
    times = np.arange(STEPS + 1) * STEP
    tolerance = scenario.run.tolerance

    def run() -> None:
        solve_ivp(
            lambda t, x: np.array(system.rhs(x, u, p)).ravel(),
            (0, times[-1]),
            x0,
            "DOP853",
            times,
            rtol=tolerance,
            atol=tolerance,
        )

    return best(run, 1)


def large_tracks(scenario: Scenario, unit: Path) -> FeatureTracks:
    """One orbit at 10 Hz with eight features in view throughout."""
    always = scenario.model_copy(update={"tracking": type(scenario.tracking)()})
    truth = simulate(unit, np.arange(FRAMES) * STEP, scenario.parameters())
    seen = observe(always, truth.time, truth["features"], truth["normals"])
    return FeatureTracks(truth.time, seen.position[:, :FEATURES], scenario.features.labels[:FEATURES])


def alignment_peer(tracks: FeatureTracks) -> float:
    """Seconds for one `align_vectors` a frame, from 2,000 frames: the registration alone, once."""
    centred = tracks.position - tracks.position.mean(axis=1, keepdims=True)
    few = 2000

    def run() -> None:
        for frame in centred[:few]:
            Rotation.align_vectors(frame, centred[0])

    return best(run) * len(centred) / few


def main() -> int:
    """Measure and print."""
    scenario = load_scenario("envisat")
    table = Table(title=f"baryscope {VERSION}, {sys.platform}", title_justify="left")
    for heading in ("what", "measured", "wanted", "peer", "peer's", "ratio"):
        table.add_column(heading, justify="left" if heading in ("what", "peer") else "right")

    def row(what: str, measured: float, wanted: float, unit: str, peer: str = "", peers: float | None = None) -> None:
        scale = {"µs": 1e6, "s": 1.0, "MB": 1e-6}[unit]
        cells = ["", ""] if peers is None else [f"{peers * scale:.3g} {unit}", f"{peers / measured:.1f}"]
        table.add_row(what, f"{measured * scale:.3g} {unit}", f"≤ {wanted * scale:g} {unit}", peer, *cells)

    with tempfile.TemporaryDirectory(prefix="baryscope-") as name:
        folder = Path(name)
        with step("building the unit"):
            unit = build_fmu(scenario, folder / "unit.fmu")
        with step("stepping"):
            plain, reading = c_steps(unit, scenario, folder)
            stepped = session_step(unit)
        times = np.arange(STEPS + 1) * STEP
        with step("whole orbits"):
            recorded = best(lambda: simulate(unit, times))
            by_fmpy = best(
                lambda: fmpy.simulate_fmu(
                    str(unit), stop_time=times[-1], output_interval=STEP, step_size=STEP, set_stop_time=False
                ),
                1,
            )
            by_scipy = scipy_orbit(scenario)
        row("doStep of 0.1 s, from C", plain, 3e-6, "µs")
        row("doStep and all outputs, from C", reading, 3e-6, "µs")
        row("Session.step with all outputs", stepped, 20e-6, "µs", "fmpy.simulate_fmu, a step", by_fmpy / STEPS)
        row("one orbit at 10 Hz, recorded", recorded, 2.0, "s", "scipy DOP853", by_scipy)
        with step(f"estimating from {FRAMES} frames × {FEATURES} features"):
            tracks = large_tracks(scenario, unit)
            estimated = best(lambda: estimate(tracks, method="screw-gpa"))
            peer = alignment_peer(tracks)
            tracemalloc.start()
            estimate(tracks, method="screw-gpa")
            peak = tracemalloc.get_traced_memory()[1]
            tracemalloc.stop()
        row(f"screw-gpa, {FRAMES} × {FEATURES}", estimated, 1.5, "s", "scipy align_vectors, frame by frame", peer)
        row("its peak memory", peak, 1e9, "MB")
    Console(width=max(out.width, 125), highlight=False).print(table)
    return 0


if __name__ == "__main__":
    sys.exit(main())

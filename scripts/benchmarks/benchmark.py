"""Speed and memory of the unit, the session and the estimator, as ratios to peers measured in the same run.

    make benchmark        or        python scripts/benchmarks/benchmark.py

Peers: fmpy's own `simulate_fmu`, scipy's DOP853, CasADi's cvodes, one call of scipy's `Rotation.align_vectors` a frame;
and, where they are installed (pip install -e '.[bench]'), heyoka, Basilisk and a pythonfmu unit of the same model.
Accuracies are measured against the closed forms of the tests: Jacobi's functions with one quadrature for the
attitude, the difference of two Kepler orbits for the position. Times are the best of several runs.
"""

import subprocess
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import fmpy
import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from scipy.spatial.transform import Rotation

from baryscope.estimator.methods import estimate
from baryscope.estimator.tables.strict import read_strict
from baryscope.estimator.tables.tracks import COLUMNS, COVARIANCE_COLUMNS, FORM
from baryscope.estimator.tracks import FeatureTracks
from baryscope.fmu import Session, build_fmu, simulate
from baryscope.fmu.generate import find_compiler
from baryscope.models.scenario import Scenario, load_scenario
from baryscope.models.sensor.tracking import observe
from baryscope.models.target import tumbling_target
from baryscope.models.variables import Kind
from baryscope.scripts.benchmarks.peers import (
    Flight,
    basilisk_step,
    cvodes_flights,
    heyoka_flights,
    pythonfmu_step,
    scipy_flights,
)
from baryscope.scripts.cli.console import VERSION, out, step

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


class Accuracy:
    """Errors of a state after one run, against closed forms."""

    def __init__(self, scenario: Scenario, duration: float):
        sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))
        import oracles

        J, rate = np.array(scenario.target.inertia), np.deg2rad(scenario.target.angular_rate_deg)
        turned = oracles.TorqueFree(J, rate).attitude(np.arange(duration + 1.0))[-1]
        self.attitude = Rotation.from_quat(scenario.target.attitude, scalar_first=True) * turned
        self.position = oracles.com_in_chaser_frame(scenario, [duration])[0]
        self.system, self.p = tumbling_target(len(scenario.features.points)), scenario.flat_parameters()

    def __call__(self, state: NDArray[np.float64]) -> tuple[float, float]:
        """Error of the attitude, rad, and of the CoM in C, m."""
        outputs = np.asarray(self.system.outputs(state, self.p)).ravel()
        values = dict(zip(self._names(), outputs, strict=True))
        q = [values[f"target.attitude[{k}]"] for k in range(1, 5)]
        position = [values[f"target.position[{k}]"] for k in range(1, 4)]
        attitude = Rotation.from_quat(q, scalar_first=True)
        return (attitude.inv() * self.attitude).magnitude(), float(np.linalg.norm(position - self.position))

    def _names(self) -> list[str]:
        return [name for v in self.system.of_kind(Kind.OUTPUT) for name in v.scalar_names]


def unit_flight(unit: Path, duration: float, variant: str, parameters: Mapping[str, float | bool]) -> Flight:
    """The unit, in one communication step."""
    with Session(unit, parameters) as session:
        times = []
        for _ in range(40):
            session.reset(parameters)
            begin = time.perf_counter()
            session.step(duration)
            times.append(time.perf_counter() - begin)
        parts = ("target.attitude", "target.angularRate", "orbit.trueAnomaly", "chaser.position", "chaser.velocity")
        state = np.concatenate([session[name].ravel() for name in parts])
    return Flight("the unit", variant, min(times), state)


def orbit_table(scenario: Scenario, unit: Path, duration: float) -> Table:
    """One orbit in one call: each peer in its fastest variant that is no less accurate than the unit."""
    accuracy = Accuracy(scenario, duration)
    peers = [scipy_flights, cvodes_flights] + ([heyoka_flights] if find_spec("heyoka") else [])
    flights = [flight for peer in peers for flight in peer(scenario, duration)]
    table = Table(title=f"{duration:.0f} s in one step", title_justify="left")
    for heading in ("who", "variant", "time", "attitude error", "position error", "its time / the unit's"):
        table.add_column(heading, justify="left" if heading in ("who", "variant") else "right")
    ours = unit_flight(unit, duration, "Taylor, tolerance 1e-13", {"solver.tolerance": 1e-13})
    pulled = {"solver.tolerance": 1e-13, "gravityGradient": True}
    bound = accuracy(ours.state)[0]

    def row(flight: Flight, torque_free: bool = True) -> None:
        attitude, position = accuracy(flight.state)
        ratio = f"{flight.seconds / ours.seconds:.2f}"
        errors = f"{attitude:.1e} rad" if torque_free else "", f"{position:.1e} m"
        table.add_row(flight.peer, flight.variant, f"{1e3 * flight.seconds:.3g} ms", *errors, ratio)

    row(ours)
    row(unit_flight(unit, duration, "DOP853 for gravity gradient", pulled), torque_free=False)
    for group in sorted({(f.peer, f.variant.split(",")[0] if "split" in f.variant else "") for f in flights}):
        members = [f for f in flights if f.peer == group[0] and ("split" in f.variant) == bool(group[1])]
        good = [f for f in members if accuracy(f.state)[0] <= bound]
        if good:
            row(min(good, key=lambda f: f.seconds))
        else:
            row(min(members, key=lambda f: accuracy(f.state)[0]))
    return table


def tracks_of(scenario: Scenario, unit: Path, time: NDArray[np.float64], count: int) -> FeatureTracks:
    """The first `count` features of a scenario, in view throughout."""
    always = scenario.model_copy(update={"tracking": type(scenario.tracking)()})
    truth = simulate(unit, time, scenario.parameters())
    seen = observe(always, truth.time, truth["features"], truth["normals"])
    return FeatureTracks(truth.time, seen.position[:, :count], scenario.features.labels[:count])


def cost_of(method: str, tracks: FeatureTracks, scenario: Scenario) -> tuple[float, float]:
    """Seconds, with all functions compiled, and the peak of traced memory in bytes."""

    def run() -> None:
        estimate(tracks, method=method, orbit=scenario.orbit)

    tracemalloc.start()
    run()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return best(run), float(peak)


def alignment_peer(tracks: FeatureTracks) -> float:
    """Seconds for one `align_vectors` a frame, from 2,000 frames: the registration alone, once."""
    centred = tracks.position - tracks.position.mean(axis=1, keepdims=True)
    few = 2000

    def run() -> None:
        for frame in centred[:few]:
            Rotation.align_vectors(frame, centred[0])

    return best(run) * len(centred) / few


READING_ROWS = 500_000


def reading_rows(folder: Path) -> Iterator[tuple[str, float, str, float]]:
    """Reading of long CSV files, without and with covariances: what, its time, the peer, the peer's time, s.

    The peer is the strict reader, which reads what the fast one leaves, and writes the messages.
    """
    rng = np.random.default_rng(0)
    frames = READING_ROWS // FEATURES
    position = rng.normal(size=(frames, FEATURES, 3))
    factor = rng.normal(size=(frames, FEATURES, 3, 3))
    labels = [f"F{index}" for index in range(FEATURES)]
    for covariance in (None, factor @ np.swapaxes(factor, -1, -2)):
        path = folder / "long.csv"
        FeatureTracks(STEP * np.arange(frames), position, labels, covariance).write_csv(path)
        columns = len(COLUMNS) + (0 if covariance is None else len(COVARIANCE_COLUMNS))
        taken = best(partial(FeatureTracks.read_csv, path), 5)
        strictly = best(partial(read_strict, path.read_text(encoding="utf-8"), str(path), FORM), 1)
        yield f"read_csv, {READING_ROWS:,} rows × {columns}", taken, "Python's csv and float", strictly


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
        with step(f"reading {READING_ROWS:,} rows"):
            for what, taken, peer_name, peers in reading_rows(folder):
                row(what, taken, 0.3, "s", peer_name, peers)
        times = np.arange(STEPS + 1) * STEP
        with step("whole orbits"):
            recorded = best(lambda: simulate(unit, times))
            by_fmpy = best(
                lambda: fmpy.simulate_fmu(
                    str(unit), stop_time=times[-1], output_interval=STEP, step_size=STEP, set_stop_time=False
                ),
                1,
            )
        row("doStep of 0.1 s, from C", plain, 3e-6, "µs")
        basilisk = ("Basilisk, a step", basilisk_step(scenario, STEP, 3000)) if find_spec("Basilisk") else ()
        row("doStep and all outputs, from C", reading, 0.6e-6, "µs", *basilisk)
        row("Session.step with all outputs", stepped, 8e-6, "µs", "fmpy.simulate_fmu, a step", by_fmpy / STEPS)
        if find_spec("pythonfmu"):
            peers = pythonfmu_step(STEP, 2000)
            row("Session.step with all outputs", stepped, 8e-6, "µs", "a pythonfmu unit, a step", peers)
        row("one orbit at 10 Hz, recorded", recorded, 2.0, "s", "fmpy.simulate_fmu", by_fmpy)
        with step(f"estimating from {FRAMES} frames × {FEATURES} features"):
            tracks = tracks_of(scenario, unit, np.linspace(0.0, (FRAMES - 1) * STEP, FRAMES), FEATURES)
            peer = alignment_peer(tracks)
            for method, seconds, memory in (("screw-gpa", 1.5, 1e9), ("pivot", 0.3, 1e9), ("ml", 20.0, 2e9)):
                taken, peak = cost_of(method, tracks, scenario)
                aligning = ("scipy align_vectors, frame by frame", peer)
                row(f"{method}, {FRAMES} × {FEATURES} at {1 / STEP:.0f} Hz", taken, seconds, "s", *aligning)
                row("its peak memory", peak, memory, "MB")
        with step(f"estimating from the same number of frames at 1 Hz, over {FRAMES / (STEPS * STEP):.0f} orbits"):
            long = tracks_of(scenario, unit, np.arange(float(FRAMES)), FEATURES)
            taken, peak = cost_of("ml", long, scenario)
            row(f"ml, {FRAMES} × {FEATURES} at 1 Hz", taken, 20.0, "s", "scipy align_vectors, frame by frame", peer)
            row("its peak memory", peak, 2e9, "MB")
        with step("estimating from 600 frames × 10 features"):
            few = tracks_of(scenario, unit, np.arange(600.0), 10)
            filtered = cost_of("ekf", few, scenario)[0]
            row("pivot, 600 × 10", cost_of("pivot", few, scenario)[0], 0.1, "s", "ekf", filtered)
            row("ml, 600 × 10", cost_of("ml", few, scenario)[0], 0.5, "s", "ekf", filtered)
        with step("peers over one orbit"):
            orbits = orbit_table(scenario, unit, STEPS * STEP)
    Console(width=max(out.width, 125), highlight=False).print(table, orbits)
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""The costs of estimation from long tracks, with default options, so with process noise; and of reading them."""

import tracemalloc
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from baryscope.estimator.methods import estimate
from baryscope.estimator.tables.strict import read_strict
from baryscope.estimator.tables.tracks import COLUMNS, COVARIANCE_COLUMNS, FORM
from baryscope.estimator.tracks import FeatureTracks
from baryscope.fmu import simulate
from baryscope.models.sensor.tracking import observe
from baryscope.scripts.benchmarks.report import Part, Row, differs, exceeds
from baryscope.scripts.benchmarks.setting import STEP, Setting, best

FEATURES = 8
SHORT, SHORT_FEATURES = 600, 10  # frames at 1 Hz
LONGER = 6000  # frames at 1 Hz, of as many features
ALIGNING = "scipy align_vectors, frame by frame"
# RMSE of the path, m, at noise of 2 cm: ten times what each method has here. It tells a wrong path, not a good one.
RMSE = {"screw-gpa": 10.0, "pivot": 0.01, "ml": 0.01, "ekf": 0.01}


@dataclass(frozen=True)
class Seen:
    """Tracks, and the true path of the CoM in C, (n, 3), m."""

    tracks: FeatureTracks
    path: NDArray[np.float64]


@dataclass(frozen=True)
class Cost:
    """Seconds with all functions compiled, the peak of traced memory in bytes, and the RMSE of the path, m."""

    seconds: float
    peak: float
    rmse: float


def tracks_of(setting: Setting, time: NDArray[np.float64], count: int) -> Seen:
    """The first `count` features of the scenario, in view throughout."""
    scenario = setting.scenario
    always = scenario.model_copy(update={"tracking": type(scenario.tracking)()})
    truth = simulate(setting.unit, time, scenario.parameters())
    seen = observe(always, truth.time, truth["features"], truth["normals"])
    tracks = FeatureTracks(truth.time, seen.position[:, :count], scenario.features.labels[:count])
    return Seen(tracks, truth["target.position"])


def cost_of(setting: Setting, method: str, seen: Seen) -> Cost:
    """Measure one method on some tracks, with the orbit given."""
    run = partial(estimate, seen.tracks, method=method, orbit=setting.scenario.orbit.of_simulation())
    tracemalloc.start()
    result = run()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    rmse = float(np.sqrt(np.mean(np.sum((result.position - seen.path) ** 2, axis=1))))
    return Cost(best(run), float(peak), rmse)


def alignment_peer(tracks: FeatureTracks) -> float:
    """Seconds for one `align_vectors` a frame, from 2,000 frames: the registration alone, once."""
    centred = tracks.position - tracks.position.mean(axis=1, keepdims=True)
    few = centred[:2000]

    def run() -> None:
        for frame in few:
            Rotation.align_vectors(frame, centred[0])

    return best(run) * len(centred) / len(few)


def estimating(setting: Setting) -> Part:
    """Every method on long and short tracks; each must find the path to within RMSE."""
    rows: list[Row] = []
    faults: list[str] = []

    def measure(method: str, seen: Seen, what: str) -> Cost:
        cost = cost_of(setting, method, seen)
        faults.extend(exceeds(f"{method}, {what}: path", cost.rmse, RMSE[method], "m"))
        return cost

    frames = setting.frames
    seen = tracks_of(setting, np.linspace(0.0, (frames - 1) * STEP, frames), FEATURES)
    peer = alignment_peer(seen.tracks)
    what = f"{frames} × {FEATURES} at {1 / STEP:.0f} Hz"
    for method, seconds, memory in (("screw-gpa", 1.5, 1e9), ("pivot", 0.5, 1e9), ("ml", 6.0, 2e9)):
        cost = measure(method, seen, what)
        rows.append(Row(f"{method}, {what}", cost.seconds, seconds, "s", ALIGNING, peer))
        rows.append(Row("its peak memory", cost.peak, memory, "MB"))
    what = f"{frames} × {FEATURES} at 1 Hz"
    cost = measure("ml", tracks_of(setting, np.arange(float(frames)), FEATURES), what)
    rows.append(Row(f"ml, {what}", cost.seconds, 6.0, "s", ALIGNING, peer))
    rows.append(Row("its peak memory", cost.peak, 2e9, "MB"))
    short = tracks_of(setting, np.arange(float(SHORT)), SHORT_FEATURES)
    what = f"{SHORT} × {SHORT_FEATURES}"
    filtered = measure("ekf", short, what).seconds
    rows.append(Row(f"ekf, {what}", filtered, 0.5, "s", "real time", SHORT / 1.0))
    cost = measure("ekf", tracks_of(setting, np.arange(float(LONGER)), SHORT_FEATURES), f"{LONGER} × {SHORT_FEATURES}")
    rows.append(Row(f"ekf, {LONGER} × {SHORT_FEATURES}", cost.seconds, 5.0, "s", "ten of 600", 10 * filtered))
    rows.append(Row("its peak memory", cost.peak, 1e9, "MB"))
    for method, seconds in (("pivot", 0.1), ("ml", 0.3)):
        rows.append(Row(f"{method}, {what}", measure(method, short, what).seconds, seconds, "s", "ekf", filtered))
    return Part(tuple(rows), faults=tuple(faults))


def reading(setting: Setting) -> Part:
    """Reading of long CSV files, without and with covariances; what is read must be what was written.

    The peer is the strict reader, which reads what the fast one leaves, and writes the messages.
    """
    rows: list[Row] = []
    faults: list[str] = []
    for tracks in _long_tracks(setting.rows // FEATURES):
        path = setting.folder / "long.csv"
        tracks.write_csv(path)
        columns = len(COLUMNS) + (0 if tracks.covariance is None else len(COVARIANCE_COLUMNS))
        what = f"read_csv, {setting.rows:,} rows × {columns}"
        taken = best(partial(FeatureTracks.read_csv, path), 5)
        strictly = best(partial(read_strict, path.read_text(encoding="utf-8"), str(path), FORM), 1)
        rows.append(Row(what, taken, 0.3, "s", "Python's csv and float", strictly))
        faults += differs(f"{what}: positions", FeatureTracks.read_csv(path).position, tracks.position, 0.0)
    return Part(tuple(rows), faults=tuple(faults))


def _long_tracks(frames: int) -> Iterator[FeatureTracks]:
    rng = np.random.default_rng(0)
    position = rng.normal(size=(frames, FEATURES, 3))
    factor = rng.normal(size=(frames, FEATURES, 3, 3))
    labels = [f"F{index}" for index in range(FEATURES)]
    for covariance in (None, factor @ np.swapaxes(factor, -1, -2)):
        yield FeatureTracks(STEP * np.arange(frames), position, labels, covariance)

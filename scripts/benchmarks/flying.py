"""The online estimator's time per frame in C, beside `ekf` and a filter of its size in numpy."""

import ctypes
import subprocess
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from baryscope.estimator.methods import estimate
from baryscope.estimator.online import OnlineEstimator, core
from baryscope.estimator.online.core import OFFSET, SPEED, THRUST, Options, Thrust, Tumble, compiled
from baryscope.estimator.online.estimator import CAMERA, LONGEST_GAP
from baryscope.fmu.generate import find_compiler
from baryscope.models.lvlh import lvlh_attitude
from baryscope.models.orbit import Orbit
from baryscope.models.relative_orbit import relative_transition
from baryscope.scripts.benchmarks.estimating import RMSE, SHORT, SHORT_FEATURES, Seen, tracks_of
from baryscope.scripts.benchmarks.report import Part, Row, exceeds
from baryscope.scripts.benchmarks.setting import Setting, best

FloatArray = NDArray[np.float64]

FAST = 100.0  # Hz
RUNS = 3  # of which the least time of each frame counts
DENSITY = 1e-12  # m²/s³, of the numpy filter
PUSH, ROUND = 0.03, 100.0  # m/s² of told thrust, which goes round in so many seconds, as of a chaser that turns along


def flying(setting: Setting, frames: int = SHORT) -> Part:
    """At 1 Hz, and at 100 Hz for ten times as many frames; the path at the end must be found to within RMSE.

    The pivot stage ends with the first frame in which the tumble is known: beginning with that is the full filter's.
    """
    rows: list[Row] = []
    faults: list[str] = []
    sigma, orbit = setting.scenario.sensor.noise, setting.scenario.orbit
    slow = tracks_of(setting, np.arange(float(frames)), SHORT_FEATURES)
    fast = tracks_of(setting, np.arange(10 * frames) / FAST, SHORT_FEATURES)
    smoother = best(partial(estimate, slow.tracks, method="ekf", orbit=orbit)) / frames
    peer = numpy_filter(slow, sigma, orbit)
    cases = [(seen, what, told) for seen, what in ((slow, "1 Hz"), (fast, f"{FAST:.0f} Hz")) for told in (False, True)]
    for still, rate, told in cases:
        seen, push = pushed(still, orbit) if told else (still, np.zeros((len(still.path), 3)))
        each, known = in_c(setting.folder, seen, sigma, orbit, push)
        what = f"a frame × {SHORT_FEATURES} at {rate}" + (", with thrust" if told else "")
        for stage, its, wanted in (("pivot stage", ~known, 20e-6), ("full filter", known, 200e-6)):
            if its.any():
                rows.append(Row(f"online, {stage}, {what}", each[its].mean(), wanted, "µs", "numpy, 9 states", peer))
        rows.append(Row("its slowest in a hundred", float(np.quantile(each, 0.99)), 200e-6, "µs", "ekf", smoother))
    filter = OnlineEstimator(sigma, orbit)
    for time, points in zip(slow.tracks.time, slow.tracks.position, strict=True):
        state = filter.update(float(time), points)
    rows.append(Row("its memory", float(len(filter.save())), 256 * 1024, "MB"))
    if frames >= SHORT:
        error = float(np.linalg.norm(state.position - slow.path[-1]))
        faults += exceeds("online, at the end: path", error, RMSE["ekf"], "m")
    return Part(tuple(rows), faults=tuple(faults))


def pushed(seen: Seen, orbit: Orbit) -> tuple[Seen, FloatArray]:
    """What is seen by a chaser with thrust, which is told: (n, 3) in C, m/s², from the frame before each on.

    What has displaced the target goes on along the relative orbit. Thrust between two frames is one impulse halfway,
    which moves it as far by the next one.
    """
    time, path = seen.tracks.time, seen.path
    halfway = time - 0.5 * np.diff(time, prepend=time[0])
    angle = 2 * np.pi * halfway / ROUND
    push = PUSH * np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    axes, moved = lvlh_attitude(orbit, time), np.zeros((len(time), 6))  # R_I_L; moved is in L
    kicks = np.einsum("nji,nj->ni", lvlh_attitude(orbit, halfway), push)
    for k in range(1, len(time)):
        ends = ((halfway[k], time[k - 1]), (time[k], halfway[k]))
        first, last = (relative_transition(orbit, np.array([end]), float(begin))[0] for end, begin in ends)
        there = first @ moved[k - 1]
        there[3:] -= (time[k] - time[k - 1]) * kicks[k]
        moved[k] = last @ there
    shift = np.einsum("nij,nj->ni", axes, moved[:, :3])
    tracks = replace(seen.tracks, position=seen.tracks.position + shift[:, None])
    return Seen(tracks, path + shift), push


def in_c(
    folder: Path, seen: Seen, sigma: float, orbit: Orbit, push: FloatArray
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Seconds of each frame, the least of RUNS from a C program, and where the tumble is known.

    push: (n, 3), told, in C, m/s²; folder: for the program and its files.
    """
    tracks = seen.tracks
    options = Options(sigma, OFFSET, SPEED, 0.0, THRUST, LONGEST_GAP, 1.0, core.Orbit.of(orbit))
    sizes = [*tracks.position.shape[:2], *map(ctypes.sizeof, (Options, Thrust, Tumble))]
    camera = np.broadcast_to(np.array(CAMERA), (len(push), 9))
    rows = np.concatenate([tracks.time[:, None], push, camera, tracks.position.reshape(len(push), -1)], axis=1)
    frames, program = folder / "frames.bin", folder / "online_benchmark"
    frames.write_bytes(np.array(sizes, dtype=np.int64).tobytes() + bytes(options) + rows.tobytes())
    if not program.exists():
        source = Path(__file__).with_name("online_benchmark.c")
        subprocess.run([*find_compiler(), "-O2", "-std=c11", str(source), "-o", str(program), "-ldl"], check=True)
    command = [str(program), str(compiled(folder)), str(frames), str(RUNS)]
    printed = subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()
    taken, known = np.array(printed, dtype=np.float64).reshape(-1, 2).T
    return 1e-9 * taken, known > 0


def numpy_filter(seen: Seen, sigma: float, orbit: Orbit) -> float:
    """Seconds per frame of a filter as one would write it in Python: registration by scipy, nine states."""
    time, position = seen.tracks.time, seen.tracks.position
    axes = lvlh_attitude(orbit, time)
    steps = [relative_transition(orbit, time[k : k + 1], float(time[k - 1]))[0] for k in range(1, len(time))]

    def run() -> None:
        shape = position[0] - position[0].mean(axis=0)
        x, P = np.zeros(9), np.diag(np.repeat([20.0, 0.1, 20.0], 3) ** 2)
        x[:3] = axes[0].T @ position[0].mean(axis=0)
        F, noise = np.eye(9), sigma**2 / len(shape) * np.eye(3)
        for k, frame in enumerate(position):
            if k:
                T = time[k] - time[k - 1]
                F[:6, :6] = steps[k - 1]
                x, P = F @ x, F @ P @ F.T
                P[:6, :6] += DENSITY * np.kron([[T**3 / 3, T**2 / 2], [T**2 / 2, T]], np.eye(3))
            centroid = frame.mean(axis=0)
            attitude, _ = Rotation.align_vectors(frame - centroid, shape)
            H = np.hstack([axes[k], np.zeros((3, 3)), attitude.as_matrix()])
            gain = P @ H.T @ np.linalg.inv(H @ P @ H.T + noise)
            x, P = x + gain @ (centroid - H @ x), P - gain @ H @ P

    return best(run) / len(time)

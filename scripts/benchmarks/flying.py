"""The online estimator's time per frame in C, beside `ekf` and a filter of its size in numpy."""

import ctypes
import time as clock
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from baryscope.estimator.methods import estimate
from baryscope.estimator.online import OnlineEstimator
from baryscope.estimator.online.core import OFFSET, SPEED, THRUST, Options, Thrust, library
from baryscope.estimator.online.estimator import LONGEST_GAP
from baryscope.models.keplerian import ELEMENT_COUNT
from baryscope.models.lvlh import lvlh_attitude
from baryscope.models.orbit import Orbit
from baryscope.models.relative_orbit import relative_transition
from baryscope.scripts.benchmarks.estimating import RMSE, SHORT, SHORT_FEATURES, Seen, tracks_of
from baryscope.scripts.benchmarks.report import Part, Row, exceeds
from baryscope.scripts.benchmarks.setting import Setting, best

FloatArray = NDArray[np.float64]

FAST = 100.0  # Hz
DENSITY = 1e-12  # m²/s³, of the numpy filter


def flying(setting: Setting, frames: int = SHORT) -> Part:
    """At 1 Hz, and at 100 Hz for ten times as many frames; the path at the end must be found to within RMSE."""
    rows: list[Row] = []
    faults: list[str] = []
    sigma, orbit = setting.scenario.sensor.noise, setting.scenario.orbit
    slow = tracks_of(setting, np.arange(float(frames)), SHORT_FEATURES)
    fast = tracks_of(setting, np.arange(10 * frames) / FAST, SHORT_FEATURES)
    smoother = best(partial(estimate, slow.tracks, method="ekf", orbit=orbit)) / frames
    peer = numpy_filter(slow, sigma, orbit)
    for seen, what in ((slow, "1 Hz"), (fast, f"{FAST:.0f} Hz")):
        each = np.min([in_c(seen, sigma, orbit) for _ in range(3)], axis=0)
        rows.append(
            Row(f"online, a frame × {SHORT_FEATURES} at {what}", each.mean(), 20e-6, "µs", "numpy, 9 states", peer)
        )
        rows.append(Row("its slowest in a hundred", float(np.quantile(each, 0.99)), 200e-6, "µs", "ekf", smoother))
    filter = OnlineEstimator(sigma, orbit)
    for time, points in zip(slow.tracks.time, slow.tracks.position, strict=True):
        state = filter.update(float(time), points)
    rows.append(Row("its memory", float(len(filter.save())), 256 * 1024, "MB"))
    if frames >= SHORT:
        error = float(np.linalg.norm(state.position - slow.path[-1]))
        faults += exceeds("online, at the end: path", error, RMSE["ekf"], "m")
    return Part(tuple(rows), faults=tuple(faults))


def in_c(seen: Seen, sigma: float, orbit: Orbit) -> FloatArray:
    """Seconds of each frame, with little of ctypes."""
    core, tracks = library(), seen.tracks
    numbers = ctypes.POINTER(ctypes.c_double)
    memory = ctypes.create_string_buffer(core.online_size())
    elements = (ctypes.c_double * ELEMENT_COUNT)(*orbit.elements)
    core.online_start(memory, ctypes.byref(Options(sigma, OFFSET, SPEED, 0.0, THRUST, LONGEST_GAP, 1.0, elements)))
    count = tracks.position.shape[1]
    names, push = (ctypes.c_longlong * count)(*range(count)), ctypes.byref(Thrust())
    points = [np.ascontiguousarray(frame) for frame in tracks.position]
    pointers = [frame.ctypes.data_as(numbers) for frame in points]
    taken = np.empty(len(points))
    for k, (time, pointer) in enumerate(zip(tracks.time.tolist(), pointers, strict=True)):
        begin = clock.perf_counter()
        core.online_update(memory, time, count, names, pointer, None, push)
        taken[k] = clock.perf_counter() - begin
    return taken


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

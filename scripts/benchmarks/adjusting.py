"""`pivot` beside general programs for the same least squares: times and accuracies in one table."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from baryscope.estimator.adjustment.degrees_of_freedom import least_variance
from baryscope.estimator.adjustment.stereo import observations_of
from baryscope.estimator.adjustment.subsample import SUBSAMPLE_FRAMES, subsampled
from baryscope.estimator.methods import estimate
from baryscope.estimator.options import PathOptions
from baryscope.estimator.paths.relative_motion import RelativeOrbit
from baryscope.estimator.pivot.refinement import ROUNDING
from baryscope.estimator.pivot.start import linear_start
from baryscope.estimator.registration.clusters import find_bodies
from baryscope.estimator.registration.screening import screen
from baryscope.estimator.tracks import FeatureTracks
from baryscope.scripts.benchmarks.adjustments import Adjusted, Problem, asked_of, by_gtsam, by_scipy, timed
from baryscope.scripts.benchmarks.estimating import FEATURES, LONGER, SHORT, SHORT_FEATURES, Seen, tracks_of
from baryscope.scripts.benchmarks.near_path import disturbance, with_noise, without_noise
from baryscope.scripts.benchmarks.report import Part, exceeds
from baryscope.scripts.benchmarks.setting import STEP, Setting, best

FloatArray = NDArray[np.float64]

Size = tuple[int, int, float]  # frames, features, and the step in s
SIZES: tuple[Size, ...] = ((SHORT, SHORT_FEATURES, 1.0), (LONGER, SHORT_FEATURES, 1.0), (60_000, FEATURES, STEP))
DENSITY = 1e-12  # m²/s³, of process noise: 7 mm in ten minutes, 0.3 m in an orbit
SAME = 0.2  # of the predicted error: the rms distance between two solutions of the same problem
SAME_RATIO = 0.05  # of two predicted errors: its difference from 1
TITLE = "the same least squares: free attitudes, features, {} (from the approximate solution of `pivot`)"


def adjusting(setting: Setting, sizes: Sequence[Size] = SIZES, density: float = 0.0) -> Part:
    """The default `pivot`, `pivot` told the density of process noise in m²/s³, and the peers, which agree with it.

    The tracks have that noise.
    """
    path = f"relative orbit with noise of {density:g} m²/s³" if density else "relative orbit"
    told = f"pivot, process noise {density:g}" if density else "pivot, no process noise"
    table = Table(title=TITLE.format(path), title_justify="left")
    for heading in ("who", "what", "time", "its time / pivot's", "rms error", "predicted", "from pivot's path"):
        table.add_column(heading, justify="left" if heading in ("who", "what") else "right")
    faults: list[str] = []
    for frames, features, step in sizes:
        peers: list[tuple[str, Callable[[Problem], tuple[FloatArray, FloatArray]]]] = [
            ("scipy least_squares", by_scipy)
        ]
        if "gtsam" in setting.peers:
            peers.append(("GTSAM", by_gtsam))
        seen, what = tracks_of(setting, step * np.arange(float(frames)), features), f"{frames} × {features}"
        if density:
            seen = disturbed(setting, seen, density)
        sigma = setting.scenario.sensor.noise
        exact = ours(setting, seen, told, PathOptions(sigma=sigma, process_noise=density or "none"))
        problem = problem_of(setting, seen, sigma, density)
        others = [timed(name, solve, problem) for name, solve in peers]
        for one in (ours(setting, seen, "pivot", PathOptions()), exact, *others):
            errors = rms(one.path - seen.path), one.predicted, rms(one.path - exact.path)
            times = f"{one.seconds:.3g} s", f"{one.seconds / exact.seconds:.1f}"
            table.add_row(one.peer, what, *times, *(f"{1e3 * error:.3f} mm" for error in errors))
        for one in others:
            apart, ratio = rms(one.path - exact.path), one.predicted / exact.predicted
            faults += exceeds(f"{one.peer}, {what}: path, against pivot", apart, SAME * exact.predicted, "m")
            faults += exceeds(f"{one.peer}, {what}: predicted error, against pivot's", abs(ratio - 1), SAME_RATIO, "")
    return Part(tables=(table,), faults=tuple(faults))


def ours(setting: Setting, seen: Seen, name: str, options: PathOptions) -> Adjusted:
    """The whole of `pivot`, with registration, start and robust weights."""
    run = partial(estimate, seen.tracks, method="pivot", orbit=setting.scenario.orbit.of_simulation(), options=options)
    found = run()
    assert found.covariance is not None  # noqa: S101  pivot gives one
    return Adjusted(name, found.position, found.covariance[asked_of(len(found.position))], best(run))


def problem_of(setting: Setting, seen: Seen, sigma: float, density: float = 0.0) -> Problem:
    """The peers' problem, with the start of `pivot`: its registered bodies and the linear solution for a subsample."""
    tracks, measured = seen.tracks, observations_of(seen.tracks, seen.tracks.seen)
    registered = find_bodies(tracks.position, screen(tracks.position, tracks.seen), tracks.time)
    path = path_of(setting, seen)
    few = subsampled(registered.bodies, measured, SUBSAMPLE_FRAMES)
    least = least_variance(measured, ROUNDING)
    initial = linear_start(registered, few, path.at(tracks.time[few.rows]), path.prior, least, 1.0)
    x = initial.x
    near = with_noise(path, x, tracks.time, density) if density else without_noise(path.at(tracks.time), x)
    return Problem(tracks.position, sigma, initial.bodies[0], near)


def disturbed(setting: Setting, seen: Seen, density: float) -> Seen:
    """The tracks and their path with white acceleration of a density in m²/s³."""
    tracks = seen.tracks
    moved = disturbance(path_of(setting, seen), tracks.time, density, np.random.default_rng(0))
    return Seen(FeatureTracks(tracks.time, tracks.position + moved[:, None], tracks.labels), seen.path + moved)


def path_of(setting: Setting, seen: Seen) -> RelativeOrbit:
    """The model of the undisturbed path."""
    return RelativeOrbit(setting.scenario.orbit, float(seen.tracks.time[0] + seen.tracks.time[-1]) / 2)


def rms(difference: FloatArray) -> float:
    """The root mean square length of vectors (n, 3)."""
    return float(np.sqrt(np.mean(np.sum(difference**2, axis=1))))

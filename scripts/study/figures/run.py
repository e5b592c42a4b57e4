"""What the figures show: one flight with noise and without, the published method step by step, and other distances."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.bound import Bound
from baryscope.estimator.options import ScrewOptions
from baryscope.estimator.screws import ScrewFunction, Stages, gpa_screws, raw_screws, run_stages
from baryscope.estimator.screws.motion import step_of
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import ComputationError
from baryscope.models.files import AnyPath, temporary_folder
from baryscope.models.lvlh import lvlh_attitude
from baryscope.models.scenario import Scenario
from baryscope.progress import Progress, stage
from baryscope.study.bounds import variant_of
from baryscope.study.comparison import Comparison, Outcome, compare
from baryscope.study.flight import Flight, build_unit, fly, scenario_of

FloatArray = NDArray[np.float64]

PUBLISHED, IN_LVLH, FREE, BEST = "screw-gpa", "screw-gpa-lvlh", "pivot", "ml"
DISTANCES = (0.25, 0.5, 1.0, 2.0)  # of the scenario's own, for the error against v⊥


@dataclass(frozen=True, eq=False)
class Misses:
    """How far the published method is off without noise, at k times of a flight from one distance.

    Attributes:
        distance: of the chaser at the start, m.
        velocity: ‖v⊥‖ of the centre of mass in C, normal to the axis, (k,), m/s.
        expected: how far the axis must miss the middle of the centre's way over the lag, ‖v⊥‖ Δt/(2 tan(θ/2)), (k,), m.
        axis: how far it does, (k,), m.
        middle: how far the pseudo-intersection is from the centre of mass, (k,), m.
    """

    distance: float
    velocity: FloatArray
    expected: FloatArray
    axis: FloatArray
    middle: FloatArray


@dataclass(frozen=True, eq=False)
class PaperRun:
    """One flight and what the published method makes of it on its way.

    Attributes:
        comparison: the flight, the methods of the last figures, and the bound.
        raw: stages of screws of three raw features, with the lag of the published method.
        published: stages of the published method.
        exact: the same with tracks that have no noise.
        brief: the same with tracks that have no noise, and a lag of one frame.
        misses: the same for flights from other distances.
    """

    comparison: Comparison
    raw: Stages
    published: Stages
    exact: Stages
    brief: Stages
    misses: tuple[Misses, ...]

    @property
    def flight(self) -> Flight:
        """What is flown."""
        return self.comparison.flight

    @property
    def true_path(self) -> FloatArray:
        """The centre of mass in C, (n, 3), m."""
        return self.flight.true_path

    @cached_property
    def path_in_L(self) -> FloatArray:
        """The chaser seen from the target, (n, 3) in LVLH axes, m."""
        R_I_L = lvlh_attitude(self.flight.scenario.orbit, self.flight.truth.time)
        return np.asarray(np.einsum("nji,nj->ni", R_I_L, -self.true_path))

    def outcome(self, label: str) -> Outcome:
        """What the method of a label makes of the flight."""
        return self.comparison[label]

    @property
    def bound(self) -> Bound | None:
        """The Cramér–Rao bound of the scenario."""
        return self.comparison.bound


def run_paper(scenario: Scenario | AnyPath = "envisat", progress: Progress | None = None) -> PaperRun:
    """Fly a scenario, and others from other distances, and take the published method apart.

    Raises:
        InputError: there is no such scenario.
        ComputationError: the unit cannot be built or stepped, or the method finds no centre of mass.
    """
    scenario = scenario_of(scenario)
    with temporary_folder() as folder:
        unit = build_unit(scenario, folder / "unit.fmu", progress)
        comparison = compare(scenario, [PUBLISHED, FREE, BEST], unit=unit, progress=progress)
        for outcome in comparison.outcomes:
            if outcome.failure:
                raise ComputationError(f"{outcome.label}: {outcome.failure}")
        tracks = comparison.flight.tracks
        with stage(progress, "taking the published method apart"):
            published = stages_of(gpa_screws, tracks)
            raw = stages_of(raw_screws, tracks, lag_of(published))
            perfect = without_noise(comparison.flight)
            exact = stages_of(gpa_screws, perfect, lag_of(published))
            brief = stages_of(gpa_screws, perfect, sampling_time(published))
        misses = []
        with stage(progress, f"flying from {len(DISTANCES)} distances") as share:
            for k, factor in enumerate(DISTANCES):
                own = variant_of(scenario)
                other = replace(own, range=factor * own.range).of(scenario)
                misses.append(misses_of(fly(other, unit), lag_of(published)))
                share((k + 1) / len(DISTANCES))
    return PaperRun(comparison, raw, published, exact, brief, tuple(misses))


def stages_of(screws_of: ScrewFunction, tracks: FeatureTracks, lag: float | None = None) -> Stages:
    """The stages in inertial axes, as published, for a lag in s; chosen unless given."""
    return run_stages(screws_of, tracks, None, ScrewOptions(lag=lag))


def lag_of(stages: Stages) -> float:
    """The time between the frames of a pair, s."""
    return stages.pairs.lag * sampling_time(stages)


def sampling_time(stages: Stages) -> float:
    """The time between two frames, s."""
    return step_of(stages.motion)


def errors_of(stages: Stages, true_path: FloatArray) -> FloatArray:
    """Distances of the pseudo-intersections from the true centre of mass, (k,), m; NaN where the axes are parallel."""
    return np.asarray(np.linalg.norm(stages.crossings.middle - true_path[stages.frames], axis=1))


def without_noise(flight: Flight) -> FeatureTracks:
    """The tracks of a flight as a perfect sensor would give them: the same features at the same times."""
    tracks = flight.tracks
    points = np.where(tracks.seen[..., None], flight.truth["features"], np.nan)
    return FeatureTracks(tracks.time, points, tracks.labels)


def misses_of(flight: Flight, lag: float) -> Misses:
    """How far axes and pseudo-intersections of noiseless tracks are off, for a lag in s."""
    stages, path = stages_of(gpa_screws, without_noise(flight), lag), flight.true_path
    ok = stages.crossings.valid
    one = stages.one[ok]
    axis, point = stages.axes.axis[one], stages.axes.point[one]
    before, after = path[stages.axes.first[one]], path[stages.axes.second[one]]
    moved = np.linalg.norm(np.cross(axis, after - before), axis=1)
    angle = stages.screws.angle[stages.screws.valid][one]
    return Misses(
        distance=float(np.linalg.norm(path[0])),
        velocity=moved / lag_of(stages),
        expected=moved / (2 * np.tan(angle / 2)),
        axis=np.linalg.norm(np.cross(axis, (before + after) / 2 - point), axis=1),
        middle=errors_of(stages, path)[ok],
    )

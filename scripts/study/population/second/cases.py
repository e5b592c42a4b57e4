"""Cases of the second population, each from (seed, index) alone."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator import FeatureTracks
from baryscope.models.orbit import Orbit
from baryscope.study.population.interface import Sample, Truth
from baryscope.study.population.second.bodies import draw_body, draw_rate
from baryscope.study.population.second.chance import TURN
from baryscope.study.population.second.chasers import draw_chaser
from baryscope.study.population.second.motion import relative_motion, tumble
from baryscope.study.population.second.orbits import draw_orbit
from baryscope.study.population.second.sensing import Observations, Sensor, draw_sensor, observed
from baryscope.study.population.second.sensitivity import Start, path_jacobian, turn
from baryscope.study.population.second.times import FEWEST, draw_times
from baryscope.study.population.second.views import Motion, View, draw_features, draw_view

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

LONGEST = [1500.0, 6000.0, 12000.0]  # s
FEWEST_ATTITUDES = 8  # frames of three features or more; nobody sends tracks in which hardly anything is seen
LEAST_TURN = 0.15  # rotations


@dataclass(frozen=True, eq=False)
class Case:
    """What is true in one case, and what is seen: n times, m labels.

    seed, index: what it is drawn from; kind: how; start: where the motion begins; time (n,) s, of which the first need
    not be 0, for which the orbit's elements hold; path (n, 3): the centre of mass in C, m; path_jacobian (n, 3, 6) by
    the chaser's state at the start; attitude (n, 3, 3) R_C_B; rate (n, 3) rad/s in B; turn (n, 3, 8): rotation vectors
    in B by rate and inertia at the start; feature (m,) behind each label; points (m, 3): these in B, m; seen (n, m).
    """

    seed: int
    index: int
    kind: str
    start: Start
    time: FloatArray
    path: FloatArray
    path_jacobian: FloatArray
    attitude: FloatArray
    rate: FloatArray
    turn: FloatArray
    feature: IntArray
    points: FloatArray
    seen: BoolArray
    sensor: Sensor
    sample: Sample

    def at(self, time: FloatArray) -> Truth:
        """The truth at other times, see `interface.Drawn`."""
        s = self.start
        relative = relative_motion(s.orbit, s.time, s.state, time)
        turned = tumble(s.inertia, s.rate, s.quaternion, s.time, time)
        return Truth(-relative[:, :3], -relative[:, 3:], *turned)

    @property
    def orbital(self) -> bool:
        """Whether the target flies: always."""
        return True

    @property
    def orbit(self) -> Orbit:
        """The orbit at time 0, as an estimator may be told it."""
        o = self.start.orbit
        return Orbit(o.a, o.e, o.i, o.raan, o.argp, o.true_anomaly(0.0))

    @property
    def noise(self) -> float:
        """Its standard deviation, or that of the depth at the median range, m."""
        return self.sensor.noise

    @property
    def told(self) -> float | None:
        """The sigma that the estimator is told: 1 beside covariances."""
        if not self.sensor.told:
            return None
        return 1.0 if self.sensor.ratio else self.sensor.noise

    @property
    def radius(self) -> float:
        """The rms distance of the features that are seen from their centroid, m."""
        _, first = np.unique(self.feature, return_index=True)
        return _radius(self.points[first])

    @property
    def rotations(self) -> float:
        """How often the target turns while it is watched."""
        return _rotations(self.rate, self.time)


@dataclass(frozen=True, eq=False)
class _Draft:
    """A case but for its Jacobians; points (f, 3) of all features."""

    words: list[str]
    start: Start
    motion: Motion
    points: FloatArray
    view: View
    sensor: Sensor
    observations: Observations


def drawn(seed: int, index: int, clean: bool = False) -> Case:
    """The case of that index: a function of the two numbers only; clean: all in view, 0.1 µm of noise, no outliers."""
    rng = np.random.default_rng([seed, index])
    draft = _draft(rng, clean)
    while not _worth_it(draft):
        draft = _draft(rng, clean)
    start, motion, view, found = draft.start, draft.motion, draft.view, draft.observations
    tracks = FeatureTracks(motion.time, found.position, view.labels, found.covariance)
    return Case(
        seed,
        index,
        "; ".join(draft.words),
        start,
        motion.time,
        motion.path,
        path_jacobian(start, motion.time),
        motion.attitude,
        motion.rate,
        turn(start, motion.time),
        view.feature,
        draft.points[view.feature],
        view.seen,
        draft.sensor,
        Sample(tracks, found.right, found.precision),
    )


def sampled(case: Case, draw: int = 0) -> Sample:
    """The tracks of a case; draw: any number but 0 gives other noise and outliers by the same sensor."""
    if not draw:
        return case.sample
    rng = np.random.default_rng([case.seed, case.index, draw])
    found = observed(rng, case.sensor, _places(case.path, case.attitude, case.points, case.seen))
    tracks = FeatureTracks(case.time, found.position, case.sample.tracks.labels, found.covariance)
    return Sample(tracks, found.right, found.precision)


def _draft(rng: np.random.Generator, clean: bool) -> _Draft:
    body = draw_body(rng)
    rate, rate_words = draw_rate(rng, body.inertia)
    speed = float(np.linalg.norm(rate))
    rotations = float(np.clip(np.exp(rng.normal(np.log(2.5), 1.1)), 0.2, 20))
    span = float(min(rotations * TURN / speed, rng.choice(LONGEST)))
    begin = 0.0 if rng.random() < 0.7 else float(np.round(rng.uniform(-2000, 5000), 3))
    orbit, orbit_words = draw_orbit(rng, begin)
    state, span, chaser_words = draw_chaser(rng, orbit, begin, span, 0.55 * body.size + 0.6)
    rotations = span * speed / TURN
    time, time_words = draw_times(rng, begin, span, rotations)
    path = -relative_motion(orbit, begin, state, time)[:, :3]  # the target's CoM from the chaser, in axes of I
    quaternion = rng.standard_normal(4)
    quaternion /= np.linalg.norm(quaternion)
    start = Start(begin, orbit, state, body.inertia, rate, quaternion)
    motion = Motion(orbit, time, path, *tumble(body.inertia, rate, quaternion, begin, time))
    features = draw_features(rng, body, clean)
    view = draw_view(rng, features, motion, body.size, rotations)
    true = _places(path, motion.attitude, features.points[view.feature], view.seen)
    sensor, found = draw_sensor(rng, true, _radius(features.points), body.size, clean)
    words = [body.words, rate_words, orbit_words, chaser_words, time_words, view.words, sensor.words]
    frames, labels = _kept(rng, view.seen)
    motion = Motion(orbit, time[frames], path[frames], motion.attitude[frames], motion.rate[frames])
    names = [name for name, kept in zip(view.labels, labels, strict=True) if kept]
    view = View(view.feature[labels], view.seen[frames][:, labels], names, view.words)
    return _Draft(words, start, motion, features.points, view, sensor, found.within(frames, labels))


def _places(path: FloatArray, attitude: FloatArray, points: FloatArray, seen: BoolArray) -> FloatArray:
    """Points (m, 3) in C (n, m, 3), m, NaN where they are not seen (n, m)."""
    return np.where(seen[..., None], path[:, None] + np.einsum("nij,mj->nmi", attitude, points), np.nan)


def _kept(rng: np.random.Generator, seen: BoolArray) -> tuple[BoolArray, BoolArray]:
    """Frames (n,) and labels (m,) of a file: empty frames in half of the cases, never at its ends; no empty labels."""
    some, labels = np.asarray(seen.any(1)), np.asarray(seen.any(0))
    if not some.any():
        return np.ones_like(some), np.ones_like(labels)
    if rng.random() < 0.5:
        return some, labels
    return (np.cumsum(some) > 0) & (np.cumsum(some[::-1])[::-1] > 0), labels


def _worth_it(draft: _Draft) -> bool:
    time, attitudes = draft.motion.time, (draft.view.seen.sum(1) >= 3).sum()
    turned = round(_rotations(draft.motion.rate, time), 3)
    return len(time) >= FEWEST and bool(attitudes >= FEWEST_ATTITUDES) and turned >= LEAST_TURN


def _rotations(rate: FloatArray, time: FloatArray) -> float:
    return float(np.linalg.norm(rate, axis=1).mean() * (time[-1] - time[0]) / TURN)


def _radius(points: FloatArray) -> float:
    return float(np.sqrt(((points - points.mean(0)) ** 2).sum(1).mean()))

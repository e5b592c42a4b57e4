"""A case of the fourth population: its truth of a seed and an index, and its tracks."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator import FeatureTracks
from baryscope.models.orbit import Orbit
from baryscope.study.population.fourth import bodies, chasers, orbits, sensor, timing, tumble, views
from baryscope.study.population.fourth.blunders import Scene, blundered
from baryscope.study.population.fourth.bodies import Body, Mass
from baryscope.study.population.fourth.chance import normalised, of_case, of_sample
from baryscope.study.population.fourth.chasers import Place
from baryscope.study.population.fourth.relative import carried, flown, path_jacobian
from baryscope.study.population.fourth.sensor import Sensor
from baryscope.study.population.fourth.timing import Timing
from baryscope.study.population.fourth.tumble import Tumble
from baryscope.study.population.fourth.views import View
from baryscope.study.population.interface import BoolArray, FloatArray, Sample, Truth, turns

CLEAN = 1e-7  # m
TRIES = 1000  # of which a few do


@dataclass(frozen=True, eq=False)
class Motion:
    """target (6,) in I and chaser (6,) less the target, m and m/s, at `begin`, s, when the tumble begins."""

    target: FloatArray
    chaser: FloatArray
    tumble: Tumble
    begin: float
    oblate: bool

    def at(self, time: FloatArray) -> Truth:
        """The truth at ascending times (k,) from `begin` on, s."""
        relative = flown(self.target, self.chaser[None], self.begin, time, self.oblate)[1][:, 0]
        return Truth(-relative[:, :3], -relative[:, 3:], *self.tumble.at(time))


@dataclass(frozen=True, eq=False)
class Case:
    """The truth of a case, as `interface.Drawn` says: n times, m labels.

    time (n,) s; path (n, 3) in C, m; path_jacobian (n, 3, 6) by the chaser's state in I at the first time; attitude
    (n, 3, 3) R_C_B; rate (n, 3) in B, rad/s; turn (n, 3, 8) in B; feature (m,) behind each label; points (m, 3) in B,
    m; seen (n, m); size: of the body, m.
    """

    seed: int
    index: int
    kind: str
    time: FloatArray
    orbit: Orbit
    motion: Motion
    path: FloatArray
    path_jacobian: FloatArray
    attitude: FloatArray
    rate: FloatArray
    turn: FloatArray
    points: FloatArray
    feature: NDArray[np.intp]
    labels: list[str]
    seen: BoolArray
    size: float
    sensor: Sensor

    def at(self, time: FloatArray) -> Truth:
        """The truth at other times, see `interface.Drawn`."""
        return self.motion.at(time)

    @property
    def orbital(self) -> bool:
        """Whether the target flies: always."""
        return True

    @property
    def noise(self) -> float:
        """Its standard deviation, or that of the depth at the mean range, m."""
        return self.sensor.noise

    @property
    def told(self) -> float | None:
        """The sigma that the estimator is told: 1 beside covariances."""
        return self.sensor.sigma

    @property
    def radius(self) -> float:
        """The rms distance of the features that are seen from their centroid, m."""
        _, first = np.unique(self.feature, return_index=True)
        return bodies.spread(self.points[first])

    @property
    def rotations(self) -> float:
        """How often the target turns while it is watched."""
        return turns(self.rate, self.time)


@dataclass(frozen=True, eq=False)
class _Draft:
    """What is drawn of a case before it is known to be one; words: for its parts; elapsed (n,): times, s."""

    words: tuple[str, ...]
    body: Body
    orbit: Orbit
    motion: Motion
    elapsed: FloatArray
    truth: Truth
    view: View


def drawn(seed: int, index: int, clean: bool = False) -> Case:
    """The case of a seed and an index. Clean: all in view under one label, 0.1 µm of noise, no blunders."""
    rng = of_case(seed, index)
    draft = _first(rng)
    body, motion, truth, view = draft.body, draft.motion, draft.truth, draft.view
    instrument = sensor.drawn(rng, body.radius)
    if clean:
        count = len(body.points)
        everything = np.ones((len(draft.elapsed), count), dtype=bool)
        view = View(everything, np.arange(count), [f"P{feature}" for feature in range(count)], False)
        instrument = Sensor(CLEAN)
    time = motion.begin + draft.elapsed
    words = [*draft.words, *["new labels"] * view.new_labels, instrument.words()]
    return Case(
        seed=seed,
        index=index,
        kind="; ".join(words),
        time=time,
        orbit=draft.orbit,
        motion=motion,
        path=truth.path,
        path_jacobian=path_jacobian(motion.target, motion.chaser, motion.begin, time, motion.oblate),
        attitude=truth.attitude,
        rate=truth.rate,
        turn=motion.tumble.turn(time),
        points=body.points[view.feature],
        feature=view.feature,
        labels=view.labels,
        seen=view.seen,
        size=body.size,
        sensor=instrument,
    )


def sampled(case: Case, draw: int = 0) -> Sample:
    """The tracks of a case; draws differ in noise and blunders."""
    rng = of_sample(case.seed, case.index, draw)
    instrument, seen = case.sensor, case.seen
    ideal = case.path[:, None] + np.einsum("nij,mj->nmi", case.attitude, case.points)
    mean_range = float(np.linalg.norm(case.path, axis=1).mean())
    true = instrument.covariances(ideal, mean_range)
    noisy = ideal + np.einsum("nmij,nmj->nmi", np.linalg.cholesky(true), rng.standard_normal(ideal.shape))
    scene = Scene(ideal, noisy, seen, case.feature, case.size, instrument.noise)
    position, right = blundered(rng, scene, instrument.blunder, instrument.blunders)
    given = None
    if instrument.ratio:
        given = instrument.covariances(position, mean_range) if instrument.by_measured else true
        given = np.where(seen[..., None, None], instrument.factor**2 * given, np.nan)
    tracks = FeatureTracks(case.time, np.where(seen[..., None], position, np.nan), case.labels, given)
    return Sample(tracks, right, np.asarray(np.linalg.inv(true)))


def _first(rng: np.random.Generator) -> _Draft:
    """The first draft in which enough is seen from a chaser that stays near."""
    for _ in range(TRIES):
        draft = _draft(rng)
        if draft is not None:
            return draft
    raise RuntimeError("no case")


def _draft(rng: np.random.Generator) -> _Draft | None:
    body, mass = bodies.drawn(rng), bodies.drawn_mass(rng)
    elements = orbits.drawn(rng)
    times = timing.drawn(rng, 2 * np.pi * np.sqrt(elements[0] ** 3 / orbits.MU))
    if times is None:
        return None
    orbit = orbits.told(rng, elements, times.span)
    started = _started(rng, orbit, times, body, mass)
    if started is None:
        return None
    motion, motion_words = started
    elapsed, pace = timing.elapsed(rng, times)
    truth = motion.at(motion.begin + elapsed)
    look = np.einsum("nji,nj->ni", truth.attitude, -normalised(truth.path))
    view = views.drawn(rng, body, elapsed, times.span, look)
    if view is None:
        return None
    clusters = int(body.cluster.max()) + 1
    far = float(np.linalg.norm(body.points.mean(axis=0)) / body.radius)
    shape = f"{body.shape} of {len(body.points)} in {clusters}, centre {far:.1f} radii off"
    return _Draft((shape, *motion_words, f"{pace} times"), body, orbit, motion, elapsed, truth, view)


def _started(
    rng: np.random.Generator, orbit: Orbit, times: Timing, body: Body, mass: Mass
) -> tuple[Motion, tuple[str, ...]] | None:
    """How the motion begins, and words for it; None if no chaser stays near."""
    oblate = bool(orbit.j2)
    begin = timing.begun(rng, oblate)
    target = carried(orbits.state(orbit, 0.0), begin, oblate) if oblate else orbits.state(orbit, begin)
    place = Place(target, orbit.eccentricity, orbit.semi_major_axis, times.span, oblate)
    chaser = chasers.drawn(rng, place, body.reach)
    if chaser is None:
        return None
    turning, spin = tumble.drawn(rng, mass, times.rate, begin)
    orbit_words = f"a={orbit.semi_major_axis / 1e3:.0f} km e={orbit.eccentricity:.3f}{' J2' if oblate else ''}"
    words = (f"{spin} ({mass.kind}) at {np.degrees(times.rate):.2g} °/s", orbit_words, chaser[1])
    return Motion(target, chaser[0], turning, begin, oblate), words

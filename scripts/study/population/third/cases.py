"""A case of the third population: its truth of a seed and an index, and its tracks."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from baryscope.estimator import FeatureTracks
from baryscope.models.orbit import Orbit
from baryscope.study.population.interface import FloatArray, Sample, Truth, turns
from baryscope.study.population.third import blunders as all_blunders
from baryscope.study.population.third import bodies, flight, laboratory, sensor, timing, tumble, view
from baryscope.study.population.third.blunders import Blunders
from baryscope.study.population.third.bodies import Body
from baryscope.study.population.third.dice import direction, log_uniform, rotation, stream
from baryscope.study.population.third.kepler import at_epoch, propagated
from baryscope.study.population.third.mismatches import BEARING, SIGMA, Plan, planned
from baryscope.study.population.third.sensor import Sensor, Watch
from baryscope.study.population.third.timing import Timing
from baryscope.study.population.third.tumble import Torques, Tumbled

CLEAN = 1e-7  # m


@dataclass(frozen=True, eq=False)
class Case:
    """The truth of a case, as `interface.Drawn` says; time (n,) s, points (m, 3) in B, m.

    orbital: whether the target flies, so that an orbit means something; noise: m; told: a sigma, m; watch: what is to
    be seen; blunders: in the tracks; at: the truth at other times.
    """

    seed: int
    index: int
    kind: str
    orbital: bool
    time: FloatArray
    orbit: Orbit
    path: FloatArray
    path_jacobian: FloatArray
    attitude: FloatArray
    rate: FloatArray
    turn: FloatArray
    points: FloatArray
    sensor: Sensor
    blunders: Blunders
    noise: float
    told: float | None
    watch: Watch
    at: Callable[[FloatArray], Truth]

    @property
    def radius(self) -> float:
        """The rms distance of the features that are seen from their centroid, m."""
        return self.watch.spread

    @property
    def rotations(self) -> float:
        """How often the target turns while it is watched."""
        return turns(self.rate, self.time)


@dataclass(frozen=True, eq=False)
class _World:
    """orbit: as told; path, velocity, attitude and rate of the truth; words: for what departs from the models; at: the
    truth at other times.
    """

    orbit: Orbit
    path: FloatArray
    velocity: FloatArray
    jacobian: FloatArray
    tumbled: Tumbled
    words: tuple[str, ...]
    at: Callable[[FloatArray], Truth]


def drawn(seed: int, index: int, clean: bool = False) -> Case:
    """The case of a seed and an index. Clean: seen by a perfect sensor, all of it, as a rigid body."""
    plan = planned(seed, index)
    times = timing.drawn(stream(seed, index, "times"), plan.orbital)
    rng = stream(seed, index, "body")
    distance = log_uniform(rng, flight.NEAREST, flight.FARTHEST) if plan.orbital else log_uniform(rng, 1.5, 6)
    body = bodies.drawn(rng, plan.mismatches, min(4.0, distance / 4) if plan.orbital else 0.4)
    distance = max(distance, 2.5 * body.size)
    noise = log_uniform(rng, 5e-4, 0.1) if plan.orbital else log_uniform(rng, 3e-4, 5e-3)
    noise = min(noise, 0.1 * body.size)
    world = (_in_orbit if plan.orbital else _in_laboratory)(seed, index, plan, times, body, (distance, noise))
    rng = stream(seed, index, "view")
    chosen = _viewed(rng, plan, times, body, world)
    bent, wing_words = _bent(rng, plan, times, body) if not clean else (np.zeros((len(times.time), 0, 3)), ())
    watch = _watch(world, body, chosen, bent)
    rng = stream(seed, index, "sensor")
    instrument = sensor.drawn(rng, plan, noise, watch)
    bad = all_blunders.drawn(rng, plan.mismatches, float(body.half.min()))
    factor = log_uniform(rng, 0.5, 2) if "wrong sigma" in plan.mismatches else 1.0
    told = noise * factor if plan.telling == SIGMA else None
    told_words = (f"sigma told times {factor:.2f}",) if factor != 1 else ()
    if clean:
        watch = replace(watch, seen=np.ones_like(watch.seen))
        instrument, bad, noise, told = Sensor(), Blunders(), CLEAN, CLEAN
    words = [*world.words, *wing_words, *instrument.words(), *told_words, *bad.words()]
    rate_words = f"{np.degrees(times.rate):.2g} °/s, {distance:.0f} m, {chosen.how}, noise {plan.telling}"
    kind = f"{plan.place}, {body.hull}, {rate_words}: {'; '.join(words) or 'no mismatch'}"
    return Case(
        seed=seed,
        index=index,
        kind=kind,
        orbital=plan.orbital,
        time=times.time,
        orbit=world.orbit,
        path=world.path,
        path_jacobian=world.jacobian,
        attitude=world.tumbled.attitude,
        rate=world.tumbled.rate,
        turn=world.tumbled.turn,
        points=body.points[chosen.feature],
        sensor=instrument,
        blunders=bad,
        noise=noise,
        told=told,
        watch=watch,
        at=world.at,
    )


def sampled(case: Case, draw: int = 0) -> Sample:
    """The tracks of a case; draws differ in noise and blunders."""
    rng = stream(case.seed, case.index, "sample", draw)
    watch, instrument = case.watch, case.sensor
    said = sensor.covariances(instrument, case.noise, watch)
    own = said * sensor.scales(instrument, watch)[..., None, None] ** 2
    all_noise = sensor.marginal(instrument, own, watch)
    noisy = watch.ideal + sensor.noises(rng, instrument, own, watch)
    root = np.asarray(np.linalg.cholesky(own))
    position, right = all_blunders.blundered(rng, case.blunders, noisy, root, watch)
    position[~watch.seen] = np.nan
    labels = [f"p{number}" for number in range(watch.seen.shape[1])]
    given = instrument.factor * said if instrument.covariances else None
    tracks = FeatureTracks(case.time, position, labels, given)
    return Sample(tracks, right & watch.seen, np.asarray(np.linalg.inv(all_noise)))


def _in_orbit(seed: int, index: int, plan: Plan, times: Timing, body: Body, sizes: tuple[float, float]) -> _World:
    flown = flight.drawn(stream(seed, index, "motion"), plan, times, *sizes)
    rng = stream(seed, index, "tumble")
    torques = tumble.drawn(rng, plan.mismatches, times.rate, times.span)
    tumbled = _tumbled(rng, times, body, torques, flown.truth)
    path, motion = flown.flown.path, flown.flown
    words = (*flown.forces.words(), *flown.words, *torques.words())

    def at(time: FloatArray) -> Truth:
        there = motion.way.at(time)
        return Truth(there.path, there.velocity, *tumbled.at(time))

    return _World(flown.told, path, motion.velocity, motion.transition[:, :3], tumbled, words, at)


def _in_laboratory(seed: int, index: int, plan: Plan, times: Timing, body: Body, sizes: tuple[float, float]) -> _World:
    rng = stream(seed, index, "motion")
    pivot = laboratory.pivot(rng, times.time, sizes[0], "slipping pivot" in plan.mismatches)
    words = pivot.words
    rng = stream(seed, index, "tumble")
    if plan.place == BEARING:
        torques = tumble.drawn(rng, plan.mismatches, times.rate, times.span)
        tumbled = _tumbled(rng, times, body, torques, laboratory.ANY_ORBIT)
        words = (*words, *torques.words())
    else:
        tumbled, more = laboratory.led(rng, body.inertia, times, "limited joint" in plan.mismatches)
        words = (*words, *more)

    def at(time: FloatArray) -> Truth:
        stays = pivot.at(times.time, time)
        return Truth(stays, np.zeros_like(stays), *tumbled.at(time))

    return _World(laboratory.ANY_ORBIT, pivot.path, np.zeros_like(pivot.path), pivot.jacobian, tumbled, words, at)


def _tumbled(rng: np.random.Generator, times: Timing, body: Body, torques: Torques, orbit: Orbit) -> Tumbled:
    """The tumble about any axis, or in 40 of 100 cases nearly about a principal one."""
    axis = direction(rng)
    if rng.random() < 0.4:
        principal = np.linalg.eigh(body.inertia)[1][:, rng.choice([0, 2])]
        axis = principal + log_uniform(rng, 1e-3, 0.3) * axis
        axis /= np.linalg.norm(axis)
    epoch = at_epoch(orbit)

    def place(t: float) -> FloatArray:
        return propagated(epoch, orbit.gravitational_parameter, np.array([t]))[0, :3]

    return tumble.tumbled((rotation(rng), times.rate * axis), body.inertia, times.time, torques, place)


def _viewed(rng: np.random.Generator, plan: Plan, times: Timing, body: Body, world: _World) -> view.View:
    features = world.path[:, None] + np.einsum("nij,mj->nmi", world.tumbled.attitude, body.points)
    dark = np.zeros(len(times.time), dtype=bool)
    if times.blind:
        dark = (times.time >= times.blind[0]) & (times.time <= times.blind[1])
    return view.drawn(rng, _facing(features, world.tumbled.attitude, body.normals), dark, plan.orbital)


def _facing(features: FloatArray, attitude: FloatArray, normals: FloatArray) -> FloatArray:
    """Cosines (n, m) between the normals (m, 3) in B of features (n, m, 3) in C and the ways to the chaser."""
    rays = features / np.linalg.norm(features, axis=2, keepdims=True)
    return np.asarray(-np.einsum("nmi,nij,mj->nm", rays, attitude, normals, optimize=True))


def _bent(rng: np.random.Generator, plan: Plan, times: Timing, body: Body) -> tuple[FloatArray, tuple[str, ...]]:
    """Shifts (n, M, 3) of the features in B, m, by wings that swing, and words for it."""
    if "flexible wing" not in plan.mismatches:
        return np.zeros((len(times.time), 0, 3)), ()
    tip, period = log_uniform(rng, 5e-4, 0.05), log_uniform(rng, 5, 60)
    swing = tip * np.sin(2 * np.pi * times.time / period + rng.uniform(0, 2 * np.pi))
    return np.multiply.outer(swing, body.swing), (f"flexible wing {1e3 * tip:.2g} mm at {period:.0f} s",)


def _watch(world: _World, body: Body, chosen: view.View, bent: FloatArray) -> Watch:
    """What is to be seen of a body's chosen features, shifted by `bent` (n, M, 3) in B unless that is empty."""
    R = world.tumbled.attitude
    points: FloatArray = body.points[chosen.feature][None]
    if bent.shape[1]:
        points = points + bent[:, chosen.feature]
    ideal = world.path[:, None] + np.einsum("nij,nmj->nmi", R, np.broadcast_to(points, (len(R), *points.shape[1:])))
    moved = np.einsum("nij,nmj->nmi", R, np.cross(world.tumbled.rate[:, None], points))
    facing = _facing(ideal, R, body.normals[chosen.feature])
    return Watch(ideal, world.velocity[:, None] + moved, R, world.path, facing, chosen.seen)

"""What the online estimator sees in a draw: a world of the world suite, or a case of a population."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator import FeatureTracks
from baryscope.estimator.online import OnlineEstimator, OnlineState
from baryscope.estimator.online.course import mean_pushes, seen_at_once
from baryscope.estimator.thrust import KnownAcceleration
from baryscope.models.orbit import Orbit
from baryscope.study.population.information import Watched, unknowns_bound
from baryscope.study.population.populations import FIRST, POPULATIONS
from baryscope.study.world.judging import told_orbit
from baryscope.study.world.scenes import RATE, logged_thrust, memory, scene
from baryscope.study.world.worlds import WORLDS, World

FloatArray = NDArray[np.float64]

POPULATION = "population"  # the first one
UNTOLD = ", no orbit"
OF_POPULATIONS = {
    (POPULATION if name == FIRST else f"{POPULATION} {name}") + more: (name, not more)
    for name in POPULATIONS
    for more in ("", UNTOLD)
}  # by suite: whose cases, and whether the orbit is told
ANY_WHITE = "white, any density"
"""Each draw's density is one of those that the filter holds possible, as likely as it takes it for."""
POSSIBLE = (-17.0, -5.25)  # log10 of the densities that those of its bank stand for (fmu/csrc/online/bank.c), m²/s³
TOLD_J2 = {f"{name}, J2 told": name for name, world in WORLDS.items() if world.j2}
SUITES = (*WORLDS, *TOLD_J2, ANY_WHITE, *OF_POPULATIONS)


@dataclass(frozen=True, eq=False)
class Flight:
    """A draw: its tracks, what is told, and the truth.

    sigma in m, of a coordinate without a covariance of its own; attitude_noise of the camera, rad; path (n, 3) of the
    centre of mass in C; jacobian (n, 3, p) of it by unknowns with the prior information (p,); moved: how many of these
    move the path; watched: what is seen; rotations (n,): how often the target has turned; thrust: of the
    chaser, as it is logged.
    """

    tracks: FeatureTracks
    sigma: float
    orbit: Orbit | None
    attitude_noise: float
    path: FloatArray
    jacobian: FloatArray
    prior: FloatArray
    moved: int
    watched: Watched
    rotations: FloatArray
    thrust: KnownAcceleration | None = None

    def states(self) -> Iterator[OnlineState]:
        """The state after each frame, by a new filter, which sees the first of the features if it can't hold all."""
        tracks = self.tracks
        seen = seen_at_once(tracks.position)
        pushes = self.pushes()
        filter = OnlineEstimator(self.sigma, self.orbit, attitude_noise=self.attitude_noise)
        for k, time in enumerate(tracks.time):
            covariance = None if tracks.covariance is None else tracks.covariance[k]
            yield filter.update(float(time), tracks.position[k], seen[k], covariance=covariance, acceleration=pushes[k])

    def pushes(self) -> FloatArray:
        """The mean acceleration (n, 3) of the chaser in C since the frame before, m/s², as it is logged."""
        time, log = self.tracks.time, self.thrust
        return np.zeros((len(time), 3)) if log is None else mean_pushes(log, time, self.orbit)

    def causal_bound(self, k: int, tumble: bool) -> float:
        """The bound of the error of the path at frame k from the frames up to it, m; tumble: a free one, else any."""
        end, found = k + 1, self.watched
        turn = found.turn[:end] if tumble and found.turn is not None else None
        watched = Watched(found.attitude[:end], found.points, found.precision[:end], found.right[:end], turn)
        of_x = unknowns_bound(self.jacobian[:end], watched, self.prior)[: self.moved, : self.moved]
        J = self.jacobian[k][:, : self.moved]
        return float(np.sqrt(np.trace(J @ of_x @ J.T)))


def flight(suite: str, seed: int, draw: int) -> Flight:
    """A draw of a suite, from the three alone."""
    return _of_population(suite, seed, draw) if suite in OF_POPULATIONS else _of_world(suite, seed, draw)


def world_of(name: str, seed: int, draw: int) -> World:
    """The world of a draw, which is the suite's, unless the suite's differ."""
    if name != ANY_WHITE:
        return WORLDS[TOLD_J2.get(name, name)]
    rng = np.random.default_rng([seed, draw, *name.encode()])
    return replace(WORLDS["white 1e-8"], name=name, white=float(10 ** rng.uniform(*POSSIBLE)))


def _of_world(name: str, seed: int, draw: int) -> Flight:
    made = scene(world_of(name, seed, draw), seed, draw)
    n, m, own = len(made.time), len(made.points), made.jacobian.shape[2]
    # In the bound, errors that last count as white ones of as great a spectrum at frequency zero.
    keep = memory(made.time, made.world.error_time)[0]
    white = made.world.noise * float(np.sqrt((1 + keep) / (1 - keep)))
    jacobian = np.concatenate([made.jacobian, made.disturbance.columns], axis=2)
    tumbles = not made.world.eddy and not made.world.slip
    return Flight(
        tracks=made.tracks,
        sigma=made.world.noise,
        orbit=told_orbit(made) if name in TOLD_J2 else made.orbit,
        attitude_noise=made.world.attitude_noise,
        path=made.path,
        jacobian=jacobian,
        prior=np.concatenate([np.zeros(own), 1 / made.disturbance.variance]),
        moved=jacobian.shape[2] if made.disturbance.moves_path else own,
        watched=Watched(
            made.attitude,
            made.points,
            np.broadcast_to(np.eye(3) / white**2, (n, m, 3, 3)),
            np.ones((n, m), dtype=bool),
            made.turn if tumbles else None,
        ),
        rotations=made.time * float(np.linalg.norm(RATE)) / (2 * np.pi),
        thrust=logged_thrust(made),
    )


def _of_population(suite: str, seed: int, index: int) -> Flight:
    name, told = OF_POPULATIONS[suite]
    case, sampler = POPULATIONS[name](seed, index)
    sample = sampler(0)
    steps = np.diff(case.time) * np.linalg.norm(case.rate[:-1], axis=1)
    tracks = sample.tracks
    if tracks.covariance is not None:
        seen = tracks.seen[..., None, None]
        tracks = replace(tracks, covariance=np.where(seen, tracks.covariance, np.eye(3)))
    return Flight(
        tracks,
        case.noise if case.told is None else case.told,
        case.orbit if told and case.orbital else None,
        0.0,
        case.path,
        case.path_jacobian,
        np.zeros(6),
        6,
        Watched(case.attitude, case.points, sample.precision, sample.right, case.turn),
        np.concatenate([[0.0], np.cumsum(steps)]) / (2 * np.pi),
    )

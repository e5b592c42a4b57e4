"""The population: random bodies, tumbles, orbits, chasers, features and sensors, each from (seed, index) alone."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from baryscope.models.orbit import EARTH_RADIUS, Orbit
from baryscope.study.population.interface import Truth, turns
from baryscope.study.population.motion import relative_motion, tumble

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

NEAREST, FARTHEST = 3.0, 150.0  # m between chaser and centre of mass; cases that leave this range are drawn again
LONGEST = 30_000.0  # s
MIDDLE_STEP = 1.0  # m and m/(1/n): of the differences that make the path's Jacobian


@dataclass(frozen=True, eq=False)
class Start:
    """The motion at time 0: inertia (3, 3) of trace 1; quaternion (4,) of R_C_B, (x, y, z, w); rate (3,) in B, rad/s;
    state (6,): the chaser's in LVLH, m and m/s.
    """

    inertia: FloatArray
    quaternion: FloatArray
    rate: FloatArray
    state: FloatArray


@dataclass(frozen=True, eq=False)
class Case:
    """What is true in one case, and how it is seen.

    seed, index: what it is drawn from; kind: words that name what is special; time (n,) s; orbit; start; path (n, 3):
    the centre of mass in C, m; path_jacobian (n, 3, 6) by the chaser's state at the first time; attitude (n, 3, 3)
    R_C_B; rate (n, 3) rad/s in B; turn (n, 3, 8): rotation vectors in B by the rate and five parameters of the
    inertia at the first time; points (m, 3) in B, m; seen (n, m): what is seen but for dropouts; sensor: its errors.
    """

    seed: int
    index: int
    kind: str
    time: FloatArray
    orbit: Orbit
    start: Start
    path: FloatArray
    path_jacobian: FloatArray
    attitude: FloatArray
    rate: FloatArray
    turn: FloatArray
    points: FloatArray
    seen: BoolArray
    sensor: "Sensor"

    def at(self, time: FloatArray) -> Truth:
        """The truth at other times, see `interface.Drawn`."""
        every, start = np.concatenate([[0.0], time]), self.start
        relative, _ = relative_motion(self.orbit, start.state[None], every)
        attitude, rate = tumble(start.inertia[None], start.quaternion[None], start.rate[None], every)
        return Truth(-relative[0, 1:, :3], -relative[0, 1:, 3:], attitude[0, 1:], rate[0, 1:])

    @property
    def orbital(self) -> bool:
        """Whether the target flies: always."""
        return True

    @property
    def noise(self) -> float:
        """Its standard deviation, as the sensor has it."""
        return self.sensor.noise

    @property
    def told(self) -> float | None:
        """The sigma that the estimator is told: 1 beside covariances."""
        if not self.sensor.told:
            return None
        return 1.0 if self.sensor.baseline else self.sensor.noise

    @property
    def radius(self) -> float:
        """The rms distance of the features that are seen from their centroid, m."""
        points = self.points[self.seen.any(axis=0)]
        return float(np.sqrt(((points - points.mean(axis=0)) ** 2).sum(axis=1).mean())) if len(points) else 0.0

    @property
    def rotations(self) -> float:
        """How often the target turns while it is watched."""
        return turns(self.rate, self.time)


@dataclass(frozen=True)
class Sensor:
    """noise: standard deviation of a coordinate in m, or of a pixel coordinate of a stereo rig in px if baseline > 0.

    baseline in m, focal length 1911 px; dropout: share of missing observations; outliers: share of observations
    displaced by up to `blunder` m; swapped: share whose label is another's; mislabelled: two features change their
    labels for a stretch of time; told: whether the estimator is told the noise.
    """

    noise: float
    baseline: float = 0.0
    dropout: float = 0.0
    outliers: float = 0.0
    blunder: float = 1.0
    swapped: float = 0.0
    mislabelled: bool = False
    told: bool = False


def drawn(seed: int, index: int) -> Case:
    """The case of that index: a function of the two numbers only."""
    streams = [np.random.default_rng(s) for s in np.random.SeedSequence([seed, index]).spawn(5)]
    inertia, rate, tumble_kind = _tumble(streams[0])
    orbit, orbit_kind = _orbit(streams[1])
    time = _times(streams[2], float(np.linalg.norm(rate)), orbit)
    points, normals, shape_kind = _features(streams[3])
    nearest = max(NEAREST, 1.3 * float(np.linalg.norm(points, axis=1).max()))
    time, state, path, path_jacobian, chaser_kind = _path(streams[1], orbit, time, nearest)
    start = Start(inertia, Rotation.random(random_state=streams[0]).as_quat(), rate, state)
    attitude, rates, turn = rotation_with_sensitivity(inertia, start.quaternion, rate, time)
    seen, view_kind = _view(streams[4], path, attitude, points, normals)
    sensor = _sensor(streams[2], path)
    words = [orbit_kind, chaser_kind, tumble_kind, shape_kind, view_kind, *_words(sensor)]
    kind = " ".join(word for word in words if word)
    return Case(
        seed=seed,
        index=index,
        kind=kind,
        time=time,
        orbit=orbit,
        start=start,
        path=path,
        path_jacobian=path_jacobian,
        attitude=attitude,
        rate=rates,
        turn=turn,
        points=points,
        seen=seen,
        sensor=sensor,
    )


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _direction(rng: np.random.Generator) -> FloatArray:
    v = rng.standard_normal(3)
    return np.asarray(v / np.linalg.norm(v))


def _tumble(rng: np.random.Generator) -> tuple[FloatArray, FloatArray, str]:
    """Inertia (3, 3) of trace 1, and the rate in B, 0.1 to 20 °/s."""
    spread = np.exp(rng.normal(0, 1.0, 3))  # the body's second moments of mass
    symmetric, axis = rng.random() < 0.25, _direction(rng)
    if symmetric:
        spread[1] = spread[0] * (1 + rng.choice([-1, 1]) * _log_uniform(rng, 1e-3, 3e-2))
    moments = spread.sum() - spread
    axes = Rotation.random(random_state=rng).as_matrix()
    size = np.deg2rad(_log_uniform(rng, 0.1, 20))
    spin = rng.random() < 0.2
    if spin:
        order = np.argsort(moments)
        about = axes[:, order[rng.choice([0, 2])]]
        cone = np.deg2rad(_log_uniform(rng, 0.01, 10))
        axis = np.cos(cone) * about + np.sin(cone) * np.cross(about, axis) / np.linalg.norm(np.cross(about, axis))
    words = " ".join(["symmetric"] * bool(symmetric) + ["spin"] * bool(spin))
    return np.asarray(axes * (moments / moments.sum()) @ axes.T), np.asarray(size * axis), words


def _orbit(rng: np.random.Generator) -> tuple[Orbit, str]:
    kind = str(rng.choice(["leo", "gto", "geo", "ellipse"], p=[0.45, 0.2, 0.15, 0.2]))
    e = {"leo": rng.uniform(0, 0.02), "gto": rng.uniform(0.6, 0.7), "geo": rng.uniform(0, 0.01)}.get(
        kind, rng.uniform(0.02, 0.7)
    )
    periapsis = EARTH_RADIUS + _log_uniform(rng, 300e3, 1500e3)
    a = 42_164e3 if kind == "geo" else periapsis / (1 - e)
    tilt, node, argument, anomaly = rng.uniform(0, [np.pi, 2 * np.pi, 2 * np.pi, 2 * np.pi])
    return Orbit(a, e, tilt, node, argument, anomaly), kind


def _times(rng: np.random.Generator, rate: float, orbit: Orbit) -> FloatArray:
    """20 to 2000 frames over 0.2 to 20 rotations, but not over LONGEST nor two orbits; some unevenly spaced."""
    frames = round(_log_uniform(rng, 20, 2000))
    span = min(2 * np.pi / rate * _log_uniform(rng, 0.2, 20), LONGEST, 2 * orbit.period)
    time = np.linspace(0, span, frames)
    if rng.random() < 0.15:
        time[1:-1] += rng.uniform(-0.4, 0.4, frames - 2) * span / (frames - 1)
    return np.asarray(time)


def _path(
    rng: np.random.Generator, orbit: Orbit, time: FloatArray, nearest: float
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, str]:
    """The times, the chaser's state at the first, the path in C with its Jacobian, and the kind of relative motion.

    A chaser that comes nearer than `nearest` m or drifts too far is drawn again, after ten times in half the time.
    """
    for attempt in range(100):
        if attempt % 10 == 9:
            time = time / 2
        kind = str(rng.choice(["v-bar", "r-bar", "round", "drift"]))
        distance, sign = _log_uniform(rng, 5, 50), rng.choice([-1.0, 1.0])
        n, phase = orbit.mean_motion, rng.uniform(0, 2 * np.pi)
        state = np.zeros(6)
        if kind == "v-bar":
            state[1] = sign * distance
        elif kind == "r-bar":
            state[0] = sign * distance
        elif kind == "round":  # a 2:1 ellipse about the target with an oscillation out of the plane
            s, c, tilt = np.sin(phase), np.cos(phase), rng.uniform(0.2, 1.0)
            state[:] = distance * np.array([s / 2, c, tilt * s, n * c / 2, -n * s, n * tilt * c])
        else:
            state[:] = np.concatenate([distance * _direction(rng), n * distance * rng.uniform(-0.5, 0.5, 3)])
        scale = np.repeat([MIDDLE_STEP, MIDDLE_STEP * n], 3)
        ways = np.concatenate([state[None], state + np.diag(scale), state - np.diag(scale)])
        relative, _ = relative_motion(orbit, ways, time)
        away = np.linalg.norm(relative[0, :, :3], axis=1)
        if away.min() > nearest and away.max() < FARTHEST:
            break
    jacobian = -(relative[1:7] - relative[7:])[..., :3].transpose(1, 2, 0) / (2 * scale)
    return time, state, -relative[0, :, :3], jacobian, kind


def rotation_with_sensitivity(
    inertia: FloatArray, quaternion: FloatArray, rate: FloatArray, time: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Attitude (n, 3, 3), rate (n, 3) and rotation vectors (n, 3, 8) in B per unit of rate and inertia over its trace.

    By central differences. The five parameters of the inertia are those of a symmetric matrix whose trace is kept.
    """
    step = 1e-6
    basis = np.zeros((5, 3, 3))
    for index, (i, j) in enumerate([(0, 1), (0, 2), (1, 2)]):
        basis[index, i, j] = basis[index, j, i] = 1
    basis[3], basis[4] = np.diag([1.0, -1.0, 0.0]), np.diag([0.0, 1.0, -1.0])
    size = np.linalg.norm(rate)
    rates = np.concatenate([step * size * np.eye(3), np.zeros((5, 3))])
    inertias = np.concatenate([np.zeros((3, 3, 3)), step * basis]) * np.trace(inertia)
    all_inertia = np.concatenate([inertia[None], inertia + inertias, inertia - inertias])
    all_rates = np.concatenate([rate[None], rate + rates, rate - rates])
    R, w = tumble(all_inertia, np.tile(quaternion, (17, 1)), all_rates, time)
    change = np.swapaxes(R[9:], 2, 3) @ R[1:9]
    vectors = Rotation.from_matrix(change.reshape(-1, 3, 3)).as_rotvec().reshape(8, len(time), 3)
    per = np.concatenate([np.full(3, 2 * step * size), np.full(5, 2 * step)])
    return R[0], w[0], np.asarray(vectors.transpose(1, 2, 0) / per)


def _features(rng: np.random.Generator) -> tuple[FloatArray, FloatArray, str]:
    """3 to 30 features on a box round the centre of mass, or on one of its sides, or along an edge, and normals."""
    m = round(_log_uniform(rng, 3, 30))
    half = _log_uniform(rng, 0.4, 6) * np.exp(rng.normal(0, 0.4, 3))
    centre = rng.uniform(-0.5, 0.5, 3) * half  # of the box, from the centre of mass
    kind = str(rng.choice(["", "coplanar", "in-line"], p=[0.8, 0.14, 0.06]))
    side, sign = rng.integers(0, 3, m), rng.choice([-1.0, 1.0], m)
    if kind:
        side[:], sign[:] = side[0], sign[0]
    normals = np.eye(3)[side] * sign[:, None]
    points = rng.uniform(-1, 1, (m, 3))
    points[np.arange(m), side] = sign
    if kind == "in-line":  # but for a few per cent
        points[:, (side[0] + 1) % 3] *= _log_uniform(rng, 1e-3, 0.1)
    return centre + points * half, normals, kind


def _view(
    rng: np.random.Generator, path: FloatArray, attitude: FloatArray, points: FloatArray, normals: FloatArray
) -> tuple[BoolArray, str]:
    """Which features are in view, (n, m): all, those that face the chaser, or changing groups of them; with gaps."""
    n, m = len(path), len(points)
    kind = str(rng.choice(["", "arcs", "groups", "fragments"], p=[0.3, 0.35, 0.2, 0.15]))
    seen = np.ones((n, m), dtype=bool)
    if kind == "arcs":
        place = path[:, None] + points @ np.swapaxes(attitude, 1, 2)
        towards = -np.einsum("nmi,nmi->nm", normals @ np.swapaxes(attitude, 1, 2), place)
        seen = towards > np.cos(np.deg2rad(rng.uniform(60, 88))) * np.linalg.norm(place, axis=2)
    elif kind:
        begin: int = 0
        seen[:] = False
        while begin < n:
            longest = max(n // 2, 8) if kind == "groups" else rng.choice([4, max(n // 3, 8)])
            length = round(_log_uniform(rng, 5 if kind == "groups" else 1, longest))
            group = rng.permutation(m)[: int(rng.integers(3, m + 1))]
            seen[begin : begin + length, group] = True
            begin += length
    for _ in range(rng.choice([0, 0, 0, 1, 2, 3])):
        begin, length = int(rng.integers(0, n)), round(n * rng.uniform(0.03, 0.2))
        seen[begin : begin + length] = False
    return seen, kind


def _sensor(rng: np.random.Generator, path: FloatArray) -> Sensor:
    stereo, dirty, swapping, told = rng.random(4) < [1 / 3, 0.35, 0.15, 0.25]
    noise, baseline = _log_uniform(rng, 1e-3, 0.2), 0.0
    if stereo:  # the depth has the noise drawn, at the mean distance, but at most a twentieth of it
        baseline, away = rng.uniform(0.2, 1.0), float(np.linalg.norm(path, axis=1).mean())
        noise = min(noise, 0.05 * away) * FOCAL_LENGTH * baseline / (np.sqrt(2) * away**2)
    return Sensor(
        noise,
        baseline,
        dropout=float(rng.choice([0, rng.uniform(0, 0.3)])),
        outliers=float(rng.uniform(0, 0.3)) if dirty else 0.0,
        blunder=_log_uniform(rng, 0.1, 5),
        swapped=float(rng.uniform(0, 0.1)) if swapping else 0.0,
        mislabelled=bool(rng.random() < 0.05),
        told=bool(told),
    )


FOCAL_LENGTH = 1911.0  # px, of the stereo rig


def _words(sensor: Sensor) -> list[str]:
    flags = {
        "stereo": sensor.baseline > 0,
        "outliers": sensor.outliers > 0,
        "swaps": sensor.swapped > 0,
        "mislabelled": sensor.mislabelled,
        "told": sensor.told,
    }
    return [word for word, holds in flags.items() if holds]

"""A draw of a world: its truth, the tracks, and what the estimators are told."""

import itertools
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from baryscope.estimator import FeatureTracks
from baryscope.estimator.camera.attitude import AttitudeSeries
from baryscope.estimator.camera.camera import Camera
from baryscope.estimator.camera.rig import Rig
from baryscope.estimator.thrust import KnownAcceleration
from baryscope.models.ephemeris import elements_of
from baryscope.models.orbit import Orbit
from baryscope.study.population.cases import rotation_with_sensitivity
from baryscope.study.population.motion import orbit_state, relative_motion, tumble
from baryscope.study.world.disturbances import Disturbance, camera_axes, disturbance_of
from baryscope.study.world.forces import Burn, burns_of, eddy_torque, force_of
from baryscope.study.world.worlds import World

FloatArray = NDArray[np.float64]

INERTIA = np.array([[17023.3, 397.1, -2171.4], [397.1, 124825.7, 344.2], [-2171.4, 344.2, 129112.2]])
RATE = np.deg2rad([3.38, 0.45, 0.77])  # Envisat's as in the e.Deorbit studies
POINTS = np.array(
    [
        [-6.1, 1.4, -1.2],
        [-6.1, -1.4, 0.9],
        [3.9, 1.4, 0.9],
        [3.9, -1.4, -1.2],
        [-1.1, 1.4, -1.2],
        [-3.2, -1.4, 0.3],
        [-2.1, 5.0, -1.5],
        [-3.4, -5.0, -1.5],
        [3.9, 0.2, 0.5],
        [5.9, 2.5, 0.5],
    ]
)
TOOL = 0.05  # a pivot's tool has features as far from each other as Envisat's times this
DISTANCE = 20.0  # m on V-bar
SHIFT, TURN = 1e3, np.deg2rad(1.0)  # of a wrong orbit, m and rad
LOG_ERROR = 0.01  # of each component of a burn, relative


@dataclass(frozen=True, eq=False)
class Scene:
    """time (n,) s; path (n, 3) of the centre of mass in C, m; jacobian (n, 3, 6) by (ρ, ρ̇) at the first time;
    attitude (n, 3, 3); turn (n, 3, 8), see `Case`; points (m, 3); orbit: that is told, None for a pivot; tracks;
    burns: as they are logged, None if they are not; disturbance: of the observed path, for the bound;
    camera: that the tracks have been turned by, with what is uncertain about it.
    """

    world: World
    time: FloatArray
    path: FloatArray
    jacobian: FloatArray
    attitude: FloatArray
    turn: FloatArray
    points: FloatArray
    orbit: Orbit | None
    tracks: FeatureTracks
    burns: tuple[Burn, ...] | None
    disturbance: Disturbance
    camera: Camera | None


def scene(world: World, seed: int, draw: int) -> Scene:
    """A draw of a world; the same number gives the same attitude and noise in every world."""
    streams = [np.random.default_rng(s) for s in np.random.SeedSequence([seed, draw]).spawn(6)]
    of_attitude, of_anomaly, of_noise, of_force, of_orbit, of_camera = streams
    time = np.linspace(0, world.span, world.frames)
    quaternion = Rotation.random(random_state=of_attitude).as_quat()
    orbit = replace(world.orbit, true_anomaly=float(of_anomaly.uniform(0, 2 * np.pi)))
    if world.periapsis:
        orbit = _before_periapsis(world)
    burns = burns_of(world, of_force)
    path, jacobian, where = _path(world, orbit, time, of_force, burns)
    attitude, _, turn = rotation_with_sensitivity(INERTIA, quaternion, RATE, time)
    torque = eddy_torque(world, INERTIA, where)
    if torque is not None:
        attitude = tumble(INERTIA[None], quaternion[None], RATE[None], time, torque)[0][0]
    points = POINTS
    if world.slip:
        path, points = np.tile([0.2, -0.1, 1.5], (len(time), 1)), TOOL * POINTS
        jacobian = np.tile(np.eye(3), (len(time), 1, 1))
    places = (path + _slips(world, time, of_orbit))[:, None] + points @ np.swapaxes(attitude, 1, 2)
    errors = world.noise * lasting(of_noise.standard_normal(places.shape), time, world.error_time)
    if world.error_axes == "body":
        errors = errors @ np.swapaxes(attitude, 1, 2)
    seen, camera = _seen(world, time, places, errors, of_camera)
    tracks = FeatureTracks(time, seen, [f"F{k}" for k in range(len(points))])
    told = None if world.slip else _wrong(orbit, of_orbit) if world.wrong_orbit else orbit
    log, disturbance = _log(world, burns, of_orbit), disturbance_of(world, orbit, time, path)
    return Scene(
        world=world,
        time=time,
        path=path,
        jacobian=jacobian,
        attitude=attitude,
        turn=turn,
        points=points,
        orbit=told,
        tracks=tracks,
        burns=log,
        disturbance=disturbance,
        camera=camera,
    )


def _path(
    world: World, orbit: Orbit, time: FloatArray, rng: np.random.Generator, burns: tuple[Burn, ...]
) -> tuple[FloatArray, FloatArray, CubicSpline]:
    """The path, its Jacobian, and the direction (3,) of the target in I as a function of time."""
    force, breaks = force_of(world, rng, orbit, burns)
    n = orbit.mean_motion
    start = np.array([0.0, -DISTANCE, 0.0, 0.0, 0.0, 0.0])
    scale = np.repeat([1.0, n], 3)
    ways = np.concatenate([start[None], start + np.diag(scale), start - np.diag(scale)])
    relative, R_I_L = relative_motion(orbit, ways, time, force, breaks)
    jacobian = -(relative[1:7] - relative[7:])[..., :3].transpose(1, 2, 0) / (2 * scale)
    return -relative[0, :, :3], jacobian, CubicSpline(time, R_I_L[:, :, 0])


def _before_periapsis(world: World) -> Orbit:
    """The orbit that passes its periapsis in mid-span: Kepler's equation at half the span before."""
    orbit, e = world.orbit, world.orbit.eccentricity
    mean = -orbit.mean_motion * world.span / 2
    E = mean
    for _ in range(50):
        E = E - (E - e * np.sin(E) - mean) / (1 - e * np.cos(E))
    return replace(orbit, true_anomaly=float(2 * np.arctan(np.sqrt((1 + e) / (1 - e)) * np.tan(E / 2))))


def _wrong(orbit: Orbit, rng: np.random.Generator) -> Orbit:
    """The orbit of a state that is 1 km beside the true one, and turned by 1°, both in any direction."""
    shift, axis = (v / np.linalg.norm(v) for v in rng.standard_normal((2, 3)))
    return displaced(orbit, SHIFT * shift, TURN * axis)


def displaced(orbit: Orbit, shift: FloatArray, turn: FloatArray) -> Orbit:
    """The orbit of a state that is moved by a shift (3,) in m, then turned by a rotation vector (3,)."""
    state, rotation = orbit_state(orbit), Rotation.from_rotvec(turn)
    r, v = rotation.apply(state[:3] + shift), rotation.apply(state[3:])
    elements: dict[str, Any] = {**elements_of(np.concatenate([r, v]), orbit.gravitational_parameter)}
    return replace(orbit, **elements)


def _slips(world: World, time: FloatArray, rng: np.random.Generator) -> FloatArray:
    """How far a pivot's tip is off, (n, 3)."""
    return world.slip * lasting(rng.standard_normal((len(time), 3)), time, world.slip_time)


def memory(time: FloatArray, correlation_time: float) -> FloatArray:
    """What is left of an error from each time to the next, (n - 1,)."""
    return np.exp(-np.diff(time) / correlation_time) if correlation_time else np.zeros(len(time) - 1)


def lasting(noise: FloatArray, time: FloatArray, correlation_time: float) -> FloatArray:
    """White noise (n, …) of deviation 1 as a first-order Markov process of the same deviation."""
    found = noise.copy()
    for k, a in enumerate(memory(time, correlation_time), 1):
        found[k] = a * found[k - 1] + np.sqrt(1 - a * a) * noise[k]
    return found


def _seen(
    world: World,
    time: FloatArray,
    places: FloatArray,
    errors: FloatArray,
    of_camera: np.random.Generator,
) -> tuple[FloatArray, Camera | None]:
    """The features with their errors (n, m, 3), turned by those of the camera's attitude, all in C.

    The camera points at the features' centroid; its axes are V. What it sees in V is turned by the attitude it reports.
    """
    seen = places + errors
    if not world.attitude_noise and not world.boresight:
        return np.asarray(seen), None
    R_C_V = camera_axes(places.mean(axis=1))
    boresight = world.boresight * of_camera.standard_normal(3)
    error = Rotation.from_rotvec(world.attitude_noise * of_camera.standard_normal((len(seen), 3)) + boresight)
    reported = R_C_V @ error.as_matrix()
    series = AttitudeSeries(time, Rotation.from_matrix(reported).as_quat()[:, [3, 0, 1, 2]])
    camera = Camera(series, Rig(boresight_deviation=world.boresight, attitude_noise=world.attitude_noise))
    return np.asarray(seen @ R_C_V @ np.swapaxes(reported, 1, 2)), camera


def _log(world: World, burns: tuple[Burn, ...], rng: np.random.Generator) -> tuple[Burn, ...] | None:
    if world.logged == "no":
        return None
    if world.logged == "exactly":
        return burns
    return tuple(replace(b, acceleration=b.acceleration * (1 + LOG_ERROR * rng.standard_normal(3))) for b in burns)


def logged_thrust(made: Scene) -> KnownAcceleration | None:
    """The burns as they are logged, with what is told of their errors; None if they are not."""
    if made.burns is None:
        return None
    firing = 0.0 if made.world.logged == "exactly" else LOG_ERROR
    return KnownAcceleration(*rows_of(made.burns, made.world.span), axes="lvlh", firing=firing)


def rows_of(burns: tuple[Burn, ...], span: float) -> tuple[FloatArray, FloatArray]:
    """Times (k,) in s and accelerations (k, 3) in LVLH, m/s², each of which holds until the next; burns may overlap."""
    edges = sorted({0.0, span, *itertools.chain.from_iterable((b.begin, b.end) for b in burns)})
    held = [sum((b.acceleration for b in burns if b.begin <= t < b.end), np.zeros(3)) for t in edges]
    return np.array(edges), np.array(held)

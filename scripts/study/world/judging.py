"""One estimate in one draw of a world as a line of numbers, with the posterior bound."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator import Failure, PathOptions, attempt
from baryscope.estimator.methods import TURNING
from baryscope.models.errors import InputError
from baryscope.models.orbit import EARTH_J2, EARTH_RADIUS, Orbit
from baryscope.study.population.information import Watched, rms, unknowns_bound
from baryscope.study.population.judging import accuracy, measured, of_estimate
from baryscope.study.population.running import Line
from baryscope.study.world.lasting_bound import lasting_bound
from baryscope.study.world.scenes import Scene, logged_thrust, scene
from baryscope.study.world.smoother import smoothed
from baryscope.study.world.told_bound import unknown_of_told
from baryscope.study.world.worlds import WORLDS, World

FloatArray = NDArray[np.float64]

TOLD = " told"  # ends the name of a method that is told the forces that can be told
PEER = "smoother"


@lru_cache(maxsize=1)
def prepared(name: str, seed: int, draw: int) -> tuple[Scene, dict[str, float]]:
    """A draw of a world and its bounds: with free attitudes, and with a free tumble where there is one.

    And the same with what is not known of forces that are told.
    """
    made = scene(WORLDS[name], seed, draw)
    unknown = unknown_of_told(made)
    turns = {"free": None} if made.world.eddy or made.world.slip else {"free": None, "tumble": made.turn}
    bounds = {}
    for kind, turn in turns.items():
        bounds[kind] = bound_of(made, turn)
        bounds[kind + TOLD] = bounds[kind] if unknown is None else bound_of(replace(made, disturbance=unknown), turn)
    return made, bounds


def bound_of(made: Scene, turn: FloatArray | None = None) -> float:
    """The posterior Cramér–Rao bound of the path's rms error, m.

    It knows the scene's disturbance by its variance, and all forces exactly.
    """
    if made.world.error_time:
        return rms(made.jacobian @ lasting_bound(made, turn) @ np.swapaxes(made.jacobian, 1, 2))
    found = made.disturbance
    n, m = len(made.time), len(made.points)
    jacobian = np.concatenate([made.jacobian, found.columns], axis=2)
    own = made.jacobian.shape[2]
    prior = np.concatenate([np.zeros(own), 1 / found.variance])
    precision = np.broadcast_to(np.eye(3) / made.world.noise**2, (n, m, 3, 3))
    right = np.ones((n, m), dtype=bool)
    of_x = unknowns_bound(jacobian, Watched(made.attitude, made.points, precision, right, turn), prior)
    path = jacobian if found.moves_path else jacobian[:, :, :own]
    size = path.shape[2]
    return rms(path @ of_x[:size, :size] @ np.swapaxes(path, 1, 2))


def judged(name: str, seed: int, draw: int, method: str) -> Line:
    """The line of an estimate by a method, or by one that is told the forces."""
    made, bounds = prepared(name, seed, draw)
    line: Line = {"world": name, "seed": seed, "draw": draw, "method": method}
    with measured(line):
        try:
            line |= _of_smoother(made) if method == PEER else _of_method(made, method)
        except InputError as error:
            line |= {"failure": "input error", "message": str(error)}
        except Exception as error:
            line |= {"failure": "crashed", "message": f"{type(error).__name__}: {error}"}
    free = method.removesuffix(TOLD) not in TURNING or "tumble" not in bounds
    kind = "free" if free else "tumble"
    if method.endswith(TOLD):
        line["told_bound"] = bounds[kind + TOLD]
    return line | {"bound": bounds[kind]}


def can_be_told(world: World) -> bool:
    """Whether a force of the world, or its camera, can be told to an estimator."""
    return world.j2 or bool(world.drag) or bool(world.light) or world.logged != "no" or bool(world.boresight)


def told(made: Scene, options: PathOptions) -> tuple[Orbit | None, PathOptions]:
    """The orbit, the logged thrust, and that there is drag or light, where the world has them."""
    world = made.world
    if made.burns is not None:
        options = replace(options, acceleration=logged_thrust(made))
    if world.drag or world.light:
        options = replace(options, constant_acceleration="drag" if world.drag else "sun")
    return told_orbit(made), options


def told_orbit(made: Scene) -> Orbit | None:
    """The orbit with J2, and that it is exact, where they are so in the world."""
    orbit, world = made.orbit, made.world
    if orbit is not None and not world.wrong_orbit:
        orbit = replace(orbit, accuracy=0.0)
    if orbit is not None and world.j2:
        orbit = replace(orbit, j2=EARTH_J2, equatorial_radius=EARTH_RADIUS)
    return orbit


def _of_smoother(made: Scene) -> Line:
    found = smoothed(made.time, made.tracks.position, made.orbit, made.burns)
    line: Line = {
        "status": "good",
        "announced": False,
        "predicted_rmse": rms(found.covariance),
        "density": found.density,
    }
    return line | accuracy(found.position, found.covariance, made.path)


def _of_method(made: Scene, method: str) -> Line:
    name = method.removesuffix(TOLD)
    tracks, orbit = made.tracks, made.orbit
    options = PathOptions(trajectory="fixed" if orbit is None else None)
    if method.endswith(TOLD):
        tracks = replace(tracks, camera=made.camera)
        orbit, options = told(made, options)
    found = attempt(tracks, method=name, orbit=orbit, options=options)
    if isinstance(found, Failure):
        return {"failure": found.reason, "message": found.message}
    return of_estimate(found, made.path)

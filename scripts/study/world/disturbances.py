"""What moves the observed path at random, as columns with a variance each, for the posterior Cramér–Rao bound."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.models.orbit import Orbit
from baryscope.study.population.motion import relative_motion
from baryscope.study.world.worlds import World

FloatArray = NDArray[np.float64]

MODES = 40  # cosines of white acceleration in each direction; 8 are above the noise at 1e-10 m²/s³


@dataclass(frozen=True, eq=False)
class Disturbance:
    """columns (n, 3, e) in m in C per unit, variance (e,) of each; moves_path: whether the centre of mass moves by
    them, or only what is seen of it.
    """

    columns: FloatArray
    variance: FloatArray
    moves_path: bool


def disturbance_of(world: World, orbit: Orbit, time: FloatArray, path: FloatArray) -> Disturbance:
    """White acceleration, a slipping pivot's shift in every frame, or the errors of the camera's attitude."""
    n = len(time)
    if world.white:
        return Disturbance(_forced(world, orbit, time), np.full(3 * MODES, world.white), True)
    shift = np.zeros((n, 3, n, 3))
    each = np.arange(n)
    if world.slip:
        shift[each, :, each] = np.eye(3)
        return Disturbance(shift.reshape(n, 3, -1), np.full(3 * n, world.slip**2), False)
    if world.attitude_noise:
        by_turn = np.cross(np.eye(3), path[:, None]).transpose(0, 2, 1) @ camera_axes(path)
        shift[each, :, each] = by_turn
        columns = np.concatenate([shift.reshape(n, 3, -1), by_turn], axis=2)
        variance = np.repeat([world.attitude_noise**2, world.boresight**2], [3 * n, 3])
        return Disturbance(columns, variance, False)
    return Disturbance(np.zeros((n, 3, 0)), np.zeros(0), True)


def camera_axes(target: FloatArray) -> FloatArray:
    """R_C_V (n, 3, 3) of a camera that points, by its z, at places (n, 3) in C."""
    ahead = target / np.linalg.norm(target, axis=1, keepdims=True)
    side = np.cross(ahead, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    return np.stack([side, np.cross(ahead, side), ahead], axis=2)


def _forced(world: World, orbit: Orbit, time: FloatArray) -> FloatArray:
    """The path's response (n, 3, 3 MODES) to orthonormal cosines of acceleration over the span."""
    order = np.repeat(np.arange(MODES), 3)
    axis = np.tile(np.eye(3), (MODES, 1))
    norm = np.where(order == 0, 1.0, np.sqrt(2.0)) / np.sqrt(world.span)
    return response(
        orbit, time, lambda t, here: (norm * np.cos(np.pi * order * t / world.span))[:, None] * axis, 3 * MODES, 1e-6
    )


def response(
    orbit: Orbit,
    time: FloatArray,
    accelerations: Callable[[float, FloatArray], FloatArray],
    count: int,
    size: float,
    breaks: Sequence[float] = (),
) -> FloatArray:
    """The path's response (n, 3, count) in C to accelerations of the chaser, per unit.

    accelerations: of the time in s and the target's state (6,), (count, 3) in I; size: a factor so small that the
    response is linear, so great that its digits are not lost; breaks: times at which they jump.
    """

    def force(t: float, here: FloatArray, others: FloatArray) -> FloatArray:
        found = np.zeros((len(others) + 1, 3))
        found[2:] = size * accelerations(t, here)
        return found

    state = np.tile([0.0, -20.0, 0.0, 0.0, 0.0, 0.0], (count + 1, 1))
    relative, _ = relative_motion(orbit, state, time, force, breaks)
    return np.asarray(-(relative[1:] - relative[0])[..., :3].transpose(1, 2, 0) / size)

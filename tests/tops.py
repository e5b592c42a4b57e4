"""A symmetric top as tests of the online estimator watch it: closed-form motion, and what a batch would know of it.

It precesses about z, with a tilt, and spins about its axis; its centre of mass moves in a straight line unless a test
has another path. Nothing of it is shared with the filter.
"""

from contextlib import contextmanager

import numpy as np
from scipy.spatial.transform import Rotation

from baryscope.estimator.online import Thrust

SIGMA = 0.02  # m
POINTS = np.array(
    [
        [2.0, 1.4, -1.2],
        [-2.1, -1.4, 0.9],
        [1.9, 1.0, 0.9],
        [0.9, -1.4, -1.2],
        [-1.1, 1.4, -1.2],
        [-1.2, -0.4, 1.3],
        [0.3, 0.2, 1.6],
        [2.4, -0.6, 0.2],
    ]
)
START, DRIFT = np.array([3.0, 18.0, -4.0]), np.array([0.02, -0.01, 0.015])
TURN = 120.0  # s, of the precession
FRAMES = 180


def attitudes(time):
    """R_C_B (n, 3, 3) of a symmetric top."""
    turn = 2 * np.pi * time / TURN
    angles = np.stack([turn, np.full_like(turn, 0.7), 0.6 * turn], axis=1)
    return Rotation.from_euler("ZXZ", angles).as_matrix()


def tracks(rng, time, path, points=POINTS, sigma=SIGMA):
    places = path[:, None] + points @ np.swapaxes(attitudes(time), 1, 2)
    return places + sigma * rng.standard_normal(places.shape)


def two_sides(rng, time, path, turn):
    """Tracks (n, 2 m, 3) of a target that shows one half of its features up to frame `turn`, then the other."""
    seen = tracks(rng, time, path, np.concatenate([POINTS, -0.7 * POINTS]))
    seen[:turn, len(POINTS) :] = np.nan
    seen[turn:, : len(POINTS)] = np.nan
    return seen


def straight(time):
    return START + time[:, None] * DRIFT


@contextmanager
def unread(filter):
    """Where nobody looks at the states that frames give: none is computed, as that takes time.

    `predict`, by which `update` computes them, changes nothing of the filter.
    """
    filter.predict = lambda *_: None  # of this one, in place of that of its class
    try:
        yield filter
    finally:
        del filter.predict


def flown_through(filter, frames, looked_at):
    """The states (a dict) after the frames whose numbers are in `looked_at`, of all, each the arguments of `update`."""
    states = {}
    for k, (given, named) in enumerate(frames):
        if k in looked_at:
            states[k] = filter.update(*given, **named)
        else:
            with unread(filter):
                filter.update(*given, **named)
    return states


def run(filter, time, seen, **more):
    return [filter.update(float(t), frame, **more) for t, frame in zip(time, seen, strict=True)]


def beside_the_target(time):
    """The path (n, 3) of a target from a chaser that comes to 8 m and turns with it, and its accelerations (n - 1, 3).

    From 130 s on the chaser is steered to a point of the target by what is true; each acceleration is constant from
    one frame to the next, at most 0.05 m/s².
    """
    goal = attitudes(np.append(time, time[-1] + 1)) @ [-7.0, -3.0, -2.5]
    path, speed, accelerations = [START], DRIFT, []
    for k in range(1, len(time)):
        off, force = path[-1] - goal[k], np.zeros(3)
        if time[k] > 130:
            wanted = (goal[k + 1] - goal[k - 1]) / 2 - 0.05 * off / max(1.0, np.linalg.norm(off) / 2)
            force = goal[k + 1] - 2 * goal[k] + goal[k - 1] + 0.15 * (wanted - speed)
        accelerations.append(force * min(1.0, 0.05 / max(np.linalg.norm(force), 1e-9)))
        path.append(path[-1] + speed + accelerations[-1] / 2)
        speed = speed + accelerations[-1]
    return np.array(path), np.array(accelerations)


def seen_by_a_rig(rng, places):
    """Places (n, m, 3), with the noise of a pair of cameras, and its covariances: depth is told by its square."""
    far = np.linalg.norm(places, axis=-1)[..., None, None]
    sight = places[..., None] / far
    along, across = sight @ np.swapaxes(sight, -1, -2), far / 5400  # 0.5 px, f = 1911 px, 1 m apart
    covariances = across**2 * (np.eye(3) - along) + (far**2 / 2700) ** 2 * along
    noise = np.einsum("...ij,...j", np.linalg.cholesky(covariances), rng.standard_normal(places.shape))
    return places + noise, covariances


def flown_beside(rng, filter, wrong, looked_at):
    """A flight of 700 s beside the target, seen by a rig, on thrusters that are wrong: the states (a dict) at the times
    that are looked at, in whole seconds, and the path (n, 3).

    The filter is told of accelerations that make the true ones on these thrusters. wrong: a scale, and a rotation
    vector in axes of the camera, (4,), or (699, 4) from frame to frame.
    """
    time, wrong = np.arange(700.0), np.broadcast_to(wrong, (699, 4)).copy()
    path, accelerations = beside_the_target(time)
    z = path / np.linalg.norm(path, axis=1)[:, None]
    x = np.cross(z, [0.0, 0.0, 1.0]) / np.linalg.norm(np.cross(z, [0.0, 0.0, 1.0]), axis=1)[:, None]
    axes = np.stack([x, np.cross(z, x), z], axis=2)  # of the camera, in which thrusters are fixed
    of_camera = Rotation.from_matrix(axes[:-1])
    told = -(of_camera * Rotation.from_rotvec(wrong[:, 1:]).inv() * of_camera.inv()).apply(accelerations)
    told /= 1 + wrong[:, :1]
    seen, covariances = seen_by_a_rig(rng, path[:, None] + POINTS @ np.swapaxes(attitudes(time), 1, 2))
    thrusts = [None, *(Thrust(push, attitude) for push, attitude in zip(told, axes[:-1], strict=True))]
    frames = (
        ((t, frame), {"covariance": covariance, "acceleration": thrust})
        for t, frame, covariance, thrust in zip(time.tolist(), seen, covariances, thrusts, strict=True)
    )
    return flown_through(filter, frames, looked_at), path


def errors(states, path):
    """Distances (n,) and NEES (n,) of states."""
    off = np.array([state.position for state in states]) - path
    of_place = np.array([state.covariance[:3, :3] for state in states])
    return np.linalg.norm(off, axis=1), np.einsum("ni,nij,nj->n", off, np.linalg.inv(of_place), off)


def batch_bound(time):
    """The rms error of least squares on all frames, at the last: position, velocity and offset, known attitudes."""
    t = (time - time[-1])[:, None, None]
    design = np.concatenate([np.tile(np.eye(3), (len(time), 1, 1)), t * np.eye(3), attitudes(time)], axis=2)
    information = np.einsum("nki,nkj->ij", design, design) * len(POINTS) / SIGMA**2
    return np.sqrt(np.trace(np.linalg.inv(information)[:3, :3]))
